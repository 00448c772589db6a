# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The clock of rows: their rate, and the place of each on a grid of it, or a fault where times contradict."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence

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
SAME_RATE = 1.05  # the rate of a quarter of a slide, or of another file, may differ by this factor
RESET_ROWS = 5  # times that stay behind for longer are those of another run
MAX_LEFT_OUT = 0.1  # share of the rows
WIDEST = 1.2  # rows within which the number of rows follows the time, where bursts have several sizes
FEW = 12  # random losses that look like those of a coarse clock once in 100 000 times
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
            return np.asarray(np.unwrap(times, period=modulus))
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


def estimated_rate_hz(slides: Sequence[Array], burst_s: float) -> float:
    """Return the rate of the rows of slides in spite of jitter and gaps, of four digits; NaN without steps of time."""
    found = [_bursts(times, burst_s)[1:] for times in slides if len(times)]
    counts, steps = (
        np.concatenate(one) for one in zip(*((counts[:-1], steps) for counts, steps in found), strict=True)
    )
    counts, steps = counts[steps > 0], steps[steps > 0]
    if not len(steps):
        return math.nan
    usual = np.ones(len(steps), dtype=bool)
    if not burst_s:
        usual = (steps < 1.75 * np.median(steps)) & (steps > 0.25 * np.median(steps))  # without gaps and repeated rows
    elif _one_size(counts):
        usual = steps < 1.75 * np.median(steps)
        counts = np.full(len(counts), np.median(counts))
    if not usual.any():
        return math.nan
    rate_hz = float(counts[usual].sum() / steps[usual].sum())
    simple = float(f'{rate_hz:.2g}')
    return simple if abs(rate_hz / simple - 1.0) < ROUND_RATE else float(f'{rate_hz:.{SIGNIFICANT}g}')


def _bursts(times: Array, burst_s: float) -> tuple[AnyArray, AnyArray, Array]:
    """Return the first row of each burst, its number of rows, and the steps of time between bursts."""
    starts = np.flatnonzero(np.concatenate(([True], np.diff(times) >= burst_s)))
    return starts, np.diff(np.append(starts, len(times))), np.diff(times[starts])


def on_grid(
    samples: AnyArray, times: Array, rate_hz: float, burst_s: float = 0.0, *, stated: bool = False
) -> tuple[AnyArray, AnyArray, Counter[str]]:
    """Return which rows of a slide are samples, (n,), the place of each on a grid, and counts of what is left out.

    Jitter of the times is that of the host that stamped them, and not of the device that sampled. ClockFault where the
    times contradict the rate, go back, or lack more samples than there are.
    """
    kept = _in_order(times, samples)
    out = int((~kept).sum())
    counts = Counter({'rows out of order': out} if out else {})
    if out and burst_s:
        raise ClockFault(
            int(np.argmax(~kept)), f'rows come in bursts, and {out} of them are out of order by their times, so the '
            f'order within a burst is not known either; correct these rows, or {WITHOUT_TIME}',
        )  # fmt: skip
    longest = max((edge.stop - edge.start for edge in runs(~kept)), default=0)
    if out > MAX_LEFT_OUT * len(times) or longest > RESET_ROWS:
        row = int(np.argmax(np.diff(times) < 0)) + 1
        raise ClockFault(
            row, f'time goes back from {times[row - 1]:.9g} to {times[row]:.9g} s, and {out} of {len(times)} rows are '
            'out of order; where the file holds several runs, write slides: {by: pause}, or cut them by a column; a '
            'counter is only unwrapped at 2^16, 2^24, 2^31 or 2^32',
        )  # fmt: skip
    rows = np.flatnonzero(kept)
    if burst_s:
        index, dropped = _burst_places(times[rows], samples[rows], rate_hz, burst_s, stated=stated)
        reason = 'rows of incomplete bursts'
    else:
        index, dropped = _places(times[rows], samples[rows], rate_hz, out, stated=stated)
        reason = 'repeated rows'
    counts |= {reason: int(dropped.sum())} if dropped.any() else {}
    rows, index = rows[~dropped], index[~dropped]
    # Of a row or two behind a gap at an end nobody knows whether the gap or their time is wrong.
    apart = np.flatnonzero(np.diff(index) > 1)
    low = max((place + 1 for place in apart[apart < 2]), default=0)
    high = min((place + 1 for place in apart[apart >= len(index) - 3]), default=len(index))
    if high - low < len(index) and high > low:
        counts['rows alone at the end of a slide'] = len(index) - (high - low)
        rows, index = rows[low:high], index[low:high]
    left_out = len(times) - len(rows)
    if left_out > MAX_LEFT_OUT * len(times):
        row = int(np.argmax(dropped))
        raise ClockFault(
            row, f'{left_out} of {len(times)} rows have the time of another one or come in incomplete bursts; filter '
            f'them (`rows: {{column: value}}`); {WITHOUT_TIME}',
        )  # fmt: skip
    # The grid must agree with the clock as a whole.
    lost = int(index[-1] - index[0] + 1 - len(index)) if len(index) else 0
    seconds = float(times[rows[-1]] - times[rows[0]]) if len(rows) else 0.0
    if lost > len(rows):
        row = rows[1 + int(np.argmax(np.diff(index)))]
        raise ClockFault(
            row, f'by the usual step the rate is {rate_hz:g} Hz and {lost} samples are lost next to {len(rows)} rows, '
            f'by rows and duration it is {len(rows) / max(seconds, 1e-9):.4g} Hz{TIMES}, or give `rate_hz` in place '
            'of the column of time',
        )  # fmt: skip
    if len(index) and abs((index[-1] - index[0]) - seconds * rate_hz) > 3.0 + 0.03 * (index[-1] - index[0]) + (
        2.0 * burst_s * rate_hz if burst_s else 0.0
    ):
        raise ClockFault(
            0, f'{len(rows)} rows and {lost} lost samples at {rate_hz:g} Hz take other than the {seconds:.4g} s of '
            f'their times, which are too irregular{TIMES}, or give `rate_hz` in place of the column of time',
        )  # fmt: skip
    _check_steady(times[rows], index, rate_hz, burst_s)
    counts |= {'samples': len(index), 'lost': lost}
    return rows, index - (index[0] if len(index) else 0), counts


