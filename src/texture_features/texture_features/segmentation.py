# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Find slides and their contact in a continuous recording."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, maximum_filter1d, minimum_filter1d, percentile_filter, uniform_filter1d
from scipy.signal import savgol_coeffs, savgol_filter, welch

from texture_core.config import param
from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS, AnyArray, Array, ExplorationState, Phase, Samples, TactileSignal
from texture_features.windows import SampleBuffer

# --------------------
# Power of vibration in short cells of time, against that of the sensor's noise.

# What follows a cubic over the time to smooth over is the load, and its leaking away, not vibration.
SMOOTH_S, SMOOTH_ORDER = 0.05, 3
SMOOTHED_CELLS = 11
REST_QUANTILE = 0.1
# Means of 50 samples scatter by 20 %: the lowest tenth of them, rest being about half of all, ends at 0.8 of the mean.
REST_OVER_QUANTILE = 1.25
# Samples that do not change at all are no measure of the noise.
MIN_REST, TINY = 1e-9, 1e-300


def cell_power(fast: Samples, rate_hz: float, cell_s: float, smooth_s: float = SMOOTH_S) -> tuple[float, Array]:
    """Return the length of a cell in s, and the power of the vibration in each, (n_cells, n_channels).

    What changes over longer than `smooth_s` is no vibration, what is not finite has none, and a cell in which a channel
    stands at the end of its range is NaN.
    """
    width = max(1, round(cell_s * rate_hz))
    count = len(fast) // width
    if len(fast) <= _smoothed(rate_hz, smooth_s):
        return width / rate_hz, np.empty((0, fast.shape[1]))
    known = np.isfinite(fast)
    lowest = np.where(known, fast, np.inf).min(axis=0)
    highest = np.where(known, fast, -np.inf).max(axis=0)
    at_end = ((fast <= lowest) | (fast >= highest))[: count * width].reshape(count, width, -1).all(axis=1)
    power: Array = np.square(highpass(fast, rate_hz, smooth_s)[: count * width]).reshape(count, width, -1).mean(axis=1)
    power[at_end] = np.nan
    return width / rate_hz, power


def highpass(fast: Samples, rate_hz: float, smooth_s: float = SMOOTH_S) -> Samples:
    """Return the samples without what changes over longer than `smooth_s`; 0 for what is not finite."""
    vibration = median_centred(fast)
    smoothed = _smoothed(rate_hz, smooth_s)
    if len(fast) > smoothed:
        vibration -= savgol_filter(vibration, smoothed, SMOOTH_ORDER, axis=0)
    vibration[~np.isfinite(fast)] = 0.0
    return vibration


def baseline_power(powers: Array) -> Array:
    """Return the power of each channel at rest, (n_channels,), above 0, from the quietest tenth of the recording."""
    known = np.isfinite(powers)
    share = uniform_filter1d(known.astype(float), SMOOTHED_CELLS, axis=0)
    smooth = uniform_filter1d(np.where(known, powers, 0.0), SMOOTHED_CELLS, axis=0) / np.maximum(share, 1e-3)
    smooth[share < 0.5] = np.inf
    quiet = REST_OVER_QUANTILE * np.quantile(smooth, REST_QUANTILE, axis=0, method='lower')
    quiet[np.isinf(quiet)] = smooth.min(axis=0)[np.isinf(quiet)]
    return np.maximum(np.maximum(quiet, MIN_REST * np.where(known, powers, 0.0).max(axis=0)), TINY)


def _smoothed(rate_hz: float, smooth_s: float) -> int:
    """Return over how many samples the smooth part is taken: odd, and enough for its order."""
    return max(2 * round(0.5 * smooth_s * rate_hz) + 1, SMOOTH_ORDER + 2)


def median_centred(fast: Samples) -> Samples:
    """Return the samples about the median of each channel; 0 for what is not finite."""
    known = np.where(np.isfinite(fast), fast, np.nan)
    some = np.isfinite(known).any(axis=0)
    middle = np.nanmedian(np.where(some, known, 0.0), axis=0)
    return np.nan_to_num(known - middle)


def highpass_gain(frequency_hz: AnyArray, rate_hz: float, smooth_s: float) -> Array:
    """Return the share of power at frequencies that is not taken for the smooth part."""
    grid_hz, passed = _highpass_response(rate_hz, smooth_s)
    return np.interp(frequency_hz, grid_hz, passed)


