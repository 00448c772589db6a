"""Speed of the finger."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch


@dataclass(frozen=True)
class Speed:
    """Mean speed of the finger along the surface in the window, m/s; NaN if the exploration does not say.

    Examples
    --------
    >>> Speed()(WindowBatch(np.zeros((5, 1)), rate_hz=100.0, speed_m_s=np.array(0.05))).item()
    0.05
    """

    per_channel: ClassVar[bool] = False
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the speed."""
        return np.asarray(windows.speed_m_s, dtype=np.float64)[..., None, None]
