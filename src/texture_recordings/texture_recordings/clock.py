# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The clock of rows: their rate, and the place of each on a grid of it, or a fault where times contradict."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from texture_core.types import AnyArray, Array

SIGNIFICANT = 4  # digits of an estimated rate: the resolution of time stamps allows no more
ROUND_RATE = 1e-3  # a rate that is so near to one of two digits is taken for that one
GAP = 1.5  # steps of time longer than so many sampling intervals are gaps, whose samples count as lost
CLEAR = 0.25  # intervals between the longest step without a loss and the shortest with one
SAME_TIME = 0.1  # rows nearer than this share of an interval have one time
BURST_RATIO, BURST_DUTY, BURST_SHARE, LONGEST_BURST_S = 5.0, 0.25, 0.2, 1.0
MIN_BURSTS = 4
MODULI = (
    *(2.0**bits / unit for bits in (16, 24, 31, 32) for unit in (1.0, 1e3, 1e6, 1e9)),
    *(86_400.0 * unit for unit in (1.0, 1e3, 1e6, 1e9)),  # times of the day pass midnight
)
SAME_RATE = 1.05  # the rate of another file may differ by this factor
MOST_OFF, MOST_OFF_SHARE = 3.0, 0.003  # samples, and share of those of a slide, by which rows may be off an even grid
MAX_LEFT_OUT = 0.1  # share of the rows
TIMES = '; look at the column of time, its unit and `slides` in the mapping'
WITHOUT_TIME = 'if no sample is lost, give `rate_hz` in place of the column of time'


class ClockFault(ValueError):
    """Times of which no grid can be made: the row at which that is seen, and why."""

    def __init__(self, row: int, reason: str) -> None:
        super().__init__(reason)
        self.row = row


def unwrapped(times: Array) -> Array:
    """Return times of a counter that rolls over at 2^16, 2^24, 2^31 or 2^32 of some unit, or a day, without jumps."""
    steps = np.diff(times)
    back, forward = steps[steps < 0], steps[steps > 0]
    if not len(back) or not len(forward):
        return times
    for modulus in MODULI:
        usual = float(forward[forward < modulus / 2].mean()) if (forward < modulus / 2).any() else math.inf
        far = back[back < -modulus / 2] + modulus
        near = usual * (20.0 if modulus > 1000 * usual else 1.75)
        if times.max() < modulus and times.min() >= 0 and len(far) and (far > 0).all() and (far <= near).all():
            whole = np.asarray(np.unwrap(times, period=modulus))
            # Rows in disorder next to a roll may hide another one.
            return whole if (np.diff(whole) >= 0).all() else times
    return times


def burst_step_s(steps: Array) -> float:
    """Return the step of time that begins a burst of rows that were stamped at once, as of a buffer; 0 without."""
    ordered = np.sort(steps[steps >= 0])
    total = float(ordered.sum())
    if len(ordered) < 2 * MIN_BURSTS or not total > 0:
        return 0.0
    floor = 1e-6 * total / len(ordered)
    ratios = np.maximum(ordered[1:], floor) / np.maximum(ordered[:-1], floor)
    place = int(ratios.argmax()) + 1
    small, large = ordered[:place], ordered[place:]
    if ratios[place - 1] < BURST_RATIO or len(small) < BURST_SHARE * len(ordered) or len(large) < MIN_BURSTS:
        return 0.0
    regular = np.median(large) <= LONGEST_BURST_S and np.quantile(large, 0.75) <= 3.0 * np.quantile(large, 0.25)
    return float(large[0]) if regular and small.sum() < BURST_DUTY * total else 0.0


def estimated_rate_hz(times: Array, burst_s: float) -> float:
    """Return the rate of rows in spite of jitter and gaps, of four digits; NaN without steps of time."""
    starts, counts = _bursts(times, burst_s)
    size, steps = np.median(counts) if burst_s else 1, np.diff(times[starts])
    steps = steps[steps > 0]
    # Without gaps and rows that are there twice.
    usual = steps[(steps < 1.75 * np.median(steps)) & (steps > 0.25 * np.median(steps))] if len(steps) else steps
    if not len(usual):
        return math.nan
    rate_hz = float(size / usual.mean())
    simple = float(f'{rate_hz:.2g}')
    return simple if abs(rate_hz / simple - 1.0) < ROUND_RATE else float(f'{rate_hz:.{SIGNIFICANT}g}')


def _bursts(times: Array, burst_s: float) -> tuple[AnyArray, AnyArray]:
    """Return the first row of each burst and its number of rows."""
    starts = np.flatnonzero(np.concatenate(([True], np.diff(times) >= burst_s)))
    return starts, np.diff(np.append(starts, len(times)))


