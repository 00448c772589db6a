"""Mean of the log power in equal frequency bands over the segments of a window."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch
from texture_features.features.log_bands import LogBands
from texture_features.spectra.spectrum import densities_of, mean_over_segments


@dataclass(frozen=True)
class MeanLogBands(LogBands):
    """Mean over short segments of the logarithm of the power spectral density, in the bands of `log_bands`.

    Where this is well below `log_bands`, the power comes in bursts: single bumps, stick and slip.

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal((1000, 1))
    >>> bursts = noise * (np.arange(1000) < 200)[:, None]  # silent for most of the window
    >>> both = [WindowBatch(samples, rate_hz=1000.0) for samples in (noise, bursts)]
    >>> below = [float((LogBands()(window) - MeanLogBands()(window)).mean()) for window in both]
    >>> below[1] > 10 * below[0] > 0
    True
    """

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the mean of log(density + floor)."""
        densities = densities_of(windows, 2 * self.bands, self._step, self.bands)
        return mean_over_segments(np.log(densities + self.floor))
