# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The motions by name: linear, circular, cross and surface slides, in-hand sliding, touches."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from texture_core.errors import ExplorationError, MotionRefused
from texture_core.types import ExplorationRequest
from texture_exploration.arms.arm import Vector
from texture_exploration.motion import Motion, Planner
from texture_exploration.paths import (
    LEAST_FRACTION,
    QUARTER_RAD,
    STEADY_S,
    CircularPath,
    CrossLegs,
    Follower,
    PathFollower,
    StraightPath,
    StrokeEnds,
    Strokes,
    lead_m,
    ramps_m,
    random_strokes,
    whole_strokes,
)
from texture_exploration.safety import MAX_DISTANCE_M, SafetyLimits, stated
from texture_exploration.stages import (
    AccelerateStage,
    Along,
    ApproachStage,
    BrakeStage,
    GoHomeStage,
    LiftStage,
    SettleForceStage,
    SlideStage,
)
from texture_exploration.touch import TouchParams
from texture_exploration.watches import ContactWatch

# --------------------
# The stages of every slide of a finger over a surface, on any path.


def plan_surface_slide(
    follower: Follower, request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits
) -> Motion:
    """Return the motion along a path, for a request whose speed and force are filled in and checked.

    Parameters
    ----------
    follower
        Path along the surface, as a function of the travelled distance.
    request
        With speed and force filled in and checked.
    home
        Place above which the finger comes down, m, in the frame of the surface.
    touch
        How the finger approaches, presses and lifts.
    limits
        Allowed speeds, forces and workspace.

    Returns
    -------
    Motion
        Go there, touch, press, speed up, slide, brake and lift.
    """
    speed, force = request.speed_m_s, request.force_n
    along = Along(follower, speed, force, touch, limits, ContactWatch(force, touch))
    slide = SlideStage(along)

    stages = [
        GoHomeStage(home, touch, limits),
        ApproachStage(force, touch, limits),
        SettleForceStage(force, touch, limits),
        AccelerateStage(along),
        slide,
        BrakeStage(along),
        LiftStage(home, force, touch, limits),
    ]
    return Motion(stages, slide)


# --------------------
# Slide in a circle at constant speed and force.

CIRCULAR_DEFAULTS = {'speed_m_s': 0.1, 'force_n': 1.0, 'radius_m': 0.02, 'turns': 2.0}  # ETS: "a radius of about 2" cm


