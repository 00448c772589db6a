"""A path along the surface, how far the finger is on it, and how speed is gained and lost."""

from __future__ import annotations

import math
from typing import Protocol

from texture_exploration.arms.protocol import ArmState

MIN_RAMP_S = 0.1  # even a slow slide starts softly
STEADY_S = 0.05  # at full speed before it counts as sliding: the arm lags behind, the skin still swings
HALF_STEP_S = 0.005  # a command holds for one step of the exploration: its middle counts
STEERING_1_S = 15.0  # sideways speed per distance from the path; a tenth of what would be too much for a lag of 20 ms
MAX_SIDEWAYS = 0.5  # share of the speed


class SurfacePath(Protocol):
    """A curve along the surface; `travelled_m` counts from where the finger begins to gain speed."""

    @property
    def length_m(self) -> float:
        """Length of the part at constant speed."""

    def place(self, travelled_m: float) -> tuple[float, float]:
        """Return the place on the path, as seen from its beginning, m."""

    def direction_rad(self, travelled_m: float) -> float:
        """Return the direction of travel from +x towards +y."""


class Follower(Protocol):
    """Whoever steers the finger; the stages of a slide ask it where to go."""

    length_m: float  # of the part at constant speed
    travelled_m: float

    @property
    def direction_rad(self) -> float:
        """Present direction of travel."""

    @property
    def steady_m(self) -> float:
        """How far from here speed and force can be kept."""

    def begin_slide(self) -> None:
        """The slide begins here; what came before was for gaining speed."""

    def update(self, time_ns: int, arm: ArmState) -> None:
        """Take note of where the finger is."""

    def velocity(self, speed_m_s: float) -> tuple[float, float]:
        """Return the velocity to command for a speed, m/s."""


class PathFollower:
    """Keep track of how far the finger has travelled on a path, and steer it along.

    The direction is that of the path where the finger will be in the middle of the next step: age of the state, lag
    of the arm and half a step ahead. What is left of the distance to the path is steered off at constant speed.

    Parameters
    ----------
    path
        It begins where the finger is at the first update.
    arm_lag_s
        How long the arm takes to follow a command.
    """

    def __init__(self, path: SurfacePath, arm_lag_s: float = 0.0) -> None:
        self.path = path
        self.length_m = path.length_m
        self.travelled_m = 0.0
        self.steady_m = math.inf
        self._arm_lag_s = arm_lag_s
        self._age_s = 0.0
        self._across_m = 0.0
        self._origin: tuple[float, float] | None = None

    @property
    def direction_rad(self) -> float:
        """Present direction of travel."""
        return self.path.direction_rad(self.travelled_m)

    def begin_slide(self) -> None:
        """One path serves the ramp and the slide: there is nothing to change."""

    def update(self, time_ns: int, arm: ArmState) -> None:
        """Project the finger on the path: so noise of the position does not add up."""
        x, y, _ = arm.position
        if self._origin is None:
            self._origin = (x, y)
        along, _ = self._off(x, y)
        self.travelled_m += along
        _, self._across_m = self._off(x, y)
        self._age_s = max(0.0, (time_ns - arm.time_ns) * 1e-9)

    def velocity(self, speed_m_s: float) -> tuple[float, float]:
        """Return the velocity along the path at a speed, m/s."""
        ahead_m = speed_m_s * (self._age_s + self._arm_lag_s + HALF_STEP_S)
        direction = self.path.direction_rad(self.travelled_m + ahead_m)
        most = MAX_SIDEWAYS * speed_m_s
        sideways = min(most, max(-most, -STEERING_1_S * self._across_m))
        forward = math.sqrt(speed_m_s**2 - sideways**2)
        cos, sin = math.cos(direction), math.sin(direction)
        return forward * cos - sideways * sin, forward * sin + sideways * cos

    def _off(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return how far the finger is off its supposed place, along the path and to the left of it, m."""
        assert self._origin is not None
        place_x, place_y = self.path.place(self.travelled_m)
        x, y = x_m - self._origin[0] - place_x, y_m - self._origin[1] - place_y
        cos, sin = math.cos(self.direction_rad), math.sin(self.direction_rad)
        return x * cos + y * sin, y * cos - x * sin


def smooth(share: float) -> float:
    """Return a cosine rise from 0 to 1 as `share` goes from 0 to 1: no step in speed, no jolt in acceleration."""
    return 0.5 - 0.5 * math.cos(math.pi * min(1.0, max(0.0, share)))


def ramp_s(speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float = math.inf) -> float:
    """Return how long `smooth` takes to a speed v within the limits.

    Over a time T its acceleration is highest in the middle, π·v / (2·T), its jerk at both ends, π²·v / (2·T²).

    Parameters
    ----------
    speed_m_s
        Speed to be reached from standstill.
    acceleration_m_s2
        Largest acceleration.
    jerk_m_s3
        Largest jerk.

    Returns
    -------
    float
        s, never below MIN_RAMP_S.
    """
    by_acceleration = 0.5 * math.pi * speed_m_s / acceleration_m_s2
    by_jerk = math.pi * math.sqrt(0.5 * speed_m_s / jerk_m_s3)
    return max(MIN_RAMP_S, by_acceleration, by_jerk)


def lead_m(speed_m_s: float, gaining_s: float) -> float:
    """Return the way before the slide itself: to gain speed, at half of it in the mean, and to get steady."""
    return speed_m_s * (0.5 * gaining_s + STEADY_S)


def ramps_m(speed_m_s: float, gaining_s: float) -> float:
    """Return the way needed beside the slide itself: to gain speed, to get steady and to lose speed again."""
    return lead_m(speed_m_s, gaining_s) + 0.5 * speed_m_s * gaining_s
