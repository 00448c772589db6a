"""Short spectra along a window: what the spectral features are made of."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_features.feature import Windows, centred


def segment_densities(rows: Array, rate_hz: float, segment: int, step: int) -> Array:
    """Return the one-sided power spectral density of each segment of each row.

    A segment is freed of its mean and tapered by a Hann window. A row shorter than one is padded with zeros.

    Parameters
    ----------
    rows : (..., n_samples)
    rate_hz
        Sampling rate.
    segment, step
        Length of a segment, even, and distance between two of them, in samples.

    Returns
    -------
    (..., n_segments, segment / 2 + 1)
        At the frequencies k · rate_hz / segment, unit²/Hz.

    Source: Welch 1967; the mean over the segments is scipy.signal.welch(detrend='constant').
    """
    n_samples = rows.shape[-1]
    cut = rows[..., None, :] if n_samples <= segment else np.take(rows, _indices(n_samples, segment, step), axis=-1)
    pieces = centred(cut)
    pieces *= hann(cut.shape[-1])
    spectra = np.fft.rfft(pieces, segment)
    real, imaginary = spectra.real, spectra.imag
    densities: Array = real * real
    densities += imaginary * imaginary
    densities *= _scale(rate_hz, segment, cut.shape[-1])
    return densities


def densities_of(windows: Windows, segment: int, step: int) -> Array:
    """Return the densities of the segments of windows; features that ask for the same share them."""
    key = ('densities', segment, step)
    if key not in windows.memo:
        windows.memo[key] = segment_densities(windows.rows, windows.rate_hz, segment, step)
    densities: Array = windows.memo[key]
    return densities


def mean_over_segments(densities: Array) -> Array:
    """Return the mean over the segments, (..., n_bins)."""
    mean: Array = np.add.reduce(densities, axis=-2) / densities.shape[-2]
    return mean


@lru_cache(maxsize=64)
def hann(length: int) -> Array:
    """Return a Hann window that is nowhere 0: taken in the middle of each sample."""
    window: Array = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    window.flags.writeable = False
    return window


@lru_cache(maxsize=64)
def _scale(rate_hz: float, segment: int, length: int) -> Array:
    """Return what makes a squared spectrum a one-sided density: the inner bins count for both signs of frequency."""
    window = hann(length)
    scale = np.full(segment // 2 + 1, 2.0 / (rate_hz * float(window @ window)))
    scale[[0, -1]] /= 2.0
    return scale


@lru_cache(maxsize=64)
def _indices(n_samples: int, segment: int, step: int) -> NDArray[np.intp]:
    """Return the sample indices of each segment, (n_segments, segment)."""
    return np.arange(0, n_samples - segment + 1, step)[:, None] + np.arange(segment)
