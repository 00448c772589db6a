"""Short spectra along a window: what the spectral features are made of."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch, mean_weights


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
    squares = _squares(rows, rate_hz, segment, step, bins)
    densities: Array = squares[..., :bins, :] + squares[..., bins:, :]
    return densities.swapaxes(-1, -2)


def mean_densities(rows: Array, rate_hz: float, segment: int, step: int, bins: int) -> Array:
    """Return the mean of `segment_densities` over the segments, (..., bins); it costs less than all of them.

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
    (..., bins)
        At the frequencies k · rate_hz / segment, k = 1 to `bins`, unit²/Hz.
    """
    squares = _squares(rows, rate_hz, segment, step, bins)
    means = squares @ mean_weights(squares.shape[-1])
    densities: Array = means[..., :bins] + means[..., bins:]
    return densities


def _squares(rows: Array, rate_hz: float, segment: int, step: int, bins: int) -> Array:
    """Return the densities as their shares of cosines, then of sines, (..., 2 · bins, n_segments).

    Each half lies in one piece of memory, which makes the sum of both three times as fast as side by side.
    """
    cut = segments(rows, segment, step)
    parts: Array = _transform(cut.shape[-1], segment, bins, rate_hz).T @ cut.swapaxes(-1, -2)
    parts *= parts
    return parts


def segments(rows: Array, length: int, step: int) -> Array:
    """Return the segments of rows; a row shorter than a segment is its only segment.

    Parameters
    ----------
    rows : (..., n_samples)
    length, step
        Length of a segment and distance between two of them, in samples.

    Returns
    -------
    (..., n_segments, min(length, n_samples))
        A copy.
    """
    if rows.shape[-1] <= length:
        return rows[..., None, :]
    return overlapping(rows, length, step).copy()  # a product of the view itself would crawl


def overlapping(rows: Array, length: int, step: int) -> Array:
    """Return the segments of rows as a view that must not be changed.

    Parameters
    ----------
    rows : (..., n_samples)
        At least `length` samples long.
    length, step
        Length of a segment and distance between two of them, in samples.

    Returns
    -------
    (..., n_segments, length)
    """
    rows = np.ascontiguousarray(rows)
    count = (rows.shape[-1] - length) // step + 1
    # The bare constructor: numpy's as_strided takes longer than a copy of all segments.
    return np.ndarray(
        (*rows.shape[:-1], count, length),
        rows.dtype,
        rows,
        0,
        (*rows.strides[:-1], step * rows.itemsize, rows.itemsize),
    )


def densities_of(windows: WindowBatch, segment: int, step: int, bins: int) -> Array:
    """Return the densities of the segments of windows; features that ask for the same share them.

    Parameters
    ----------
    windows
        What is described.
    segment, step
        Length of a segment, even, and distance between two of them, in samples.
    bins
        Number of bins, at most segment / 2.

    Returns
    -------
    (..., n_channels, n_segments, bins)
        As `segment_densities` gives them, unit²/Hz.
    """
    return windows.shared(
        ('densities', segment, step, bins),
        lambda: segment_densities(windows.centred_rows, windows.rate_hz, segment, step, bins),
    )


def mean_over_segments(densities: Array) -> Array:
    """Return the mean over the segments, (..., n_bins).

    Parameters
    ----------
    densities : (..., n_segments, n_bins)

    Returns
    -------
    (..., n_bins)
        In the unit of the densities.
    """
    mean: Array = mean_weights(densities.shape[-2]) @ densities
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
    segment = 2 * bins
    cut = segments(rows, segment, bins)
    taper = hann(cut.shape[-1])
    means = np.add.reduce(cut, axis=-1, keepdims=True) / cut.shape[-1]
    waves = np.fft.rfft((cut - means) * taper, segment)[..., 1:]
    densities = waves.real * waves.real + waves.imag * waves.imag
    densities *= 2.0 / (rate_hz * float(taper @ taper))
    densities[..., -1] /= 2.0
    return mean_over_segments(densities)


def amplitudes_of(windows: WindowBatch, points: int) -> tuple[Array, float]:
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
    """Return a Hann window that is nowhere 0: taken in the middle of each sample.

    Returns
    -------
    (length,)
        Read-only, because it is shared.
    """
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
