# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The motions by name: linear, circular, cross and surface slides, in-hand sliding, touches."""

from __future__ import annotations

import math
from collections.abc import Mapping

from texture_core.errors import ExplorationError, MotionRefused
from texture_core.types import ExplorationRequest
from texture_exploration.arms.arm import Vector
from texture_exploration.motion import Motion, Planner
from texture_exploration.paths import (
    QUARTER_RAD,
    STEADY_S,
    CircularPath,
    CrossLegs,
    PathFollower,
    StraightPath,
    Strokes,
    lead_m,
    ramps_m,
)
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams

# The numbers that each motion takes, with their defaults: the form of the dashboard.
DEFAULTS: Mapping[str, Mapping[str, float]] = {
    'linear_slide': {'speed_m_s': 0.05, 'force_n': 1.0, 'distance_m': 0.1},
    'circular': {'speed_m_s': 0.1, 'force_n': 1.0, 'radius_m': 0.02, 'turns': 2.0},  # ETS: "a radius of about 2" cm
    'cross_slide': {'speed_m_s': 0.0255, 'force_n': 1.5, 'distance_m': 0.05},  # Hu et al. 2014, section 5.1; no length
    # A stroke is about what a fingertip reaches; duration: Kaboli et al. 2015.
    'in_hand_sliding': {'speed_m_s': 0.02, 'force_n': 1.0, 'distance_m': 0.02, 'duration_s': 2.0},
}

# --------------------
# Slide in a circle at constant speed and force.


def circular(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan `turns` turns on a circle around `home`; the slide begins at the angle `direction_rad` of the circle.

    The finger comes down before that angle, and gains its speed on the circle.
    """
    request = limits.complete(request, DEFAULTS['circular'])
    radius, speed = request.radius_m, request.speed_m_s
    fastest = math.sqrt(limits.max_turning_m_s2 * radius)
    if speed > fastest:
        raise MotionRefused(
            f'{request.motion}: speed_m_s is {speed:g}; on a circle of {radius:g} m allowed is '
            f'at most {math.floor(fastest * 1000) / 1000:g} m/s; choose a larger one',
            field='speed_m_s',
        )
    room = min(limits.free_distance_m(home, quarter * QUARTER_RAD) for quarter in range(4))
    if radius > room:
        raise MotionRefused(
            f'{request.motion}: radius_m is {radius:g}, which leaves the workspace; allowed from here is at '
            f'most {math.floor(room * 1000) / 1000:g} m',
            ExplorationError.OUTSIDE_WORKSPACE,
            'radius_m',
        )
    start = request.direction_rad - lead_m(speed, touch.ramp_s(speed)) / radius
    begin = (home[0] + radius * math.cos(start), home[1] + radius * math.sin(start), home[2])
    follower = PathFollower(CircularPath(radius, request.turns, start), touch.arm_lag_s)
    return Motion(follower, request, begin, touch, limits)


# --------------------
# Rub to and fro with a fingertip, as the free fingers of a hand do on an object that the others hold.


def in_hand_sliding(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan strokes of `distance_m` to and fro, for `duration_s`.

    Which fingers slide and which hold is up to the hand (`texture_exploration.arms.in_hand`).
    """
    request = limits.complete(request, DEFAULTS['in_hand_sliding'])
    speed, stroke_m = request.speed_m_s, request.distance_m
    turn_s = touch.ramp_s(2 * speed)
    least_m = ramps_m(speed, touch.ramp_s(speed)) + speed * turn_s
    room = limits.free_distance_m(home, request.direction_rad)
    if not least_m <= stroke_m <= room:
        raise MotionRefused(
            f'{request.motion}: distance_m, the length of a stroke, is {stroke_m:g}; allowed is '
            f'{math.ceil(least_m * 1e4) / 1e4:g} m, to turn at this speed, to {math.floor(room * 1e3) / 1e3:g} m, the '
            'end of the workspace',
            ExplorationError.OUTSIDE_WORKSPACE if stroke_m > room else ExplorationError.INVALID_REQUEST,
            'distance_m',
        )
    strokes = Strokes(request.direction_rad, stroke_m, speed, turn_s, speed * request.duration_s)
    return Motion(strokes, request, home, touch, limits)


# --------------------
# Slide in a straight line at constant speed and force.


def linear_slide(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan a slide of `distance_m` at constant speed, with a ramp before and after it."""
    given_m, request = request.distance_m, limits.complete(request, DEFAULTS['linear_slide'])
    ramps = ramps_m(request.speed_m_s, touch.ramp_s(request.speed_m_s))
    allowed = max(0.0, limits.free_distance_m(home, request.direction_rad) - ramps)
    if request.distance_m > allowed:
        default = '' if given_m else ' (the default of the motion)'
        raise MotionRefused(
            f'{request.motion}: distance_m is {request.distance_m:g}{default}, which with {ramps:.3f} m for the '
            'ramps leaves the workspace; allowed in this direction is at most '
            f'{math.floor(allowed * 1000) / 1000:g} m {limits.limits_ahead(home, request.direction_rad)}',
            ExplorationError.OUTSIDE_WORKSPACE,
            'distance_m',
        )
    follower = PathFollower(StraightPath(request.distance_m, request.direction_rad), touch.arm_lag_s)
    return Motion(follower, request, home, touch, limits)


# --------------------
# Slide along one direction, go round a corner, and slide along the direction at right angles to it.


def cross_slide(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan two slides of `distance_m` at right angles in one contact: along `direction_rad`, then to the left of it."""
    request = limits.complete(request, DEFAULTS['cross_slide'])
    speed, direction = request.speed_m_s, request.direction_rad
    corner_s = touch.ramp_s(QUARTER_RAD * speed)  # the arc of a quarter turn is as steep as a ramp of this speed
    extra_m = ramps_m(speed, touch.ramp_s(speed)) + speed * (corner_s + STEADY_S)
    # The end of the second leg lies along the diagonal; between points within the workspace all is within it.
    diagonal_m = limits.free_distance_m(home, direction + 0.5 * QUARTER_RAD)
    allowed_m = min(limits.free_distance_m(home, direction), diagonal_m / math.sqrt(2.0)) - extra_m
    if request.distance_m > allowed_m:
        raise MotionRefused(
            f'{request.motion}: distance_m, the length of each of two legs, is {request.distance_m:g}, which with '
            f'{extra_m:.3f} m for the ramps and the corner leaves the workspace; allowed in this direction is at most '
            f'{math.floor(max(0.0, allowed_m) * 1000) / 1000:g} m '
            f'{limits.limits_ahead(home, direction, direction + QUARTER_RAD)}',
            ExplorationError.OUTSIDE_WORKSPACE,
            'distance_m',
        )
    legs = CrossLegs(direction, request.distance_m, speed, corner_s, touch.arm_lag_s)
    return Motion(legs, request, home, touch, limits)


# --------------------
# All motions by name.

MOTIONS: dict[str, Planner] = {
    'linear_slide': linear_slide,  # ETS, Jamali & Sammut 2010, Hu et al. 2014
    'circular': circular,  # ETS
    'cross_slide': cross_slide,  # Hu et al. 2014: along x and along y
    'in_hand_sliding': in_hand_sliding,  # Kaboli et al. 2015
}
