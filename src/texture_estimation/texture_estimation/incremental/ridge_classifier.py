"""A judge that learns more textures in milliseconds: a linear layer in closed form over features that stay as they are.

What a window is described by does not change: the hidden layer of the network that was trained, if it was one, and
random cosines of the standardised features, which stand for a Gaussian kernel. Only a linear layer on top is fitted, by
ridge regression to 1 for the own texture and 0 for the others, every texture counting alike however many examples it
has. It depends on the examples of a texture through their mean and their second moments alone: teaching one changes
these, and a linear system is solved anew. So nothing is forgotten, and the order of the lessons does not matter.

Among the textures of the training that were taught nothing since, the trained learner and the layer have half the say
each.

Source: Rahimi & Recht 2007 for the random features.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import solve
from scipy.optimize import minimize_scalar

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes, LogProbabilities
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.log_probabilities import log_loss, log_softmax

# Chosen on slides 1 to 30 of recorded materials: more cosines hardly help with many slides, and harm with one.
COSINES = 384
WIDTH = 1.0  # of the kernel, in the root mean square distance of a standardised feature vector from the mean
HIDDEN_WEIGHT = 0.3
RIDGE = 3e-4
SEED = 0
# Examples of a texture that count; more cost time and memory, and hardly help.
MAX_EXAMPLES = 400
DEFAULT_SHARPNESS = 10.0


@dataclass(frozen=True, eq=False)
class Lift:
    """Fixed features of a window, made from those of the recipe.

    Parameters
    ----------
    cosines : (n_features, n_cosines)
    phases : (n_cosines,)
    hidden : (n_features, n_hidden)
    hidden_offset : (n_hidden,)
        Of the network; n_hidden 0 without one.
    """

    cosines: Array
    phases: Array
    hidden: Array
    hidden_offset: Array

    @classmethod
    def over(cls, values: Array, parts: Mapping[str, Any] | None) -> Lift:
        """Return the features for examples (n, n_features); `parts` are those of a network, or None."""
        rng = np.random.default_rng(SEED)
        mean, scale = standardisation(values)
        count = values.shape[1]
        directions = rng.normal(size=(count, COSINES)) * (1.0 / (WIDTH * math.sqrt(count)))
        cosines = directions / scale[:, None]
        phases = rng.uniform(0.0, 2.0 * np.pi, COSINES) - mean @ cosines
        if parts is None:
            return cls(cosines, phases, np.zeros((count, 0)), np.zeros(0))
        hidden, offset = (np.asarray(parts[name], dtype=np.float64) for name in ('hidden', 'hidden_offset'))
        deviation = np.maximum(values @ hidden + offset, 0.0).std(axis=0)
        weight = HIDDEN_WEIGHT / np.where(deviation > 0, deviation, 1.0)
        return cls(cosines, phases, hidden * weight, offset * weight)

    def __call__(self, values: Array) -> Array:
        """Return the features, (..., n_hidden + n_cosines + 1), of (..., n_features); the last is 1."""
        n_hidden, n_cosines = self.hidden.shape[1], self.cosines.shape[1]
        lifted = np.ones((*values.shape[:-1], n_hidden + n_cosines + 1))
        np.maximum(values @ self.hidden + self.hidden_offset, 0.0, out=lifted[..., :n_hidden])
        np.cos(values @ self.cosines + self.phases, out=lifted[..., n_hidden:-1])
        return lifted


@dataclass(frozen=True, eq=False)
class TaughtJudge:
    """The linear layer over the fixed features, and what judges the labels of the training.

    Parameters
    ----------
    lift
        The fixed features.
    weights : (n_lifted, n_labels)
    trained
        What was trained, which knows the first labels.
    kept : (n_kept,)
        Numbers of the labels among which it has a say.
    """

    lift: Lift
    weights: Array
    trained: LogProbabilities
    kept: Codes

    def __call__(self, values: Array) -> Array:
        """Return log-probabilities up to a constant of the window, (..., n_labels) of (..., n_features)."""
        scores: Array = self.lift(values) @ self.weights
        if len(self.kept) > 1:
            own = scores[..., self.kept]
            both = log_softmax(0.5 * (own + self.trained(values)[..., self.kept]))
            highest = np.maximum.reduce(own, axis=-1, keepdims=True)
            any_of_them = highest + np.log(np.add.reduce(np.exp(own - highest), axis=-1, keepdims=True))
            scores[..., self.kept] = any_of_them + both
        return scores


class TaughtHead:
    """What the linear layer is solved from.

    Parameters
    ----------
    values : (n, n_features)
    codes, slides : (n,)
        Number of the label, 0…, and of the slide of each example.
    trained
        What judges their labels since the training.
    parts
        Of the network that was trained on them, or None.
    """

    def __init__(
        self,
        values: Array,
        codes: Codes,
        slides: Codes,
        *,
        trained: LogProbabilities,
        parts: Mapping[str, Any] | None = None,
    ) -> None:
        self._trained = trained
        self._kept = set(range(int(codes.max()) + 1))
        self._lift = Lift.over(values, parts)
        self._rows: list[Array] = [values[codes == code] for code in range(int(codes.max()) + 1)]
        lifted = self._lift(values)
        half = _half(codes, slides)
        halves = [
            [_Moments.of(lifted[(codes == code) & (half == side)]) for code in range(len(self._rows))]
            for side in (0, 1)
        ]
        whole = [first.with_(second) for first, second in zip(*halves, strict=True)]
        self._sharpness = _sharpness(halves, lifted, codes, half)
        self._squares = np.sum([moments.square for moments in whole], axis=0)
        self._means = [moments.mean for moments in whole]

    @property
    def judge(self) -> TaughtJudge:
        """What judges by all that is known now."""
        weights = self._sharpness * _solve(self._squares, self._means)
        return TaughtJudge(self._lift, weights, self._trained, np.array(sorted(self._kept), dtype=np.intp))

    def examples_of(self, code: int) -> Array:
        """Return the examples of a label, (n, n_features)."""
        return self._rows[code]

    def set_examples(self, code: int, rows: Array, *, as_trained: bool = False) -> None:
        """Let `rows`, (n, n_features), be the examples of a label; of the next new one if `code` is their number.

        None at all make the last label unknown. `as_trained`: they are those of the training, nothing was taught.
        """
        (self._kept.add if as_trained else self._kept.discard)(code)
        if code == len(self._rows):
            self._rows.append(rows[:0])
            self._means.append(np.zeros(len(self._squares)))
        before, after = self._rows[code], thinned(rows)
        old = _Moments.of(self._lift(before))
        more = len(after) > len(before) and np.array_equal(after[: len(before)], before)
        new = old.with_(_Moments.of(self._lift(after[len(before) :]))) if more else _Moments.of(self._lift(after))
        self._squares += new.square - old.square
        self._rows[code], self._means[code] = after, new.mean
        if not len(rows):
            del self._rows[code], self._means[code]


def thinned(rows: Array, most: int = MAX_EXAMPLES) -> Array:
    """Return at most so many of the rows, evenly spread over all."""
    kept: Array = rows[spread(len(rows), most)]
    return kept


def spread(count: int, most: int = MAX_EXAMPLES) -> Codes:
    """Return at most so many of the numbers 0 to count - 1, evenly spread."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).round().astype(np.intp))


