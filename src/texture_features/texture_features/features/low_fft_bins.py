"""Power density in the lowest FFT bins of long segments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.welch_spectrum import welch_spectrum


@dataclass(frozen=True)
class LowFftBins:
    """Logarithm of the power spectral density at the lowest lines of long segments: where ridges and grids show.

    `log_bands` with as many bands would be as fine everywhere, and noisier where fineness does not help.

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 30.0 * np.arange(1000) / 1000.0)[:, None]
    >>> bins = LowFftBins(bins=10, points=100)(WindowBatch(tone, rate_hz=1000.0))  # at 10, 20, … 100 Hz
    >>> int(bins[0].argmax()) + 1
    3
    """

    per_channel: ClassVar[bool] = True

    bins: int = param(
        32,
        'Sets the number of FFT bins, from the first above 0 Hz; more bins reach higher frequencies.',
        low=1,
        high=512,
    )
    points: int = param(
        128, 'Length of an FFT segment in samples; FFT bins are rate / points apart.', low=4, high=16384
    )
    floor: float = param(
        1e-20,
        'Power density added before the logarithm, so that silence gives a finite value, unit²/Hz.',
        low=1e-300,
        high=1e300,
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the line, from 1."""
        return tuple(str(bin_index + 1) for bin_index in range(self._count))

    @property
    def _count(self) -> int:
        return min(self.bins, self.points // 2)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(mean density + floor)."""
        densities, _ = welch_spectrum(windows, self.points, rate_of_change=False)
        return np.log(densities[..., : self._count] + self.floor)
