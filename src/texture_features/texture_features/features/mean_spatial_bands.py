"""Power in bands of spatial frequency: the mean over the channels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import Windows
from texture_features.features.spatial_bands import SpatialBands


@dataclass(frozen=True)
class MeanSpatialBands(SpatialBands):
    """Mean over the channels of `spatial_bands`: the texture, not which taxel felt it. NaN if the speed is unknown."""

    of_signal: ClassVar[bool] = False

    def __call__(self, windows: Windows) -> Array:
        """Return the mean over the channels of the log bands."""
        bands = SpatialBands.__call__(self, windows)
        mean: Array = np.add.reduce(bands, axis=-2, keepdims=True) / bands.shape[-2]
        return mean
