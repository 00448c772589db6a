# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The host time and the running index of each sample, whatever the device reports of either."""

from __future__ import annotations

import copy
import enum
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from texture_core.types import NANOSECONDS, Array

# --------------------
# Transport delay of samples of a device, against its clock.

SLEW_RATE = 0.02  # largest correction per time


@dataclass
class DelayModel:
    """Delay of the stream's clock against the host's: offset + drift · elapsed, and a residual that is slewed to 0."""

    start_ns: float = 0.0
    offset_ns: float = 0.0
    drift: float = 0.0
    residual_ns: float = 0.0  # at since_ns

    def trend_ns(self, elapsed_ns: float) -> float:
        """Return the linear part of the delay, without the residual."""
        return self.offset_ns + self.drift * elapsed_ns

    def delay_ns_at(self, elapsed_ns: float) -> float:
        """Return the delay with the remaining residual, which shrinks by SLEW_RATE per time."""
        remaining = max(0.0, abs(self.residual_ns) - SLEW_RATE * max(0.0, elapsed_ns - self.start_ns))
        return self.trend_ns(elapsed_ns) + math.copysign(remaining, self.residual_ns)


# --------------------
# Host time of the samples of a stream, free of the jitter with which they arrive and of the drift of its clock.

PPM = 1e6
SLOW_CLOCK = 'device clock slow by [ppm]'  # name of the drift among the details of a sensor
BINS = 64
FIRST_BIN_NS = 20e6
SETTLE_NS = 0.1 * NANOSECONDS  # so long arrivals are watched before a clock is settled and may be read
MEMORY_NS = 60.0 * NANOSECONDS  # so long arrivals count; over this time the drift is taken as constant
DRIFT_AFTER_NS = 2.0 * NANOSECONDS  # so long arrivals are observed before a drift is estimated
STEP_NS = 0.5 * NANOSECONDS  # a deviation above this is a step of the host's clock


class Arrival(NamedTuple):
    """When a sample was taken by its index and the nominal rate, and how much later than that it was there, ns."""

    elapsed_ns: float
    delay_ns: float


