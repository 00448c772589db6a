"""Running mean and variance of the features of a slide."""

from __future__ import annotations

import numpy as np

from texture_core.arrays import Array


class SlideMoments:
    """Mean and variance of the windows of one slide so far, updated in constant memory.

    Source: Welford 1962 for the update without cancellation.

    Parameters
    ----------
    n_features
        Length of a feature vector.

    Attributes
    ----------
    mean, variance : (n_features,)
        Of the windows so far; zero before the first one.

    Examples
    --------
    >>> moments = SlideMoments(n_features=1)
    >>> for value in (1.0, 3.0):
    ...     moments.add(np.array([value]))
    >>> moments.mean.tolist(), moments.variance.tolist()
    ([2.0], [1.0])
    """

    def __init__(self, n_features: int) -> None:
        self.mean: Array = np.zeros(n_features)
        self.variance: Array = np.zeros(n_features)
        self._count = 0

    def add(self, values: Array) -> None:
        """Add a window.

        Parameters
        ----------
        values : (n_features,)
            Its features.
        """
        self._count += 1
        before = values - self.mean
        self.mean = self.mean + before / self._count
        self.variance = self.variance + (before * (values - self.mean) - self.variance) / self._count
