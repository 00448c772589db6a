# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Paths of a finger on the surface, followers of paths, and speed ramps."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

from texture_exploration.arms.arm import ArmState

# --------------------
# A path along the surface, the progress of the finger on it, and speed ramps.

MIN_RAMP_S = 0.1  # even a slow slide starts softly
STEADY_S = 0.05  # at full speed before it counts as sliding: the arm lags, the skin still oscillates
HALF_STEP_S = 0.005  # a command holds for one step of the exploration: its middle counts
STEERING_1_S = 15.0  # sideways speed per distance from the path; a tenth of what would be too much for a lag of 20 ms
MAX_SIDEWAYS = 0.5  # fraction of the speed
TURN_MARGIN_S = 0.01  # steady speed is guaranteed from one step after a turn until one step before the next


class SurfacePath(Protocol):
    """A curve along the surface; `travelled_m` counts from where the finger begins to gain speed."""

    @property
    def length_m(self) -> float:
        """Length of the part at constant speed."""

    def place(self, travelled_m: float) -> tuple[float, float]:
        """Return the place on the path, as seen from its beginning, m."""

    def direction_rad(self, travelled_m: float) -> float:
        """Return the direction of travel from +x towards +y."""


class Follower:
    """Steers the finger along the surface, for the stages of a slide; a base of all followers.

    `length_m` is the length of the part at constant speed, `travelled_m` the way until now.
    """

    def __init__(self, length_m: float) -> None:
        self.length_m = length_m
        self.travelled_m = 0.0

    @property
    def steady_m(self) -> float:
        """How far from here speed and force can be kept."""
        return math.inf

    @property
    def direction_rad(self) -> float:
        """Present direction of travel."""
        raise NotImplementedError

    def begin_slide(self) -> None:
        """Mark the start of the slide after the ramp."""

    def update(self, time_ns: int, arm: ArmState) -> None:
        """Update the position of the finger."""
        raise NotImplementedError

    def velocity(self, speed_m_s: float) -> tuple[float, float]:
        """Return the velocity to command for a speed, m/s."""
        raise NotImplementedError


class PathFollower(Follower):
    """Keep track of how far the finger has travelled on a path, and steer it along.

    The path begins where the finger is at the first update. The direction is that of the path where the finger will be
    in the middle of the next step: age of the state, lag of the arm (`arm_lag_s` after a command) and half a step
    ahead. The remaining distance to the path is corrected at constant speed.
    """

    def __init__(self, path: SurfacePath, arm_lag_s: float = 0.0) -> None:
        super().__init__(path.length_m)
        self.path = path
        self._arm_lag_s = arm_lag_s
        self._age_s = 0.0
        self._across_m = 0.0
        self._origin: tuple[float, float] | None = None

    @property
    def direction_rad(self) -> float:
        """Present direction of travel."""
        return self.path.direction_rad(self.travelled_m)

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


def smooth(fraction: float) -> float:
    """Return a cosine rise from 0 to 1 for `fraction` from 0 to 1: no step in speed, limited jerk."""
    return 0.5 - 0.5 * math.cos(math.pi * min(1.0, max(0.0, fraction)))


def ramp_s(speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float = math.inf) -> float:
    """Return how long `smooth` takes to a speed v within the limits.

    Over a time T its acceleration is highest in the middle, π·v / (2·T), its jerk at both ends, π²·v / (2·T²).
    """
    by_acceleration = 0.5 * math.pi * speed_m_s / acceleration_m_s2
    by_jerk = math.pi * math.sqrt(0.5 * speed_m_s / jerk_m_s3)
    return max(MIN_RAMP_S, by_acceleration, by_jerk)


def lead_m(speed_m_s: float, gaining_s: float) -> float:
    """Return the distance before the slide: to gain speed, at half of it in the mean, and to become steady."""
    return speed_m_s * (0.5 * gaining_s + STEADY_S)


def ramps_m(speed_m_s: float, gaining_s: float) -> float:
    """Return the distance before and after the slide: to gain speed, to become steady and to lose speed."""
    return lead_m(speed_m_s, gaining_s) + 0.5 * speed_m_s * gaining_s


# --------------------
# A straight line.


