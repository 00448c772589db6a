"""Mean of the signal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch


@dataclass(frozen=True)
class ChannelMean:
    """Mean of each channel. It may depend on how a surface was mounted.

    Examples
    --------
    >>> ChannelMean()(WindowBatch(np.array([[1.0, 10.0], [3.0, 30.0]]), rate_hz=100.0))[:, 0].tolist()
    [2.0, 20.0]
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the mean."""
        rows = windows.rows
        levels: Array = np.add.reduce(rows, axis=-1) / rows.shape[-1]
        return levels[..., None]
