"""Power in bands of spatial frequency: the mean over the channels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch
from texture_features.features.spatial_bands import SpatialBands


@dataclass(frozen=True)
class MeanSpatialBands(SpatialBands):
    """Mean over the channels of `spatial_bands`, independent of the taxel. NaN if the speed is unknown.

    Examples
    --------
    >>> samples = np.random.default_rng(0).standard_normal((500, 4))
    >>> both = [WindowBatch(each, 1000.0, np.array(0.05)) for each in (samples, samples[:, ::-1])]
    >>> np.allclose(MeanSpatialBands()(both[0]), MeanSpatialBands()(both[1]))  # which taxel measured what is lost
    True
    """

    per_channel: ClassVar[bool] = False

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the mean over the channels of the log bands."""
        bands = SpatialBands.__call__(self, windows)
        mean: Array = np.add.reduce(bands, axis=-2, keepdims=True) / bands.shape[-2]
        return mean
