"""Friction of the surface under the finger."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch

LEAST_N = 0.1  # normal force by which is divided at least


@dataclass(frozen=True)
class Friction:
    """Mean tangential over mean normal force in the window; NaN if the arm does not measure the tangential force.

    The ratio of the means: noise of the force sensor averages out before the division.

    Examples
    --------
    >>> samples = np.zeros((5, 1))
    >>> pressed, dragged = np.array(2.0), np.array(0.5)
    >>> Friction()(WindowBatch(samples, rate_hz=100.0, force_n=pressed, tangential_force_n=dragged)).item()
    0.25
    """

    per_channel: ClassVar[bool] = False
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the ratio."""
        ratio: Array = np.asarray(windows.tangential_force_n) / np.maximum(windows.force_n, LEAST_N)
        return ratio[..., None, None]
