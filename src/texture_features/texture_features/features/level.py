"""Mean of the signal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import Windows


@dataclass(frozen=True)
class Level:
    """Mean of each channel: what a slow channel rests at. It may betray how a surface was mounted."""

    of_signal: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: Windows) -> Array:
        """Return the mean."""
        rows = windows.rows
        levels: Array = np.add.reduce(rows, axis=-1) / rows.shape[-1]
        return levels[..., None]
