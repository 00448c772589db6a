"""Predict with a fitted multi-layer perceptron."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array


@dataclass(frozen=True, eq=False)
class MlpPredictor:
    """The two layers, made for features as they come.

    Parameters
    ----------
    hidden : (n_features, n_hidden)
    hidden_offset : (n_hidden,)
    output : (n_hidden, n_labels)
    output_offset : (n_labels,)

    Examples
    --------
    >>> predictor = MlpPredictor(np.eye(2), np.zeros(2), np.eye(2), np.zeros(2))
    >>> predictor(np.array([3.0, -1.0])).tolist()
    [3.0, 0.0]
    """

    hidden: Array
    hidden_offset: Array
    output: Array
    output_offset: Array

    def activations(self, X: Array) -> Array:
        """Return the outputs of the hidden layer, (..., n_hidden) of (..., n_features)."""
        active: Array = X @ self.hidden
        active += self.hidden_offset
        np.maximum(active, 0.0, out=active)
        return active

    def __call__(self, X: Array) -> Array:
        """Return log-probabilities up to a constant of the window, (..., n_labels) of (..., n_features)."""
        return self.scores(self.activations(X))

    def scores(self, activations: Array) -> Array:
        """Return the same, (..., n_labels), from the outputs of the hidden layer, (..., n_hidden).

        Parameters
        ----------
        activations : (..., n_hidden)

        Returns
        -------
        (..., n_labels)
        """
        scores: Array = activations @ self.output
        scores += self.output_offset
        return scores
