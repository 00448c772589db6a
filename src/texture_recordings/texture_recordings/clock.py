# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The clock of rows: their rate, and the place of each on an even grid, or a fault where times contradict it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

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
BURST_DUTY, MIN_BURSTS, LONGEST_BURST_S = 0.1, 4, 1.0
# Counters of 16 to 32 bits, and times of the day, s. In a shorter period, losses and slower rates would be unseen.
PERIODS = (*(2.0**bits * unit for bits in (16, 24, 31, 32) for unit in (1e-9, 1e-6, 1e-3, 1.0)), 86_400.0)
SHORTEST_PERIOD_S = 1.0
MINUTE_AND_HOUR = (60.0, 3600.0)
SAME_RATE = 1.05  # the rate of another file may differ by this factor
IN_DISORDER = 2  # consecutive rows at most
MAX_LEFT_OUT = 0.1  # share of the rows
WITHOUT_TIME = 'if no sample is lost, give `rate_hz` in place of the column of time'


class ClockFault(ValueError):
    """Times of which no grid can be made: the row at which that is seen, and why."""

    def __init__(self, row: int, reason: str) -> None:
        super().__init__(reason)
        self.row = row


def _period_s(times: Array, periods: Sequence[float]) -> float:
    """Return the period of a clock that rolls over, s; 0 if its steps back are none of a roll."""
    steps = np.diff(times)
    back, forward = steps[steps < 0], steps[steps > 0]
    if not len(back) or not len(forward):
        return 0.0
    for period in periods:
        after = back + period
        usual = forward[forward < period / 2].mean() if (forward < period / 2).any() else 0.0
        near = max(1.75 * usual, min(20.0 * usual, period / 50.0))
        if times.min() >= 0 and times.max() < period and (after > 0).all() and (after <= near).all():
            return period
    return 0.0


def forward(times: Array, *, runs: bool) -> Array:
    """Return times of a counter or of the day without its rolls; ClockFault where these hide losses, or may be runs."""
    period_s = _period_s(times, (*PERIODS, *(MINUTE_AND_HOUR if runs else ())))
    if period_s and (runs or period_s < SHORTEST_PERIOD_S):
        hidden = f'lost samples and a slower rate cannot be seen; {WITHOUT_TIME}'
        other = 'a run that is another slide looks alike; cut the slides by a column, or save times that grow'
        raise ClockFault(
            int(np.argmax(np.diff(times) < 0)) + 1,
            f'the clock rolls over every {period_s:.3g} s, in which {other if runs else hidden}',
        )
    return np.asarray(np.unwrap(times, period=period_s)) if period_s else times


def _burst_step_s(steps: Array) -> float:
    """Return the least step between bursts of rows that a buffer stamped at once; 0 where steps are not bimodal."""
    steps = steps[steps >= 0]
    large = steps[steps > steps.mean()] if len(steps) else steps
    if not MIN_BURSTS <= len(large) <= 0.6 * len(steps):
        return 0.0
    regular = np.median(large) <= LONGEST_BURST_S and np.quantile(large, 0.75) <= 3.0 * np.quantile(large, 0.25)
    within = 1.0 - large.sum() / steps.sum()
    return float(large.min()) if regular and within < BURST_DUTY else 0.0


def estimated(steps: Array) -> tuple[float, float]:
    """Return the rate of rows in spite of jitter and gaps, of four digits, and the least step between bursts, s.

    Both are 0 without such.
    """
    burst_s, size = _burst_step_s(steps), 1.0
    if burst_s:  # the steps from burst to burst
        ends = np.flatnonzero(steps >= burst_s)
        size = float(np.median(np.diff(ends)))
        steps = np.diff(np.cumsum(steps)[ends])
    steps = steps[steps > 0]
    # Without gaps and rows that are there twice.
    usual = steps[(steps < 1.75 * np.median(steps)) & (steps > 0.25 * np.median(steps))] if len(steps) else steps
    if not len(usual):
        return 0.0, burst_s
    rate_hz = float(size / usual.mean())
    simple = float(f'{rate_hz:.2g}')
    near = abs(rate_hz / simple - 1.0) < ROUND_RATE
    return simple if near else float(f'{rate_hz:.{SIGNIFICANT}g}'), burst_s