def _check_steady(times: Array, index: AnyArray, rate_hz: float, burst_s: float) -> None:
    """Refuse a slide in which the rate changes, so that rows would be placed at other times than their own."""
    quarter = len(index) // 4
    if quarter < 2 * MIN_BURSTS:
        return
    for first in range(0, 4 * quarter, quarter):
        part = slice(first, first + quarter)
        since = times[part] - times[first]
        if since[-1] <= 0:
            continue
        found_hz = float(np.polyfit(since, index[part].astype(float), 1)[0])
        samples = abs(found_hz - rate_hz) * since[-1]
        if not 1 / SAME_RATE <= found_hz / rate_hz <= SAME_RATE and samples > 3.0 + 2.0 * burst_s * rate_hz:
            raise ClockFault(
                first, f'the rate changes within a slide: {found_hz:.4g} Hz from here, {rate_hz:g} Hz over all; cut '
                'the slides where it changes, and give each rate a mapping',
            )  # fmt: skip


def _in_order(times: Array, samples: AnyArray) -> AnyArray:
    """Return the rows, as a mask, of the longest sequence in which times do not go back."""
    kept = np.ones(len(times), dtype=bool)
    if not (np.diff(times) < 0).any():
        return kept
    ends: list[float] = []  # by length, the least time at which a sequence of it ends, and its row
    rows: list[int] = []
    previous = []
    for row, time_s in enumerate(times.tolist()):
        length = bisect_right(ends, time_s)
        previous.append(rows[length - 1] if length else -1)
        ends[length : length + 1], rows[length : length + 1] = [time_s], [row]
    kept[:] = False
    row = rows[-1]
    while row >= 0:
        kept[row] = True
        row = previous[row]
    # Of two rows that only contradict each other nobody knows which one is wrong.
    for row in np.flatnonzero(~kept).tolist():
        near = slice(max(0, row - 1000), row + 1001)
        same = kept[near] & (times[near] == times[row])
        if (samples[near][same] == samples[row]).all(axis=1).any():
            continue  # a row that is there twice
        earlier = np.arange(near.start, near.start + len(times[near])) < row
        partners = np.flatnonzero(kept[near] & np.where(earlier, times[near] > times[row], times[near] < times[row]))
        if len(partners) == 1:
            kept[near.start + partners[0]] = False
    return kept


