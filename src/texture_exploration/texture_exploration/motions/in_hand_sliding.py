"""Rub a surface to and fro with a fingertip, as the free fingers of a hand do on what the others hold."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from texture_core.errors import MotionRefused
from texture_core.exploration import ExplorationRequest
from texture_exploration.arms.protocol import ArmState, Vector
from texture_exploration.motions.path import ramps_m
from texture_exploration.motions.protocol import Motion
from texture_exploration.motions.surface_slide import plan_surface_slide
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits

# A stroke is about what a fingertip reaches; duration: Kaboli et al. 2015.
DEFAULTS = {'speed_m_s': 0.02, 'force_n': 1.0, 'distance_m': 0.02, 'duration_s': 2.0}
TURN_MARGIN_S = 0.01  # steady speed is guaranteed from one step after a turn until one step before the next
LEAST_SHARE = 0.5  # of the longest stroke: a random stroke is at least so long
# (whether the next stroke goes forth, where it begins, m) -> where it ends, m
StrokeEnds = Callable[[bool, float], float]


def whole_strokes(stroke_m: float) -> StrokeEnds:
    """Return the ends of strokes that are all `stroke_m` long."""
    return lambda forth, _begin_m: stroke_m if forth else 0.0


def random_strokes(longest_m: float, rng: np.random.Generator) -> StrokeEnds:
    """Return ends that are drawn at each turn: strokes of at least half of the longest, within 0 to `longest_m`.

    Parameters
    ----------
    longest_m
        Way that all strokes stay within.
    rng
        Draws the ends, equally distributed over what is allowed.
    """
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

    Parameters
    ----------
    heading_rad
        Direction of the first stroke.
    ends
        Where each stroke ends, as seen from where the first begins.
    speed_m_s
        Between the turns.
    turn_s
        How long a turn takes.
    length_m
        The way of all strokes together as if it had no turns: a turn counts as long as it takes.
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
        if self._since_turn_s < max(self._turn_s, self._reversed_s + 0.5 * self._turn_s + TURN_MARGIN_S):
            return 0.0
        return max(0.0, self._left_m - self._age_m - TURN_MARGIN_S * self._speed_m_s)

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
    return _plan(limits.complete(request, DEFAULTS), home, touch, limits, ends=whole_strokes)


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
    return _plan(limits.complete(request, DEFAULTS), home, touch, limits, ends=drawn, least_share=LEAST_SHARE)


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
            'end of the workspace'
        )
