# SPDX-License-Identifier: Apache-2.0
"""Linear discriminant analysis with a shrunk covariance, in plain arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from texture_core.config import param
from texture_core.types import Array
from texture_estimation.learners.learner import Codes, Fitted, FoldFit, assign_folds
from texture_estimation.numerics import log_loss, log_softmax

# --------------------
# Linear discriminant analysis with a shrunk covariance, as one linear layer.

CONSTANT = 1e-12


def linear_discriminant(X: Array, y: Codes, n_labels: int, shrinkage: float) -> tuple[Array, Array]:
    """Return the layer that gives the log-probabilities of Gaussian classes with one covariance, up to a constant.

    Parameters
    ----------
    X : (n, n_features)
        Features.
    y : (n,)
        Number of the label of each.
    n_labels
        Number of labels, which are equally probable before.
    shrinkage
        0 for the covariance within classes as it is, 1 for its diagonal alone.

    Returns
    -------
    (n_features, n_labels)
        Weights; 0 for features that are constant, and all 0 where a label has fewer than two examples.
    (n_labels,)
        Offsets.

    Source: Fisher 1936; Friedman 1989, "Regularized discriminant analysis".

    Examples
    --------
    >>> X, y = np.array([[0.0], [2.0], [4.0], [6.0]]), np.array([0, 0, 1, 1])  # means 1 and 5, variance 1
    >>> weights, offsets = linear_discriminant(X, y, 2, shrinkage=0.0)
    >>> scores = 3.0 * weights[0] + offsets  # in the middle
    >>> bool(np.isclose(scores[0], scores[1])), round(float(weights[0, 1] - weights[0, 0]), 6)  # (5 - 1) / 1
    (True, 4.0)
    """
    nothing = np.zeros((X.shape[1], n_labels)), np.zeros(n_labels)
    if np.bincount(y, minlength=n_labels).min() < 2:
        return nothing
    means = np.stack([X[y == code].mean(axis=0) for code in range(n_labels)])
    centre = means.mean(axis=0)
    rest = X - means[y]
    scale = np.sqrt(np.mean(rest * rest, axis=0))
    scale[scale <= CONSTANT * (1.0 + np.abs(centre))] = np.inf
    rest /= scale
    correlations = (1.0 - shrinkage) * (rest.T @ rest) / len(rest)
    correlations[np.diag_indices_from(correlations)] += shrinkage + CONSTANT
    relative = (means - centre) / scale
    weights = np.linalg.solve(correlations, relative.T)
    offsets = -0.5 * np.einsum('cf,fc->c', relative, weights)
    weights /= scale[:, None]
    return weights, offsets - centre @ weights


# --------------------
# The discriminant as a learner: Gaussian classes of one covariance, calibrated on what was held out.


@dataclass(frozen=True, eq=False)
class DiscriminantPredictor:
    """One linear layer.

    Parameters
    ----------
    weights : (n_features, n_labels)
    offsets : (n_labels,)

    Examples
    --------
    >>> DiscriminantPredictor(np.array([[1.0, -1.0]]), np.zeros(2))(np.array([2.0])).tolist()
    [2.0, -2.0]
    """

    weights: Array
    offsets: Array

    def __call__(self, X: Array) -> Array:
        """Return log-probabilities up to a constant of the window, (..., n_labels) of (..., n_features)."""
        scores: Array = X @ self.weights
        scores += self.offsets
        return scores


@dataclass(frozen=True)
class Discriminant:
    """Gaussian classes with one covariance, which is shrunk towards its diagonal; one temperature from held-out slides.

    Scores are linear in the features, so that the mean log-probability of the windows is that of the mean features of
    the slide so far. With few parameters it holds where the slides to come differ from those of the training.

    Source: Fisher 1936; Friedman 1989, "Regularized discriminant analysis"; Guo et al. 2017 for the temperature.

    Examples
    --------
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> fitted = Discriminant().fit(values, codes, groups)
    >>> bool((Discriminant.predictor(fitted.parameters)(values).argmax(axis=1) == codes).all())
    True
    """

    extras: ClassVar[tuple[str, ...]] = ('parts',)

    shrinkage: float = param(
        0.1,
        'Sets how far the correlations within classes are shrunk towards 0; more needs fewer slides and separates '
        'less finely.',
        low=0.0,
        high=1.0,
    )
    folds: int = param(
        5,
        'Sets the number of cross-validation folds for the calibration; more folds take longer to train.',
        low=2,
        high=50,
    )

    def fit(self, X: Array, y: Codes, groups: Codes, parts: Codes | None = None) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,).

        Parameters
        ----------
        X : (n, n_features)
            Features of windows; finite.
        y : (n,)
            Number of the label of each, from 0, without gaps.
        groups : (n,)
            Number of the slide of each.
        parts : (n_groups,) or None
            Part in which the slide of each number is held out; by slides if None.

        Returns
        -------
        Fitted
            Parameters, log-probabilities when held out, and a note on the calibration.
        """
        from scipy.optimize import minimize_scalar  # noqa: PLC0415  # takes 0.3 s, and only training needs it

        n_labels = int(y.max()) + 1
        split = assign_folds(y, groups, self.folds, parts)
        if split is None:
            return Fitted(self._fit(X, y, n_labels, 1.0), None, 'not calibrated, as a label has a single window')
        folds_of, note = split
        scores = np.empty((len(y), n_labels))
        for part in np.unique(folds_of):
            held = folds_of == part
            scores[held] = self.predictor(self._fit(X[~held], y[~held], n_labels, 1.0))(X[held])
        best = minimize_scalar(
            lambda log_t: log_loss(log_softmax(scores / math.exp(log_t)), y), bounds=(-2.0, 8.0), method='bounded'
        )
        temperature = math.exp(best.x)
        folds = [
            FoldFit(np.unique(groups[held]), self._fit(X[~held], y[~held], n_labels, temperature))
            for held in (folds_of == part for part in np.unique(folds_of))
        ]
        return Fitted(self._fit(X, y, n_labels, temperature), log_softmax(scores / temperature), note, folds)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> DiscriminantPredictor:
        """Return the predictor made from the stored parameters."""
        return DiscriminantPredictor(
            np.asarray(parameters['weights'], dtype=np.float64, order='F'),
            np.asarray(parameters['offsets'], dtype=np.float64),
        )

    def _fit(self, X: Array, y: Codes, n_labels: int, temperature: float) -> dict[str, Array]:
        weights, offsets = linear_discriminant(X, y, n_labels, self.shrinkage)
        return {'weights': weights / temperature, 'offsets': offsets / temperature}
