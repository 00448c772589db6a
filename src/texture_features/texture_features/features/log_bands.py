"""Power in equal frequency bands: the mean over the window."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.spectrum import densities_of, mean_over_segments


@dataclass(frozen=True)
class LogBands:
    """Logarithm of the mean power spectral density in equal bands from 0 Hz to half the sampling rate (Welch).

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 100.0 * np.arange(1000) / 1000.0)[:, None]
    >>> bands = LogBands(bands=10)(WindowBatch(tone, rate_hz=1000.0))  # at 50, 100, … 500 Hz
    >>> int(bands[0].argmax()) + 1
    2
    """

    per_channel: ClassVar[bool] = True

    bands: int = param(32, 'Number of frequency bands; a segment is twice as many samples long.', low=2, high=512)
    overlap: float = param(
        0.75,
        'Fraction of a segment that overlaps the next one; more gives smoother values and costs time.',
        low=0.0,
        high=0.9,
    )
    floor: float = param(
        1e-20,
        'Power density added before the logarithm, so that silence gives a finite value, unit²/Hz.',
        low=1e-300,
        high=1e300,
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the band, from 1."""
        return tuple(str(band + 1) for band in range(self.bands))

    @cached_property
    def _step(self) -> int:
        return max(1, round(2 * self.bands * (1.0 - self.overlap)))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(mean density + floor)."""
        densities = densities_of(windows, 2 * self.bands, self._step, self.bands)
        return np.log(mean_over_segments(densities) + self.floor)
