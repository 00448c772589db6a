"""The learner itself, fitted to each half as `train` would."""

from __future__ import annotations

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes, Learner
from texture_estimation.search.halves import Mask
from texture_estimation.search.judges.judge import ScoresOfHalf


def exact(learner: Learner, values: Array, codes: Codes, groups: Codes) -> ScoresOfHalf:
    """Return what fits the learner to a half, standardisation included, and lets its array form judge."""

    def scores(learnt: Mask) -> Array:
        fitted = learner.fit(values[learnt], codes[learnt], groups[learnt])
        return learner.array_form(fitted.parts)(values)

    return scores