class StreamClock:
    """Tie the running index of a stream of constant rate to the host's clock.

    A sample arrives late by a varying delay but never early, so the truth is a line just below all arrivals. Of each
    bin of time the least late arrival is kept; the line is that edge of their lower convex hull which lies below their
    middle, the one with the least mean distance to them. Its slope is the drift of the device's clock against the
    host's. The answers bend towards that line and never jump, unless the host's clock did: stamps are contiguous and
    in order. An arrival costs constant time on average, and the memory is constant.

    Parameters
    ----------
    rate_hz
        Nominal rate of the stream.
    max_drift
        Largest drift accepted; the internal oscillator of a microcontroller on USB is right to 0.25 %.

    Source: the line below the hull, Moon, Skelly & Towsley 1999, "Estimation and removal of clock skew".
    """

    def __init__(self, rate_hz: float, *, max_drift: float = 5e-3) -> None:
        self.steps = 0
        self._period_ns = NANOSECONDS / rate_hz
        self._max_drift = max_drift
        self._drift = 0.0
        self.restart()

    def restart(self) -> None:
        """Reset for a new stream, with another index and another delay. The drift is kept."""
        self.settled = False
        self._origin: tuple[int, int] | None = None  # index and host time of the first arrival
        self._bins: deque[Arrival] = deque()  # the least late of each bin; the last bin is still open
        self._width_ns = FIRST_BIN_NS
        self._last_index = 0
        self._late_since_ns: int | None = None
        self._before = self._now = DelayModel(drift=self._drift)

    def skip(self, samples: int) -> None:
        """Shift the indices of the samples of this stream by this many; their times stay."""
        if self._origin is not None:
            first_index, first_ns = self._origin
            self._origin = first_index + samples, first_ns
            self._last_index += samples

    @property
    def drift(self) -> float:
        """How much longer than nominal a sample takes: 50e-6 is a device whose clock is slow by 50 ppm."""
        return self._drift

    def observe(self, index: int, arrival_ns: int) -> None:
        """Take note that sample `index` was there at `arrival_ns`."""
        if self._origin is None:
            self._origin = (index, arrival_ns)
        arrival = self._arrival(index, arrival_ns)
        if self._has_stepped(index, arrival, arrival_ns):
            # The host's clock was set to another time: begin there.
            self.steps += 1
            self.restart()
            self._origin, self.settled = (index, arrival_ns), True
            arrival = Arrival(0.0, 0.0)
        self._last_index = index
        self._store(arrival)
        # By both clocks: delayed samples arrive in one burst, which does not show when they were taken.
        watched_ns = min(arrival.elapsed_ns, arrival_ns - self._origin[1])
        self.settled = self.settled or watched_ns >= SETTLE_NS

    def time_ns(self, index: float) -> int:
        """Return the host time of a sample."""
        first_index, first_ns = self._origin or (0, 0)
        elapsed_ns = (index - first_index) * self._period_ns
        line = self._now if elapsed_ns >= self._now.start_ns else self._before
        return first_ns + round(elapsed_ns + line.delay_ns_at(elapsed_ns))

    def index_at(self, time_ns: int) -> float:
        """Return the (fractional) index of the sample taken at a host time, now or to come."""
        first_index, first_ns = self._origin or (0, 0)
        reached_ns = float(time_ns - first_ns)
        elapsed_ns = (reached_ns - self._now.offset_ns) / (1 + self._now.drift)
        remaining_ns = self._now.delay_ns_at(elapsed_ns) - self._now.trend_ns(elapsed_ns)
        return first_index + (elapsed_ns - remaining_ns) / self._period_ns

    def _arrival(self, index: int, arrival_ns: int) -> Arrival:
        first_index, first_ns = self._origin or (index, arrival_ns)
        elapsed_ns = (index - first_index) * self._period_ns
        return Arrival(elapsed_ns, arrival_ns - first_ns - elapsed_ns)

    def _has_stepped(self, index: int, arrival: Arrival, arrival_ns: int) -> bool:
        """Return whether the stream or the host's clock cannot be the one of before."""
        if not self._bins:
            return False
        # No sample arrives before it was taken: such times are those of a stream at another rate.
        if self._now.delay_ns_at(arrival.elapsed_ns) - arrival.delay_ns > STEP_NS:
            return True
        late_ns = arrival.delay_ns - self._now.trend_ns(arrival.elapsed_ns)
        if late_ns <= STEP_NS:
            self._late_since_ns = None
            return index < self._last_index or late_ns < -STEP_NS
        if self._late_since_ns is None:  # one late arrival is a busy host
            self._late_since_ns = arrival_ns
        return index < self._last_index or arrival_ns - self._late_since_ns > NANOSECONDS

    def _store(self, arrival: Arrival) -> None:
        late_ns = arrival.delay_ns - self._now.trend_ns(arrival.elapsed_ns)
        if not self._bins or late_ns < 0:
            self._switch_to(arrival.elapsed_ns, self._now.offset_ns + late_ns)
        if not self._bins:
            self._bins.append(arrival)
        elif arrival.elapsed_ns // self._width_ns == self._bins[-1].elapsed_ns // self._width_ns:
            self._bins[-1] = min(self._bins[-1], arrival, key=self._excess_delay_ns)
        else:
            self._fit(arrival.elapsed_ns)
            self._bins.append(arrival)
            self._prune(arrival.elapsed_ns)

    def _excess_delay_ns(self, arrival: Arrival) -> float:
        return arrival.delay_ns - self._now.trend_ns(arrival.elapsed_ns)

    def _prune(self, elapsed_ns: float) -> None:
        """Drop what is too old, but keep one from before a long gap; make the bins wider when there are too many."""
        while len(self._bins) > 2 and elapsed_ns - self._bins[1].elapsed_ns > MEMORY_NS:
            self._bins.popleft()
        if len(self._bins) <= BINS:
            return
        self._width_ns *= 2
        wider: dict[float, Arrival] = {}
        for arrival in self._bins:
            number = arrival.elapsed_ns // self._width_ns
            wider[number] = min(wider.get(number, arrival), arrival, key=self._excess_delay_ns)
        self._bins = deque(wider.values())

    def _fit(self, elapsed_ns: float) -> None:
        """Lay the line again below the closed bins."""
        if self._bins[-1].elapsed_ns - self._bins[0].elapsed_ns >= DRIFT_AFTER_NS:
            slope = supporting_slope(self._bins)
            self._drift = min(max(slope, -self._max_drift), self._max_drift)
        offset_ns = min(arrival.delay_ns - self._drift * arrival.elapsed_ns for arrival in self._bins)
        self._switch_to(elapsed_ns, offset_ns)

    def _switch_to(self, elapsed_ns: float, offset_ns: float) -> None:
        """Go over to another line from `elapsed_ns` on, without a jump once the clock has been read."""
        line = DelayModel(elapsed_ns, offset_ns, self._drift)
        if self.settled:
            line.residual_ns = self._now.delay_ns_at(elapsed_ns) - line.trend_ns(elapsed_ns)
            if elapsed_ns > self._now.start_ns:
                self._before = self._now
        else:
            self._before = line
        self._now = line


