"""A path along the surface, how far the finger is on it, and how speed is gained and lost."""

from __future__ import annotations

import math
from typing import Protocol

from texture_exploration.arms.protocol import ArmState

MIN_RAMP_S = 0.1  # even a slow slide starts softly
STEADY_S = 0.05  # at full speed before it counts as sliding: the arm lags behind, the skin still swings


class Path(Protocol):
    """A curve along the surface; `travelled_m` counts from where the finger begins to gain speed."""

    @property
    def length_m(self) -> float:
        """Length of the part at constant speed."""

    def direction_rad(self, travelled_m: float) -> float:
        """Return the direction of travel from +x towards +y."""


class PathFollower:
    """Keep track of how far the finger has travelled on a path, and steer it along."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.travelled_m = 0.0
        self._last: tuple[float, float] | None = None

    @property
    def direction_rad(self) -> float:
        """Present direction of travel."""
        return self.path.direction_rad(self.travelled_m)

    def update(self, arm: ArmState) -> None:
        """Add the way since the last update, projected on the path: so noise of the position does not add up."""
        x, y, _ = arm.position
        if self._last is not None:
            direction = self.direction_rad
            self.travelled_m += (x - self._last[0]) * math.cos(direction) + (y - self._last[1]) * math.sin(direction)
        self._last = (x, y)

    def velocity(self, speed_m_s: float) -> tuple[float, float]:
        """Return the velocity along the path at a speed, m/s."""
        direction = self.direction_rad
        return speed_m_s * math.cos(direction), speed_m_s * math.sin(direction)


def smooth(share: float) -> float:
    """Return a cosine rise from 0 to 1 as `share` goes from 0 to 1: no step in speed, no jolt in acceleration."""
    return 0.5 - 0.5 * math.cos(math.pi * min(1.0, max(0.0, share)))


def ramp_s(speed_m_s: float, acceleration_m_s2: float) -> float:
    """Return how long `smooth` takes to a speed if its steepest part, π/2 of the mean, keeps to the acceleration."""
    return max(MIN_RAMP_S, 0.5 * math.pi * speed_m_s / acceleration_m_s2)


def ramps_m(speed_m_s: float, acceleration_m_s2: float) -> float:
    """Return the way needed beside the slide itself: to gain speed, to get steady and to lose speed again."""
    return speed_m_s * (ramp_s(speed_m_s, acceleration_m_s2) + STEADY_S)  # a ramp has half the speed in the mean
