"""When a finger slides, told from what it feels alone: no force sensor, no word from the robot.

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
from texture_features.segmentation.cell_power import SMOOTH_S, SMOOTHED_CELLS, TINY, cell_power, rest_power
from texture_features.segmentation.contact_load import Touch, find_touches
from texture_features.segmentation.onset import SENSES, OnsetModel

# Rest and sliding are told apart over 50 ms. A touch or a knock lasts a part of that, sliding most.
SMOOTHED_PERCENTILE = 70
KNOCK_S = 0.08
# In a contact, its knocks left out, less is enough for longer: the mean of 0.25 s of rest scatters by some percent.
LONG_S, LONG_ON, LONG_OFF = 0.25, 3.0, 1.5
# How near a slide begins to where it is seen first.
NEAR_S = 0.18
# Levels of the vibration channels themselves, where no others tell the load.
LEVEL_S = 0.01
UNTOUCHED = Touch(-math.inf, -math.inf, math.inf, math.inf)


@dataclass(frozen=True)
class SegmentParams:
    """How sliding is found. None of it is fitted to recordings: the power of 50 ms of rest scatters by a fifth."""

    cell_s: float = param(0.005, 'Time over which power is taken.', unit='s', low=0.001, high=0.1)
    on: float = param(6.0, 'Power, in that of rest, above which sliding is certain.', low=1.0, high=1e6)
    off: float = param(3.0, 'Power, in that of rest, down to which it then goes on.', low=1.0, high=1e6)
    bridge_s: float = param(0.2, 'A quieter part of a slide is at most so long.', unit='s', low=0.0, high=10.0)
    least_s: float = param(0.15, 'A slide is at least so long.', unit='s', low=0.0, high=60.0)
    ramp_s: float = param(
        0.2, 'Time in which the robot gains its speed, and loses it, from its plan.', unit='s', low=0.0, high=10.0
    )
    press_s: float = param(
        0.1, 'Time in which the robot presses on, and lets go, from its plan.', unit='s', low=0.0, high=10.0
    )
    senses: str = param(
        'either', "What the vibration channels feel: the force, its change, or 'either'.", choices=tuple(SENSES)
    )
    smooth_s: float = param(
        SMOOTH_S,
        'What changes over longer than this is load, not vibration; more for slow slides.',
        unit='s',
        low=0.01,
        high=1.0,
    )
    rest_rms: float = param(
        0.0, "The sensor's noise at rest, in its unit; 0: that of the quietest tenth of the recording.", low=0.0
    )


@dataclass(frozen=True)
class Sliding:
    """One stretch of sliding, s from the first sample: when the finger sets off, and where its speed is steady."""

    moving_s: float
    start_s: float
    end_s: float


def find_sliding(
    fast: Samples,
    rate_hz: float,
    params: SegmentParams,
    *,
    slow: Samples | None = None,
    slow_rate_hz: float = math.nan,
    slow_from_s: float = 0.0,
    rest: Array | None = None,
) -> list[Sliding]:
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
        Power of each channel at rest, if it is known; see `rest_power`.

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
        rest = rest_power(powers)
    if params.rest_rms:
        rest = np.full(fast.shape[1], params.rest_rms**2)
    power = _mean(powers / rest)
    if slow is None:
        slow, slow_rate_hz, slow_from_s = levels_of(fast, rate_hz)
    touches = _touches(slow, slow_rate_hz, slow_from_s, power, cell_s)
    known = np.where(_unchanged(len(power), cell_s, touches, params), power, np.nan)
    model = OnsetModel(rate_hz, rest, params.ramp_s, params.senses, params.smooth_s)
    found = []
    for run in active_runs(known, cell_s, touches, params):
        touch, steady = _steady(run, touches, cell_s)
        vibration = _Vibration(fast, round(cell_s * rate_hz), np.isfinite(known), steady, model)
        found.append(_refined(vibration, cell_s, run, touch, params))
    return [sliding for sliding in _joined(found) if sliding.end_s - sliding.start_s >= params.least_s]


def _joined(found: Sequence[Sliding]) -> list[Sliding]:
    """Return the stretches with those as one that overlap."""
    apart: list[Sliding] = []
    for sliding in found:
        if apart and sliding.start_s <= apart[-1].end_s:
            apart[-1] = replace(apart[-1], end_s=max(apart[-1].end_s, sliding.end_s))
        else:
            apart.append(sliding)
    return apart


def _mean(ratios: Array) -> Array:
    """Return the mean over the channels that are known, (n_cells,); 1 without one."""
    known = np.isfinite(ratios)
    means: Array = np.where(known, ratios, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    return np.where(known.any(axis=1), means, 1.0)


def levels_of(fast: Samples, rate_hz: float) -> tuple[Samples, float, float]:
    """Return the means of 10 ms of vibration channels, their rate, and the time of the first."""
    width = max(1, round(LEVEL_S * rate_hz))
    count = len(fast) // width
    known = np.isfinite(fast[: count * width])
    sums = np.where(known, fast[: count * width], 0.0).reshape(count, width, -1).sum(axis=1)
    means = sums / np.maximum(known.reshape(count, width, -1).sum(axis=1), 1)
    return means, rate_hz / width, 0.5 * (width - 1) / rate_hz


def active_runs(power: Array, cell_s: float, touches: Sequence[Touch], params: SegmentParams) -> list[tuple[int, int]]:
    """Return the stretches of cells, first and one past the last, in which the power stays above that of rest, 1.

    NaN for a cell in which a changing load knocks.
    """
    known = np.isfinite(power)
    filled = np.where(known, power, 0.0)
    smooth = percentile_filter(filled, SMOOTHED_PERCENTILE, SMOOTHED_CELLS, mode='nearest')
    width = max(1, round(LONG_S / cell_s))
    share = uniform_filter1d(known.astype(float), width, mode='constant')
    longer = uniform_filter1d(filled, width, mode='constant') / np.maximum(share, 0.5 / width)
    touched = _touched(len(power), cell_s, touches)
    active = (smooth > params.off) | (touched & (longer > LONG_OFF))
    certain = (smooth > params.on) | (touched & (longer > LONG_ON))
    edges = np.flatnonzero(np.diff(np.concatenate(([0], active, [0]))))
    runs: list[tuple[int, int]] = []
    for first, last in edges.reshape(-1, 2).tolist():
        if (last - first) * cell_s < KNOCK_S or not certain[first:last].any():
            continue
        if runs and (first - runs[-1][1]) * cell_s <= params.bridge_s:
            runs[-1] = (runs[-1][0], last)
        else:
            runs.append((first, last))
    return [run for run in runs if (run[1] - run[0]) * cell_s >= params.least_s]


def _touches(slow: Samples, rate_hz: float, from_s: float, power: Array, cell_s: float) -> list[Touch]:
    """Return the contacts, in the time of the vibration."""
    smooth = uniform_filter1d(np.log(power + TINY**0.1), SMOOTHED_CELLS)
    vibration = np.interp(from_s + np.arange(len(slow)) / rate_hz, (np.arange(len(power)) + 0.5) * cell_s, smooth)
    return [touch.later(from_s) for touch in find_touches(slow, rate_hz, vibration)]


def _touched(count: int, cell_s: float, touches: Sequence[Touch]) -> NDArray[np.bool_]:
    """Return which of `count` cells lie in a contact."""
    middle = (np.arange(count) + 0.5) * cell_s
    inside = [(middle > touch.begins_s) & (middle < touch.ends_s) for touch in touches]
    return np.any(inside, axis=0) if inside else np.zeros(count, dtype=bool)


def _unchanged(count: int, cell_s: float, touches: Sequence[Touch], params: SegmentParams) -> NDArray[np.bool_]:
    """Return which of `count` cells hold no knock of a changing load."""
    middle = (np.arange(count) + 0.5) * cell_s
    sure = np.ones(count, dtype=bool)
    for touch in touches:
        pressed_s = max(touch.pressed_s, touch.begins_s + params.press_s)
        free_s = max(touch.ends_s, touch.falls_s + params.press_s)
        for first_s, last_s in ((touch.begins_s, pressed_s), (touch.falls_s, free_s)):
            sure &= (middle < first_s - 0.5 * params.smooth_s) | (middle > last_s + params.smooth_s)
    return sure


def _steady(run: tuple[int, int], touches: Sequence[Touch], cell_s: float) -> tuple[Touch, slice]:
    """Return the contact in which the cells of a run lie, and the middle half of what they share with it."""
    first, last = run
    middle_s = 0.5 * (first + last) * cell_s
    touch = next((touch for touch in touches if touch.pressed_s <= middle_s <= touch.falls_s), UNTOUCHED)
    begin = max(first, math.floor(max(touch.pressed_s, 0.0) / cell_s))
    end = min(last, math.ceil(min(touch.falls_s, last * cell_s) / cell_s))
    quarter = (end - begin) // 4
    return touch, slice(begin + quarter, end - quarter)


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
    vibration: _Vibration, cell_s: float, run: tuple[int, int], touch: Touch, params: SegmentParams
) -> Sliding:
    """Return the sliding whose power stands out in the cells of `run`."""
    first, last = run
    known = vibration.known
    # A run may begin in the knock of the touch, of which nothing is known: it is seen first after that.
    pressed = max(first, math.floor(max(touch.pressed_s, 0.0) / cell_s))
    moving_s = vibration.onset_s(pressed + int(known[pressed:].argmax()))
    start_s = max(moving_s + params.ramp_s, touch.pressed_s, 0.0)
    if touch.falls_s < last * cell_s + params.ramp_s + params.bridge_s:
        end_s = touch.falls_s
    elif last >= len(known):
        end_s = len(known) * cell_s
    else:
        end_s = len(known) * cell_s - vibration.reversed().onset_s(len(known) - last) - params.ramp_s
    return Sliding(moving_s, start_s, end_s)
