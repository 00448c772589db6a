"""Short spectra along a window: what the spectral features are made of."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_features.feature import Windows


def segment_densities(rows: Array, rate_hz: float, segment: int, step: int, bins: int) -> Array:
    """Return the one-sided power spectral density of each segment of each row, at its lowest bins above 0 Hz.

    A segment is freed of its mean and tapered by a Hann window. A row shorter than one is padded with zeros. The
    transform is a product with a matrix: for the few bins of a short window it takes half the time of a fast Fourier
    transform and the steps around it, and its rounding is the same for one window as for many.

    Parameters
    ----------
    rows : (..., n_samples)
    rate_hz
        Sampling rate.
    segment, step
        Length of a segment, even, and distance between two of them, in samples.
    bins
        Number of bins, at most segment / 2.

    Returns
    -------
    (..., n_segments, bins)
        At the frequencies k · rate_hz / segment, k = 1 to `bins`, unit²/Hz.

    Source: Welch 1967; the mean over the segments is scipy.signal.welch(detrend='constant').
    """
    n_samples = rows.shape[-1]
    cut = rows[..., None, :] if n_samples <= segment else np.take(rows, _indices(n_samples, segment, step), axis=-1)
    parts = cut @ _transform(cut.shape[-1], segment, bins, rate_hz)
    parts *= parts
    densities: Array = parts[..., :bins] + parts[..., bins:]
    return densities


def densities_of(windows: Windows, segment: int, step: int, bins: int) -> Array:
    """Return the densities of the segments of windows; features that ask for the same share them."""
    return windows.shared(
        ('densities', segment, step, bins),
        lambda: segment_densities(windows.centred_rows, windows.rate_hz, segment, step, bins),
    )


def mean_over_segments(densities: Array) -> Array:
    """Return the mean over the segments, (..., n_bins)."""
    mean: Array = np.add.reduce(densities, axis=-2) / densities.shape[-2]
    return mean


def long_densities(rows: Array, rate_hz: float, bins: int) -> Array:
    """Return the mean one-sided power spectral density at `bins` frequencies above 0 Hz, by fast Fourier transform.

    What `segment_densities` and the mean over half-overlapping segments give, for long segments and all their bins.

    Parameters
    ----------
    rows : (..., n_samples)
    rate_hz
        Sampling rate.
    bins
        Half the length of a segment.

    Returns
    -------
    (..., bins)
    """
    n_samples, segment = rows.shape[-1], 2 * bins
    cut = rows[..., None, :] if n_samples <= segment else np.take(rows, _indices(n_samples, segment, bins), axis=-1)
    taper = hann(cut.shape[-1])
    means = np.add.reduce(cut, axis=-1, keepdims=True) / cut.shape[-1]
    waves = np.fft.rfft((cut - means) * taper, segment)[..., 1:]
    densities = waves.real * waves.real + waves.imag * waves.imag
    densities *= 2.0 / (rate_hz * float(taper @ taper))
    densities[..., -1] /= 2.0
    return mean_over_segments(densities)


def amplitudes_of(windows: Windows, points: int) -> tuple[Array, float]:
    """Return the amplitudes of the Fourier transform of the zero-mean windows, and the step between its bins.

    Parameters
    ----------
    points
        Samples of the transform: a shorter window is padded with zeros, for a longer one there are as many as it has.

    Returns
    -------
    (..., n_channels, n_bins)
        From 0 Hz on, in the unit of the signal: a tone of amplitude 1 in the middle of a bin has 1.
    float
        Distance of the bins, Hz.
    """
    n_samples = windows.samples.shape[-2]
    points = max(points, n_samples)
    amplitudes = windows.shared(
        ('amplitudes', points), lambda: np.abs(np.fft.rfft(windows.centred_rows, points)) * (2.0 / n_samples)
    )
    return amplitudes, windows.rate_hz / points


@lru_cache(maxsize=64)
def hann(length: int) -> Array:
    """Return a Hann window that is nowhere 0: taken in the middle of each sample."""
    window: Array = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    window.flags.writeable = False
    return window


@lru_cache(maxsize=64)
def _transform(length: int, segment: int, bins: int, rate_hz: float) -> Array:
    """Return the matrix (length, 2 · bins) that takes a segment to the square roots of its densities.

    Columns are cosines, then sines, tapered. Their own mean is removed, which removes that of the segment: with the
    taper w and a wave e, Σ w e (s - mean(s)) = Σ (w e - mean(w e)) s.
    """
    taper = hann(length)
    phases = 2.0 * np.pi * np.outer(np.arange(length), np.arange(1, bins + 1)) / segment
    waves = np.concatenate((np.cos(phases), np.sin(phases)), axis=1) * taper[:, None]
    waves -= waves.mean(axis=0)
    # The bins count for both signs of frequency, but for the one at half the sampling rate, which has no other.
    scale = np.full(bins, 2.0 / (rate_hz * float(taper @ taper)))
    scale[segment // 2 - 1 :] /= 2.0
    matrix: Array = waves * np.sqrt(np.tile(scale, 2))
    matrix.flags.writeable = False
    return matrix


@lru_cache(maxsize=64)
def _indices(n_samples: int, segment: int, step: int) -> NDArray[np.intp]:
    """Return the sample indices of each segment, (n_segments, segment)."""
    return np.arange(0, n_samples - segment + 1, step)[:, None] + np.arange(segment)