def supporting_slope(points: Sequence[Arrival]) -> float:
    """Return the slope of that edge of the lower convex hull which lies below the mean of the points."""
    middle = sum(point.elapsed_ns for point in points) / len(points)
    hull: list[Arrival] = []
    for point in points:
        while len(hull) > 1 and _slope(hull[-2], point) <= _slope(hull[-2], hull[-1]):
            hull.pop()
        hull.append(point)
    right = next(i for i in range(1, len(hull)) if hull[i].elapsed_ns >= middle)
    return _slope(hull[right - 1], hull[right])


def _slope(remaining: Arrival, right: Arrival) -> float:
    return (right.delay_ns - remaining.delay_ns) / (right.elapsed_ns - remaining.elapsed_ns)


# --------------------
# Give every sample its running index, so that a jump of the index is exactly what was lost.

SHORT_COUNTER = 1 << 16
TICK_STAMPS = 4  # show how many ticks a sample takes
MICROSECOND_TICKS = 1000  # a sample at 1 kHz, where a stamp counts microseconds
LONGEST_GAP = 2000  # samples that one loss may have


class StampStatus(enum.Enum):
    """Status of a stamp, assessed with its neighbours."""

    GOOD = enum.auto()
    DAMAGED = enum.auto()
    RESTARTED = enum.auto()  # the device counts from another start value
    PENDING = enum.auto()  # odd, and the next stamp is not known yet


class SampleCounter:
    """Count samples by the device's stamps, `ticks` of them a sample; 0 measures by the first four stamps.

    A stamp not following its predecessor is a loss if the next stamp continues from there, and a damaged stamp if
    not; so the last one given is left open when it is odd. A sample that comes one tick early (a device that samples a
    trifle faster than its clock ticks) is numbered through, and evens out a tick skipped later.
    """

    def __init__(self, ticks: int = 1) -> None:
        self.next_index = 0
        self.lost = 0
        self.damaged_stamps = 0
        self.ticks = ticks
        self._last: int | None = None
        self._early = 0

    def interrupt(self) -> None:
        """Number on, whatever the next stamp is."""
        self._last = None
        self._early = 0

    def skip(self, samples: int) -> None:
        """Number on behind samples that are known to be lost."""
        self.lost += samples
        self.next_index += samples

    def place(self, stamps: Sequence[int | None]) -> tuple[list[int], bool]:
        """Return the index of each stamp's sample as far as decided, and whether the device restarted after those."""
        indices: list[int] = []
        if not self.ticks and not self._measure([stamp for stamp in stamps if stamp is not None]):
            return indices, False
        for position, stamp in enumerate(stamps):
            status = self._classify(stamp, stamps[position + 1 : position + 2])
            if status in (StampStatus.RESTARTED, StampStatus.PENDING):
                return indices, status is StampStatus.RESTARTED
            self.damaged_stamps += status is StampStatus.DAMAGED
            indices.append(self._take(stamp if status is StampStatus.GOOD else None))
        return indices, False

    def _measure(self, stamps: Sequence[int]) -> bool:
        """Return whether samples can be counted: without stamps, or once their ticks are known."""
        if len(stamps) >= TICK_STAMPS:
            step = float(np.median(np.diff(stamps)))
            self.ticks = MICROSECOND_TICKS if abs(step / MICROSECOND_TICKS - 1) < 0.5 else 1
        return bool(self.ticks) or not stamps

    def _classify(self, stamp: int | None, following: Sequence[int | None]) -> StampStatus:
        step = self._step(self._last, stamp)
        if step in (0, 1):
            return StampStatus.GOOD
        if not following:
            return StampStatus.PENDING
        onward = self._step(stamp, following[0])
        if 1 < step <= LONGEST_GAP:
            return StampStatus.GOOD if 1 <= onward <= LONGEST_GAP else StampStatus.DAMAGED
        return StampStatus.RESTARTED if onward == 1 else StampStatus.DAMAGED

    def _take(self, stamp: int | None) -> int:
        """Return the index of the next sample; without a stamp it follows directly."""
        step = self._step(self._last, stamp)
        if step == 0:
            self._early = 1
        skipped = max(0, step - 1)
        compensated = min(self._early, skipped)
        self._early -= compensated
        self.lost += skipped - compensated
        index = self.next_index + skipped - compensated
        self.next_index = index + 1
        self._last = stamp if stamp is not None or self._last is None else self._last + (self.ticks or 1)
        return index

    def _step(self, last: int | None, stamp: int | None) -> int:
        """Return how many samples a stamp lies after another, 1 if either is unknown."""
        if last is None or stamp is None:
            return 1
        ticks = stamp - last
        if last < SHORT_COUNTER and ticks < -SHORT_COUNTER // 2:  # 16 bits have wrapped
            ticks += SHORT_COUNTER
        return round(ticks / (self.ticks or 1))


