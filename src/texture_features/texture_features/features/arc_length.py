"""Length of the line that the signal draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch, first_difference


@dataclass(frozen=True)
class ArcLength:
    """Length of the line through the samples, with time in s and the signal in its unit.

    Source: Roberge et al., "Textures recognition through tactile exploration", eq. 2.

    Examples
    --------
    >>> still = WindowBatch(np.zeros((1001, 1)), rate_hz=1000.0)  # 1 s without any change
    >>> round(ArcLength()(still).item(), 6)
    1.0
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return Σ √(Δt² + Δs²)."""
        lengths: Array = np.add.reduce(np.hypot(first_difference(windows.rows), 1.0 / windows.rate_hz), axis=-1)
        return lengths[..., None]
