"""Predict with a fitted multi-layer perceptron and a linear discriminant for first windows."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.arrays import Array
from texture_estimation.learners.mlp_predictor import MlpPredictor


@dataclass(frozen=True, eq=False)
class OnsetMlpPredictor(MlpPredictor):
    """The layers of the network, and one that is added to its scores for first windows.

    Parameters
    ----------
    onset : (n_features, n_labels)
    onset_offset : (n_labels,)
    column
        Number of the feature that is 1 for first windows.

    Examples
    --------
    >>> import numpy as np
    >>> predictor = OnsetMlpPredictor(np.eye(2), np.zeros(2), np.eye(2), np.zeros(2), np.eye(2), np.ones(2), column=1)
    >>> predictor(np.array([[3.0, 0.0], [3.0, 1.0]])).tolist()
    [[3.0, 0.0], [7.0, 3.0]]
    """

    onset: Array
    onset_offset: Array
    column: int

    def __call__(self, X: Array) -> Array:
        """Return log-probabilities up to a constant of the window, (..., n_labels) of (..., n_features)."""
        scores, first = super().__call__(X), X[..., self.column, None]
        if first.any():
            scores += first * (X @ self.onset + self.onset_offset)
        return scores
