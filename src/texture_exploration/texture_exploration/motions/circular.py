"""Slide in a circle at constant speed and force."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.errors import MotionRefused
from texture_core.exploration import ExplorationRequest
from texture_exploration.arms.protocol import Vector
from texture_exploration.motions.path import PathFollower, lead_m
from texture_exploration.motions.protocol import Motion
from texture_exploration.motions.surface_slide import plan_surface_slide
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits

DEFAULTS = {'speed_m_s': 0.1, 'force_n': 1.0, 'radius_m': 0.02, 'turns': 2.0}  # ETS: "a radius of about 2" cm


@dataclass(frozen=True)
class CircularPath:
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


def circular(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan `turns` turns on a circle around `home`; the slide begins at the angle `direction_rad` of the circle.

    The finger comes down before that angle, and gains its speed on the circle.
    """
    request = limits.complete(request, DEFAULTS)
    _check_speed(request, limits)
    _check_free_distance(request, home, limits)
    radius, speed = request.radius_m, request.speed_m_s
    start = request.direction_rad - lead_m(speed, touch.ramp_s(speed)) / radius
    begin = (home[0] + radius * math.cos(start), home[1] + radius * math.sin(start), home[2])
    follower = PathFollower(CircularPath(radius, request.turns, start), touch.arm_lag_s)
    return plan_surface_slide(follower, request, begin, touch, limits)


def _check_speed(request: ExplorationRequest, limits: SafetyLimits) -> None:
    fastest = math.sqrt(limits.max_turning_m_s2 * request.radius_m)
    if request.speed_m_s > fastest:
        raise MotionRefused(
            f'{request.motion}: speed_m_s is {request.speed_m_s:g}; on a circle of {request.radius_m:g} m allowed is '
            f"at most {math.floor(fastest * 1000) / 1000:g} m/s; choose a larger one or raise 'max_turning_m_s2'"
        )


def _check_free_distance(request: ExplorationRequest, home: Vector, limits: SafetyLimits) -> None:
    room = min(limits.free_distance_m(home, quarter * 0.5 * math.pi) for quarter in range(4))
    if request.radius_m > room:
        raise MotionRefused(
            f'{request.motion}: radius_m is {request.radius_m:g}, which leaves the workspace; allowed from here is at '
            f'most {math.floor(room * 1000) / 1000:g} m'
        )
