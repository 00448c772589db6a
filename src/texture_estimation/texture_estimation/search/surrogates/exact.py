"""The learner itself, fitted to each half as `train` would."""

from __future__ import annotations

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes, Learner
from texture_estimation.search.halves import Mask
from texture_estimation.search.surrogates.surrogate import ScoresOfHalf


def exact(learner: Learner, X: Array, y: Codes, groups: Codes) -> ScoresOfHalf:
    """Return what fits the learner to a half, standardisation included, and lets its exported predictor evaluate.

    Parameters
    ----------
    learner
        Learner of the recipe.
    X : (n, n_features)
        Features of all examples.
    y, groups : (n,)
        Number of the label and of the slide of each.

    Returns
    -------
    callable
        Takes which examples are used for training, (n,), returns scores (n, n_labels).
    """

    def scores(training: Mask) -> Array:
        fitted = learner.fit(X[training], y[training], groups[training])
        return learner.predictor(fitted.parameters)(X)

    return scores
