"""Length of the line that the signal draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import Windows, slopes


@dataclass(frozen=True)
class ArcLength:
    """Length of the line through the samples, with time in s and the signal in its unit.

    Source: Roberge et al., "Textures recognition through tactile exploration", eq. 2.
    """

    of_signal: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: Windows) -> Array:
        """Return Σ √(Δt² + Δs²)."""
        lengths: Array = np.add.reduce(np.hypot(slopes(windows.rows), 1.0 / windows.rate_hz), axis=-1)
        return lengths[..., None]
