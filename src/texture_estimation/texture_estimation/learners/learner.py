"""What a learner is: parameters that fit examples, and the predictor that it exports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array

Codes = NDArray[np.intp]


class Predictor(Protocol):
    """Predict from features, as plain arrays."""

    def __call__(self, values: Array) -> Array:
        """Return log-probabilities up to a constant of the window, (..., n_labels) of (..., n_features)."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """Fitted parameters of a learner.

    Parameters
    ----------
    parameters
        What the model file stores: scikit-learn objects, arrays, numbers and texts.
    held_out : (n, n_labels) or None
        Log-probabilities of each example by a learner that has not seen its slide; None if there are too few examples.
    note
        How the probabilities were calibrated, in words for the model's card.
    """

    parameters: Mapping[str, Any]
    held_out: Array | None
    note: str


class Learner(Protocol):
    """Frozen parameters of a learner."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def fit(self, values: Array, codes: Codes, groups: Codes) -> Fitted:
        """Learn from values (n, n_features), label numbers 0… (n,) and slide numbers (n,)."""

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Predictor:
        """Return the predictor made from the stored parameters."""
