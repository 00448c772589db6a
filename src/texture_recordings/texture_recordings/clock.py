# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The clock of rows: their rate, and the place of each on an even grid, or a fault where times contradict it."""

from __future__ import annotations

from collections import Counter

import numpy as np

from texture_core.types import AnyArray, Array

SIGNIFICANT = 4  # digits of an estimated rate: the resolution of time stamps allows no more
ROUND_RATE = 1e-3  # a rate that is so near to one of two digits is taken for that one
GAP = 1.5  # steps of time longer than so many sampling intervals are gaps, whose samples count as lost
SAME_TIME = 0.1  # rows nearer than this share of an interval have one time
COARSE = 0.45  # intervals: of a clock that counts in longer steps, rounding looks like losses
NEAR = 11  # rows that have one median
OFF_GRID = 0.45  # intervals by which rows may be off the grid where samples are lost, or their median elsewhere
MOST_OFF, MOST_OFF_SHARE = 3.0, 0.003  # intervals, and share of the rows of a slide, where none is
SAME_RATE = 1.05  # the rate of another file may differ by this factor
WITHOUT_TIME = 'if no sample is lost, give `rate_hz` in place of the column of time'


class ClockFault(ValueError):
    """Times of which no grid can be made: the row at which that is seen, and why."""

    def __init__(self, row: int, reason: str) -> None:
        super().__init__(reason)
        self.row = row


def estimated(steps: Array) -> float:
    """Return the rate of rows in spite of jitter and gaps, of four digits; 0 if their times do not grow."""
    steps = steps[steps > 0]
    # Without gaps and rows that are there twice.
    usual = steps[(steps < 1.75 * np.median(steps)) & (steps > 0.25 * np.median(steps))] if len(steps) else steps
    if not len(usual):
        return 0.0
    rate_hz = float(1.0 / usual.mean())
    simple = float(f'{rate_hz:.2g}')
    return simple if abs(rate_hz / simple - 1.0) < ROUND_RATE else float(f'{rate_hz:.{SIGNIFICANT}g}')


def on_grid(times: Array, rate_hz: float, *, stated: bool = False) -> tuple[slice, AnyArray, Counter[str]]:
    """Return which rows of a slide are samples, the place of each on a grid, and counts of what is left out.

    ClockFault where times contradict the rate, do not grow, or lack more samples than there are.
    """
    steps = np.diff(times)
    if (steps < 0).any():
        row = int(np.argmax(steps < 0)) + 1
        raise ClockFault(
            row, f'time goes back from {times[row - 1]:.9g} to {times[row]:.9g} s, {(steps < 0).sum()} times in this '
            'slide; sort its rows by time if they are in disorder; for several runs write slides: {by: pause}, or cut '
            f'them by a column; to times behind the roll of a counter, or midnight, add its period; {WITHOUT_TIME}',
        )  # fmt: skip
    index = _places(times, rate_hz, stated=stated)
    # Of a row or two behind a gap at an end nobody knows whether the gap or their time is wrong.
    gaps = np.flatnonzero(np.diff(index) > 1)
    low = max((gap + 1 for gap in gaps if gap < 2), default=0)
    high = min((gap + 1 for gap in gaps if gap >= len(index) - 3), default=len(index))
    low, high = (low, high) if low < high else (0, len(index))
    alone, index = len(index) - (high - low), index[low:high] - index[low]
    lost = int(index[-1] + 1 - len(index))
    if lost > len(index):
        raise ClockFault(
            0, f'{len(index)} rows and {lost} lost samples at {rate_hz:g} Hz: more are lost than there are; by rows '
            f'and duration the rate is {_mean_hz(times):.4g} Hz; look at the column of time and its unit, or '
            f'whether a buffer was stamped when it was read; {WITHOUT_TIME}',
        )  # fmt: skip
    counts = Counter({'samples': len(index), 'lost': lost, 'rows alone at the end of a slide': alone})
    return slice(low, high), index, counts


