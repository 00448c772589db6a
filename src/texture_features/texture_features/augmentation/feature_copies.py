"""Features of the altered copies of slides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array


@dataclass(frozen=True, eq=False)
class FeatureCopies:
    """Features of changed copies of slides, copy by copy and in the order of time.

    Parameters
    ----------
    values : (n, n_features) float32
    groups : (n,) of text
        Slide (exploration id) of which each window is a copy.
    copies : (n,)
        Number of the copy of the slide.
    kinds : (n,) of text
        Kind of disturbance; in augmented copies NOISE if noise was added, else ''.

    Examples
    --------
    >>> copies = FeatureCopies(np.zeros((2, 3), np.float32), np.array(['a', 'b']), np.arange(2), np.array(['', '']))
    >>> copies.select(copies.groups == 'b').copies.tolist()
    [1]
    """

    values: NDArray[np.float32]
    groups: NDArray[np.str_]
    copies: NDArray[np.intp]
    kinds: NDArray[np.str_]

    def select(self, rows: NDArray[np.bool_]) -> FeatureCopies:
        """Return these windows, (n,).

        Parameters
        ----------
        rows : (n,) bool
            Which windows are kept.
        """
        return FeatureCopies(self.values[rows], self.groups[rows], self.copies[rows], self.kinds[rows])


@dataclass(frozen=True, eq=False)
class AugmentedFeatures:
    """What augmentation adds to labelled features.

    Parameters
    ----------
    copies
        To train on.
    disturbed
        To fit early stopping on.
    gain_response : (n_features,)
        Change of each feature per natural logarithm of the gain of the vibration: 2 for the logarithm of a power, 1 for
        that of an amplitude, 0 for what no gain changes.

    Examples
    --------
    >>> nothing = FeatureCopies(np.zeros((0, 1), np.float32), np.array(['']), np.arange(0), np.array(['']))
    >>> features = AugmentedFeatures(nothing, nothing, gain_response=np.array([2.0]))  # of a logarithm of a power
    >>> bool(np.isclose(np.log(3.0**2), features.gain_response[0] * np.log(3.0)))
    True
    """

    copies: FeatureCopies
    disturbed: FeatureCopies
    gain_response: Array