class StraightPath(NamedTuple):
    """A straight path."""

    length_m: float
    heading_rad: float

    def place(self, travelled_m: float) -> tuple[float, float]:
        """Return the place, m."""
        return travelled_m * math.cos(self.heading_rad), travelled_m * math.sin(self.heading_rad)

    def direction_rad(self, travelled_m: float) -> float:
        """Return the same direction everywhere."""
        return self.heading_rad


# --------------------
# A circle.


class CircularPath(NamedTuple):
    """A circle, counter-clockwise as seen from above; `start_rad` is where on it the path begins."""

    radius_m: float
    turns: float
    start_rad: float

    @property
    def length_m(self) -> float:
        """Length of all turns."""
        return 2 * math.pi * self.radius_m * self.turns

    def place(self, travelled_m: float) -> tuple[float, float]:
        """Return the place, as seen from the beginning, m."""
        angle = self._angle_rad(travelled_m)
        x = math.cos(angle) - math.cos(self.start_rad)
        y = math.sin(angle) - math.sin(self.start_rad)
        return self.radius_m * x, self.radius_m * y

    def direction_rad(self, travelled_m: float) -> float:
        """Return the direction of the tangent, −π to π."""
        return math.remainder(self._angle_rad(travelled_m) + 0.5 * math.pi, 2 * math.pi)

    def _angle_rad(self, travelled_m: float) -> float:
        return self.start_rad + travelled_m / self.radius_m


# --------------------
# To and fro on a line, as a fingertip rubs.


class Strokes(Follower):
    """Steer a finger to and fro on a line.

    A turn follows a cosine from full speed one way to full speed the other way, so the finger neither stops with a jolt
    nor rests. Arms follow late: when the finger is seen to move the other way, half of its turn is still to come,
    and nothing is guaranteed until that is over.
    """

    def __init__(self, heading_rad: float, stroke_m: float, speed_m_s: float, turn_s: float, length_m: float) -> None:
        super().__init__(length_m)
        self._heading_rad = heading_rad
        self._speed_m_s = speed_m_s
        self._turn_s = turn_s
        self._stroke_m = stroke_m
        self._runs_on_m = speed_m_s * turn_s / math.pi  # until it stops: the integral of the cosine over half a turn
        self._forth = True
        self._along_m = self._age_m = 0.0
        self._since_turn_s = math.inf  # since the newest turn began
        self._reversed_s = 0.0  # when, after that, the finger was seen to move the other way; inf until then
        self._time_ns = 0
        self._origin: tuple[float, float] | None = None

    @property
    def direction_rad(self) -> float:
        """Present direction of travel."""
        forth = self._forth is (self._since_turn_s > 0.5 * self._turn_s)
        return math.remainder(self._heading_rad + (0.0 if forth else math.pi), 2 * math.pi)

    @property
    def steady_m(self) -> float:
        """The way left until the finger turns; none while it does."""
        if self._since_turn_s < max(self._turn_s, self._reversed_s + 0.5 * self._turn_s + TURN_MARGIN_S):
            return 0.0
        return max(0.0, self._left_m - self._age_m - TURN_MARGIN_S * self._speed_m_s)

    def update(self, time_ns: int, arm: ArmState) -> None:
        """Update the position of the finger, and turn at the end of the stroke."""
        x, y, _ = arm.position
        if self._origin is None:
            self._origin, self._time_ns = (x, y), time_ns
        cos, sin = math.cos(self._heading_rad), math.sin(self._heading_rad)
        along = (x - self._origin[0]) * cos + (y - self._origin[1]) * sin
        passed_s = (time_ns - self._time_ns) * 1e-9
        self.travelled_m += self._speed_m_s * passed_s if self._turning else abs(along - self._along_m)
        self._along_m = along
        self._age_m = self._speed_m_s * max(0.0, (time_ns - arm.time_ns) * 1e-9)
        self._turn(passed_s, arm.velocity[0] * cos + arm.velocity[1] * sin)
        self._time_ns = time_ns

    def velocity(self, speed_m_s: float) -> tuple[float, float]:
        """Return the velocity for a speed, m/s; less than it while turning."""
        turned = -math.cos(math.pi * self._since_turn_s / self._turn_s) if self._turning else 1.0
        along = speed_m_s * (turned if self._forth else -turned)
        return along * math.cos(self._heading_rad), along * math.sin(self._heading_rad)

    def _turn(self, passed_s: float, along_m_s: float) -> None:
        self._since_turn_s += passed_s
        if along_m_s > 0.0 if self._forth else along_m_s < 0.0:
            self._reversed_s = min(self._reversed_s, self._since_turn_s)
        if not self._turning and self._left_m < 0.0:
            self._forth = not self._forth
            self._since_turn_s, self._reversed_s = 0.0, math.inf

    @property
    def _turning(self) -> bool:
        return self._since_turn_s < self._turn_s

    @property
    def _left_m(self) -> float:
        """The way until the turn begins; below 0 beyond it."""
        left_m = self._stroke_m - self._along_m if self._forth else self._along_m
        return left_m - self._runs_on_m