@dataclass(frozen=True, eq=False)
class _Moments:
    """Mean, (n_lifted,), and mean outer product, (n_lifted, n_lifted), of `count` examples."""

    count: int
    mean: Array
    square: Array

    @classmethod
    def of(cls, lifted: Array) -> _Moments:
        count = len(lifted)
        return cls(count, lifted.sum(axis=0) / max(count, 1), lifted.T @ lifted / max(count, 1))

    def with_(self, other: _Moments) -> _Moments:
        count = self.count + other.count
        mine, its = self.count / count, other.count / count
        return _Moments(count, mine * self.mean + its * other.mean, mine * self.square + its * other.square)


def _solve(squares: Array, means: list[Array]) -> Array:
    """Return the weights, (n_lifted, n_labels)."""
    system = squares + RIDGE * len(means) * np.eye(len(squares))
    weights: Array = solve(system, np.stack(means, axis=1), assume_a='pos')
    return weights


def _half(codes: Codes, slides: Codes) -> Codes:
    """Return 0 or 1 for each example: every second slide of each label, or window if a label has a single slide."""
    half = np.zeros(len(codes), dtype=np.intp)
    for code in np.unique(codes):
        rows = np.flatnonzero(codes == code)
        numbers = np.unique(slides[rows], return_inverse=True)[1].reshape(-1)
        half[rows] = (numbers if numbers.any() else np.arange(len(rows))) % 2
    return half


def _sharpness(halves: list[list[_Moments]], lifted: Array, codes: Codes, half: Codes) -> float:
    """Return the factor of the scores that makes each half most probable to a layer fitted to the other."""
    if any(moments.count == 0 for side in halves for moments in side):
        return DEFAULT_SHARPNESS
    scores = np.empty((len(codes), len(halves[0])))
    for side in (0, 1):
        learnt = halves[1 - side]
        weights = _solve(np.sum([moments.square for moments in learnt], axis=0), [moments.mean for moments in learnt])
        scores[half == side] = lifted[half == side] @ weights
    best = minimize_scalar(
        lambda log_s: log_loss(log_softmax(scores * math.exp(log_s)), codes), bounds=(0.0, 5.0), method='bounded'
    )
    return math.exp(best.x)
