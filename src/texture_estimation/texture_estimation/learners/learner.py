"""What a learner is: parameters that fit examples, and the array form of what was fitted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array

Codes = NDArray[np.intp]


class LogProbabilities(Protocol):
    """What judges windows, as plain arrays."""

    def __call__(self, values: Array) -> Array:
        """Return log-probabilities up to a constant of the window, (..., n_labels) of (..., n_features)."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """What a learner has learnt.

    Parameters
    ----------
    parts
        What the model file stores: scikit-learn objects, arrays, numbers and texts.
    held_out : (n, n_labels) or None
        Log-probabilities of each example by a learner that has not seen its slide; None if there are too few examples.
    note
        How the probabilities were calibrated, in words for the model's card.
    """

    parts: Mapping[str, Any]
    held_out: Array | None
    note: str


class Learner(Protocol):
    """Frozen parameters of a learner."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def fit(self, values: Array, codes: Codes, groups: Codes) -> Fitted:
        """Learn from values (n, n_features), label numbers 0… (n,) and slide numbers (n,)."""

    @staticmethod
    def array_form(parts: Mapping[str, Any]) -> LogProbabilities:
        """Return what judges, from the stored parts."""