@lru_cache(maxsize=8)
def _highpass_response(rate_hz: float, smooth_s: float) -> tuple[Array, Array]:
    """Return frequencies up to half the rate, and the share of power passed at each."""
    kernel = savgol_coeffs(_smoothed(rate_hz, smooth_s), SMOOTH_ORDER)
    turns = np.arange(len(kernel)) - len(kernel) // 2
    grid_hz = np.asarray(np.linspace(0.0, rate_hz / 2, 512), dtype=np.float64)
    answer = 1.0 - np.cos(2 * np.pi * grid_hz[:, None] * turns / rate_hz) @ kernel
    passed: Array = np.square(answer)
    return grid_hz, passed


# --------------------
# Contact intervals from channels whose mean follows the load.

# Between these shares of the load its change is drawn as a line, out to where it began and ended.
LOW, HIGH = 0.2, 0.8
# A channel follows the load if it changes by such a share of the one that changes most.
FOLLOWS = 0.1
# A finger is pressed on, and let go, so much within such a time, or the channels drift.
CHANGES, CHANGE_S = 0.5, 0.4
# A load is believed if it changes by so many times its own scatter from sample to sample.
OVER_SCATTER = 20.0


@dataclass(frozen=True)
class ContactInterval:
    """One contact, s from the first sample: begins to be pressed, is pressed, is let go, is free.

    Times before the first and after the last sample are -inf and inf.
    """

    press_start_s: float
    press_end_s: float
    release_start_s: float
    release_end_s: float


def find_contacts(levels: Samples, rate_hz: float, vibration: Array) -> list[ContactInterval]:
    """Return the contacts in their order; none without a clear load."""
    if len(levels) < 3:
        return []
    near = max(1, round(0.5 * CHANGE_S * rate_hz))
    load = _load(levels, vibration, near)
    high = load > 0.5 * load.max()
    if not high.any() or high.all():
        return []
    full, steps = float(np.median(load[high])), np.abs(np.diff(load, prepend=load[0]))
    if full <= OVER_SCATTER * max(float(np.median(steps[high])), float(np.median(steps[~high]))):
        return []
    edges = np.flatnonzero(np.diff(np.concatenate(([0], high, [0])).astype(int))).reshape(-1, 2)
    return [
        _contact_interval(load / full, first, last - 1, rate_hz)
        for first, last in edges.tolist()
        if _sudden(load / full, first - 1, near) and _sudden(load / full, last - 1, near)
    ]


def _load(levels: Samples, vibration: Array, near: int) -> Array:
    """Return the common change of the channels, (n_samples,), about 0 without contact.

    The finger vibrates more in contact than without. What knocks, within `near` samples, while it is pressed on and let
    go belongs to neither.
    """
    middle = np.nanmedian(np.where(np.isfinite(levels), levels, np.nan), axis=0, keepdims=True)
    centred = np.nan_to_num(np.where(np.isfinite(levels), levels - middle, 0.0))
    _, vectors = np.linalg.eigh(centred.T @ centred)
    weights = vectors[:, -1]
    # Channels saturate one after the other: those that follow the load count alike, or the strongest tell its end late.
    load: Array = centred @ np.where(np.abs(weights) > FOLLOWS * np.abs(weights).max(), np.sign(weights), 0.0)
    upper = load > 0.5 * (load.min() + load.max())
    still = maximum_filter1d(upper, near) == minimum_filter1d(upper, near)
    high, low = vibration[upper & still], vibration[~upper & still]
    if len(high) and len(low) and np.median(high) < np.median(low):
        load = -load
    return load - np.quantile(load, 0.05)


def _sudden(load: Array, before: int, near: int) -> bool:
    """Return whether a load passes one half after sample `before` suddenly, or there is no sample beyond."""
    if before < 0 or before == len(load) - 1:
        return True
    return abs(float(load[min(before + 1 + near, len(load) - 1)] - load[max(before - near, 0)])) > CHANGES


def _contact_interval(load: Array, first: int, last: int, rate_hz: float) -> ContactInterval:
    """Return the contact that is above one half from sample `first` to sample `last`."""
    ends = _line(load, last)
    count = len(load) - 1
    begins = [count - place for place in _line(load[::-1], count - first)]
    return ContactInterval(begins[1] / rate_hz, begins[0] / rate_hz, ends[0] / rate_hz, ends[1] / rate_hz)


