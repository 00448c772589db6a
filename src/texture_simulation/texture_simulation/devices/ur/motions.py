"""What moves the emulated robot: each motion says which velocity comes next.

Poses and velocities are arrays (6,): x, y, z in m, then a rotation vector in rad. Turning is only sketched: rotation
vectors change component by component, and 1 rad counts as 1 m.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from texture_core.arrays import Array


class RobotMove(Protocol):
    """One motion of the robot; `done` when it will not move any further by itself."""

    done: bool

    def velocity(self, pose: Array, velocity: Array, step_s: float) -> Array:
        """Return the velocity of the next step, (6,).

        Parameters
        ----------
        pose : (6,)
            Place of the tool in m and rotation vector in rad.
        velocity : (6,)
            m/s and rad/s.
        step_s
            Length of the step.

        Returns
        -------
        (6,)
            m/s and rad/s.
        """


class StopMove:
    """Lose speed (stopl)."""

    def __init__(self, deceleration: float) -> None:
        self.done = False
        self._deceleration = deceleration

    def velocity(self, pose: Array, velocity: Array, step_s: float) -> Array:
        """Slow down."""
        slower = approach(velocity, np.zeros(6), self._deceleration * step_s)
        self.done = not slower.any()
        return slower


class SpeedMove:
    """Gain a velocity and keep it (speedl)."""

    def __init__(self, wanted: Array, acceleration: float) -> None:
        self.done = False
        self._wanted = wanted
        self._acceleration = acceleration

    def velocity(self, pose: Array, velocity: Array, step_s: float) -> Array:
        """Go towards the wanted velocity."""
        return approach(velocity, self._wanted, self._acceleration * step_s)


class LinearMove:
    """Go to a pose on a straight line, speeding up and slowing down (movel)."""

    def __init__(self, goal: Array, speed: float, acceleration: float) -> None:
        self.done = False
        self.goal = goal
        self._speed = speed
        self._acceleration = acceleration

    def velocity(self, pose: Array, velocity: Array, step_s: float) -> Array:
        """Go on; the last step lands on the goal."""
        if self.done:
            return np.zeros(6)
        offset = self.goal - pose
        distance = math.sqrt(offset @ offset)
        faster = math.sqrt(velocity @ velocity) + self._acceleration * step_s
        speed = min(self._speed, faster, math.sqrt(2 * self._acceleration * distance))
        if speed * step_s >= distance:
            self.done = True
            speed = distance / step_s
        return speed / distance * offset if distance > 0 else np.zeros(6)


class ServoMove:
    """Follow a pose that is moved all the time (servoj of the pose): approach it within the look-ahead time."""

    def __init__(self, goal: Array, lookahead_s: float) -> None:
        self.done = False
        self._goal = goal
        self._lookahead_s = lookahead_s

    def velocity(self, pose: Array, velocity: Array, step_s: float) -> Array:
        """Take the share of the way that the step has in the look-ahead time."""
        follow: Array = (self._goal - pose) * -math.expm1(-step_s / self._lookahead_s) / step_s
        return follow


def approach(now: Array, wanted: Array, step: float) -> Array:
    """Return `now` led towards `wanted` by at most `step`.

    Parameters
    ----------
    now, wanted : (n,)
        In one unit.
    step
        Largest change of their distance, in that unit.

    Returns
    -------
    (n,)
    """
    offset = wanted - now
    distance = math.sqrt(offset @ offset)
    return wanted if distance <= step else now + step / distance * offset
