"""Force of the finger."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch


@dataclass(frozen=True)
class Force:
    """Mean force of the finger normal to the surface in the window, N; NaN if the exploration does not say.

    Examples
    --------
    >>> Force()(WindowBatch(np.zeros((5, 1)), rate_hz=100.0, force_n=np.array(1.5))).item()
    1.5
    """

    per_channel: ClassVar[bool] = False
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the force."""
        return np.asarray(windows.force_n, dtype=np.float64)[..., None, None]
