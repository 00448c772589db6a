"""The head itself, fitted to each half as `train` would."""

from __future__ import annotations

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.roughness.regressor import RoughnessRegressor
from texture_estimation.search.halves import Mask
from texture_estimation.search.surrogates.regressor_surrogate import GradesOfHalf


def exact_grades(regressor: RoughnessRegressor, X: Array, y: Array, groups: Codes) -> GradesOfHalf:
    """Return what fits the head to a half, standardisation included, and lets its exported predictor grade.

    Parameters
    ----------
    regressor
        Regressor of the recipe.
    X : (n, n_features)
        Features of all examples.
    y, groups : (n,)
        Grade and number of the texture of each.

    Returns
    -------
    callable
        Takes which examples are used for training, (n,), returns grades (n,).
    """

    def graded(training: Mask) -> Array:
        parameters = regressor.fit(X[training], y[training], groups[training])
        return regressor.predictor(parameters)(X)[0]

    return graded