# --------------------
# Two straight legs with a corner of 90 degrees between them.

QUARTER_RAD = 0.5 * math.pi


class CrossLegs(Follower):
    """Steer a finger along a straight leg, round a corner of 90 degrees, and along a second leg.

    In the corner the speed stays and the direction follows a cosine, so the finger neither stops nor jolts. Nothing is
    guaranteed there, nor until the arm has become steady after it.
    """

    def __init__(self, heading_rad: float, leg_m: float, speed_m_s: float, corner_s: float, arm_lag_s: float) -> None:
        super().__init__(2.0 * leg_m + speed_m_s * (corner_s + STEADY_S))
        self._heading_rad = heading_rad
        self._leg_m = leg_m
        self._speed_m_s = speed_m_s
        self._corner_s = corner_s
        self._legs = [
            PathFollower(StraightPath(leg_m, heading_rad + quarter), arm_lag_s) for quarter in (0.0, QUARTER_RAD)
        ]
        self._corner_m = math.inf  # where on the path the first leg ends; unknown until the slide begins
        self._turning_s = -math.inf  # since the corner began
        self._age_m = 0.0
        self._time_ns = 0

    def begin_slide(self) -> None:
        """The first leg counts from here."""
        self._corner_m = self.travelled_m + self._leg_m

    @property
    def direction_rad(self) -> float:
        """Present direction of travel."""
        return math.remainder(self._heading_rad + self._turned_rad, 2 * math.pi)

    @property
    def steady_m(self) -> float:
        """The way left until the corner, none in it, and no limit on the second leg."""
        if self._turning_s < 0.0:
            left_m = self._corner_m - self.travelled_m - self._age_m - TURN_MARGIN_S * self._speed_m_s
            return max(0.0, left_m)
        return 0.0 if self._turning_s < self._corner_s + STEADY_S else math.inf

    def update(self, time_ns: int, arm: ArmState) -> None:
        """Update the position of the finger, and enter the corner at the end of the first leg."""
        passed_s = (time_ns - self._time_ns) * 1e-9
        self._time_ns = time_ns
        self._age_m = self._speed_m_s * max(0.0, (time_ns - arm.time_ns) * 1e-9)
        self._turning_s += passed_s
        if self._turning_s >= 0.0 and self._turned_rad < QUARTER_RAD:
            self.travelled_m += self._speed_m_s * passed_s
            return
        leg = self._legs[self._turning_s >= 0.0]
        before_m = leg.travelled_m
        leg.update(time_ns, arm)
        self.travelled_m += leg.travelled_m - before_m
        if self._turning_s < 0.0 and self.travelled_m + self._age_m >= self._corner_m:
            self._turning_s = 0.0

    def velocity(self, speed_m_s: float) -> tuple[float, float]:
        """Return the velocity for a speed, m/s."""
        turned_rad = self._turned_rad
        if 0.0 < turned_rad < QUARTER_RAD:
            direction = self._heading_rad + turned_rad
            return speed_m_s * math.cos(direction), speed_m_s * math.sin(direction)
        return self._legs[turned_rad > 0.0].velocity(speed_m_s)

    @property
    def _turned_rad(self) -> float:
        """By how much the finger has turned, 0 to a quarter."""
        return QUARTER_RAD * smooth(self._turning_s / self._corner_s)
