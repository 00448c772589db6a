# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The motions by name: linear, circular, cross and surface slides, in-hand sliding, touches."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from texture_core.errors import ExplorationError, MotionRefused
from texture_core.types import ExplorationRequest
from texture_exploration.arms.arm import ArmState, Vector
from texture_exploration.safety import MAX_DISTANCE_M, SafetyLimits, stated
from texture_exploration.stages import (
    STEADY_S,
    AccelerateStage,
    Along,
    ApproachStage,
    BrakeStage,
    ContactWatch,
    Follower,
    GoHomeStage,
    LiftStage,
    Motion,
    PathFollower,
    Planner,
    SettleForceStage,
    SlideStage,
    TouchParams,
    lead_m,
    ramps_m,
    smooth,
)

# --------------------
# The stages that every slide of a finger over a surface has, whatever its path.


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
# Rub a surface to and fro with a fingertip, as the free fingers of a hand do on what the others hold.

# A stroke is about what a fingertip reaches; duration: Kaboli et al. 2015.
IN_HAND_SLIDING_DEFAULTS = {'speed_m_s': 0.02, 'force_n': 1.0, 'distance_m': 0.02, 'duration_s': 2.0}
IN_HAND_SLIDING_TURN_MARGIN_S = (
    0.01  # steady speed is guaranteed from one step after a turn until one step before the next
)
LEAST_SHARE = 0.5  # of the longest stroke: a random stroke is at least so long
# (whether the next stroke goes forth, where it begins, m) -> where it ends, m
StrokeEnds = Callable[[bool, float], float]


def whole_strokes(stroke_m: float) -> StrokeEnds:
    """Return the ends of strokes that are all `stroke_m` long."""
    return lambda forth, _begin_m: stroke_m if forth else 0.0


def random_strokes(longest_m: float, rng: np.random.Generator) -> StrokeEnds:
    """Return ends that are drawn at each turn: strokes of at least half of the longest, within 0 to `longest_m`."""
    least_m = LEAST_SHARE * longest_m

    def end_of(forth: bool, begin_m: float) -> float:
        low, high = (begin_m + least_m, longest_m) if forth else (0.0, begin_m - least_m)
        return float(rng.uniform(low, max(low, high)))

    return end_of


class Strokes:
    """Steer a finger to and fro on a line; a `Follower`.

    A turn follows a cosine from full speed one way to full speed the other way, so the finger neither stops with a jolt
    nor rests. Arms follow late: when the finger is seen to move the other way, half of its own turn is still to come,
    and nothing is guaranteed until that is over.
    """

    def __init__(self, heading_rad: float, ends: StrokeEnds, speed_m_s: float, turn_s: float, length_m: float) -> None:
        self.length_m = length_m
        self.travelled_m = 0.0
        self._heading_rad = heading_rad
        self._speed_m_s = speed_m_s
        self._turn_s = turn_s
        self._ends = ends
        self._runs_on_m = speed_m_s * turn_s / math.pi  # until it stands: the integral of the cosine over half a turn
        self._forth = True
        self._end_m = ends(True, 0.0)
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
        if self._since_turn_s < max(
            self._turn_s, self._reversed_s + 0.5 * self._turn_s + IN_HAND_SLIDING_TURN_MARGIN_S
        ):
            return 0.0
        return max(0.0, self._left_m - self._age_m - IN_HAND_SLIDING_TURN_MARGIN_S * self._speed_m_s)

    def begin_slide(self) -> None:
        """Strokes go on as they are: there is nothing to change."""

    def update(self, time_ns: int, arm: ArmState) -> None:
        """Take note of where the finger is, and turn at the end of the stroke."""
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
            self._end_m = self._ends(self._forth, self._end_m)

    @property
    def _turning(self) -> bool:
        return self._since_turn_s < self._turn_s

    @property
    def _left_m(self) -> float:
        """The way until the turn begins; below 0 beyond it."""
        left_m = self._end_m - self._along_m if self._forth else self._along_m - self._end_m
        return left_m - self._runs_on_m


def in_hand_sliding(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan strokes of `distance_m` to and fro, for `duration_s`.

    Which fingers slide and which hold is the hand's business (`texture_exploration.arms.in_hand`).
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
        What the operator asks for; 0 takes the default of a number.
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
        limits.complete(request, IN_HAND_SLIDING_DEFAULTS), home, touch, limits, ends=drawn, least_share=LEAST_SHARE
    )