def on_grid(
    samples: AnyArray, times: Array, rate_hz: float, burst_s: float = 0.0, *, stated: bool = False
) -> tuple[AnyArray, AnyArray, Counter[str]]:
    """Return which rows of a slide are samples, (n,), the place of each on a grid, and counts of what is left out.

    Jitter of the times is that of the host that stamped them, and not of the device that sampled. ClockFault where the
    times contradict the rate, go back, or lack more samples than there are.
    """
    # Rows that are there once more are none; those of a buffer have one time, and may have one value.
    fresh: AnyArray = np.ones(len(times), dtype=bool)
    if not burst_s and (np.diff(times) <= 0).any():
        _, first = np.unique(np.column_stack([times, samples]), axis=0, return_index=True, equal_nan=True)
        fresh = np.isin(np.arange(len(times)), first)
    rows = np.flatnonzero(fresh)
    # Of rows that contradict each other by their times nobody knows which one is wrong.
    behind = times[rows] < np.maximum.accumulate(times[rows])
    ahead = times[rows] > np.minimum.accumulate(times[rows][::-1])[::-1]
    rows, out = rows[~behind & ~ahead], int((behind | ahead).sum())
    left_out = {'repeated rows': int((~fresh).sum()), 'rows out of order': out}
    if out > MAX_LEFT_OUT * len(times) or (out and burst_s):
        row = int(np.argmax(np.diff(times) < 0)) + 1
        bursts = ', which come in bursts,' if burst_s else ''
        raise ClockFault(
            row, f'time goes back from {times[row - 1]:.9g} to {times[row]:.9g} s, and {out} of {len(times)} rows'
            f'{bursts} are out of order; where the file holds several runs, write slides: {{by: pause}}, or cut them '
            f'by a column; a counter is only unwrapped at 2^16, 2^24, 2^31 or 2^32; {WITHOUT_TIME}',
        )  # fmt: skip
    if burst_s:
        rows, index = _burst_places(times, samples, rate_hz, burst_s, stated=stated)
        left_out['rows of incomplete bursts'] = len(times) - len(rows)
    else:
        index = _places(times[rows], rows, rate_hz, out, stated=stated)
    # Of a row or two behind a gap at an end nobody knows whether the gap or their time is wrong.
    apart = np.flatnonzero(np.diff(index) > 1)
    low = max((place + 1 for place in apart[apart < 2]), default=0)
    high = min((place + 1 for place in apart[apart >= len(index) - 3]), default=len(index))
    if high - low < len(index) and high > low:
        left_out['rows alone at the end of a slide'] = len(index) - (high - low)
        rows, index = rows[low:high], index[low:high]
    if len(times) - len(rows) > MAX_LEFT_OUT * len(times):
        raise ClockFault(
            int(rows[0]), f'{len(times) - len(rows)} of {len(times)} rows have the time of another one or come in '
            f'incomplete bursts; filter them (`rows: {{column: value}}`); {WITHOUT_TIME}',
        )  # fmt: skip
    # The grid must agree with the clock as a whole, and everywhere.
    lost, seconds = int(index[-1] - index[0] + 1 - len(index)), float(times[rows[-1]] - times[rows[0]])
    burst_rows = 2.0 * burst_s * rate_hz
    if lost > len(rows) or abs(index[-1] - index[0] - seconds * rate_hz) > MOST_OFF + 0.03 * len(index) + burst_rows:
        raise ClockFault(
            0, f'{len(rows)} rows and {lost} lost samples at {rate_hz:g} Hz take other than the {seconds:.4g} s of '
            f'their times, which are too irregular; by rows and duration the rate is '
            f'{len(rows) / max(seconds, 1e-9):.4g} Hz{TIMES}, or give `rate_hz` in place of the column of time',
        )  # fmt: skip
    off = np.abs(_rest(times[rows], index))
    if off.max(initial=0.0) > MOST_OFF + MOST_OFF_SHARE * len(index) + burst_rows:
        raise ClockFault(
            int(rows[off.argmax()]), f'the rate changes within a slide: by {rate_hz:g} Hz this row is '
            f'{off.max():.3g} samples off; cut the slides where it changes, and give each rate a mapping',
        )  # fmt: skip
    counts = {'samples': len(index), 'lost': lost, **{reason: count for reason, count in left_out.items() if count}}
    return rows, index - index[0], Counter(counts)


