"""Centred log-ratio of the channel means: how the load is distributed over the taxels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch


@dataclass(frozen=True)
class CentredLogRatio:
    """Logarithm of each channel's mean level less the mean of these logarithms; for levels above 0.

    A force that presses all taxels harder by the same factor changes nothing; friction and mounting do.

    Examples
    --------
    >>> levels = np.array([[1.0, 4.0]])  # the second taxel carries four times the load of the first
    >>> CentredLogRatio()(WindowBatch(levels, rate_hz=100.0))[:, 0].round(3).tolist()
    [-0.693, 0.693]
    >>> CentredLogRatio()(WindowBatch(10 * levels, rate_hz=100.0))[:, 0].round(3).tolist()  # pressed ten times as hard
    [-0.693, 0.693]
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    floor: float = param(
        1e-3,
        'Smallest channel mean; smaller means are replaced by it, in the unit of the signal.',
        low=1e-300,
        high=1e300,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the log shares."""
        rows = windows.rows
        levels = np.log(np.maximum(np.add.reduce(rows, axis=-1) / rows.shape[-1], self.floor))
        shares: Array = levels - np.add.reduce(levels, axis=-1, keepdims=True) / levels.shape[-1]
        return shares[..., None]