def _plan(
    request: ExplorationRequest,
    home: Vector,
    touch: TouchParams,
    limits: SafetyLimits,
    *,
    ends: Callable[[float], StrokeEnds],
    least_share: float = 1.0,
) -> Motion:
    """Plan strokes of a complete request; the shortest is `least_share` of the longest."""
    speed = request.speed_m_s
    turn_s = touch.ramp_s(2 * speed)
    least_m = (ramps_m(speed, touch.ramp_s(speed)) + speed * turn_s) / least_share
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
            f'{request.motion}: distance_m is {stated(given, distance_m)}, which with {ramps:.3f} m to gain and lose '
            f'speed leaves the workspace; allowed in this direction is at most {math.floor(allowed * 1000) / 1000:g} m '
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
QUARTER_RAD = 0.5 * math.pi
CROSS_SLIDE_TURN_MARGIN_S = 0.01  # steady speed is guaranteed until one step before the corner
BISECTIONS = 20  # of the largest distance that is allowed: to less than a micrometre


class CrossLegs:
    """Steer a finger along a straight leg, round a corner of 90 degrees, and along a second leg; a `Follower`.

    In the corner the speed stays and the direction follows a cosine, so the finger neither stops nor jolts. Nothing is
    guaranteed there, nor until the arm has become steady after it.
    """

    def __init__(self, heading_rad: float, leg_m: float, speed_m_s: float, corner_s: float, arm_lag_s: float) -> None:
        self.travelled_m = 0.0
        self.length_m = 2.0 * leg_m + speed_m_s * (corner_s + STEADY_S)
        self._heading_rad = heading_rad
        self._leg_m = leg_m
        self._speed_m_s = speed_m_s
        self._corner_s = corner_s
        self._legs = [
            PathFollower(StraightPath(leg_m, heading_rad + quarter), arm_lag_s) for quarter in (0.0, QUARTER_RAD)
        ]
        self._corner_m = math.inf  # where on the path the first leg ends; unknown until the slide begins
        self._left_corner_s = math.nan  # until the arm is steady on the second leg; NaN on the first
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
        if math.isnan(self._left_corner_s):
            left_m = self._corner_m - self.travelled_m - self._age_m - CROSS_SLIDE_TURN_MARGIN_S * self._speed_m_s
            return max(0.0, left_m)
        return 0.0 if self._left_corner_s > 0.0 else math.inf

    def update(self, time_ns: int, arm: ArmState) -> None:
        """Take note of where the finger is, and enter the corner at the end of the first leg."""
        passed_s = (time_ns - self._time_ns) * 1e-9
        self._time_ns = time_ns
        self._age_m = self._speed_m_s * max(0.0, (time_ns - arm.time_ns) * 1e-9)
        if math.isnan(self._left_corner_s):
            self._follow(self._legs[0], time_ns, arm)
            if self.travelled_m + self._age_m >= self._corner_m:
                self._left_corner_s = self._corner_s + STEADY_S
            return
        self._left_corner_s -= passed_s
        if self._turned_rad < QUARTER_RAD:
            self.travelled_m += self._speed_m_s * passed_s
        else:
            self._follow(self._legs[1], time_ns, arm)

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
        if math.isnan(self._left_corner_s):
            return 0.0
        turning_s = self._corner_s + STEADY_S - self._left_corner_s
        return QUARTER_RAD * smooth(turning_s / self._corner_s)

    def _follow(self, leg: PathFollower, time_ns: int, arm: ArmState) -> None:
        before_m = leg.travelled_m
        leg.update(time_ns, arm)
        self.travelled_m += leg.travelled_m - before_m


def cross_slide(request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits) -> Motion:
    """Plan two slides of `distance_m` at right angles in one contact: along `direction_rad`, then to the left of it.

    Parameters
    ----------
    request
        What the operator asks for; 0 takes the default of a number.
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
    corner_s = touch.ramp_s(QUARTER_RAD * speed)  # the arc of a quarter turn is as steep as a ramp of so much
    _check_legs(request, home, limits, ramps_m(speed, touch.ramp_s(speed)) + speed * (corner_s + STEADY_S))
    legs = CrossLegs(request.direction_rad, request.distance_m, speed, corner_s, touch.arm_lag_s)
    return plan_surface_slide(legs, request, home, touch, limits)


def _check_legs(request: ExplorationRequest, home: Vector, limits: SafetyLimits, beside_m: float) -> None:
    """Refuse legs that leave the workspace; `beside_m` is the way beside a leg, for the ramps and the corner."""

    def fits(distance_m: float) -> bool:
        direction, reach_m = request.direction_rad, distance_m + beside_m
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
        f'{beside_m:.3f} m for the ramps and the corner leaves the workspace; allowed in this direction is at most '
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

# The numbers that each motion takes, with what is meant when one is not given: what the dashboard offers.
DEFAULTS: Mapping[str, Mapping[str, float]] = {
    'linear_slide': LINEAR_SLIDE_DEFAULTS,
    'circular': CIRCULAR_DEFAULTS,
    'cross_slide': CROSS_SLIDE_DEFAULTS,
    'in_hand_sliding': IN_HAND_SLIDING_DEFAULTS,
    'in_hand_random': IN_HAND_SLIDING_DEFAULTS,
}