def _places(times: Array, rate_hz: float, *, stated: bool) -> AnyArray:
    """Return the place of each row on the grid, (n,)."""
    steps = np.diff(times) * rate_hz
    unlike = np.flatnonzero(steps < SAME_TIME)
    if len(unlike):
        raise ClockFault(
            int(unlike[0]), f'{len(unlike)} of {len(times)} times come twice: of a coarse clock, a buffer that is '
            'stamped when it is read, several sensors, or rows that were saved twice; choose rows (`rows: {column: '
            f'value}}`), or save each row once; {WITHOUT_TIME}',
        )  # fmt: skip
    # A late row is followed by a short step, an early one comes after one, a loss is not.
    pairs = np.minimum(steps + np.append(steps[1:], np.inf), steps + np.append(np.inf, steps[:-1])[: len(steps)])
    missing = np.where((steps > GAP) & (pairs > 1.0 + GAP), np.rint(steps) - 1, 0).astype(np.int64)
    index = np.concatenate(([0], np.cumsum(1 + missing)))
    # Where the clock counts in steps of about an interval, its rounding looks like losses.
    tick_s = _tick_s(times)
    exact = stated and np.abs(steps - np.rint(steps)).max(initial=0.0) < 0.02
    if missing.any() and tick_s * rate_hz > COARSE and not exact:
        gap = int(np.argmax(missing > 0))
        raise ClockFault(
            gap, f'a gap of {times[gap + 1] - times[gap]:.3g} s follows: samples were lost there, or time, '
            f'which counts in steps of {tick_s:g} s at {rate_hz:g} Hz, was rounded; if the rate is exact, give '
            f'`rate_hz` next to the column of time, or {WITHOUT_TIME}',
        )  # fmt: skip
    # The rate must hold as a whole; where samples are lost each row must lie on the grid, elsewhere none may shift.
    lag = _rest(times, index)
    if np.abs(lag).max() > MOST_OFF + MOST_OFF_SHARE * len(index):
        row = int(np.abs(lag).argmax())
        raise ClockFault(
            row, f'the rate changes within a slide: by {rate_hz:g} Hz this row is {abs(lag[row]):.3g} '
            f'samples off, by rows and duration the rate is {_mean_hz(times):.4g} Hz; cut the slides where it changes, '
            f'and give each rate a mapping; {WITHOUT_TIME}',
        )  # fmt: skip
    off = np.abs(lag) if missing.any() else _shifts(lag)
    if off.max(initial=0.0) > OFF_GRID:
        raise ClockFault(
            int(off.argmax()), f'the steps of time are too irregular for a rate of {rate_hz:g} Hz: about this '
            f'row they are {off.max():.2g} samples off the grid, so losses cannot be told from jitter, and by rows and '
            f'duration the rate is {_mean_hz(times):.4g} Hz; {WITHOUT_TIME}',
        )  # fmt: skip
    return index


def _mean_hz(times: Array) -> float:
    return float(len(times) / max(times[-1] - times[0], 1e-9))


def _rest(times: Array, numbers: AnyArray) -> Array:
    """Return by how much numbers are above a line over the time."""
    if len(times) < 3 or not np.ptp(since := times - times[0]) > 0:
        return np.zeros(len(times))
    return np.asarray(numbers - np.polyval(np.polyfit(since, numbers.astype(float), 1), since))


def _shifts(lag: Array) -> Array:
    """Return how far apart the medians of the rows before and behind are, (n,): a loss among late rows is a step."""
    if len(lag) < 2 * NEAR:
        return lag[:0]
    medians = np.median(np.lib.stride_tricks.sliding_window_view(lag, NEAR), axis=1)
    return np.asarray(np.abs(medians[NEAR:] - medians[:-NEAR]))


def _tick_s(times: Array) -> float:
    """Return the step in which times count: 1, 0.1 … s, or as floats of 32 bits 1/2, 1/4 …; 0 below a microsecond."""
    since = times - times[0]
    decimal = next(
        (0.1**n for n in range(7) if np.abs(since * 10**n - np.rint(since * 10**n)).max() < 1e-6 * 10**n), 0.0
    )
    binary = next((0.5**n for n in range(20) if not (np.ldexp(times, n) % 1.0).any()), 0.0)
    return max(decimal, binary)


def with_malformed(times: Array, kept: AnyArray) -> Array:
    """Return times in which malformed rows that stand for a sample, as the step around them shows, have its time."""
    at = np.flatnonzero(np.isfinite(times) & kept)
    if len(at) < 2:
        return times
    rows, count, step = np.arange(len(times)), np.diff(at), np.diff(times[at])
    usual = np.median(step)
    fits = np.abs(step - count * usual) < 0.5 * usual
    between = fits[np.clip(np.searchsorted(at, rows) - 1, 0, len(fits) - 1)]
    return np.where(np.isnan(times) & kept & between, np.interp(rows, at, times[at], np.nan, np.nan), times)