def circular(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan `turns` turns on a circle around `home`; the slide begins at the angle `direction_rad` of the circle.

    The finger comes down before that angle, and gains its speed on the circle.
    """
    request = limits.complete(request, CIRCULAR_DEFAULTS)
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
            f'at most {math.floor(fastest * 1000) / 1000:g} m/s; choose a larger one',
            field='speed_m_s',
        )


def _check_free_distance(request: ExplorationRequest, home: Vector, limits: SafetyLimits) -> None:
    room = min(limits.free_distance_m(home, quarter * 0.5 * math.pi) for quarter in range(4))
    if request.radius_m > room:
        raise MotionRefused(
            f'{request.motion}: radius_m is {request.radius_m:g}, which leaves the workspace; allowed from here is at '
            f'most {math.floor(room * 1000) / 1000:g} m',
            ExplorationError.OUTSIDE_WORKSPACE,
            'radius_m',
        )


# --------------------
# Rub to and fro with a fingertip, as the free fingers of a hand do on an object that the others hold.

# A stroke is about what a fingertip reaches; duration: Kaboli et al. 2015.
IN_HAND_SLIDING_DEFAULTS = {'speed_m_s': 0.02, 'force_n': 1.0, 'distance_m': 0.02, 'duration_s': 2.0}


def in_hand_sliding(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan strokes of `distance_m` to and fro, for `duration_s`.

    Which fingers slide and which hold is up to the hand (`texture_exploration.arms.in_hand`).
    """
    return _plan(limits.complete(request, IN_HAND_SLIDING_DEFAULTS), home, touch, limits, ends=whole_strokes)


def in_hand_random(
    request: ExplorationRequest,
    home: Vector,
    touch: TouchParams,
    limits: SafetyLimits,
    rng: np.random.Generator | None = None,
) -> Motion:
    """Plan the same with strokes of random length, each of at least half of `distance_m`.

    Parameters
    ----------
    request
        Request of the operator; a number of 0 takes its default.
    home
        Place where the strokes begin, m, in the frame of the surface.
    touch
        How the finger approaches, presses and lifts.
    limits
        Allowed speeds, forces and workspace.
    rng
        Draws the strokes; None: other ones each time.

    Returns
    -------
    Motion
        Ready for its first step.

    Raises
    ------
    MotionRefused
        If a number is out of its range, does not belong to this motion, or a stroke leaves the workspace.

    Source: the "random exploratory movements" that Kaboli et al. 2015, section VI, leave to future work.
    """
    drawn = partial(random_strokes, rng=rng or np.random.default_rng())
    return _plan(
        limits.complete(request, IN_HAND_SLIDING_DEFAULTS), home, touch, limits, ends=drawn, least=LEAST_FRACTION
    )


def _plan(
    request: ExplorationRequest,
    home: Vector,
    touch: TouchParams,
    limits: SafetyLimits,
    *,
    ends: Callable[[float], StrokeEnds],
    least: float = 1.0,
) -> Motion:
    """Plan strokes of a complete request; the shortest is `least` of the longest."""
    speed = request.speed_m_s
    turn_s = touch.ramp_s(2 * speed)
    least_m = (ramps_m(speed, touch.ramp_s(speed)) + speed * turn_s) / least
    _check_stroke(request, home, limits, least_m)
    strokes = Strokes(request.direction_rad, ends(request.distance_m), speed, turn_s, speed * request.duration_s)
    return plan_surface_slide(strokes, request, home, touch, limits)


def _check_stroke(request: ExplorationRequest, home: Vector, limits: SafetyLimits, least_m: float) -> None:
    room = limits.free_distance_m(home, request.direction_rad)
    if not least_m <= request.distance_m <= room:
        raise MotionRefused(
            f'{request.motion}: distance_m, the length of a stroke, is {request.distance_m:g}; allowed is '
            f'{math.ceil(least_m * 1e4) / 1e4:g} m, to turn at this speed, to {math.floor(room * 1e3) / 1e3:g} m, the '
            'end of the workspace',
            ExplorationError.OUTSIDE_WORKSPACE if request.distance_m > room else ExplorationError.INVALID_REQUEST,
            'distance_m',
        )


# --------------------
# Slide in a straight line at constant speed and force.

LINEAR_SLIDE_DEFAULTS = {'speed_m_s': 0.05, 'force_n': 1.0, 'distance_m': 0.1}


def linear_slide(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan a slide of `distance_m` at constant speed, with a ramp before and after it."""
    _check_linear_free_distance(request, home, touch, limits)
    request = limits.complete(request, LINEAR_SLIDE_DEFAULTS)
    follower = PathFollower(StraightPath(request.distance_m, request.direction_rad), touch.arm_lag_s)
    return plan_surface_slide(follower, request, home, touch, limits)


def _check_linear_free_distance(
    request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits
) -> None:
    """Refuse a slide that leaves the workspace, with the smaller of what the workspace and `MAX_DISTANCE_M` allow."""
    given, limited = request.distance_m, replace(request, distance_m=min(request.distance_m, MAX_DISTANCE_M))
    request = limits.complete(limited, LINEAR_SLIDE_DEFAULTS)
    distance_m = given or request.distance_m
    ramps = ramps_m(request.speed_m_s, touch.ramp_s(request.speed_m_s))
    allowed = max(0.0, limits.free_distance_m(home, request.direction_rad) - ramps)
    if distance_m > allowed:
        allowed = min(allowed, MAX_DISTANCE_M)
        raise MotionRefused(
            f'{request.motion}: distance_m is {stated(given, distance_m)}, which with {ramps:.3f} m for the ramps '
            f'leaves the workspace; allowed in this direction is at most {math.floor(allowed * 1000) / 1000:g} m '
            f'{limits.limits_ahead(home, request.direction_rad)}',
            ExplorationError.OUTSIDE_WORKSPACE,
            'distance_m',
        )


# --------------------
# Slide along one direction, go round a corner, and slide along the direction at right angles to it.

CROSS_SLIDE_DEFAULTS = {
    'speed_m_s': 0.0255,
    'force_n': 1.5,
    'distance_m': 0.05,
}  # Hu et al. 2014, section 5.1; no length is given
BISECTIONS = 20  # of the largest distance that is allowed: to less than a micrometre


def cross_slide(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan two slides of `distance_m` at right angles in one contact: along `direction_rad`, then to the left of it.

    Parameters
    ----------
    request
        Request of the operator; a number of 0 takes its default.
    home
        Place where the first slide begins, m, in the frame of the surface.
    touch
        How the finger approaches, presses and lifts.
    limits
        Allowed speeds, forces and workspace.

    Returns
    -------
    Motion
        Ready for its first step.

    Raises
    ------
    MotionRefused
        If a number is out of its range, does not belong to this motion, or a leg leaves the workspace.
    """
    request = limits.complete(request, CROSS_SLIDE_DEFAULTS)
    speed = request.speed_m_s
    corner_s = touch.ramp_s(QUARTER_RAD * speed)  # the arc of a quarter turn is as steep as a ramp of this speed
    _check_legs(request, home, limits, ramps_m(speed, touch.ramp_s(speed)) + speed * (corner_s + STEADY_S))
    legs = CrossLegs(request.direction_rad, request.distance_m, speed, corner_s, touch.arm_lag_s)
    return plan_surface_slide(legs, request, home, touch, limits)


def _check_legs(request: ExplorationRequest, home: Vector, limits: SafetyLimits, extra_m: float) -> None:
    """Refuse legs that leave the workspace; `extra_m` is the distance for the ramps and the corner."""

    def fits(distance_m: float) -> bool:
        direction, reach_m = request.direction_rad, distance_m + extra_m
        corner = (home[0] + reach_m * math.cos(direction), home[1] + reach_m * math.sin(direction), home[2])
        return (
            limits.free_distance_m(home, direction) >= reach_m
            and limits.free_distance_m(corner, direction + QUARTER_RAD) >= reach_m
        )

    if fits(request.distance_m):
        return
    low, high = 0.0, request.distance_m
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    raise MotionRefused(
        f'{request.motion}: distance_m, the length of each of two legs, is {request.distance_m:g}, which with '
        f'{extra_m:.3f} m for the ramps and the corner leaves the workspace; allowed in this direction is at most '
        f'{math.floor(low * 1000) / 1000:g} m '
        f'{limits.limits_ahead(home, request.direction_rad, request.direction_rad + QUARTER_RAD)}',
        ExplorationError.OUTSIDE_WORKSPACE,
        'distance_m',
    )


# --------------------
# All motions by name.

MOTIONS: Mapping[str, Planner] = {
    'linear_slide': linear_slide,  # ETS, Jamali & Sammut 2010, Hu et al. 2014
    'circular': circular,  # ETS
    'cross_slide': cross_slide,  # Hu et al. 2014: along x and along y
    'in_hand_sliding': in_hand_sliding,  # Kaboli et al. 2015
    'in_hand_random': in_hand_random,  # its future work: random exploratory movements
}

# The numbers that each motion takes, with their defaults: the form of the dashboard.
DEFAULTS: Mapping[str, Mapping[str, float]] = {
    'linear_slide': LINEAR_SLIDE_DEFAULTS,
    'circular': CIRCULAR_DEFAULTS,
    'cross_slide': CROSS_SLIDE_DEFAULTS,
    'in_hand_sliding': IN_HAND_SLIDING_DEFAULTS,
    'in_hand_random': IN_HAND_SLIDING_DEFAULTS,
}
