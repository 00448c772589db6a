"""Segmentation of sliding from tactile signals alone, without force sensor or robot state.

A finger at rest gives the sensor's noise; a sliding one gives vibration that grows with its speed. So sliding is where
the power stays above that of rest, and its steady part begins one ramp after the power began to grow as it does while a
finger gains speed. It ends where the load on the finger begins to fall, or, without channels that follow the load, one
ramp before the power is back at rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import percentile_filter, uniform_filter1d

from texture_core.arrays import Array, Samples
from texture_core.errors import InvalidData
from texture_core.parameters import param
from texture_features.segmentation.cell_power import SMOOTH_S, SMOOTHED_CELLS, TINY, baseline_power, cell_power
from texture_features.segmentation.contact_intervals import ContactInterval, find_contacts
from texture_features.segmentation.onset import MEASURED_QUANTITIES, OnsetModel

# Rest and sliding are distinguished over 50 ms. A touch or a knock lasts a part of that, sliding most.
SMOOTHED_PERCENTILE = 70
KNOCK_S = 0.08
# In a contact, its knocks left out, less is enough for longer: the mean of 0.25 s of rest scatters by some percent.
LONG_S, LONG_ON, LONG_OFF = 0.25, 3.0, 1.5
# How near a slide begins to where it is seen first.
NEAR_S = 0.18
# Levels of the vibration channels themselves, where no others tell the load.
LEVEL_S = 0.01
NO_CONTACT = ContactInterval(-math.inf, -math.inf, math.inf, math.inf)


@dataclass(frozen=True)
class SegmentationParams:
    """How sliding is found. None of it is fitted to recordings: the power of 50 ms of rest scatters by a fifth.

    Examples
    --------
    >>> params = SegmentationParams()
    >>> params.on > params.off  # hysteresis: sliding needs more power to begin than to go on
    True
    """

    cell_s: float = param(
        0.005, 'Length of the frames in which the signal power is computed.', unit='s', low=0.001, high=0.1
    )
    on: float = param(
        6.0, 'Start threshold: power over baseline power above which sliding is detected.', low=1.0, high=1e6
    )
    off: float = param(
        3.0, 'Stop threshold: power over baseline power below which sliding ends (hysteresis).', low=1.0, high=1e6
    )
    max_gap_s: float = param(
        0.2, 'Longest gap below the stop threshold that is still part of one slide.', unit='s', low=0.0, high=10.0
    )
    min_duration_s: float = param(
        0.15, 'Shortest slide that is reported; shorter ones are discarded.', unit='s', low=0.0, high=60.0
    )
    ramp_s: float = param(
        0.2,
        'Sets the acceleration and deceleration time of the robot, from its motion plan.',
        unit='s',
        low=0.0,
        high=10.0,
    )
    press_s: float = param(
        0.1, 'Time the robot takes to press and to release, from its motion plan.', unit='s', low=0.0, high=10.0
    )
    quantity: str = param(
        'either',
        "Sets the quantity that the vibration channels measure: 'force', its 'change', or 'either' if unknown.",
        choices=tuple(MEASURED_QUANTITIES),
    )
    smooth_s: float = param(
        SMOOTH_S,
        'Sets the time constant of the high-pass filter that removes the load; slow slides need a longer one.',
        unit='s',
        low=0.01,
        high=1.0,
    )
    noise_rms: float = param(
        0.0,
        'Sets the baseline noise of the sensor, rms; 0 estimates it from the quietest tenth of the recording.',
        low=0.0,
    )


@dataclass(frozen=True)
class SlidingInterval:
    """One stretch of sliding, s from the first sample: when the finger sets off, and where its speed is steady.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> signal = 0.01 * rng.standard_normal((3000, 1))  # 3 s of noise at 1 kHz, and vibration from 1 s to 2 s
    >>> signal[1000:2000] += rng.standard_normal((1000, 1))
    >>> [interval] = find_sliding(signal, 1000.0, SegmentationParams(ramp_s=0.01, quantity='force'))
    >>> abs(interval.start_s - 1.0) < 0.03, abs(interval.end_s - 2.0) < 0.03
    (True, True)
    """

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

    Parameters
    ----------
    fast : (n_samples, n_channels)
        Vibration; what is not finite counts as rest.
    rate_hz
        Its sampling rate.
    slow : (n_slow_samples, n_slow_channels), optional
        Pressure: tells the end to some milliseconds. Without it the levels of `fast` are looked at.
    slow_rate_hz, slow_from_s
        Its sampling rate, and when its first sample was taken after the first of `fast`.
    rest : (n_channels,), optional
        Power of each channel at rest, if it is known; see `baseline_power`.
    params
        How sliding is found.

    Returns
    -------
    list of SlidingInterval
        Times in s from the first sample of `fast`.

    Raises
    ------
    InvalidData
        If the shape or a rate makes no sense.
    """
    if fast.ndim != 2 or not rate_hz > 0 or (slow is not None and (slow.ndim != 2 or not slow_rate_hz > 0)):
        raise InvalidData(
            f'sliding is looked for in samples of shape {fast.shape} at {rate_hz} Hz; '
            '(n_samples, n_channels) at a rate above 0 is needed, of the slow channels too'
        )
    cell_s, powers = cell_power(fast, rate_hz, params.cell_s, params.smooth_s)
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
        vibration = _Vibration(fast, round(cell_s * rate_hz), np.isfinite(known), steady, model)
        found.append(_refined(vibration, cell_s, run, contact, params))
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
    """Return the means of 10 ms of vibration channels, their rate, and the time of the first.

    Parameters
    ----------
    fast : (n_samples, n_channels)
        Vibration; what is not finite is left out of the means.
    rate_hz
        Its sampling rate.

    Returns
    -------
    (n_means, n_channels)
        In the unit of the samples.
    float
        Rate of the means, Hz.
    float
        Time of the first mean after the first sample, s.
    """
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

    Parameters
    ----------
    power : (n_cells,)
        Power of each cell over that at rest.
    cell_s
        Length of a cell, s.
    contacts
        When the finger is pressed on; there less power is enough.
    params
        Thresholds and durations.

    Returns
    -------
    list of (int, int)
        In order; none is shorter than `params.min_duration_s`.
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
        if runs and (first - runs[-1][1]) * cell_s <= params.max_gap_s:
            runs[-1] = (runs[-1][0], last)
        else:
            runs.append((first, last))
    return [run for run in runs if (run[1] - run[0]) * cell_s >= params.min_duration_s]


