"""Whether the finger moves along the surface as it is commanded to."""

from __future__ import annotations

import math
from collections import deque

from texture_core.errors import MotionAborted
from texture_exploration.arms.protocol import ArmState
from texture_exploration.motions.touch import TouchParams

LONGEST_STEP_NS = 50_000_000  # a command that was given longer ago may have run out: the comparison starts again


class StallWatch:
    """Compare the way that the finger makes with the way that was commanded, over the last `stall_s`.

    Only the way in the commanded direction counts, so that noise of the position does not add up, and a finger that
    goes to and fro may turn. Time is that of the arm's states; after a pause of this machine the comparison starts
    again.

    Parameters
    ----------
    touch
        The limits.
    """

    def __init__(self, touch: TouchParams) -> None:
        self._touch = touch
        self._ways: deque[tuple[int, float, float]] = deque()  # time, ns, and ways commanded and made so far, m
        self._velocity = (0.0, 0.0)  # commanded last
        self._place = (0.0, 0.0)

    def restart(self) -> None:
        """The finger moves from here on."""
        self._ways.clear()

    def update(self, arm: ArmState, velocity_m_s: tuple[float, float]) -> None:
        """Take a state of the arm, and the velocity that is commanded from now on.

        Raises
        ------
        MotionAborted
            If the finger has moved by less than `stall_speed_share` of the commanded way.
        """
        x, y, _ = arm.position
        if not self._ways or arm.time_ns - self._ways[-1][0] > LONGEST_STEP_NS:
            self._ways.clear()
            self._ways.append((arm.time_ns, 0.0, 0.0))
        elif arm.time_ns > self._ways[-1][0]:
            self._add(arm.time_ns, x - self._place[0], y - self._place[1])
            self._check(arm.time_ns)
        self._place, self._velocity = (x, y), velocity_m_s

    def _add(self, time_ns: int, x_m: float, y_m: float) -> None:
        before_ns, commanded_m, made_m = self._ways[-1]
        vx, vy = self._velocity
        speed = math.hypot(vx, vy)
        commanded_m += speed * (time_ns - before_ns) * 1e-9
        made_m += (vx * x_m + vy * y_m) / speed if speed > 0 else 0.0
        self._ways.append((time_ns, commanded_m, made_m))

    def _check(self, now_ns: int) -> None:
        begin_ns = now_ns - round(self._touch.stall_s * 1e9)
        if self._ways[0][0] > begin_ns:
            return
        while self._ways[1][0] <= begin_ns:
            self._ways.popleft()
        commanded_m, made_m = (now - then for now, then in zip(self._ways[-1][1:], self._ways[0][1:], strict=True))
        # Written so that NaN is a stall.
        if made_m >= self._touch.stall_speed_share * commanded_m:
            return
        raise MotionAborted(
            f'the finger stalled: in {self._touch.stall_s * 1e3:.0f} ms it moved by {made_m * 1e3:.2f} of '
            f'{commanded_m * 1e3:.2f} mm; see what holds it, and whether the robot or its operator slows it down'
        )
