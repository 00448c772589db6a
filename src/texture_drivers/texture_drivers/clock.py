"""Host time of the samples of a stream, free of the jitter with which they arrive and of the drift of its clock."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from texture_core.signal import NANOSECONDS
from texture_drivers.delay_model import DelayModel

PPM = 1e6
SLOW_CLOCK = 'device clock slow by [ppm]'  # name of the drift among the details of a sensor
BINS = 64
FIRST_BIN_NS = 20e6


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
    settle_s
        How long arrivals are watched before the clock is `settled` and may be read.
    memory_s
        How long arrivals count; over this time the drift is taken as constant.
    drift_after_s
        How long arrivals are observed before a drift is estimated.
    max_drift
        Largest drift accepted; the internal oscillator of a microcontroller on USB is right to 0.25 %.
    slew_rate
        Largest correction per time.
    step_s
        A deviation above this is a step of the host's clock.

    Source: the line below the hull, Moon, Skelly & Towsley 1999, "Estimation and removal of clock skew".
    """

    def __init__(
        self,
        rate_hz: float,
        *,
        settle_s: float = 0.1,
        memory_s: float = 60.0,
        drift_after_s: float = 2.0,
        max_drift: float = 5e-3,
        slew_rate: float = 0.02,
        step_s: float = 0.5,
    ) -> None:
        self.steps = 0
        self._period_ns = NANOSECONDS / rate_hz
        self._settle_ns = settle_s * NANOSECONDS
        self._memory_ns = memory_s * NANOSECONDS
        self._drift_after_ns = drift_after_s * NANOSECONDS
        self._max_drift = max_drift
        self._slew_rate = slew_rate
        self._step_ns = step_s * NANOSECONDS
        self._drift = 0.0
        self.restart()

    def restart(self) -> None:
        """Forget the stream: another one begins, with another index and another delay. Its drift is still believed."""
        self.settled = False
        self._origin: tuple[int, int] | None = None  # index and host time of the first arrival
        self._bins: deque[Arrival] = deque()  # the least late of each bin; the last bin is still open
        self._width_ns = FIRST_BIN_NS
        self._last_index = 0
        self._late_since_ns: int | None = None
        self._before = self._now = DelayModel(drift=self._drift)

    def skip(self, samples: int) -> None:
        """Take the samples of this stream for later ones by so many: their times stay, their indices do not."""
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
            self._follow_step((index, arrival_ns))
            arrival = Arrival(0.0, 0.0)
        self._last_index = index
        self._store(arrival)
        # By both clocks: what was kept back arrives in one burst, and tells nothing of when it was taken.
        watched_ns = min(arrival.elapsed_ns, arrival_ns - self._origin[1])
        self.settled = self.settled or watched_ns >= self._settle_ns

    def time_ns(self, index: float) -> int:
        """Return the host time of a sample."""
        first_index, first_ns = self._origin or (0, 0)
        elapsed_ns = (index - first_index) * self._period_ns
        line = self._now if elapsed_ns >= self._now.start_ns else self._before
        return first_ns + round(elapsed_ns + line.delay_ns_at(elapsed_ns, self._slew_rate))

    def index_at(self, time_ns: int) -> float:
        """Return the (fractional) index of the sample taken at a host time, now or to come."""
        first_index, first_ns = self._origin or (0, 0)
        reached_ns = float(time_ns - first_ns)
        elapsed_ns = (reached_ns - self._now.offset_ns) / (1 + self._now.drift)
        remaining_ns = self._now.delay_ns_at(elapsed_ns, self._slew_rate) - self._now.trend_ns(elapsed_ns)
        return first_index + (elapsed_ns - remaining_ns) / self._period_ns

    def _follow_step(self, origin: tuple[int, int]) -> None:
        """Begin anew where the host's clock was set to another time."""
        self.steps += 1
        self.restart()
        self._origin = origin
        self.settled = True

    def _arrival(self, index: int, arrival_ns: int) -> Arrival:
        first_index, first_ns = self._origin or (index, arrival_ns)
        elapsed_ns = (index - first_index) * self._period_ns
        return Arrival(elapsed_ns, arrival_ns - first_ns - elapsed_ns)

    def _has_stepped(self, index: int, arrival: Arrival, arrival_ns: int) -> bool:
        """Return whether the stream or the host's clock cannot be the one of before."""
        if not self._bins:
            return False
        # No sample arrives before it was taken: times that say so are those of a stream at another rate.
        if self._now.delay_ns_at(arrival.elapsed_ns, self._slew_rate) - arrival.delay_ns > self._step_ns:
            return True
        late_ns = arrival.delay_ns - self._now.trend_ns(arrival.elapsed_ns)
        if late_ns <= self._step_ns:
            self._late_since_ns = None
            return index < self._last_index or late_ns < -self._step_ns
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
        while len(self._bins) > 2 and elapsed_ns - self._bins[1].elapsed_ns > self._memory_ns:
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
        if self._bins[-1].elapsed_ns - self._bins[0].elapsed_ns >= self._drift_after_ns:
            slope = supporting_slope(self._bins)
            self._drift = min(max(slope, -self._max_drift), self._max_drift)
        offset_ns = min(arrival.delay_ns - self._drift * arrival.elapsed_ns for arrival in self._bins)
        self._switch_to(elapsed_ns, offset_ns)

    def _switch_to(self, elapsed_ns: float, offset_ns: float) -> None:
        """Go over to another line from `elapsed_ns` on, without a jump once the clock has been read."""
        line = DelayModel(elapsed_ns, offset_ns, self._drift)
        if self.settled:
            line.residual_ns = self._now.delay_ns_at(elapsed_ns, self._slew_rate) - line.trend_ns(elapsed_ns)
            if elapsed_ns > self._now.start_ns:
                self._before = self._now
        else:
            self._before = line
        self._now = line


def supporting_slope(points: Sequence[Arrival]) -> float:
    """Return the slope of that edge of the lower convex hull which lies below the mean of the points.

    Parameters
    ----------
    points
        At least two, of rising elapsed time.
    """
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