def runs(mask: AnyArray) -> list[slice]:
    """Return the stretches of a mask that are true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return [slice(*edge) for edge in edges.reshape(-1, 2).tolist()]


def _places(times: Array, samples: AnyArray, rate_hz: float, out: int, *, stated: bool) -> tuple[AnyArray, AnyArray]:
    """Return the place of each row on the grid, and which rows are dropped as there twice, (n,) each."""
    tick_s, times, dropped = _tick_s(times), times.copy(), np.zeros(len(times), dtype=bool)
    unlike: list[int] = []
    steps = np.diff(times) * rate_hz
    for row in np.flatnonzero(steps < SAME_TIME).tolist():
        if np.array_equal(samples[row], samples[row + 1], equal_nan=True):
            dropped[row + 1] = True  # written twice
        elif row + 1 < len(steps) and GAP <= steps[row + 1] < 2.0 + GAP:
            times[row + 1] += 0.5 * (times[row + 2] - times[row + 1])  # of a coarse clock
        else:
            dropped[[row, row + 1]] = True  # nobody knows which one is it
            unlike.append(row)
    if len(unlike) > max(2, 0.01 * len(times)):
        raise ClockFault(
            unlike[0], f'{len(unlike)} times come twice with other values: of a coarse clock, or of several sensors; '
            'choose rows (`rows: {column: value}`), or give `rate_hz` in place of the column of time',
        )  # fmt: skip
    kept = np.flatnonzero(~dropped)
    steps = np.diff(times[kept]) * rate_hz
    # A late row is followed by a short step, an early one comes after one, a loss is not.
    pairs = np.minimum(steps + np.append(steps[1:], np.inf), steps + np.append(np.inf, steps[:-1])[: len(steps)])
    missing = np.where((steps > GAP) & (pairs > 1.0 + GAP), np.rint(steps) - 1, 0).astype(np.int64)
    index = np.zeros(len(times), dtype=np.int64)
    index[kept] = np.concatenate(([0], np.cumsum(1 + np.maximum(missing, 0))))[: len(kept)]
    # Where the clock counts in steps of about an interval, its rounding looks like losses.
    exact = stated and np.abs(steps - np.rint(steps)).max(initial=0.0) < 0.02
    if missing.sum() + len(times) - len(kept) > out and tick_s * rate_hz > 0.45 and not exact:
        raise ClockFault(
            0, f'time counts in steps of {tick_s:g} s at {rate_hz:g} Hz, so lost '
            f'samples cannot be told from rounding; give `rate_hz` next to the column of time, or {WITHOUT_TIME}',
        )  # fmt: skip
    # Behind a loss the rows lie on the grid that those before it had; behind some late rows they come back by one.
    lag = _rest(times[kept], index[kept])
    for row in np.flatnonzero(missing > 0).tolist():
        if abs(np.median(lag[row + 1 : row + 6]) - np.median(lag[max(0, row - 4) : row + 1])) > 0.5:
            raise ClockFault(
                int(kept[row + 1]), f'a gap of {steps[row]:.3g} samples at {rate_hz:g} Hz contradicts the times '
                f'around it, so lost samples cannot be told from late rows; by rows and duration the rate is '
                f'{len(times) / max(times[-1] - times[0], 1e-9):.4g} Hz; {WITHOUT_TIME}',
            )  # fmt: skip
    # Losses are those that stand out: whole steps, and longer than any that is none.
    large = missing > 0
    uneven = np.abs(steps[large] - np.rint(steps[large])).mean() > 0.2 if large.sum() > 0.1 * len(steps) else False
    kinds = np.unique(steps[~large].round(6))
    coarse = float(np.diff(kinds).min()) if 1 < len(kinds) < 12 else 0.0  # resolution of the clock
    if uneven or (large.any() and steps[large].min() - steps[~large].max(initial=1.0) < CLEAR + coarse):
        raise ClockFault(
            0, f'the steps of time are too irregular for a rate of {rate_hz:g} Hz: losses cannot be told from '
            f'jitter, and by rows and duration it is '
            f'{len(times) / max(times[-1] - times[0], 1e-9):.4g} Hz; give `rate_hz` in place of the column of time',
        )  # fmt: skip
    return index, dropped


def _burst_places(
    times: Array, samples: AnyArray, rate_hz: float, burst_s: float, *, stated: bool
) -> tuple[AnyArray, AnyArray]:
    """Return the place of each row on the grid, and which rows of incomplete bursts are dropped, (n,) each."""
    starts, counts, periods = _bursts(times, burst_s)
    burst = np.repeat(np.arange(len(starts)), counts)
    within = np.arange(len(times)) - starts[burst]
    inside = np.diff(burst) == 0
    twins = inside & np.all((samples[1:] == samples[:-1]) | np.isnan(samples[1:] + samples[:-1]), axis=1)
    if twins.sum() > 0.5 * inside.sum() and np.any(samples != samples[0]):
        raise ClockFault(1, 'most rows are there twice, with one time and the same values; save each row once')
    size, period_s = int(np.median(counts)), float(np.median(periods)) if len(periods) else math.inf
    sure = stated and abs(rate_hz * period_s - size) < 0.01 * size
    if not _one_size(counts) or not (sure or (counts[1:-1] == size).all()):
        return _uneven_bursts(times, starts, counts, bool(twins.any()))
    # Nobody knows which row a burst of another size lacks or has twice, so it is left out as a whole. Where there are
    # such ones, two equal rows may be one that is there twice in place of one that was lost.
    whole = counts == size
    if not whole[1:-1].all():
        whole[burst[:-1][twins]] = False
    # The number of a burst must follow the time, or a stamp is wrong.
    number = np.concatenate(([0], np.cumsum(np.maximum(1, np.rint(periods / period_s))))).astype(np.int64)
    rest = _rest(times[starts], number)
    rounded = number[-1] >= len(starts) and _tick_s(times) > 0.45 * period_s  # which looks like lost bursts
    if rounded or np.abs(rest).max() > 0.4:
        raise ClockFault(
            int(starts[np.abs(rest).argmax()]), f'rows come in bursts of {size} every {period_s:.4g} s, and '
            f'the time of one contradicts the others, so rows cannot be placed; {WITHOUT_TIME}',
        )  # fmt: skip
    return number[burst] * size + within, ~whole[burst]


def _one_size(counts: AnyArray) -> bool:
    """Return whether bursts are those of a buffer that was read when it was full, but for rows lost or there twice."""
    whole = counts[1:-1] == np.median(counts)
    return bool(whole.mean() > 0.8) if len(whole) else True


def _rest(times: Array, numbers: AnyArray) -> Array:
    """Return by how much numbers are above a line over the time."""
    if len(times) < 3:
        return np.zeros(len(times))
    since = times - times[0]
    return np.asarray(numbers - np.polyval(np.polyfit(since, numbers.astype(float), 1), since))


def _tick_s(times: Array) -> float:
    """Return the step in which times count: 1, 0.1 … s, or as floats of 32 bits 1/2, 1/4 …; 0 below a microsecond."""
    since = times - times[0]
    decimal = next(
        (0.1**n for n in range(7) if np.abs(since * 10**n - np.rint(since * 10**n)).max() < 1e-6 * 10**n), 0.0
    )
    binary = next((0.5**n for n in range(20) if not (np.ldexp(times, n) % 1.0).any()), 0.0)
    return max(decimal, binary)


def _uneven_bursts(times: Array, starts: AnyArray, counts: AnyArray, twins: bool) -> tuple[AnyArray, AnyArray]:
    """Return the place of each row of bursts as a coarse clock or a buffer read at any time gives them.

    If none is lost, the number of rows follows the time within one row. That tells a lost row only where the rest of
    the bursts before and behind it would not be within one row, too.
    """
    rest = _rest(times[starts[1:]], starts[1:])  # a slide may begin within a burst
    low, high = np.minimum.accumulate(rest)[:-1], np.maximum.accumulate(rest)[:-1]
    low_after, high_after = (
        np.minimum.accumulate(rest[::-1])[::-1][1:], np.maximum.accumulate(rest[::-1])[::-1][1:],
    )  # fmt: skip
    told = (np.maximum(high, high_after + 1) - np.minimum(low, low_after + 1) > WIDEST) & (
        np.maximum(high, high_after - 1) - np.minimum(low, low_after - 1) > WIDEST
    )
    sure = np.flatnonzero(told)
    few = (counts[1:-1] < counts.max()).sum() < FEW  # which may be lost rows of bursts of one size
    if few or twins or np.ptp(rest) > WIDEST or not len(sure) or np.diff(sure).max(initial=1) > 1:
        raise ClockFault(
            0, f'rows come in bursts of {counts.min()} to {counts.max()}, so lost rows cannot be told; by rows and '
            f'duration the rate is {len(times) / max(times[-1] - times[0], 1e-9):.4g} Hz; {WITHOUT_TIME}, and if a '
            'buffer always holds as many rows, give `rate_hz` next to it',
        )  # fmt: skip
    dropped = np.ones(len(times), dtype=bool)
    dropped[starts[1 + sure[0]] : starts[2 + sure[-1]] + 1] = False
    return np.arange(len(times)), dropped


def with_places(times: Array, kept: AnyArray) -> Array:
    """Return times in which malformed rows that stand for a sample, as the step around them shows, have its time."""
    times = times.copy()
    steps = np.diff(times[kept & np.isfinite(times)])
    usual = float(np.median(steps)) if len(steps) else math.nan
    for run in runs(kept & np.isnan(times)):
        before, after = run.start - 1, run.stop
        if before >= 0 and after < len(times):
            step = (times[after] - times[before]) / (after - before)
            if abs((step / usual - 1.0) * (after - before)) < 0.5:
                times[run] = times[before] + step * np.arange(1, after - before)
    return times
