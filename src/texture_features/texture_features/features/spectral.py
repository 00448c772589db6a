# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Spectra of windows, in time and along a surface, and their features: band powers, peaks, spectral exponent."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.types import Array
from texture_features.features.temporal import signal_differences
from texture_features.windows import FLOOR, Feature, WindowBatch, mean_weights, power, shared_constant

# --------------------
# Short spectra along a window: what the spectral features are made of.


def segment_densities(rows: Array, rate_hz: float, segment: int, step: int, bins: int) -> Array:
    """Return the one-sided power spectral density of each segment of each row, at its lowest bins above 0 Hz.

    A segment is freed of its mean and tapered by a Hann window. A row shorter than one is padded with zeros. The
    transform is a product with a matrix: for the few bins of a short window it takes half the time of a fast Fourier
    transform and the steps around it, and its rounding is the same for one window as for many.

    Source: Welch 1967; the mean over the segments is scipy.signal.welch(detrend='constant').
    """
    squares = _squares(rows, rate_hz, segment, step, bins)
    densities: Array = squares[..., :bins, :] + squares[..., bins:, :]
    return densities.swapaxes(-1, -2)


def mean_densities(rows: Array, rate_hz: float, segment: int, step: int, bins: int) -> Array:
    """Return the mean of `segment_densities` over the segments, (..., bins); it costs less than all of them."""
    squares = _squares(rows, rate_hz, segment, step, bins)
    means = squares @ mean_weights(squares.shape[-1])
    return means[..., :bins] + means[..., bins:]


def _squares(rows: Array, rate_hz: float, segment: int, step: int, bins: int) -> Array:
    """Return the densities as their parts of cosines, then of sines, (..., 2 · bins, n_segments).

    Each half lies in one block of memory, which makes the sum of both three times as fast as side by side.
    """
    cut = segments(rows, segment, step)
    parts: Array = _transform(cut.shape[-1], segment, bins, rate_hz) @ cut.swapaxes(-1, -2)
    parts *= parts
    return parts


def segments(rows: Array, length: int, step: int) -> Array:
    """Return the segments of rows; a row shorter than a segment is its only segment."""
    if rows.shape[-1] <= length:
        return rows[..., None, :]
    return overlapping(rows, length, step).copy()  # a product of the view itself would crawl


def overlapping(rows: Array, length: int, step: int) -> Array:
    """Return the segments of rows as a view that must not be changed."""
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


def mean_over_segments(densities: Array) -> Array:
    """Return the mean over the segments, (..., n_bins)."""
    return mean_weights(densities.shape[-2]) @ densities


def long_densities(rows: Array, rate_hz: float, bins: int) -> Array:
    """Return the mean one-sided power spectral density at `bins` frequencies above 0 Hz, by fast Fourier transform.

    What `segment_densities` and the mean over half-overlapping segments give, for long segments and all their bins.
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
    """Return the amplitudes of the Fourier transform of the zero-mean windows, and the step between its bins."""
    n_samples = windows.samples.shape[-2]
    points = max(points, n_samples)
    amplitudes = windows.shared(
        ('amplitudes', points), lambda: np.abs(np.fft.rfft(windows.centred_rows, points)) * (2.0 / n_samples)
    )
    return amplitudes, windows.rate_hz / points


@lru_cache(maxsize=64)
def hann(length: int) -> Array:
    """Return a Hann window that is nowhere 0: taken in the middle of each sample."""
    return shared_constant(np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2)


@lru_cache(maxsize=64)
def _transform(length: int, segment: int, bins: int, rate_hz: float) -> Array:
    """Return the matrix (2 · bins, length) that takes a segment to the square roots of its densities.

    Rows are cosines, then sines, tapered. Their mean is removed, which removes that of the segment: with the
    taper w and a wave e, Σ w e (s - mean(s)) = Σ (w e - mean(w e)) s.
    """
    taper = hann(length)
    phases = 2.0 * np.pi * np.outer(np.arange(length), np.arange(1, bins + 1)) / segment
    waves = np.concatenate((np.cos(phases), np.sin(phases)), axis=1) * taper[:, None]
    waves -= waves.mean(axis=0)
    # The bins count for both signs of frequency, but for the one at half the sampling rate, which has no other.
    scale = np.full(bins, 2.0 / (rate_hz * float(taper @ taper)))
    scale[segment // 2 - 1 :] /= 2.0
    return shared_constant(np.ascontiguousarray((waves * np.sqrt(np.tile(scale, 2))).T))


# --------------------
# The spectrum of windows over waves per metre of the surface: frequency over speed, so that no speed moves a line.

PADDING = 4  # lines are closer than the window alone resolves by this factor, and bands may be narrower than a line


def spatial_log_bands(windows: WindowBatch, edges_per_m: Array, floor: float) -> Array:
    """Return log(mean density + floor) between edges of spatial frequency.

    The whole window is tapered and transformed at once: for its few waves there is nothing to average. A band beyond
    half the sampling rate holds the density there.
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
class WelchPower(Feature):
    """What features have in common that weigh the power of the lines of the mean spectrum."""

    points: int = param(
        128, 'Length of an FFT segment in samples; FFT bins are rate / points apart.', low=4, high=16384
    )
    rate_of_change: bool = param(
        True, 'Whether the signal is the time derivative of the contact quantity; if so it is integrated.'
    )