def _line(load: Array, last: int) -> tuple[float, float]:
    """Return where a load that is above one half up to sample `last` begins to fall and is gone, in samples.

    Both infinite if it is so to the end; where it passes one half if it never falls far.
    """
    if last == len(load) - 1:
        return math.inf, math.inf
    above = np.flatnonzero(load[: last + 1] > HIGH)
    below = np.flatnonzero(load[last:] < LOW)
    if not len(above) or not len(below):
        return float(last), float(last + 1)
    high, low = _crossing(load, int(above[-1]), HIGH), _crossing(load, last + int(below[0]) - 1, LOW)
    step = (low - high) / (HIGH - LOW)
    return high - step * (1.0 - HIGH), low + step * LOW


def _crossing(load: Array, before: int, level: float) -> float:
    drop = float(load[before] - load[before + 1])
    return before + (float(load[before]) - level) / drop if drop > 0 else float(before)


# --------------------
# Onset of motion from the shift of the spectrum while the finger accelerates.
#
# At half the speed all lines of a texture stand at half the frequency. So the spectrum at steady speed, squeezed by the
# speed of the moment, tells what each short window of the ramp should hold, and the most likely moment of setting off
# is taken (Whittle's likelihood: the powers of a spectrum are exponentially distributed about their means).

# What a vibration channel senses, and the powers of the speed with which the amplitude of one and the same wave of a
# texture then grows: films that hold their charge and hydrophones feel the force, differentiating channels its change.
# A change grows as the speed, and where waves rise towards the corner of a high-pass, faster.
MEASURED_QUANTITIES: Mapping[str, tuple[float, ...]] = {
    'force': (0.0,),
    'change': (1.0, 1.5),
    'either': (0.0, 0.5, 1.0, 1.5),
}
WINDOW_S, STEADY_WINDOW_S = 0.05, 0.25
MIN_STEADY = 8  # samples, for a spectrum
HOPS_PER_WINDOW, ONSETS_PER_HOP = 5, 4
# Windows that overlap tell much of the same: a Hann window weighs as much as two thirds of its length.
NEW_IN_WINDOW = 1.5 / HOPS_PER_WINDOW
SHARES = np.linspace(0.0, 1.0, 41)  # of the steady speed
# Multiples of the band at which the spectrum above it is looked at.
ABOVE = np.geomspace(1.2, 1000.0, 12)
# Of a line, through a Hann window: power at offsets of quarters of a bin, up to two bins.
QUARTERS = 4
OFFSETS = np.arange(-2 * QUARTERS, 2 * QUARTERS + 1) / QUARTERS
HANN = np.square(np.sinc(OFFSETS) + 0.5 * np.sinc(OFFSETS - 1.0) + 0.5 * np.sinc(OFFSETS + 1.0))
HANN /= HANN.sum()
# Points of a window at which the speed is looked at, and what they weigh in it.
POINTS = (np.arange(20) + 0.5) / 20
POINT_WEIGHTS = np.sin(np.pi * POINTS) ** 4 / (np.sin(np.pi * POINTS) ** 4).sum()
# One value in a hundred is of something else, of any power over nine decades (20 nats).
ANYTHING = float(np.log(0.01 / 20))
MIN_POWER = 0.01  # of the noise


