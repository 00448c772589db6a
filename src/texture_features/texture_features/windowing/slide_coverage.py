"""One slide: which time is covered, and how fast and hard the finger moved."""

from __future__ import annotations

import cmath
import math
from collections import deque
from dataclasses import dataclass

from texture_core.exploration import ExplorationState
from texture_core.signal import NANOSECONDS

# Two slide states at most so far apart cover the time between them.
LINK_NS = NANOSECONDS // 2
# No guarantee holds for longer: a wrong one must not make millions of windows.
MAX_STEADY_S = 3600.0
MAX_STATES = 20_000
# Of the mean of the guaranteed states. A state without guarantee beyond them shows a slide that is none: in the air,
# pressed too hard, or far too fast.
LEAST_FORCE, MOST_FORCE, MOST_SPEED = 0.5, 1.5, 2.0


@dataclass(frozen=True)
class CoveredSpan:
    """A covered stretch of time with the mean speed and forces in it.

    Examples
    --------
    >>> span = CoveredSpan(0, NANOSECONDS // 2, speed_m_s=0.05, force_n=1.0, direction_rad=0.0)
    >>> round(span.speed_m_s * (span.end_ns - span.start_ns) / NANOSECONDS, 6)  # m travelled in it
    0.025
    """

    start_ns: int
    end_ns: int
    speed_m_s: float
    force_n: float
    direction_rad: float
    tangential_force_n: float = math.nan


class SlideCoverage:
    """The covered time of consecutive `slide` states, handed out window by window.

    After a state without guarantee, though others had one, the time up to the next state is not covered: the finger has
    lost the surface, turns, or does not slide as asked. If its force or speed is far from that of the slide so far,
    what is left of the guarantee is not covered either; windows that were already handed out are not taken back.

    All it says depends on the order of the states alone, never on when they arrived: the mean speed and force of a
    window are those of the shortest beginning of the states that covers it.

    Parameters
    ----------
    state
        The first slide state.
    length_ns, hop_ns, skip_ns
        Of the windows; `skip_ns` is left out at the start.

    Examples
    --------
    >>> from texture_core.exploration import Phase
    >>> state = ExplorationState(0, 'a', 'linear_slide', Phase.SLIDE, steady_s=1.0, speed_m_s=0.05)
    >>> coverage = SlideCoverage(state, length_ns=NANOSECONDS // 2, hop_ns=NANOSECONDS // 2, skip_ns=0)
    >>> starts = []
    >>> while span := coverage.window():
    ...     starts.append(span.start_ns / NANOSECONDS)
    ...     _ = coverage.advance()
    >>> starts  # of 1 s, two windows of 0.5 s
    [0.0, 0.5]
    """

    def __init__(self, state: ExplorationState, length_ns: int, hop_ns: int, skip_ns: int) -> None:
        self.exploration_id = state.exploration_id
        self.surface = state.surface
        self.motion = state.motion
        self.start_ns = state.stamp_ns
        self.ended = False
        self.skipped = 0
        self._length_ns = length_ns
        self._hop_ns = hop_ns
        self._next_ns = state.stamp_ns + skip_ns
        self._intervals: deque[list[int]] = deque()
        # each with the end of the covered time known with it
        self._states: deque[tuple[int, ExplorationState]] = deque(maxlen=MAX_STATES)
        self._promising = False
        self._withdrawn = False
        self._force = _WeightedMean()
        self._speed = _WeightedMean()
        self.add(state)

    def add(self, state: ExplorationState) -> bool:
        """Take the next slide state; return False, and ignore it, if it is older than the last one."""
        stamp = state.stamp_ns
        start = stamp
        if self._states:
            before = self._states[-1][1].stamp_ns
            if stamp < before:
                return False
            start = before if stamp - before <= LINK_NS and not self._withdrawn else stamp
        self._promising |= state.steady_s > 0
        self._cover(start, stamp + _steady_ns(state.steady_s))
        self._withdrawn = self._promising and not state.steady_s > 0
        if self._withdrawn and self._is_far(state):
            self._intervals[-1][1] = min(self._intervals[-1][1], stamp)
        self._force.add(state.force_n, float(state.steady_s > 0))
        self._speed.add(state.speed_m_s, float(state.steady_s > 0))
        self._states.append((self._intervals[-1][1], state))
        return True

    @property
    def covered_ns(self) -> int:
        """End of the covered time."""
        return self._intervals[-1][1]

    def window(self) -> CoveredSpan | None:
        """Return the present window if it is covered, else None; windows that never can be are passed over."""
        while True:
            start, end = self._intervals[0]
            if self._next_ns < start:
                self._next_ns += -(-(start - self._next_ns) // self._hop_ns) * self._hop_ns
            if self._next_ns + self._length_ns <= end:
                return self._span(self._next_ns, self._next_ns + self._length_ns)
            if len(self._intervals) == 1:
                return None
            self._intervals.popleft()

    def advance(self, count: int = 1) -> int:
        """Go on by so many windows, but not beyond the covered stretch of the present one; return by how many."""
        left = (self._intervals[0][1] - self._length_ns - self._next_ns) // self._hop_ns + 1
        count = min(count, left)
        self._next_ns += count * self._hop_ns
        return count

    def _is_far(self, state: ExplorationState) -> bool:
        force_n, speed_m_s = self._force.value, self._speed.value
        return (
            state.force_n < LEAST_FORCE * force_n
            or state.force_n > MOST_FORCE * force_n
            or state.speed_m_s > MOST_SPEED * speed_m_s
        )

    def _cover(self, start: int, end: int) -> None:
        if self._intervals and start <= self._intervals[-1][1]:
            self._intervals[-1][1] = max(self._intervals[-1][1], end)
        else:
            self._intervals.append([start, end])

    def _span(self, start: int, end: int) -> CoveredSpan:
        states = self._states
        while len(states) > 1 and states[1][1].stamp_ns <= start and states[0][0] < end:
            states.popleft()
        speeds = _WeightedMean()
        forces = _WeightedMean()
        tangential = _WeightedMean()
        directions = _MeanDirection()
        for number, (covered, state) in enumerate(states):
            enough = covered >= end
            until = end if enough else min(states[number + 1][1].stamp_ns, end)
            weight = until - max(state.stamp_ns, start)
            speeds.add(state.speed_m_s, weight)
            forces.add(state.force_n, weight)
            tangential.add(state.tangential_force_n, weight)
            directions.add(state.direction_rad, weight)
            if enough or until >= end:
                break
        return CoveredSpan(start, end, speeds.value, forces.value, directions.value, tangential.value)


class _WeightedMean:
    """Weighted mean of what is known."""

    def __init__(self) -> None:
        self._sum = 0.0
        self._weight = 0.0

    def add(self, value: float, weight: float) -> None:
        if weight > 0 and math.isfinite(value):
            self._sum += weight * value
            self._weight += weight

    @property
    def value(self) -> float:
        return self._sum / self._weight if self._weight else math.nan


class _MeanDirection:
    """Weighted mean of the directions that are known, as that of their unit vectors."""

    def __init__(self) -> None:
        self._sum = 0j

    def add(self, direction_rad: float, weight: float) -> None:
        if weight > 0 and math.isfinite(direction_rad):
            self._sum += cmath.rect(weight, direction_rad)

    @property
    def value(self) -> float:
        return cmath.phase(self._sum) if self._sum else math.nan


def _steady_ns(steady_s: float) -> int:
    return round(min(steady_s, MAX_STEADY_S) * NANOSECONDS) if steady_s > 0 else 0