def welch_spectrum(windows: WindowBatch, points: int, rate_of_change: bool) -> tuple[Array, Array]:
    """Return the mean density of each line above 0 Hz, (..., n_channels, n_lines), and its frequency, (n_lines,) Hz."""
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
    """Return the frequencies of the lines at another speed, (..., 1, n_lines); 0 m/s: their frequencies as measured.

    A wave of the surface met at f is met at f · speed_m_s / v at that speed; NaN if that is unknown or not above 0.
    """
    if not speed_m_s:
        return hertz
    return windows.shared(
        ('at_reference_speed', speed_m_s, len(hertz)),
        lambda: hertz * (speed_m_s / windows.moving_m_s[..., None, None]),
    )


@lru_cache(maxsize=64)
def _lines(segment: int, rate_hz: float) -> tuple[Array, Array]:
    """Return the frequency of each line, (segment / 2,) Hz, and the fraction of its density that its integral has."""
    hertz = shared_constant(np.arange(1, segment // 2 + 1, dtype=np.float64) * (rate_hz / segment))
    return hertz, shared_constant(1.0 / (2.0 * np.pi * hertz) ** 2)


# --------------------
# Power density in the lowest FFT bins of long segments.


@dataclass(frozen=True)
class LowFftBins(Feature):
    """Logarithm of the power spectral density at the lowest lines of long segments: where ridges and grids show.

    `mean_log_bands` with as many bands would be as fine everywhere, and noisier where fineness does not help.

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 30.0 * np.arange(1000) / 1000.0)[:, None]
    >>> bins = LowFftBins(bins=10, points=100)(WindowBatch(tone, rate_hz=1000.0))  # at 10, 20, … 100 Hz
    >>> int(bins[0].argmax()) + 1
    3
    """

    bins: int = param(
        32,
        'Number of FFT bins, from the first above 0 Hz.',
        low=1,
        high=512,
    )
    points: int = param(
        128, 'Length of an FFT segment in samples; FFT bins are rate / points apart.', low=4, high=16384
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
        return np.log(densities[..., : self._count] + FLOOR)


# --------------------
# Mean of the log power in equal frequency bands over the segments of a window.


@dataclass(frozen=True)
class MeanLogBands(Feature):
    """Mean over short segments of the log power spectral density, in equal bands from 0 Hz to half the sampling rate.

    Source: Welch 1967 for the segments; a mean of logarithms follows no single burst.

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 100.0 * np.arange(1000) / 1000.0)[:, None]
    >>> bands = MeanLogBands(bands=10)(WindowBatch(tone, rate_hz=1000.0))  # at 50, 100, … 500 Hz
    >>> int(bands[0].argmax()) + 1
    2
    """

    bands: int = param(32, 'Number of frequency bands; a segment is twice as many samples long.', low=2, high=512)

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the band, from 1."""
        return tuple(str(band + 1) for band in range(self.bands))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the mean of log(density + floor)."""
        step = max(1, self.bands // 2)  # a quarter of a segment
        logs = segment_densities(windows.centred_rows, windows.rate_hz, 2 * self.bands, step, self.bands) + FLOOR
        return mean_over_segments(np.log(logs, out=logs))


# --------------------
# Vibration power, weighted as the Pacinian receptors of the skin weight it.

BEST_HZ, DB_PER_OCTAVE = 250.0, 12.0  # where the threshold of the Pacinian channel is lowest, and its slopes


@dataclass(frozen=True)
class PacinianPower(WelchPower):
    """Logarithm of Σ (amplitude / threshold amplitude)² over the lines of the spectrum.

    The threshold is that of the Pacinian channel in two straight lines: it falls by 12 dB an octave up to 250 Hz and
    rises as fast beyond; 1 at its best. A tone of amplitude a at 250 Hz gives log(a²/2).

    Source: Bensmaia & Hollins 2005, "Pacinian representations of fine surface texture"; slope and best frequency
    after Bolanowski et al. 1988. The straight lines are an approximation.

    Examples
    --------
    >>> time_s = np.arange(1280) / 1280.0
    >>> tones = np.sin(2 * np.pi * np.array([60.0, 250.0]) * time_s[:, None])
    >>> low, best = PacinianPower(rate_of_change=False)(WindowBatch(tones, rate_hz=1280.0))[:, 0].tolist()
    >>> np.exp(best).round(1).item(), round((best - low) * 10 / np.log(10))  # a²/2, and some 12 dB · log2(250 / 60)
    (0.5, 24)
    """

    at_speed_m_s: float = param(
        0.0,
        'Reference speed to which frequencies are scaled before weighting; 0: no scaling.',
        unit='m/s',
        low=0.0,
        high=10.0,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the log power."""
        densities, hertz = welch_spectrum(windows, self.points, self.rate_of_change)
        octaves = np.abs(np.log2(at_reference_speed(hertz, windows, self.at_speed_m_s) / BEST_HZ))
        weights = 10.0 ** (-0.1 * DB_PER_OCTAVE * octaves)  # 1 / threshold²
        power = np.add.reduce(densities * weights, axis=-1, keepdims=True) * hertz[0]
        return np.log(power + FLOOR)


# --------------------
# Peak-to-median power of the segments of a window: high when the finger sticks and slips.

MEDIAN, MINIMUM = 'median', 'minimum'


@dataclass(frozen=True)
class PeakToMedianPower(Feature):
    """Logarithm of the power of the strongest segment over that of the median or of the weakest one.

    A finger that sticks and slips is still and then jumps; over an even texture all events are alike. The weakest event
    responds to a single skid: being still for a tenth of the window does not move the middle.

    Examples
    --------
    >>> alternating = np.resize([1.0, -1.0], 100)[:, None]
    >>> jump = alternating * np.where(np.arange(100) < 10, 3.0, 1.0)[:, None]  # 9 times the power in one segment
    >>> np.exp(PeakToMedianPower()(WindowBatch(jump, rate_hz=100.0))).round(6).item()
    9.0
    """

    segments: int = param(
        10, 'Number of equal segments of the window; fewer if it has fewer samples.', low=2, high=1000
    )
    reference: str = param(
        MEDIAN,
        'Segment with whose power the largest is compared: the median or the minimum one.',
        choices=(MEDIAN, MINIMUM),
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(strongest / other)."""
        rows = windows.centred_rows
        segments = min(self.segments, rows.shape[-1])
        length = rows.shape[-1] // segments
        cut = rows[..., : segments * length].reshape(*rows.shape[:-1], segments, length)
        powers = power(cut)
        powers.sort(axis=-1)
        other = segments // 2 if self.reference == MEDIAN else 0
        ratio = (powers[..., -1:] + FLOOR) / (powers[..., other : other + 1] + FLOOR)
        return np.log(ratio)


# --------------------
# Autocorrelation of the power of the signal and of its first difference.

# Of a power squared: far below any, far above the smallest number, so that nothing over nothing is 1.
POWER_AUTOCORRELATION_TINY = 1e-200
LEAST_RATIO = 1e-3  # added before the logarithm: a lag without any power gives a finite value


@dataclass(frozen=True)
class PowerAutocorrelation(Feature):
    """Log of the mean product of the squared signal and itself some samples later, over its mean squared, and of steps.

    0 where they are independent, above where bursts last so long, below where they keep such a distance.
    The gain of the sensor changes nothing.

    Examples
    --------
    >>> clicks = np.zeros((400, 1))
    >>> clicks[::12] = 1.0
    >>> feature = PowerAutocorrelation()
    >>> values = dict(zip(feature.names, feature(WindowBatch(clicks, rate_hz=100.0))[0].tolist()))
    >>> values['signal_12'] > 2.0 > -1.5 > values['signal_8']  # clicks have a spacing of 12 samples, never 8
    True
    """

    lags: int = param(12, 'Number of lags, taken from 1, 2, 3, 4, 6, 8, 12, 16, 24, … samples.', low=1, high=24)

    @cached_property
    def _lags(self) -> NDArray[np.intp]:
        lags = [1, *chain.from_iterable((2 << octave, 3 << octave) for octave in range(self.lags // 2))]
        return np.array(lags[: self.lags])  # which picks rows faster than a list

    @property
    def names(self) -> tuple[str, ...]:
        """Lag in samples, for the signal and for its steps."""
        return tuple(f'{what}_{lag}' for what in ('signal', 'difference') for lag in self._lags)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the values; 0 for all if the window is not two samples longer than the longest lag."""
        powers = signal_differences(windows)[..., 1, :2, :]
        n_steps = powers.shape[-1] - 1  # one less than samples
        count = n_steps - int(self._lags[-1])
        if count < 1:
            return np.zeros((*powers.shape[:-2], len(self.names)))
        # The axis of lags in front, where picking some copies whole blocks: a third of the time of doing so behind.
        later = overlapping(powers, count, 1).swapaxes(0, -2)[self._lags].swapaxes(0, -2)
        products = (later @ powers[..., :count, None])[..., 0] / count
        mean = (powers[..., :-1] @ mean_weights(n_steps))[..., None]
        autocorrelations = np.log(
            (products + POWER_AUTOCORRELATION_TINY) / (mean * mean + POWER_AUTOCORRELATION_TINY) + LEAST_RATIO
        )
        return autocorrelations.reshape(*powers.shape[:-2], -1)


# --------------------
# How fast the spectrum falls.

SPECTRAL_EXPONENT_TINY = 1e-300


@dataclass(frozen=True)
class SpectralExponent(Feature):
    """Exponent s of the power spectral density 1/f^s, by least squares in double logarithms.

    A power law keeps its exponent when the finger goes faster; where the spectrum of a surface is none, the same waves
    of the surface must be looked at: `at_speed_m_s` moves the band with the speed. 0 if fewer than two lines lie in it.

    Source: Toscani & Metzger 2022.

    Examples
    --------
    >>> walk = np.cumsum(np.random.default_rng(0).standard_normal((100_000, 1)), axis=0)  # its density falls as 1/f²
    >>> round(SpectralExponent(low_hz=20.0, high_hz=100.0)(WindowBatch(walk, rate_hz=1000.0)).item(), 1)
    2.0
    """

    points: int = param(
        128, 'Length of an FFT segment in samples; FFT bins are rate / points apart.', low=4, high=16384
    )
    low_hz: float = param(
        60.0, 'Lower edge of the frequency band in which the exponent is fitted.', unit='Hz', low=0.0, high=1e6
    )
    high_hz: float = param(
        420.0, 'Upper edge of the frequency band in which the exponent is fitted.', unit='Hz', low=0.0, high=1e6
    )
    rate_of_change: bool = param(
        False, 'Whether the signal is the time derivative of the contact quantity; adds 2 to the exponent.'
    )
    at_speed_m_s: float = param(
        0.0,
        'Speed for which the band is given; it scales with the speed. 0: the band is fixed.',
        unit='m/s',
        low=0.0,
        high=10.0,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return s."""
        densities, hertz = welch_spectrum(windows, self.points, self.rate_of_change)
        measured = at_reference_speed(hertz, windows, self.at_speed_m_s)
        within = np.where(np.isnan(measured), np.nan, (measured >= self.low_hz) & (measured <= self.high_hz))
        logs = np.log(hertz)
        middle = (within @ logs) / (np.add.reduce(within, axis=-1) + SPECTRAL_EXPONENT_TINY)
        weights = within * (logs - middle[..., None])
        fall = np.add.reduce(weights * np.log(densities + FLOOR), axis=-1)
        exponent: Array = -fall / (weights @ logs + SPECTRAL_EXPONENT_TINY)
        return exponent[..., None]