# --------------------
# Number and time the samples of a stream that neither counts nor stamps them, by when they arrive.

BLOCKS_LATE = 1.5  # a block may come so late by the pace at which it is read, and nothing is lost
# Whatever comes after a lost sample seems late by its time, and stays so. A busy host makes some arrivals late, but not
# all of half a second: what was kept back arrives in one burst, whose last sample is in time. So what the least late
# arrival of the end of such a stretch is late by has been lost.
LATE_NS = 0.5 * NANOSECONDS
LATE_END_NS = 0.2 * LATE_NS


class ArrivalNumbering:
    """Give blocks of samples their running index: a jump is what was lost.

    Losses that the protocol shows are given by the caller. Others are known half a second later, by all samples being
    late from then on (`LATE_NS`); over an interruption the host's clock shows how much is missing.
    """

    def __init__(self, rate_hz: float, *, block_s: float, max_drift: float = 5e-3) -> None:
        self.clock = StreamClock(rate_hz, max_drift=max_drift)
        self.next_index = 0
        self._rate_hz = rate_hz
        self._no_loss_ns = BLOCKS_LATE * max(block_s, 1 / rate_hz) * NANOSECONDS
        self._late: deque[tuple[int, int]] = deque()  # arrival and lateness: the first of a stretch, and its end
        self._interrupted = False
        self._clock_before: StreamClock | None = None  # before an interruption, until the clock is settled again

    def interrupt(self) -> None:
        """Reset the state for a new stream."""
        self._interrupted = True

    def place(self, blocks: Sequence[tuple[int, int]], arrival_ns: int) -> list[int]:
        """Return the index of the first sample of each block."""
        indices = []
        for missing, samples in blocks:
            indices.append(self.next_index + missing)
            self.next_index += missing + samples
        skipped = self.missing(self.next_index - 1, arrival_ns)
        self.next_index += skipped
        return [index + skipped for index in indices] if self.clock.settled else []

    def missing(self, index: int, arrival_ns: int, *, counted: bool = False) -> int:
        """Return how many samples were lost, by the host's clock, before those that have just arrived."""
        if self._interrupted:
            self._resume()
        unseen = self._unseen(index, arrival_ns, counted)
        self.clock.observe(index + unseen, arrival_ns)
        return unseen + self._skipped(index + unseen)

    def _resume(self) -> None:
        """Number on after an interruption, and keep the clock of before for telling what was lost in it."""
        self._interrupted = False
        if self.clock.settled:
            self._clock_before = copy.copy(self.clock)
        self.clock.restart()
        self._late.clear()

    def _unseen(self, index: int, arrival_ns: int, counted: bool) -> int:
        """Return how many samples must have been lost before those that have just arrived."""
        late_ns = arrival_ns - self.clock.time_ns(index)
        if counted or not self.clock.settled or self._clock_before is not None or late_ns <= self._no_loss_ns:
            self._late.clear()
            return 0
        late = self._late
        late.append((arrival_ns, late_ns))
        while len(late) > 2 and arrival_ns - late[1][0] > LATE_END_NS:
            del late[1]
        if arrival_ns - late[0][0] < LATE_NS:
            return 0
        least_ns = min(by_ns for at_ns, by_ns in late if arrival_ns - at_ns <= LATE_END_NS)
        late.clear()
        return round(least_ns / NANOSECONDS * self._rate_hz)

    def _skipped(self, index: int) -> int:
        """Return how many samples an interruption has cost that is over now.

        That is known when the clock is settled again and not before: the first arrivals may be long delayed.
        """
        if self._clock_before is None or not self.clock.settled:
            return 0
        skipped = max(0, round(self._clock_before.index_at(self.clock.time_ns(index))) - index)
        self._clock_before = None
        self.clock.skip(skipped)
        return skipped


