"""Linear discriminant analysis with a shrunk covariance, as one linear layer."""

from __future__ import annotations

import numpy as np

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes

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