def disorder(times: Array) -> tuple[AnyArray, AnyArray]:
    """Return which rows, (n,), have a time before that of an earlier one, and which after that of a later one."""
    return times < np.maximum.accumulate(times), times > np.minimum.accumulate(times[::-1])[::-1]


def jumps_back(behind: AnyArray, ahead: AnyArray) -> AnyArray:
    """Return the rows, (n,), at which another run begins within the times of the one before; see `disorder`.

    More than two rows are behind the newest there, and as many ahead of them: fewer are rows out of order.
    """
    starts = np.flatnonzero(behind & ~np.append(False, behind[:-1]))
    return np.array([row for row in starts.tolist() if row > IN_DISORDER and ahead[row - IN_DISORDER - 1 : row].all()
                     and behind[row : row + IN_DISORDER + 1].sum() > IN_DISORDER], dtype=np.intp)  # fmt: skip


def once(times: Array, samples: AnyArray) -> AnyArray:
    """Return the rows, (n,), without those that are there once more."""
    _, first = np.unique(np.column_stack([times, samples]), axis=0, return_index=True, equal_nan=True)
    return np.sort(first)


def on_grid(
    samples: AnyArray, times: Array, rate_hz: float, burst_s: float = 0.0, *, stated: bool = False
) -> tuple[AnyArray, AnyArray, Counter[str]]:
    """Return which rows of a slide are samples, (n,), the place of each on a grid, and counts of what is left out.

    ClockFault where times contradict the rate, go back, or lack more samples than there are.
    """
    count, steps = len(times), np.diff(times)
    left: Counter[str] = Counter()
    rows: AnyArray = np.arange(count)
    # Rows that are there once more are none; those of a buffer have one time, and may have one value.
    if not burst_s and (steps <= 0).any():
        rows = once(times, samples)
        left['repeated rows'] = count - len(rows)
    # Of rows that contradict each other by their times nobody knows which one is wrong.
    behind, ahead = disorder(times[rows])
    out, jumps = int((behind | ahead).sum()), jumps_back(behind, ahead)
    left['rows out of order'] = out
    row = int(rows[jumps[0]]) if len(jumps) else int(np.argmax(steps < 0)) + 1
    rows = rows[~behind & ~ahead]
    if out > MAX_LEFT_OUT * count or (out and burst_s) or len(jumps):
        bursts = ', which come in bursts,' if burst_s else ''
        raise ClockFault(
            row, f'time goes back from {times[row - 1]:.9g} to {times[row]:.9g} s, and {out} of {count} rows{bursts} '
            'are out of order; where the file holds several runs, write slides: {by: pause}, or cut them by a column; '
            f'a counter is only unwrapped at 2^16, 2^24, 2^31 or 2^32; {WITHOUT_TIME}',
        )  # fmt: skip
    if burst_s:
        rows = index = _in_bursts(times, samples, burst_s)
        left['rows of incomplete bursts'] = count - len(rows)
    else:
        index = _places(times[rows], rows, rate_hz, out, stated=stated)
    # Of a row or two behind a gap at an end nobody knows whether the gap or their time is wrong.
    gaps = np.flatnonzero(np.diff(index) > 1)
    low = max((gap + 1 for gap in gaps if gap < 2), default=0)
    high = min((gap + 1 for gap in gaps if gap >= len(index) - 3), default=len(index))
    if low < high:
        left['rows alone at the end of a slide'] = len(index) - (high - low)
        rows, index = rows[low:high], index[low:high]
    if count - len(rows) > MAX_LEFT_OUT * count:
        raise ClockFault(
            0, f'{count - len(rows)} of {count} rows have the time of another one or come in incomplete bursts; filter '
            f'them (`rows: {{column: value}}`); {WITHOUT_TIME}',
        )  # fmt: skip
    lost = int(index[-1] - index[0] + 1 - len(index))
    if lost > len(rows):
        raise ClockFault(
            0, f'{len(rows)} rows and {lost} lost samples at {rate_hz:g} Hz: more are lost than there are; by rows and '
            f'duration the rate is {_mean_hz(times[rows]):.4g} Hz; look at the column of time and its unit; '
            f'{WITHOUT_TIME}',
        )  # fmt: skip
    return rows, index - index[0], Counter({'samples': len(index), 'lost': lost}) + left


