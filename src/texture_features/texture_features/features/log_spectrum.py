"""The whole power spectrum, point by point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.spectrum import long_densities


@dataclass(frozen=True)
class LogSpectrum:
    """Logarithm of the power spectral density at equal steps up to half the sampling rate.

    Meant for a learner that begins with principal components. A window shorter than 2 · `points` is padded with zeros;
    of a longer one the mean over segments of that length, half overlapping, is taken.

    Source: Hu et al. 2014, section 4.1 (12 288 points there).

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 100.0 * np.arange(1000) / 1000.0)[:, None]
    >>> spectrum = LogSpectrum(points=500)(WindowBatch(tone, rate_hz=1000.0))  # at 1, 2, … 500 Hz
    >>> int(spectrum[0].argmax()) + 1
    100
    """

    per_channel: ClassVar[bool] = True

    points: int = param(
        12288,
        'Sets the number of frequency bins k · rate / (2 · points), k from 1; more bins resolve finer.',
        low=2,
        high=1 << 19,
    )
    floor: float = param(
        1e-20,
        'Power density added before the logarithm, so that silence gives a finite value, unit²/Hz.',
        low=1e-300,
        high=1e300,
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the frequency, from 1."""
        return tuple(str(point + 1) for point in range(self.points))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(density + floor)."""
        return np.log(long_densities(windows.rows, windows.rate_hz, self.points) + self.floor)
