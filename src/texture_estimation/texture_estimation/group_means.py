"""Means of the rows that belong together, such as the windows of a slide or the slides of a texture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array


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