def _places(times: Array, rows: AnyArray, rate_hz: float, out: int, *, stated: bool) -> AnyArray:
    """Return the place of each of these rows on the grid, (n,), from which `out` others were left out."""
    steps = np.diff(times) * rate_hz
    unlike = np.flatnonzero(steps < SAME_TIME)
    if len(unlike):
        raise ClockFault(
            int(rows[unlike[0]]), f'{len(unlike)} times come twice with other values: of a coarse clock, or of several '
            f'sensors; choose rows (`rows: {{column: value}}`); {WITHOUT_TIME}',
        )  # fmt: skip
    # A late row is followed by a short step, an early one comes after one, a loss is not.
    pairs = np.minimum(steps + np.append(steps[1:], np.inf), steps + np.append(np.inf, steps[:-1])[: len(steps)])
    missing = np.where((steps > GAP) & (pairs > 1.0 + GAP), np.rint(steps) - 1, 0).astype(np.int64)
    index = np.concatenate(([0], np.cumsum(1 + missing)))
    # Where the clock counts in steps of about an interval, its rounding looks like losses.
    tick_s = _tick_s(times)
    exact = stated and np.abs(steps - np.rint(steps)).max(initial=0.0) < 0.02
    if missing.sum() > out and tick_s * rate_hz > COARSE and not exact:
        raise ClockFault(
            0, f'time counts in steps of {tick_s:g} s at {rate_hz:g} Hz, so lost samples cannot be told from rounding; '
            f'give `rate_hz` next to the column of time, or {WITHOUT_TIME}',
        )  # fmt: skip
    # The rate must hold as a whole; where samples are lost each row must lie on the grid, elsewhere none may shift.
    lag = _rest(times, index)
    if np.abs(lag).max() > MOST_OFF + MOST_OFF_SHARE * len(index):
        row = int(np.abs(lag).argmax())
        raise ClockFault(
            int(rows[row]), f'the rate changes within a slide: by {rate_hz:g} Hz this row is {abs(lag[row]):.3g} '
            f'samples off, by rows and duration the rate is {_mean_hz(times):.4g} Hz; cut the slides where it changes, '
            f'and give each rate a mapping; {WITHOUT_TIME}',
        )  # fmt: skip
    off = np.abs(lag) if missing.any() else _shifts(lag)
    if off.max(initial=0.0) > OFF_GRID:
        raise ClockFault(
            int(rows[off.argmax()]), f'the steps of time are too irregular for a rate of {rate_hz:g} Hz: about this '
            f'row they are {off.max():.2g} samples off the grid, so losses cannot be told from jitter, and by rows and '
            f'duration the rate is {_mean_hz(times):.4g} Hz; {WITHOUT_TIME}',
        )  # fmt: skip
    return index


def _in_bursts(times: Array, samples: AnyArray, burst_s: float) -> AnyArray:
    """Return the rows of whole bursts, (n,): of one size and an even distance, one comes after the other."""
    inside = np.diff(times) < burst_s
    starts = np.flatnonzero(np.append(True, ~inside))
    counts = np.diff(np.append(starts, len(times)))
    if np.all(samples[1:] == samples[:-1], axis=1)[inside].mean() > 0.5 and np.any(samples != samples[0]):
        raise ClockFault(1, 'most rows are there twice, with one time and the same values; save each row once')
    # Nobody knows which row a burst of another size lacks; a slide may begin and end within one.
    size, steps = int(np.median(counts)), np.diff(times[starts[1:]])
    if (counts[1:-1] != size).any() or (len(steps) and steps.max() > GAP * np.median(steps)):
        raise ClockFault(
            0, f'rows come in bursts of {counts.min()} to {counts.max()}, every {steps.min():.3g} to {steps.max():.3g} '
            f's, so lost rows cannot be told; by rows and duration the rate is {_mean_hz(times):.4g} Hz; '
            f'{WITHOUT_TIME}',
        )  # fmt: skip
    return np.flatnonzero(np.repeat(counts == size, counts))


def _mean_hz(times: Array) -> float:
    return float(len(times) / max(times[-1] - times[0], 1e-9))


def _rest(times: Array, numbers: AnyArray) -> Array:
    """Return by how much numbers are above a line over the time."""
    since = times - times[0]
    if len(times) < 3 or not np.ptp(since) > 0:
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
    filled = np.interp(rows, at, times[at], np.nan, np.nan)
    return np.where(np.isnan(times) & kept & between, filled, times)
