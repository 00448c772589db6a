"""How the power in frequency bands changes over the window."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.spectrum import densities_of


@dataclass(frozen=True)
class ShortTimeFourier:
    """Logarithm of the power spectral density in equal bands, for each of some equal parts of the window.

    The short-time Fourier transform, averaged within each part. Where a window has fewer segments than parts,
    neighbouring parts share one.

    Examples
    --------
    >>> time_s = np.arange(1000) / 1000.0
    >>> chirp = np.where(time_s < 0.5, np.sin(2 * np.pi * 100.0 * time_s), np.sin(2 * np.pi * 300.0 * time_s))[:, None]
    >>> feature = ShortTimeFourier(parts=2, bands=10)  # bands at 50, 100, … 500 Hz
    >>> values = feature(WindowBatch(chirp, rate_hz=1000.0)).reshape(2, 10)
    >>> (values.argmax(axis=1) + 1).tolist()
    [2, 6]
    """

    per_channel: ClassVar[bool] = True

    parts: int = param(
        4, 'Sets the number of equal time segments of the window; more segments resolve finer in time.', low=1, high=256
    )
    bands: int = param(16, 'Number of frequency bands; a segment is twice as many samples long.', low=2, high=512)
    overlap: float = param(
        0.5,
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
        """Part and band, each from 1."""
        return tuple(f'{part + 1}/{band + 1}' for part in range(self.parts) for band in range(self.bands))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(mean density of each part + floor), part by part."""
        step = max(1, round(2 * self.bands * (1.0 - self.overlap)))
        densities = densities_of(windows, 2 * self.bands, step, self.bands)
        means = _averaging(self.parts, densities.shape[-2]) @ densities
        return np.log(means + self.floor).reshape(*means.shape[:-2], -1)


@lru_cache(maxsize=64)
def _averaging(parts: int, segments: int) -> Array:
    """Return the matrix (parts, segments) whose product with segments is the mean of each part."""
    first = np.arange(parts) * segments // parts
    last = np.maximum(np.arange(1, parts + 1) * segments // parts, first + 1)
    index = np.arange(segments)
    belongs = ((index >= first[:, None]) & (index < last[:, None])).astype(np.float64)
    matrix: Array = belongs / belongs.sum(axis=1, keepdims=True)
    matrix.flags.writeable = False
    return matrix
