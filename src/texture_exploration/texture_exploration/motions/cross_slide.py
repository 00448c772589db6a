"""Slide along one direction, go round a corner, and slide along the direction at right angles to it."""

from __future__ import annotations

import math

from texture_core.errors import MotionRefused
from texture_core.exploration import ExplorationRequest
from texture_exploration.arms.protocol import ArmState, Vector
from texture_exploration.motions.linear_slide import StraightPath
from texture_exploration.motions.path import STEADY_S, PathFollower, ramps_m, smooth
from texture_exploration.motions.protocol import Motion
from texture_exploration.motions.surface_slide import plan_surface_slide
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits

DEFAULTS = {'speed_m_s': 0.0255, 'force_n': 1.5, 'distance_m': 0.05}  # Hu et al. 2014, section 5.1; no length is given
QUARTER_RAD = 0.5 * math.pi
TURN_MARGIN_S = 0.01  # steady speed is guaranteed until one step before the corner
BISECTIONS = 20  # of the largest distance that is allowed: to less than a micrometre


class CrossLegs:
    """Steer a finger along a straight leg, round a corner of 90 degrees, and along a second leg; a `Follower`.

    In the corner the speed stays and the direction follows a cosine, so the finger neither stops nor jolts. Nothing is
    guaranteed there, nor until the arm has become steady after it.

    Parameters
    ----------
    heading_rad
        Direction of the first leg; that of the second is a quarter turn anticlockwise from it.
    leg_m
        Length of each leg at constant speed.
    speed_m_s
        Along both.
    corner_s
        How long the corner takes.
    arm_lag_s
        How long the arm takes to follow a command.
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
            left_m = self._corner_m - self.travelled_m - self._age_m - TURN_MARGIN_S * self._speed_m_s
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
    request = limits.complete(request, DEFAULTS)
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
        f'{math.floor(low * 1000) / 1000:g} m'
    )
