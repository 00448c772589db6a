"""Leave one condition out: train on the others, choose what is to be chosen among the others alone, then test."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import AnyArray, Array
from texture_estimation.learners.learner import Learner

Mask = NDArray[np.bool_]
# (which slides train, which are tested) -> whether each test example is recognised
EvaluateSplit = Callable[[Mask, Mask], Mask]


@dataclass(frozen=True, eq=False)
class HeldOutResult:
    """What came out, by the condition left out.

    Parameters
    ----------
    right
        Whether each test example was recognised.
    chosen
        Which candidate was chosen, where there was a choice.
    """

    right: Mapping[str, Mask]
    chosen: Mapping[str, str] = field(default_factory=dict)

    @property
    def accuracy(self) -> float:
        """Mean over the conditions left out of the share recognised: each counts alike."""
        return float(np.mean([part.mean() for part in self.right.values()]))

    @property
    def pooled(self) -> float:
        """Share of all test examples that were recognised."""
        return float(np.concatenate(list(self.right.values())).mean())

    def numbers(self) -> dict[str, Any]:
        """Return accuracies as shares."""
        each = {name: round(float(part.mean()), 4) for name, part in self.right.items()}
        content = {'accuracy': round(self.accuracy, 4), 'pooled': round(self.pooled, 4), 'left_out': each}
        examples = {'tested': int(sum(len(part) for part in self.right.values()))}
        return {**content, **examples, **({'chosen': dict(self.chosen)} if self.chosen else {})}


def one_out(conditions: AnyArray, within: Mask | None = None) -> dict[str, tuple[Mask, Mask]]:
    """Return train and test slides of each condition left out in turn, by its name, among the slides `within`.

    Parameters
    ----------
    conditions : (n_slides,)
        Condition of each slide.
    within : (n_slides,) bool
        Slides that take part; None for all.

    Returns
    -------
    dict
        Condition → train and test slides, (n_slides,) bool each.
    """
    among = np.ones(len(conditions), dtype=bool) if within is None else within
    return {
        f'{value:g}': (among & (conditions != value), among & (conditions == value))
        for value in np.unique(conditions[among])
    }


def run(trial: EvaluateSplit, parts: Mapping[str, tuple[Mask, Mask]]) -> HeldOutResult:
    """Test each part.

    Parameters
    ----------
    trial
        Trains and tests.
    parts
        What is left out → train and test slides, (n_slides,) bool each.
    """
    return HeldOutResult({name: trial(train, test) for name, (train, test) in parts.items()})


def run_chosen(
    candidates: Mapping[str, EvaluateSplit],
    parts: Mapping[str, tuple[Mask, Mask]],
    conditions: Sequence[AnyArray],
    inner_trials: Mapping[str, EvaluateSplit] | None = None,
) -> HeldOutResult:
    """Test each part by the candidate that does best within its training slides, each condition there left out in turn.

    Of candidates that do alike, the first is taken.

    Parameters
    ----------
    candidates
        Trials by name.
    parts
        Train and test slides by what is left out.
    conditions
        What is left out in turn within the training.
    inner_trials
        Trials of the same names that evaluate the candidates there, if something else is to be tested than at the end.

    Returns
    -------
    HeldOutResult
    """
    evaluations = candidates if inner_trials is None else inner_trials
    right, chosen = {}, {}
    for name, (train, test) in parts.items():
        inner = [part for values in conditions for part in one_out(values, train).values() if part[0].any()]
        scores = {key: np.mean([trial(*part).mean() for part in inner]) for key, trial in evaluations.items()}
        best = max(scores, key=lambda key: scores[key])
        right[name], chosen[name] = candidates[best](train, test), best
    return HeldOutResult(right, chosen)


def recognised(learner: Learner, trained: tuple[Array, AnyArray, AnyArray], tested: tuple[Array, AnyArray]) -> Mask:
    """Return whether each test example is recognised.

    Parameters
    ----------
    learner
        What learns.
    trained
        Values (n, n_features), surfaces (n,) and slides (n,).
    tested
        Values (m, n_features) and surfaces (m,).

    Returns
    -------
    (m,) bool
    """
    values, surfaces, slides = trained
    labels, codes = np.unique(surfaces, return_inverse=True)
    _, groups = np.unique(slides, return_inverse=True)
    parts = learner.fit(values, codes, groups).parameters
    answers = labels[learner.predictor(parts)(tested[0]).argmax(axis=-1)]
    return np.asarray(answers == tested[1])
