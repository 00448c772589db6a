"""Racing: evaluate an individual on half split after half split until it is significantly worse."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from scipy.stats import t as student_t

from texture_core.arrays import Array

HalfScorer = Callable[[int], tuple[float, float]]  # number of a half → learning and test score
# Halves after which an individual may have lost; the first look is for the hopeless.
TEST_POINTS = (2, 4, 7, 12)
# Probability, at each look, of giving up one that is as good as its rival; it is ranked by its estimate even so.
SIGNIFICANCE = 0.05
# Shares come in steps: two differences may be equal by chance, and seem to have no scatter at all.
MIN_SCATTER = 0.005


class FitnessFunction(Protocol):
    """What an individual needs to be evaluated; plain data that may travel to another process."""

    def start(self) -> HalfScorer:
        """Prepare what all halves share, such as a matrix of distances, and return what classifies one half."""


@dataclass(frozen=True, eq=False)
class HalfScores:
    """Learning and test scores on the first halves, (n_done,) each; fewer than all if the individual lost.

    Examples
    --------
    >>> scores = HalfScores.of([(1.0, 0.8), (0.9, 0.7)])
    >>> scores.halves, scores.means.round(2).tolist()
    (2, [0.9, 0.8])
    """

    learning: Array
    test: Array

    @classmethod
    def of(cls, scores: Sequence[tuple[float, float]]) -> HalfScores:
        """Return the record of (learning, test) scores of the first halves."""
        learning, test = np.array(scores, dtype=np.float64).reshape(-1, 2).T
        return cls(learning, test)

    @property
    def means(self) -> Array:
        """Mean of learning and test score on each half, (n_done,)."""
        mean: Array = (self.learning + self.test) / 2.0
        return mean

    @property
    def halves(self) -> int:
        """How many halves were done."""
        return len(self.test)


EMPTY = HalfScores(np.zeros(0), np.zeros(0))


def race(fitness_function: FitnessFunction, known: HalfScores, incumbent: Array | None, n_halves: int) -> HalfScores:
    """Evaluate an individual on the halves until it has clearly lost against its rival, or all are done.

    Individuals are compared half by half, each half being the same for all: differences scatter far less than scores.

    Parameters
    ----------
    fitness_function
        Of the individual; not started if all that is needed is known.
    known
        Scores that are remembered.
    incumbent : (n_halves,) or None
        Mean scores on each half of one that is to be beaten; None: all halves are done.
    n_halves
        How many there are.

    Returns
    -------
    HalfScores
        Those that were known, and the new ones.
    """
    scores = list(zip(known.learning.tolist(), known.test.tolist(), strict=True))
    half: HalfScorer | None = None
    for number in range(n_halves):
        if (
            incumbent is not None
            and number in TEST_POINTS
            and is_clearly_worse(HalfScores.of(scores).means[:number], incumbent[:number])
        ):
            break
        if number >= len(scores):
            half = half or fitness_function.start()
            scores.append(half(number))
    return HalfScores.of(scores)


def raced_fitness(record: HalfScores, incumbent: Array | None, n_halves: int) -> tuple[float, int]:
    """Return the fitness and the halves it rests on, as `race` would have found them: what else is known is not used.

    One that lost is placed below its rival by their mean difference on the halves that both did.

    Parameters
    ----------
    record
        Scores of an individual on each half.
    incumbent : (n_halves,) or None
        Mean scores of the one that is to be beaten.
    n_halves
        Number of halves.

    Returns
    -------
    (float, int)
        Fitness, 0 to 1, and number of halves.
    """
    for number in range(1, n_halves):
        means = record.means[:number]
        if incumbent is not None and number in TEST_POINTS and is_clearly_worse(means, incumbent[:number]):
            return float(incumbent.mean() + (means - incumbent[:number]).mean()), number
    return float(record.means[:n_halves].mean()), n_halves


def is_clearly_worse(means: Array, incumbent: Array) -> bool:
    """Tell whether an individual is worse than its rival beyond chance (paired, one-sided t test).

    Parameters
    ----------
    means : (n,)
        Scores on each half.
    incumbent : (n,)
        Scores of the rival on the same halves.
    """
    difference = means - incumbent
    parallel_map = max(float(difference.std(ddof=1)), MIN_SCATTER) / np.sqrt(len(difference))
    return bool(difference.mean() + _quantile(len(difference) - 1) * parallel_map < 0.0)


@lru_cache
def _quantile(freedom: int) -> float:
    return float(student_t.ppf(1.0 - SIGNIFICANCE, freedom))