@dataclass(frozen=True)
class OnsetModel:
    """How a finger gains speed, and what its vibration channels make of it."""

    rate_hz: float
    rest: Array
    ramp_s: float
    quantity: str
    smooth_s: float

    def find(self, around: Samples, known: NDArray[np.bool_], steady: Samples, between_s: tuple[float, float]) -> float:
        """Return when the finger sets off, s from the first sample: the mean over what is likely.

        All moments of the range, and all ways to grow, are equally likely beforehand; so the middle of the range is
        returned where nothing is known.
        """
        length = HOPS_PER_WINDOW * max(1, round(WINDOW_S * self.rate_hz / HOPS_PER_WINDOW))
        hop = length // HOPS_PER_WINDOW
        step_s = hop / ONSETS_PER_HOP / self.rate_hz
        onsets = np.arange(round(between_s[0] / step_s), round(between_s[1] / step_s) + 1)  # in steps
        starts = np.flatnonzero(_whole(known, length)[::hop])  # in hops
        if not len(starts) or len(steady) < MIN_STEADY:
            return float(onsets.mean()) * step_s
        vibration = highpass(around, self.rate_hz, self.smooth_s) / np.sqrt(self.rest)
        powers = _spectra(vibration[(starts * hop)[:, None] + np.arange(length)])
        fit = _fit(powers, self._expected(steady, length, self.ramp_s / step_s))  # (n_ways, n_windows, n_ages)
        ages = np.clip((starts + HOPS_PER_WINDOW) * ONSETS_PER_HOP - onsets[:, None], 0, fit.shape[2] - 1)
        total = NEW_IN_WINDOW * fit[:, np.arange(len(starts)), ages].sum(axis=-1)  # (n_ways, n_onsets)
        likely = np.exp(total - total.max()).sum(axis=0)
        return float(likely @ onsets / likely.sum()) * step_s

    def _expected(self, steady: Samples, length: int, ramp: float) -> Array:
        """Return the power expected in windows by their age, (n_ways, n_ages, n_bins).

        Age, in steps: 0 for a window that ends as the finger sets off, the last for one that begins as it is at speed.
        `length` is that of a window, in samples, `ramp` that of the ramp, in steps.
        """
        steady_length = min(len(steady), round(STEADY_WINDOW_S * self.rate_hz))
        frequency_hz, density = welch(
            median_centred(steady), self.rate_hz, nperseg=steady_length, detrend='linear', axis=0
        )
        passed = highpass_gain(frequency_hz, self.rate_hz, self.smooth_s)
        noise = 1.0 / max(float(passed.mean()) * self.rate_hz / 2, TINY)  # white: its density
        texture = np.maximum(density / self.rest - noise, 0.0).mean(axis=1)
        bins_hz = np.fft.rfftfreq(length, 1.0 / self.rate_hz)
        squeezed = self._squeezed(frequency_hz, texture, bins_hz)
        window = HOPS_PER_WINDOW * ONSETS_PER_HOP
        ages = np.arange(window + math.ceil(ramp) + 1)
        shares = np.clip((ages[:, None] - window * (1.0 - POINTS)) / max(ramp, TINY), 0.0, 1.0)
        at = np.rint(shares * (len(SHARES) - 1)).astype(int)
        sensed = SHARES ** (2.0 * np.array(MEASURED_QUANTITIES[self.quantity])[:, None])
        ways = (sensed[:, None, :, None] * squeezed).reshape(-1, len(SHARES), len(bins_hz))
        measured = np.einsum('wapf,p->waf', ways[:, at], POINT_WEIGHTS)
        rest = noise * highpass_gain(bins_hz, self.rate_hz, self.smooth_s)
        return np.maximum(self.rate_hz / 2 * (rest + measured), MIN_POWER)

    def _squeezed(self, frequency_hz: Array, texture: Array, bins_hz: AnyArray) -> Array:
        """Return the density at `SHARES` of the speed, as windows see it at their frequencies: (2, n_shares, n_bins).

        What lies above the band at steady speed comes into it at less, and is unknown: nothing in the first, and in
        the second as much as below the edge of the sensor's filters, falling with the square of the frequency.
        """
        half_hz = self.rate_hz / 2
        lines_hz = np.clip((np.arange(len(texture) + 1) - 0.5) * frequency_hz[1], 0.0, half_hz)
        bands = QUARTERS * (len(bins_hz) - 1) + 1
        bands_hz = np.clip((np.arange(bands + 1) - 0.5) * bins_hz[1] / QUARTERS, 0.0, half_hz)
        edge = float(texture[len(texture) // 2 : 3 * len(texture) // 4 + 1].mean())
        above = edge * half_hz * (1.0 - 1.0 / ABOVE)
        squeezed = np.zeros((2, len(SHARES), bands))  # what does not move is not measured
        for i, share in enumerate(SHARES[1:], start=1):
            passed = texture * highpass_gain(share * frequency_hz, self.rate_hz, self.smooth_s)
            below = np.concatenate([[0.0], np.cumsum(passed * np.diff(lines_hz))])
            squeezed[0, i] = np.diff(np.interp(bands_hz, share * lines_hz, below))
            far_hz, all_below = np.append(lines_hz, half_hz * ABOVE), np.append(below, below[-1] + above)
            squeezed[1, i] = np.diff(np.interp(bands_hz, share * far_hz, all_below))
        return np.asarray(convolve1d(squeezed / np.diff(bands_hz), HANN, mode='mirror')[:, :, ::QUARTERS])


def _whole(known: NDArray[np.bool_], length: int) -> NDArray[np.bool_]:
    """Return whether the window that begins at each sample is known as a whole."""
    if len(known) < length:
        return np.zeros(0, dtype=bool)
    return np.asarray(sliding_window_view(known, length).all(axis=-1))


def _spectra(windows: Samples) -> Array:
    """Return the mean power over the channels at each frequency, 1 for white noise of power 1: (n_windows, n_bins)."""
    transforms = np.fft.rfft(windows * _hann(windows.shape[1])[:, None], axis=1)
    return np.square(np.abs(transforms)).mean(axis=2)


def _hann(length: int) -> Array:
    """Return a Hann window of power 1."""
    window = np.hanning(length + 2)[1:-1]
    return window / np.sqrt(np.square(window).sum())


def _fit(powers: Array, expected: Array) -> Array:
    """Return the log-likelihood of each window at each age, (n_ways, n_windows, n_ages)."""
    ratio = np.maximum(powers, MIN_POWER)[:, None, :] / expected[:, None]
    return np.maximum(np.log(ratio) - ratio, ANYTHING).sum(axis=-1)


# --------------------
# Segmentation of sliding from tactile signals alone, without force sensor or robot state.
#
# A finger at rest gives the sensor's noise; a sliding one gives vibration that grows with its speed. So sliding is
# where the power stays above that of rest, and its steady part begins one ramp after the power began to grow as it does
# while a finger gains speed. It ends where the load on the finger begins to fall, or, without channels that follow the
# load, one ramp before the power is back at rest.

# Rest and sliding are distinguished over 50 ms. A touch or a knock lasts a part of that, sliding most.
SMOOTHED_PERCENTILE = 70
KNOCK_S = 0.08
CELL_S = 0.005  # in which the power is computed
MAX_GAP_S = 0.2  # below the threshold, and still part of one slide
# In a contact, its knocks left out, less is enough for longer: the mean of 0.25 s of rest scatters by some percent.
LONG_S, LONG_ON, LONG_OFF = 0.25, 3.0, 1.5
# How near a slide begins to where it is seen first.
NEAR_S = 0.18
# Levels of the vibration channels themselves, where no others tell the load.
LEVEL_S = 0.01
NO_CONTACT = ContactInterval(-math.inf, -math.inf, math.inf, math.inf)


@dataclass(frozen=True)
class SegmentationParams:
    """How sliding is found. None of it is fitted to recordings: the power of 50 ms of rest scatters by a fifth."""

    on: float = param(
        6.0, 'Start threshold: power over baseline power above which sliding is detected.', low=1.0, high=1e6
    )
    off: float = param(
        3.0, 'Stop threshold: power over baseline power below which sliding ends (hysteresis).', low=1.0, high=1e6
    )
    min_duration_s: float = param(
        0.15, 'Shortest slide that is reported; shorter ones are discarded.', unit='s', low=0.0, high=60.0
    )
    ramp_s: float = param(
        0.2,
        'Acceleration and deceleration time of the robot, from its motion plan.',
        unit='s',
        low=0.0,
        high=10.0,
    )
    press_s: float = param(
        0.1, 'Time the robot takes to press and to release, from its motion plan.', unit='s', low=0.0, high=10.0
    )
    quantity: str = param(
        'either',
        "Quantity that the vibration channels measure: 'force', its 'change', or 'either' if unknown.",
        choices=tuple(MEASURED_QUANTITIES),
    )
    smooth_s: float = param(
        SMOOTH_S,
        'Time constant of the high-pass filter that removes the load; slow slides need a longer one.',
        unit='s',
        low=0.01,
        high=1.0,
    )
    noise_rms: float = param(
        0.0,
        'Baseline noise of the sensor, rms; 0 estimates it from the quietest tenth of the recording.',
        low=0.0,
    )


@dataclass(frozen=True)
class SlidingInterval:
    """One stretch of sliding, s from the first sample: when the finger sets off, and where its speed is steady."""

    motion_start_s: float
    start_s: float
    end_s: float


def find_sliding(
    fast: Samples,
    rate_hz: float,
    params: SegmentationParams,
    *,
    slow: Samples | None = None,
    slow_rate_hz: float = math.nan,
    slow_from_s: float = 0.0,
    rest: Array | None = None,
) -> list[SlidingInterval]:
    """Return the stretches of sliding in a recording that holds some rest, in order.

    A surface that makes no more vibration than the sensor has noise is not found to slide.
    """
    if fast.ndim != 2 or not rate_hz > 0 or (slow is not None and (slow.ndim != 2 or not slow_rate_hz > 0)):
        raise InvalidData(
            f'sliding is looked for in samples of shape {fast.shape} at {rate_hz} Hz; '
            '(n_samples, n_channels) at a rate above 0 is needed, of the slow channels too'
        )
    cell_s, powers = cell_power(fast, rate_hz, CELL_S, params.smooth_s)
    if len(powers) < SMOOTHED_CELLS:
        return []
    if rest is None:
        rest = baseline_power(powers)
    if params.noise_rms:
        rest = np.full(fast.shape[1], params.noise_rms**2)
    power = _mean(powers / rest)
    if slow is None:
        slow, slow_rate_hz, slow_from_s = channel_means(fast, rate_hz)
    contacts = _find_contacts(slow, slow_rate_hz, slow_from_s, power, cell_s)
    known = np.where(_unchanged(len(power), cell_s, contacts, params), power, np.nan)
    model = OnsetModel(rate_hz, rest, params.ramp_s, params.quantity, params.smooth_s)
    found = []
    for run in active_runs(known, cell_s, contacts, params):
        contact, steady = _steady(run, contacts, cell_s)
        found.append(
            _refined(model, fast, np.isfinite(known), steady, cell_s=cell_s, run=run, contact=contact, params=params)
        )
    return [interval for interval in _joined(found) if interval.end_s - interval.start_s >= params.min_duration_s]


def _joined(found: Sequence[SlidingInterval]) -> list[SlidingInterval]:
    """Return the stretches with those as one that overlap."""
    apart: list[SlidingInterval] = []
    for interval in found:
        if apart and interval.start_s <= apart[-1].end_s:
            apart[-1] = replace(apart[-1], end_s=max(apart[-1].end_s, interval.end_s))
        else:
            apart.append(interval)
    return apart


def _mean(ratios: Array) -> Array:
    """Return the mean over the channels that are known, (n_cells,); 1 without one."""
    known = np.isfinite(ratios)
    means: Array = np.where(known, ratios, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    return np.where(known.any(axis=1), means, 1.0)


def channel_means(fast: Samples, rate_hz: float) -> tuple[Samples, float, float]:
    """Return the means of 10 ms of vibration channels, their rate, and the time of the first."""
    width = max(1, round(LEVEL_S * rate_hz))
    count = len(fast) // width
    known = np.isfinite(fast[: count * width])
    sums = np.where(known, fast[: count * width], 0.0).reshape(count, width, -1).sum(axis=1)
    means = sums / np.maximum(known.reshape(count, width, -1).sum(axis=1), 1)
    return means, rate_hz / width, 0.5 * (width - 1) / rate_hz


def active_runs(
    power: Array, cell_s: float, contacts: Sequence[ContactInterval], params: SegmentationParams
) -> list[tuple[int, int]]:
    """Return the stretches of cells, first and one past the last, in which the power stays above that of rest, 1.

    NaN for a cell in which a changing load knocks.
    """
    known = np.isfinite(power)
    filled = np.where(known, power, 0.0)
    smooth = percentile_filter(filled, SMOOTHED_PERCENTILE, SMOOTHED_CELLS, mode='nearest')
    width = max(1, round(LONG_S / cell_s))
    share = uniform_filter1d(known.astype(float), width, mode='constant')
    longer = uniform_filter1d(filled, width, mode='constant') / np.maximum(share, 0.5 / width)
    touched = _in_contact(len(power), cell_s, contacts)
    active = (smooth > params.off) | (touched & (longer > LONG_OFF))
    certain = (smooth > params.on) | (touched & (longer > LONG_ON))
    edges = np.flatnonzero(np.diff(np.concatenate(([0], active, [0]))))
    runs: list[tuple[int, int]] = []
    for first, last in edges.reshape(-1, 2).tolist():
        if (last - first) * cell_s < KNOCK_S or not certain[first:last].any():
            continue
        if runs and (first - runs[-1][1]) * cell_s <= MAX_GAP_S:
            runs[-1] = (runs[-1][0], last)
        else:
            runs.append((first, last))
    return [run for run in runs if (run[1] - run[0]) * cell_s >= params.min_duration_s]


def _find_contacts(slow: Samples, rate_hz: float, from_s: float, power: Array, cell_s: float) -> list[ContactInterval]:
    """Return the contacts, in the time of the vibration."""
    smooth = uniform_filter1d(np.log(power + TINY**0.1), SMOOTHED_CELLS)
    vibration = np.interp(from_s + np.arange(len(slow)) / rate_hz, (np.arange(len(power)) + 0.5) * cell_s, smooth)
    return [
        ContactInterval(*(from_s + at_s for at_s in astuple(contact)))
        for contact in find_contacts(slow, rate_hz, vibration)
    ]


def _in_contact(count: int, cell_s: float, contacts: Sequence[ContactInterval]) -> NDArray[np.bool_]:
    """Return which of `count` cells lie in a contact."""
    middle = (np.arange(count) + 0.5) * cell_s
    inside = [(middle > contact.press_start_s) & (middle < contact.release_end_s) for contact in contacts]
    return np.any(inside, axis=0) if inside else np.zeros(count, dtype=bool)


def _unchanged(
    count: int, cell_s: float, contacts: Sequence[ContactInterval], params: SegmentationParams
) -> NDArray[np.bool_]:
    """Return which of `count` cells hold no knock of a changing load."""
    middle = (np.arange(count) + 0.5) * cell_s
    sure = np.ones(count, dtype=bool)
    for contact in contacts:
        press_end_s = max(contact.press_end_s, contact.press_start_s + params.press_s)
        free_s = max(contact.release_end_s, contact.release_start_s + params.press_s)
        for first_s, last_s in ((contact.press_start_s, press_end_s), (contact.release_start_s, free_s)):
            sure &= (middle < first_s - 0.5 * params.smooth_s) | (middle > last_s + params.smooth_s)
    return sure


def _steady(run: tuple[int, int], contacts: Sequence[ContactInterval], cell_s: float) -> tuple[ContactInterval, slice]:
    """Return the contact in which the cells of a run lie, and the middle half of what they share with it."""
    first, last = run
    middle_s = 0.5 * (first + last) * cell_s
    contact = next(
        (contact for contact in contacts if contact.press_end_s <= middle_s <= contact.release_start_s), NO_CONTACT
    )
    begin = max(first, math.floor(max(contact.press_end_s, 0.0) / cell_s))
    end = min(last, math.ceil(min(contact.release_start_s, last * cell_s) / cell_s))
    quarter = (end - begin) // 4
    return contact, slice(begin + quarter, end - quarter)


def _onset_s(
    model: OnsetModel, fast: Samples, known: NDArray[np.bool_], steady: slice, *, near: int, width: int
) -> float:
    """Return when the finger sets off, if it is seen to slide from the cell `near` on; cells have `width` samples."""
    rate_hz, before_s = model.rate_hz, model.ramp_s + NEAR_S
    far = math.ceil(before_s * rate_hz / width)
    begin, end = max(0, near - far), near + far
    near_s = (near - begin) * width / rate_hz
    from_begin_s = model.find(
        fast[begin * width : end * width],
        np.repeat(known[begin:end], width),
        fast[steady.start * width : steady.stop * width],
        (near_s - before_s, near_s + NEAR_S),
    )
    return begin * width / rate_hz + from_begin_s


def _refined(
    model: OnsetModel,
    fast: Samples,
    known: NDArray[np.bool_],
    steady: slice,
    *,
    cell_s: float,
    run: tuple[int, int],
    contact: ContactInterval,
    params: SegmentationParams,
) -> SlidingInterval:
    """Return the sliding whose power stands out in the cells of `run`."""
    first, last = run
    count, width = len(known), round(cell_s * model.rate_hz)
    # A run may begin in the knock of the touch, of which nothing is known: it is seen first after that.
    pressed = max(first, math.floor(max(contact.press_end_s, 0.0) / cell_s))
    motion_start_s = _onset_s(model, fast, known, steady, near=pressed + int(known[pressed:].argmax()), width=width)
    start_s = max(motion_start_s + params.ramp_s, contact.press_end_s, 0.0)
    if contact.release_start_s < last * cell_s + params.ramp_s + MAX_GAP_S:
        end_s = contact.release_start_s
    elif last >= count:
        end_s = count * cell_s
    else:  # as it sets off, from the end to the beginning
        backwards, from_end = fast[: count * width][::-1], slice(count - steady.stop, count - steady.start)
        onset_s = _onset_s(model, backwards, known[::-1], from_end, near=count - last, width=width)
        end_s = count * cell_s - onset_s - params.ramp_s
    return SlidingInterval(motion_start_s, start_s, end_s)


# --------------------
# Exploration states made from the signals themselves, where no explorer tells them or they are wrong.

FAST, SLOW = 'signal', 'signal_static'
WHOLE_S = 1e6  # so that a recording is kept as a whole
MOTION = 'detected'


def segment_recording(
    signals: Mapping[str, Iterable[TactileSignal]], params: SegmentationParams, exploration_id: str = 'detected'
) -> list[ExplorationState]:
    """Return the states of the slides in a recording, a `slide` and a `lift` each, found with all of it in view.

    The sensor's noise is estimated at rest, so let the finger rest at first, or give `noise_rms`.
    """
    states: list[ExplorationState] = []
    rest: Array = np.empty(0)
    reported_ns = 0
    for fast, slow in _runs(signals):
        samples, begin_ns, over_ns = _whole_run(fast), fast.time_of(fast.first_sample), fast.time_of(fast.next_sample)
        _, powers = cell_power(samples, fast.rate_hz, CELL_S, params.smooth_s)
        if len(powers):  # a channel is as quiet as in its quietest run: one may hold little rest
            quiet = baseline_power(powers)
            rest = np.minimum(rest, quiet) if quiet.shape == rest.shape else quiet
        found = find_sliding(
            samples,
            fast.rate_hz,
            params,
            slow=None if slow is None else _whole_run(slow),
            slow_rate_hz=math.nan if slow is None else slow.rate_hz,
            slow_from_s=0.0 if slow is None else (slow.time_of(slow.first_sample) - begin_ns) / NANOSECONDS,
            rest=rest,
        )
        for interval in found:
            start_ns, end_ns = (
                fast.time_of(fast.first_sample + at_s * fast.rate_hz) for at_s in (interval.start_s, interval.end_s)
            )
            start_ns = max(start_ns, reported_ns)  # a sensor that starts again may be a little early
            too_short = end_ns - start_ns < params.min_duration_s * NANOSECONDS
            if too_short or end_ns <= reported_ns or start_ns >= over_ns:
                continue
            reported_ns = min(end_ns, over_ns)
            name = f'{exploration_id}/{len(states) // 2 + 1:03d}'
            steady_s = (reported_ns - start_ns) / NANOSECONDS
            states.append(ExplorationState(start_ns, name, MOTION, Phase.SLIDE, steady_s=steady_s))
            states.append(ExplorationState(reported_ns, name, MOTION, Phase.LIFT))
    return states


def _runs(signals: Mapping[str, Iterable[TactileSignal]]) -> Iterator[tuple[SampleBuffer, SampleBuffer | None]]:
    """Yield each numbering of the vibration as a whole, and the pressure measured until its end, if there is any."""
    runs: dict[str, SampleBuffer] = {}
    tracks = [[(batch.stamp_ns, topic, batch) for batch in signals.get(topic, ())] for topic in (FAST, SLOW)]
    for _, topic, batch in heapq.merge(*tracks, key=lambda item: item[0]):
        if not len(batch.samples):
            continue
        run = runs.get(topic)
        if run is not None and run.continued_by(batch):
            run.append(batch)
            continue
        if run is not None and topic == FAST:
            yield run, runs.get(SLOW)
        runs[topic] = SampleBuffer(batch, WHOLE_S)
    if FAST in runs:
        yield runs[FAST], runs.get(SLOW)


def _whole_run(run: SampleBuffer) -> Samples:
    return run.take(run.first_sample, run.next_sample - run.first_sample)