def _find_contacts(slow: Samples, rate_hz: float, from_s: float, power: Array, cell_s: float) -> list[ContactInterval]:
    """Return the contacts, in the time of the vibration."""
    smooth = uniform_filter1d(np.log(power + TINY**0.1), SMOOTHED_CELLS)
    vibration = np.interp(from_s + np.arange(len(slow)) / rate_hz, (np.arange(len(power)) + 0.5) * cell_s, smooth)
    return [contact.shifted(from_s) for contact in find_contacts(slow, rate_hz, vibration)]


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


@dataclass(frozen=True)
class _Vibration:
    """Vibration channels in cells of `width` samples, of which some are known, and some at steady speed."""

    fast: Samples
    width: int
    known: NDArray[np.bool_]
    steady: slice
    model: OnsetModel

    def reversed(self) -> _Vibration:
        """Return the same from its end to its beginning."""
        count = len(self.known)
        return replace(
            self,
            fast=self.fast[: count * self.width][::-1],
            known=self.known[::-1],
            steady=slice(count - self.steady.stop, count - self.steady.start),
        )

    def onset_s(self, near: int) -> float:
        """Return when the finger sets off, if it is seen to slide from the cell `near` on."""
        width, rate_hz, before_s = self.width, self.model.rate_hz, self.model.ramp_s + NEAR_S
        far = math.ceil(before_s * rate_hz / width)
        begin, end = max(0, near - far), near + far
        near_s = (near - begin) * width / rate_hz
        from_begin_s = self.model.find(
            self.fast[begin * width : end * width],
            np.repeat(self.known[begin:end], width),
            self.fast[self.steady.start * width : self.steady.stop * width],
            (near_s - before_s, near_s + NEAR_S),
        )
        return begin * width / rate_hz + from_begin_s


def _refined(
    vibration: _Vibration, cell_s: float, run: tuple[int, int], contact: ContactInterval, params: SegmentationParams
) -> SlidingInterval:
    """Return the sliding whose power stands out in the cells of `run`."""
    first, last = run
    known = vibration.known
    # A run may begin in the knock of the touch, of which nothing is known: it is seen first after that.
    pressed = max(first, math.floor(max(contact.press_end_s, 0.0) / cell_s))
    motion_start_s = vibration.onset_s(pressed + int(known[pressed:].argmax()))
    start_s = max(motion_start_s + params.ramp_s, contact.press_end_s, 0.0)
    if contact.release_start_s < last * cell_s + params.ramp_s + params.max_gap_s:
        end_s = contact.release_start_s
    elif last >= len(known):
        end_s = len(known) * cell_s
    else:
        end_s = len(known) * cell_s - vibration.reversed().onset_s(len(known) - last) - params.ramp_s
    return SlidingInterval(motion_start_s, start_s, end_s)
