"""Within-class whitening: shrink the directions in which slides of one texture differ among themselves."""

from __future__ import annotations

import numpy as np

from texture_core.arrays import Array
from texture_estimation.group_means import group_means
from texture_estimation.learners.learner import Codes


def within_class_whitening(X: Array, y: Codes, groups: Codes, ridge: float, differences: Array | None = None) -> Array:
    """Return the matrix that whitens what is no difference between textures, to be multiplied from the right.

    Slides of one texture differ by force, speed and place. The covariance of their means about the mean of the texture
    says in which directions; a difference along these tells little. `differences` add what else is known to matter
    nothing, such as how the load moves when friction begins to shear a finger that was at rest: a slide in the other
    direction shears it the other way.

    Parameters
    ----------
    X : (n, n_features)
        Features of windows.
    y : (n,)
        Number of the label of each.
    groups : (n,)
        Number of the slide of each.
    ridge
        Added to the eigenvalues of the covariance, whose mean is 1; a large one leaves the features as they are.
    differences : (n_groups, n_features) or None
        For the number of each slide a difference that is no difference of textures; NaN where it is not known.

    Returns
    -------
    (n_features, n_features)
        Symmetric; the identity if slides of one texture do not differ.

    Source: within-class covariance normalisation, Hatch, Kajarekar & Stolcke 2006.

    Examples
    --------
    >>> X = np.array([[0.0, 0.0], [9.0, 0.0], [0.0, 1.0], [9.0, 1.0]])  # the first feature varies within both textures
    >>> whitening = within_class_whitening(X, np.array([0, 0, 1, 1]), np.arange(4), ridge=0.01)
    >>> whitening.round(2).tolist()
    [[0.71, 0.0], [0.0, 10.0]]
    """
    slides, first, rows = np.unique(groups, return_index=True, return_inverse=True)
    means = group_means(X, rows)
    _, labels = np.unique(y[first], return_inverse=True)
    centres = group_means(means, labels)
    covariance = _mean_square(means - centres[labels])
    if differences is not None:
        own = differences[slides]
        covariance = covariance + _mean_square(own[np.isfinite(own).all(axis=1)])
    mean_power = float(np.trace(covariance)) / X.shape[1]
    if mean_power <= 0.0:
        return np.eye(X.shape[1])
    strengths, directions = np.linalg.eigh(covariance / mean_power)
    return np.asarray((directions / np.sqrt(np.maximum(strengths, 0.0) + ridge)) @ directions.T)


def _mean_square(deviations: Array) -> Array:
    """Return the mean outer product, (n_features, n_features)."""
    product: Array = deviations.T @ deviations / max(1, len(deviations))
    return product
