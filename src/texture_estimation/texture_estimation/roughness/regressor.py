"""Protocol of roughness regressors: parameters that fit graded windows and export a predictor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

import numpy as np

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes

GRADES: Array = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
SMOOTH, ROUGH = 1.0, 5.0


class RegressorPredictor(Protocol):
    """Predict grades of windows, as plain arrays."""

    def __call__(self, X: Array) -> tuple[Array, Array]:
        """Return grade and its standard deviation.

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (...,), (...,)
            NaN as the grade where the regressor has no answer; 0 as the deviation if the regressor does not know it.
        """


class RoughnessRegressor(Protocol):
    """Frozen parameters of a regressor."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def fit(self, X: Array, y: Array, groups: Codes) -> Mapping[str, Any]:
        """Learn from features `X`, grades `y` and texture numbers `groups`; return plain arrays.

        Parameters
        ----------
        X : (n, n_features)
            Features of windows; finite.
        y : (n,)
            Mean grade of the texture of each, 1 to 5.
        groups : (n,)
            Number of the texture of each.

        Returns
        -------
        mapping
            Arrays for `predictor` and for the model file.
        """

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> RegressorPredictor:
        """Return the predictor made from the stored parameters."""
