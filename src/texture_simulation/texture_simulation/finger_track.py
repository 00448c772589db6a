"""The path of a finger as it happens, from what the arm reports about it."""

from __future__ import annotations

from texture_core.finger_state import FingerState
from texture_core.signal import NANOSECONDS
from texture_simulation.trajectory import Trajectory, straight

STALE_S = 0.2  # an arm silent for longer has stopped
JUMP_M_S = 3.0  # what moves faster than this was put elsewhere, it did not slide


class FingerTrack:
    """Follow a finger: extrapolate its newest state, and join what comes without steps."""

    def __init__(self) -> None:
        self.newest: FingerState | None = None
        self._at = (0.0, 0.0, 0.0)  # x, y, force at the end of the path so far

    @property
    def touching(self) -> bool:
        """Whether the path so far ends on the surface."""
        return self._at[2] > 0.0

    def update(self, state: FingerState) -> None:
        """Take note of a state; one older than the newest is passed over."""
        if self.newest is None or state.time_ns >= self.newest.time_ns:
            self.newest = state

    def advance(self, until_ns: int, n_points: int, rate_hz: float) -> Trajectory:
        """Return the next `n_points` of the path, the last one at `until_ns`.

        Between two calls speed and change of force are constant; an arm that was put elsewhere leaves no trace of the
        way there.

        Parameters
        ----------
        until_ns
            Time of the last point.
        n_points
            Number of points.
        rate_hz
            Points a second.

        Returns
        -------
        Trajectory
            `n_points` points, m and N.
        """
        end = self._expected(until_ns)
        travelled_m = max(abs(end[0] - self._at[0]), abs(end[1] - self._at[1]))
        if travelled_m > JUMP_M_S * n_points / rate_hz:
            self._at = (end[0], end[1], self._at[2])
        path = straight(self._at, end, n_points)
        self._at = end
        return path

    def _expected(self, time_ns: int) -> tuple[float, float, float]:
        """Return x, y and force at a time."""
        state = self.newest
        if state is None:
            return self._at
        ahead_s = (time_ns - state.time_ns) / NANOSECONDS
        force_n = max(0.0, state.force_n)
        if ahead_s > STALE_S:
            return self._at[0], self._at[1], force_n
        return state.x_m + state.vx_m_s * ahead_s, state.y_m + state.vy_m_s * ahead_s, force_n
