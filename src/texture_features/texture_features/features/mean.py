"""Mean of the signal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch


@dataclass(frozen=True)
class ChannelMean:
    """Mean of each channel. It may depend on how a surface was mounted."""

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the mean."""
        rows = windows.rows
        levels: Array = np.add.reduce(rows, axis=-1) / rows.shape[-1]
        return levels[..., None]
