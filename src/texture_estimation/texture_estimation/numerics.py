# SPDX-License-Identifier: Apache-2.0
"""Log-probabilities and means of groups."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from texture_core.types import Array

# --------------------
# Means of the rows that belong together, such as the windows of a slide or the slides of a texture.


def group_means(values: Array, groups: NDArray[np.intp]) -> Array:
    """Return the mean of the rows of each group, (n_groups, n_features).

    Parameters
    ----------
    values : (n, n_features)
        Such as the features of windows.
    groups : (n,)
        Number of the group of each row, from 0, without gaps.

    Returns
    -------
    (n_groups, n_features)
        In the units of the values.

    Examples
    --------
    >>> group_means(np.array([[1.0], [3.0], [5.0]]), np.array([0, 0, 1])).tolist()
    [[2.0], [5.0]]
    """
    counts = np.bincount(groups)
    means = np.zeros((len(counts), values.shape[1]))
    np.add.at(means, groups, values)
    means /= counts[:, None]
    return means


def shrunk_covariance(covariance: Array, shrinkage: float) -> Array:
    """Return a covariance drawn to its diagonal, (n_features, n_features).

    Parameters
    ----------
    covariance : (n_features, n_features)
    shrinkage
        0 for the covariance as it is, 1 for its diagonal alone: few examples hardly tell what is correlated.

    Source: Friedman 1989, "Regularized discriminant analysis".
    """
    shrunk: Array = (1.0 - shrinkage) * covariance
    np.fill_diagonal(shrunk, np.diag(covariance))
    return shrunk


# --------------------
# Logarithms of probabilities, the textures along the last axis.

CHUNK = 1 << 21  # numbers, 16 MiB


def chunks(n_rows: int, n_columns: int) -> Iterator[slice]:
    """Yield slices of rows that hold at most CHUNK numbers together, so that intermediate results stay small.

    Parameters
    ----------
    n_rows, n_columns
        Shape of an array.

    Examples
    --------
    >>> list(chunks(5, CHUNK // 2))
    [slice(0, 2, None), slice(2, 4, None), slice(4, 5, None)]
    """
    size = max(1, CHUNK // max(1, n_columns))
    for start in range(0, n_rows, size):
        yield slice(start, min(start + size, n_rows))


def log_softmax(scores: Array) -> Array:
    """Return scores less the logarithm of the sum of their exponentials, (..., n_labels).

    Parameters
    ----------
    scores : (..., n_labels)

    Returns
    -------
    (..., n_labels)
        Logarithms of probabilities that add up to 1.
    """
    shifted = scores - np.maximum.reduce(scores, axis=-1, keepdims=True)
    return shifted - np.log(np.add.reduce(np.exp(shifted), axis=-1, keepdims=True))


def softmax(scores: Array) -> Array:
    """Return the exponentials of scores less what makes their sum 1, (..., n_labels).

    Parameters
    ----------
    scores : (..., n_labels)

    Returns
    -------
    (..., n_labels)
        Probabilities that add up to 1.
    """
    shares: Array = np.exp(scores - np.maximum.reduce(scores, axis=-1, keepdims=True))
    shares /= np.add.reduce(shares, axis=-1, keepdims=True)
    return shares


def is_tied(log_probabilities: Array) -> NDArray[np.bool_]:
    """Return whether several textures share the highest log-probability to the last bit, (...): nothing is decided.

    Parameters
    ----------
    log_probabilities : (..., n_labels)

    Returns
    -------
    (...) bool
        True where nothing is decided.
    """
    best = np.maximum.reduce(log_probabilities, axis=-1, keepdims=True)
    return np.count_nonzero(log_probabilities == best, axis=-1) > 1


def log_loss(log_probabilities: Array, codes: NDArray[np.intp]) -> float:
    """Return the mean negative log-probability of the true textures; (n, n_labels) and (n,) of their numbers.

    Parameters
    ----------
    log_probabilities : (n, n_labels)
    codes : (n,)
        Numbers of the true labels.
    """
    return float(-np.take_along_axis(log_probabilities, codes[:, None], axis=-1).mean())


def fit_temperature(scores: Array, codes: NDArray[np.intp], trusted: Array | None = None, most: float = 4.0) -> float:
    """Return the temperature that makes the true textures most probable by log_softmax(scores / temperature).

    Parameters
    ----------
    scores : (n, n_labels)
        Of examples that were held out.
    codes : (n,)
        Numbers of the true labels.
    trusted : (n,) or None
        How much each example counts; all the same if None.
    most
        Its logarithm is sought from -2 to this.

    Source: Guo et al. 2017, "On calibration of modern neural networks".
    """
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  # takes 0.3 s, and only training needs it

    parts = list(chunks(*scores.shape))
    weights = [rows.stop - rows.start for rows in parts]

    def loss(logarithm: float) -> float:
        losses = []
        for rows in parts:
            log_probabilities = log_softmax(scores[rows] / np.exp(logarithm))
            counted = log_probabilities if trusted is None else trusted[rows, None] * log_probabilities
            losses.append(log_loss(counted, codes[rows]))
        return float(np.average(losses, weights=weights))

    return float(np.exp(minimize_scalar(loss, bounds=(-2.0, most), method='bounded').x))
