"""Slide in a straight line at constant speed and force."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from texture_core.errors import MotionRefused
from texture_core.exploration import ExplorationRequest
from texture_exploration.arms.protocol import Vector
from texture_exploration.motions.path import PathFollower, ramps_m
from texture_exploration.motions.protocol import Motion
from texture_exploration.motions.surface_slide import plan_surface_slide
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits, stated

DEFAULTS = {'speed_m_s': 0.05, 'force_n': 1.0, 'distance_m': 0.1}


@dataclass(frozen=True)
class StraightPath:
    """A straight path."""

    length_m: float
    heading_rad: float

    def place(self, travelled_m: float) -> tuple[float, float]:
        """Return the place, m."""
        return travelled_m * math.cos(self.heading_rad), travelled_m * math.sin(self.heading_rad)

    def direction_rad(self, travelled_m: float) -> float:
        """Return the same direction everywhere."""
        return self.heading_rad


def linear_slide(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan a slide of `distance_m` at constant speed, with a ramp before and after it."""
    _check_free_distance(request, home, touch, limits)
    request = limits.complete(request, DEFAULTS)
    follower = PathFollower(StraightPath(request.distance_m, request.direction_rad), touch.arm_lag_s)
    return plan_surface_slide(follower, request, home, touch, limits)


def _check_free_distance(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> None:
    """Refuse a slide that leaves the workspace, with the smaller limit of the workspace and of `max_distance_m`."""
    given, limited = request.distance_m, replace(request, distance_m=min(request.distance_m, limits.max_distance_m))
    request = limits.complete(limited, DEFAULTS)
    distance_m = given or request.distance_m
    ramps = ramps_m(request.speed_m_s, touch.ramp_s(request.speed_m_s))
    allowed = max(0.0, limits.free_distance_m(home, request.direction_rad) - ramps)
    if distance_m > allowed:
        allowed = min(allowed, limits.max_distance_m)
        raise MotionRefused(
            f'{request.motion}: distance_m is {stated(given, distance_m)}, which with {ramps:.3f} m to gain and lose '
            f'speed leaves the workspace; allowed in this direction is at most {math.floor(allowed * 1000) / 1000:g} m'
        )