def _places(times: Array, rows: AnyArray, rate_hz: float, out: int, *, stated: bool) -> AnyArray:
    """Return the place of each of these rows on the grid, (n,), from which `out` others were left out."""
    steps = np.diff(times) * rate_hz
    unlike = np.flatnonzero(steps < SAME_TIME)
    if len(unlike):
        raise ClockFault(
            int(rows[unlike[0]]), f'{len(unlike)} times come twice with other values: of a coarse clock, or of several '
            'sensors; choose rows (`rows: {column: value}`), or give `rate_hz` in place of the column of time',
        )  # fmt: skip
    # A late row is followed by a short step, an early one comes after one, a loss is not.
    pairs = np.minimum(steps + np.append(steps[1:], np.inf), steps + np.append(np.inf, steps[:-1])[: len(steps)])
    missing = np.where((steps > GAP) & (pairs > 1.0 + GAP), np.rint(steps) - 1, 0).astype(np.int64)
    index = np.concatenate(([0], np.cumsum(1 + missing)))
    # Where the clock counts in steps of about an interval, its rounding looks like losses.
    exact = stated and np.abs(steps - np.rint(steps)).max(initial=0.0) < 0.02
    tick_s = _tick_s(times)
    if missing.sum() > out and tick_s * rate_hz > 0.45 and not exact:
        raise ClockFault(
            0, f'time counts in steps of {tick_s:g} s at {rate_hz:g} Hz, so lost '
            f'samples cannot be told from rounding; give `rate_hz` next to the column of time, or {WITHOUT_TIME}',
        )  # fmt: skip
    # Behind a loss the rows lie on the grid that those before it had; behind some late rows they come back by one.
    lag = _rest(times, index)
    for row in np.flatnonzero(missing).tolist():
        if abs(np.median(lag[row + 1 : row + 6]) - np.median(lag[max(0, row - 4) : row + 1])) > 0.5:
            raise ClockFault(
                int(rows[row + 1]), f'a gap of {steps[row]:.3g} samples at {rate_hz:g} Hz contradicts the times '
                f'around it, so lost samples cannot be told from late rows; by rows and duration the rate is '
                f'{len(times) / max(times[-1] - times[0], 1e-9):.4g} Hz; {WITHOUT_TIME}',
            )  # fmt: skip
    # Losses are those that stand out: whole steps, and longer than any that is none.
    large = missing > 0
    if large.any() and (
        np.abs(steps[large] - np.rint(steps[large])).mean() > 0.2
        or steps[large].min() - steps[~large].max(initial=1.0) < CLEAR + (0.0 if exact else tick_s * rate_hz)
    ):
        raise ClockFault(
            0, f'the steps of time are too irregular for a rate of {rate_hz:g} Hz: losses cannot be told from '
            f'jitter, and by rows and duration it is '
            f'{len(times) / max(times[-1] - times[0], 1e-9):.4g} Hz; give `rate_hz` in place of the column of time',
        )  # fmt: skip
    return index


def _burst_places(
    times: Array, samples: AnyArray, rate_hz: float, burst_s: float, *, stated: bool
) -> tuple[AnyArray, AnyArray]:
    """Return which rows are in whole bursts, and the place of each on the grid, (n,) each."""
    starts, counts = _bursts(times, burst_s)
    inside = np.diff(times) < burst_s
    if np.all(samples[1:] == samples[:-1], axis=1)[inside].mean() > 0.5 and np.any(samples != samples[0]):
        raise ClockFault(1, 'most rows are there twice, with one time and the same values; save each row once')
    # Nobody knows which row a burst of another size lacks; a slide may begin and end within one.
    size = int(np.median(counts))
    if (counts[1:-1] != size).any() or size not in counts:
        raise ClockFault(
            0, f'rows come in bursts of {counts.min()} to {counts.max()}, so lost rows cannot be told; by rows and '
            f'duration the rate is {len(times) / max(times[-1] - times[0], 1e-9):.4g} Hz; {WITHOUT_TIME}',
        )  # fmt: skip
    whole = counts == size
    index = _places(times[starts[whole]], starts[whole], rate_hz / size, 0, stated=stated)
    rows = np.add.outer(starts[whole], np.arange(size)).ravel()
    return rows, np.add.outer(size * index, np.arange(size)).ravel()


def _rest(times: Array, numbers: AnyArray) -> Array:
    """Return by how much numbers are above a line over the time."""
    since = times - times[0]
    if len(times) < 3 or not np.ptp(since) > 0:
        return np.zeros(len(times))
    return np.asarray(numbers - np.polyval(np.polyfit(since, numbers.astype(float), 1), since))


def _tick_s(times: Array) -> float:
    """Return the step in which times count: 1, 0.1 … s, or as floats of 32 bits 1/2, 1/4 …; 0 below a microsecond."""
    since = times - times[0]
    decimal = next(
        (0.1**n for n in range(7) if np.abs(since * 10**n - np.rint(since * 10**n)).max() < 1e-6 * 10**n), 0.0
    )
    binary = next((0.5**n for n in range(20) if not (np.ldexp(times, n) % 1.0).any()), 0.0)
    return max(decimal, binary)


def with_places(times: Array, kept: AnyArray) -> Array:
    """Return times in which malformed rows that stand for a sample, as the step around them shows, have its time."""
    known = np.flatnonzero(np.isfinite(times))
    steps = np.diff(times[kept & np.isfinite(times)])
    usual = float(np.median(steps)) if len(steps) else 0.0
    gaps = np.flatnonzero(kept & np.isnan(times))
    gaps = gaps[(gaps > known[0]) & (gaps < known[-1])] if usual > 0 else gaps[:0]
    after = np.searchsorted(known, gaps)
    count, step = np.diff(known)[after - 1], np.diff(times[known])[after - 1]
    one = np.abs(step / usual - count) < 0.5 if usual > 0 else gaps > 0
    filled = times.copy()
    filled[gaps[one]] = (times[known[after - 1]] + step * (gaps - known[after - 1]) / count)[one]
    return filled