# --------------------
# Measure the rate of a stream that does not report it, by the arrival of its samples.

MEASURED_S = 2.0  # with arrivals seen each 10 ms, the error of a rate of 100 Hz is some 0.1 Hz
LEAST_ARRIVALS = 20
# Whole hertz from here on, below it three digits: each launch finds the same rate, off by less than the drift that a
# clock follows (0.5 %).
WHOLE_FROM_HZ = 100.0
RATE_TOLERANCE = 0.02  # far more than clocks differ, far less than a wrong setting


def rounded_rate(rate_hz: float) -> float:
    """Return a measured rate as it is used."""
    return float(round(rate_hz)) if rate_hz >= WHOLE_FROM_HZ else float(f'{rate_hz:.3g}')


class RateMeter:
    """Count samples until their rate is known.

    A sample arrives late by a varying delay but never early, so the period is the slope of the line just below all
    arrivals (see `StreamClock`). Reads hold any number of samples, and missing ones are counted by the caller; where
    messages may be lost unseen, see `PeriodMeter` of the adaptor: with three in ten lost this one is wrong by 30 %.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget what has arrived."""
        self._samples = 0
        self._arrivals: list[Arrival] = []  # samples so far, and when the last of them was there

    def update(self, samples: int, arrival_ns: int) -> float:
        """Add samples that have just arrived; return the rate, Hz, rounded, or 0.0 while it is unknown."""
        self._samples += samples
        if not self._arrivals:
            self._start_ns = arrival_ns
        self._arrivals.append(Arrival(float(self._samples), float(arrival_ns - self._start_ns)))
        elapsed_ns = self._arrivals[-1].delay_ns
        if elapsed_ns < MEASURED_S * NANOSECONDS or len(self._arrivals) < LEAST_ARRIVALS:
            return 0.0
        return rounded_rate(NANOSECONDS / supporting_slope(self._arrivals))


# --------------------
# Lower the rate of a stream by a whole factor, without folding what lies above the new band into it.

HALF_WIDTH = 12  # of the filter, in samples of the lower rate
CUTOFF = 0.42  # of the lower rate: half of the amplitude is left there
KAISER_BETA = 6.0  # up to 0.34 of the lower rate all passes, from 0.5 on everything is damped by 60 dB


class Decimator:
    """Filter blocks of samples that follow each other, and keep every `factor`-th sample.

    Output `k` is the filtered value at input `k · factor`: the filter is symmetric, so nothing is delayed. An output
    needs the inputs of 12 output periods around it, so those around a gap are left out.
    """

    def __init__(self, factor: int) -> None:
        self._factor = factor
        self._taps = taps(factor)
        self._half = len(self._taps) // 2
        self._begin = self._next = 0  # index of the first sample in the buffer, and of the one after it
        self._buffer: NDArray[np.float32] | None = None

    def feed(self, first: int, samples: NDArray[np.float32]) -> tuple[int, NDArray[np.float32]]:
        """Return the outputs that have become possible, and the index of the first of them."""
        if self._buffer is None or first != self._next:
            self._buffer, self._begin = samples[:0], first
        buffer = np.concatenate([self._buffer, samples])
        self._next = first + len(samples)
        output = math.ceil((self._begin + self._half) / self._factor)
        start = output * self._factor - self._half - self._begin
        if len(buffer) < start + len(self._taps):
            self._buffer = buffer
            return output, samples[:0]
        windows = sliding_window_view(buffer[start:], len(self._taps), axis=0)[:: self._factor]
        used = start + len(windows) * self._factor
        self._buffer, self._begin = buffer[used:], self._begin + used
        return output, (windows @ self._taps).astype(np.float32)


def taps(factor: int) -> Array:
    """Return the coefficients of the low-pass before lowering a rate by `factor`: a sinc in a Kaiser window."""
    if factor == 1:
        return np.ones(1)
    half = HALF_WIDTH * factor
    places = np.arange(-half, half + 1)
    sinc = np.sinc(2 * CUTOFF * places / factor) * np.kaiser(len(places), KAISER_BETA)
    return np.asarray(sinc / sinc.sum())
