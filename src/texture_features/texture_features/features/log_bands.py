"""Logarithm of the power in equal frequency bands (Welch's method)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import Windows, centred


@dataclass(frozen=True)
class LogBands:
    """Logarithm of the power spectral density in `bands` equal bands from 0 Hz to half the sampling rate."""

    of_signal: ClassVar[bool] = True

    bands: int = param(
        128, 'Number of bands; a segment of the spectrum is twice as many samples long.', low=2, high=8192
    )
    floor: float = param(1e-20, 'Density added before the logarithm, unit²/Hz.', low=1e-300, high=1e300)

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the band, from 1."""
        return tuple(str(band + 1) for band in range(self.bands))

    def __call__(self, windows: Windows) -> Array:
        """Return log(density + floor)."""
        return np.log(welch_density(windows.rows, windows.rate_hz, 2 * self.bands)[..., 1:] + self.floor)


def welch_density(rows: Array, rate_hz: float, segment: int) -> Array:
    """Return the one-sided power spectral density, averaged over half-overlapping segments.

    Each segment is freed of its mean and tapered by a Hann window. A row shorter than the segment is padded with zeros.

    Parameters
    ----------
    rows : (..., n_samples)
    rate_hz
        Sampling rate.
    segment
        Samples a segment, even.

    Returns
    -------
    (..., segment / 2 + 1)
        At the frequencies k · rate_hz / segment, unit²/Hz.

    Source: Welch 1967; agrees with scipy.signal.welch(detrend='constant').
    """
    n_samples = rows.shape[-1]
    if n_samples <= segment:
        pieces = centred(rows)[..., None, :]
    else:
        pieces = centred(np.take(rows, _segments(n_samples, segment), axis=-1))
    taper = hann(pieces.shape[-1])
    spectrum = np.fft.rfft(pieces * taper, segment)
    squares = spectrum.real**2
    squares += spectrum.imag**2
    density: Array = np.add.reduce(squares, axis=-2)
    density *= 2.0 / (squares.shape[-2] * rate_hz * float(taper @ taper))
    density[..., 0] /= 2.0
    density[..., -1] /= 2.0
    return density


@lru_cache(maxsize=64)
def hann(length: int) -> Array:
    """Return a Hann window that is nowhere 0: taken in the middle of each sample."""
    window: Array = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    window.flags.writeable = False
    return window


@lru_cache(maxsize=64)
def _segments(n_samples: int, segment: int) -> NDArray[np.intp]:
    """Return the sample indices of each segment, (n_segments, segment)."""
    starts = np.arange(0, n_samples - segment + 1, segment // 2)
    return starts[:, None] + np.arange(segment)
