"""The learner itself, fitted to each half as `train` would."""

from __future__ import annotations

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes, Learner
from texture_estimation.search.halves import Mask
from texture_estimation.search.surrogates.surrogate import ScoresOfHalf


def exact(learner: Learner, values: Array, codes: Codes, groups: Codes) -> ScoresOfHalf:
    """Return what fits the learner to a half, standardisation included, and lets its exported predictor evaluate."""

    def scores(training: Mask) -> Array:
        fitted = learner.fit(values[training], codes[training], groups[training])
        return learner.predictor(fitted.parameters)(values)

    return scores
