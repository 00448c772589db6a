# SPDX-License-Identifier: Apache-2.0
"""Spectra of windows, in time and along a surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from texture_core.config import param
from texture_core.types import Array
from texture_features.feature import WindowBatch, floor_param, mean_weights

# --------------------
# Short spectra along a window: what the spectral features are made of.


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
    return means[..., :bins] + means[..., bins:]


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
    return mean_weights(densities.shape[-2]) @ densities


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


# --------------------
# The spectrum of windows over waves per metre of the surface: frequency over speed, so that no speed moves a line.

PADDING = 4  # lines stand so much closer than the window alone resolves, and bands may be narrower than a line


def spatial_log_bands(windows: WindowBatch, edges_per_m: Array, floor: float) -> Array:
    """Return log(mean density + floor) between edges of spatial frequency.

    The whole window is tapered and transformed at once: for its few waves there is nothing to average. A band beyond
    half the sampling rate holds the density there.

    Parameters
    ----------
    windows
        What is described. NaN comes back where the speed is unknown or not above 0: what stands still has no waves.
    edges_per_m : (n_bands + 1,)
        Waves per metre, rising.
    floor
        unit² m.

    Returns
    -------
    (..., n_channels, n_bands)
    """
    rows = windows.centred_rows
    n_samples = rows.shape[-1]
    points = PADDING << (n_samples - 1).bit_length()
    lines = np.fft.rfft(rows * hann(n_samples), points, axis=-1)
    density = lines.real**2 + lines.imag**2
    density *= 2.0 / (windows.rate_hz * float(np.square(hann(n_samples)).sum()))
    speed = np.asarray(windows.speed_m_s, dtype=np.float64)
    moving = speed > 0.0
    scale = np.where(moving, speed, 1.0)[..., None, None]
    per_hz = _mean_between(density, edges_per_m * scale * (points / windows.rate_hz))
    # The same power on a stretch that is narrower by the speed: unit²/Hz · m/s = unit² m.
    logarithm: Array = np.log(per_hz * scale + floor)
    return np.where(moving[..., None, None], logarithm, np.nan)


def mean_subtracted(log_bands: Array) -> Array:
    """Return log bands less their mean over the bands: how hard and how fast the finger presses is mostly level.

    Parameters
    ----------
    log_bands : (..., n_bands)

    Returns
    -------
    (..., n_bands)
        Of zero mean.
    """
    return log_bands - np.add.reduce(log_bands, axis=-1, keepdims=True) / log_bands.shape[-1]


def _mean_between(density: Array, edges: Array) -> Array:
    """Return the mean of a density, (..., n_lines), between fractions of lines, (..., n_edges)."""
    last = density.shape[-1] - 1
    at = np.broadcast_to(np.clip(edges, 0.0, last), (*density.shape[:-1], edges.shape[-1]))
    total = np.zeros_like(density)
    np.cumsum(0.5 * (density[..., 1:] + density[..., :-1]), axis=-1, out=total[..., 1:])
    low = np.minimum(at.astype(np.intp), last - 1)
    below = np.take_along_axis(total, low, axis=-1)
    above = np.take_along_axis(total, low + 1, axis=-1)
    summed = below + (at - low) * (above - below)
    width = np.diff(at, axis=-1)
    inside = width > 0.0
    mean: Array = np.where(inside, np.diff(summed, axis=-1) / np.where(inside, width, 1.0), density[..., -1:])
    return np.maximum(mean, 0.0)


# --------------------
# The spectrum of windows as lines: mean density and frequency of each, of the signal or of what it is the rate of.


@dataclass(frozen=True)
class WelchPower:
    """What features have in common that weigh the power of the lines of the mean spectrum."""

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    points: int = param(
        128, 'Length of an FFT segment in samples; FFT bins are rate / points apart.', low=4, high=16384
    )
    rate_of_change: bool = param(
        True, 'Whether the signal is the time derivative of the contact quantity; if so it is integrated.'
    )
    force_exponent: float = param(
        0.0,
        'Exponent of the force by which the power is divided; 2/3 for Hertzian contact, 0 for none.',
        low=0.0,
        high=4.0,
    )
    floor: float = floor_param()


def welch_spectrum(windows: WindowBatch, points: int, rate_of_change: bool) -> tuple[Array, Array]:
    """Return the mean density of each line above 0 Hz, (..., n_channels, n_lines), and its frequency, (n_lines,) Hz.

    Parameters
    ----------
    windows
        What is described.
    points
        Samples of a segment; segments overlap by a half, lines are rate / points apart.
    rate_of_change
        The signal is the rate of change of what touches, as a dynamic capacitive channel gives it: the density of the
        integral is returned, by split by (2πf)².

    Returns
    -------
    (..., n_channels, n_lines)
        Density, unit²/Hz; for a rate of change that of its integral.
    (n_lines,)
        Frequencies, Hz.
    """
    segment = 2 * (points // 2)
    hertz, integration = _lines(segment, windows.rate_hz)
    densities = windows.shared(
        ('line_spectrum', segment),
        lambda: mean_densities(windows.centred_rows, windows.rate_hz, segment, segment // 2, len(hertz)),
    )
    if rate_of_change:
        whole = densities
        densities = windows.shared(('line_spectrum', segment, 'signal_energy'), lambda: whole * integration)
    return densities, hertz


def at_reference_speed(hertz: Array, windows: WindowBatch, speed_m_s: float) -> Array:
    """Return at which frequencies the lines would stand at another speed, (..., 1, n_lines); 0 m/s: where they stand.

    A wave of the surface met at f is met at f · speed_m_s / v at that speed; NaN if that is unknown or not above 0.

    Parameters
    ----------
    hertz : (n_lines,)
        Frequencies at the speed of each window, Hz.
    windows
        What is described; their speeds are used.
    speed_m_s
        The other speed; 0 returns the frequencies unchanged.

    Returns
    -------
    (..., 1, n_lines), or (n_lines,) for 0 m/s
        Hz.
    """
    if not speed_m_s:
        return hertz
    return windows.shared(
        ('at_reference_speed', speed_m_s, len(hertz)),
        lambda: hertz * (speed_m_s / windows.moving_m_s[..., None, None]),
    )


def force_normalised(log_power: Array, windows: WindowBatch, exponent: float) -> Array:
    """Return a log power, (..., n_channels, n_values), less what it owes to the force, exponent · log(force).

    On a soft round finger (Hertz) the stiffness grows with the cube root of the force, so the power with force^(2/3).

    Parameters
    ----------
    log_power : (..., n_channels, n_values)
    windows
        What is described; their forces are used.
    exponent
        Power of the force with which the power of the vibration grows; 0 returns `log_power` unchanged.

    Returns
    -------
    (..., n_channels, n_values)
        NaN where the force is unknown.
    """
    if not exponent:
        return log_power
    return log_power - exponent * np.log(np.asarray(windows.force_n))[..., None, None]


@lru_cache(maxsize=64)
def _lines(segment: int, rate_hz: float) -> tuple[Array, Array]:
    """Return the frequency of each line, (segment / 2,) Hz, and the share of its density that its integral has."""
    hertz: Array = np.arange(1, segment // 2 + 1, dtype=np.float64) * (rate_hz / segment)
    integration: Array = 1.0 / (2.0 * np.pi * hertz) ** 2
    for array in (hertz, integration):
        array.flags.writeable = False
    return hertz, integration
