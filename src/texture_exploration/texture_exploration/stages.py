# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The stages of which motions are made: touch, press, slide, lift; each knows what to command and when it is over."""

from __future__ import annotations

import math
import statistics
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from texture_core.config import param
from texture_core.errors import ExplorationError, MotionAborted, MotionRefused
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.arm import ArmCommand, ArmState, FreeAir, Vector
from texture_exploration.force_control import stopping_m_s
from texture_exploration.safety import SafetyLimits

# --------------------
# A path along the surface, how far the finger is on it, and how speed is gained and lost.

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


# --------------------
# How the finger comes to the surface, presses and leaves: the same for every motion.

REACTION_S = 0.03  # from contact to standstill: two states of the arm, two steps of the exploration
STEP_S = 0.014  # of exploration and arm, that an arm stands later than by its delay
WALL_SHARE = 4.5  # times the force limit, with which a wall as stiff as declared may press until the arm stands
IMPACT = 0.8  # of the wanted force
HARMLESS_N = 0.5  # a smaller force is not approached more slowly for what an arm does that hears nothing


def stop_s(delay_s: float) -> float:
    """Return how long after a contact an arm stands."""
    return max(REACTION_S, delay_s + STEP_S)


@dataclass(frozen=True)
class TouchParams:
    """Parameters of approach, contact, acceleration and lift."""

    travel_speed_m_s: float = param(
        0.05,
        'Highest speed above the surface on the way back to the start; a stiff contact may ask for a lower one.',
        unit='m/s',
        low=0.01,
        high=1.0,
    )
    approach_speed_m_s: float = param(
        0.02,
        'Highest speed towards the surface; the wanted force may ask for a lower one.',
        unit='m/s',
        low=0.001,
        high=0.1,
    )
    approach_stiffness_n_m: float = param(
        2000.0,
        'Stiffest contact that is expected, also from the side; larger values lower the approach speed, so that the '
        'impact stays below the wanted force, and the highest speed of a slide.',
        unit='N/m',
        low=10.0,
        high=200000.0,
    )
    approach_travel_m: float = param(
        0.05,
        'How far the finger comes down in search of the surface before the motion is aborted.',
        unit='m',
        low=0.001,
        high=0.5,
    )
    unheard_force_fraction = 1.5  # of the wanted force, that an arm may reach which only its watchdog stops
    contact_force_n: float = param(
        0.2,
        'Force above which the finger counts as in contact; a larger force needs a harder touch.',
        unit='N',
        low=0.02,
        high=5.0,
    )
    force_tolerance: float = param(
        0.1,
        'Fraction of the wanted force within which the force has settled; a larger fraction settles sooner.',
        low=0.01,
        high=0.5,
    )
    speed_tolerance: float = param(
        0.05,
        'Fraction of the wanted speed within which the speed is reached; a larger fraction starts the slide sooner.',
        low=0.005,
        high=0.5,
    )
    settle_s: float = param(
        0.1,
        'How long the force must stay within its tolerance before the finger starts to slide.',
        unit='s',
        low=0.0,
        high=2.0,
    )
    acceleration_m_s2: float = param(
        1.0,
        'Highest tangential acceleration; larger values shorten the ramps before and after a slide.',
        unit='m/s²',
        low=0.05,
        high=10.0,
    )
    jerk_m_s3 = 50.0  # along the surface: ramps of 0.1 s up to 0.05 m/s
    arm_lag_s = 0.005  # after which an arm follows a command: the direction on a curved path is led by it
    lost_force_fraction = 0.25  # of the wanted force, below which contact counts as lost
    lost_contact_s: float = param(
        0.1,
        'How long contact may be lost before the slide ends; shorter gaps are bounces on a rough surface.',
        unit='s',
        low=0.02,
        high=5.0,
    )
    stall_speed_fraction = 0.25  # of the commanded way, below which a sliding finger counts as stalled
    stall_s: float = param(
        0.25,
        'Time over which the commanded way and that of the finger are compared during a slide; a longer time '
        'notices a stall later.',
        unit='s',
        low=0.05,
        high=5.0,
    )
    mean_force_fraction = 0.3  # error of the mean force with which a slide succeeds
    peak_force_fraction: float = param(
        0.5,
        'By which fraction of the wanted force a slide may be pressed harder for a moment and succeed; states beyond '
        'it are not steady. A larger fraction bears a rougher surface.',
        low=0.05,
        high=20.0,
    )
    mean_speed_fraction: float = param(
        0.2,
        'Largest relative error of the mean speed with which a slide succeeds.',
        low=0.02,
        high=5.0,
    )
    peak_speed_fraction: float = param(
        0.5,
        'By which fraction of the wanted speed the finger may be faster for 50 ms in a slide that succeeds; states '
        'beyond it are not steady.',
        low=0.05,
        high=20.0,
    )
    mean_friction = 2.0  # mean force along the surface by wanted force, of a slide that succeeds
    peak_friction = 3.0  # the same for 50 ms; states beyond it are not steady
    lift_speed_m_s: float = param(
        0.05,
        'Speed away from the surface; a higher speed leaves the surface sooner.',
        unit='m/s',
        low=0.005,
        high=0.5,
    )
    clearance_m = 0.005  # least rise after a contact

    def approach_m_s(self, force_n: float, watchdog_s: float = 0.0, delay_s: float = 0.0) -> float:
        """Return how fast the finger may come down to press with a force.

        An arm that loses its commands just as it reacts to the contact goes on for the time of its watchdog. Until then
        the force stays below `unheard_force_fraction` of the wanted one on a contact of `approach_stiffness_n_m`.

        Parameters
        ----------
        force_n
            The wanted force.
        watchdog_s, delay_s
            See `texture_exploration.arms.arm.ArmState`.
        """
        heard_m_s = stopping_m_s(IMPACT * force_n, self.approach_stiffness_n_m, stop_s(delay_s))
        allowed_n, unheard_s = max(self.unheard_force_fraction * force_n, HARMLESS_N), watchdog_s + REACTION_S
        unheard_m_s = stopping_m_s(allowed_n, self.approach_stiffness_n_m, unheard_s) if watchdog_s else math.inf
        return min(self.approach_speed_m_s, heard_m_s, unheard_m_s)

    def travel_m_s(self, limit_n: float, delay_s: float) -> float:
        """Return how fast the finger may go where something may stand in its way, for an impact below a force."""
        return min(self.travel_speed_m_s, stopping_m_s(limit_n, self.approach_stiffness_n_m, stop_s(delay_s)))

    def slide_m_s(self, limit_n: float, delay_s: float) -> float:
        """Return how fast the finger may slide: from the force limit on, a wall presses on until the arm stands."""
        return stopping_m_s((WALL_SHARE - 1.0) * limit_n, self.approach_stiffness_n_m, delay_s + STEP_S)

    def ramp_s(self, speed_m_s: float) -> float:
        """Return how long it takes to gain or lose a speed."""
        return ramp_s(speed_m_s, self.acceleration_m_s2, self.jerk_m_s3)


# --------------------
# One step of a motion.


@dataclass(frozen=True)
class MotionStep:
    """What the arm shall do now, and how far the motion is.

    `steady_s` guarantees that phase, speed and force hold so long from now; `direction_rad` is the direction of travel;
    `progress` the share of the slide that is over.
    """

    command: ArmCommand
    phase: Phase
    steady_s: float
    direction_rad: float
    progress: float


# --------------------
# Whether the finger still touches the surface while it moves along it.


class ContactLost(MotionAborted):
    """The finger has been off the surface for longer than is allowed."""


class ContactWatch:
    """Decide from the measured force whether the finger touches, and for how long it has not.

    A force below `lost_force_fraction` of the wanted one counts as no contact. Gaps up to `lost_contact_s` are bounces,
    which a rough surface causes; a longer one is a lost surface. Time is that of the arm's states, so a pause of this
    machine is no loss.
    """

    def __init__(self, force_n: float, touch: TouchParams) -> None:
        self._force_n = force_n
        self._least_n = touch.lost_force_fraction * force_n
        self._longest_s = touch.lost_contact_s
        self._lost_ns: int | None = None
        self._force_now_n = force_n

    @property
    def touching(self) -> bool:
        """Whether the newest state was one with contact."""
        return self._lost_ns is None

    def update(self, arm: ArmState) -> None:
        """Take a state of the arm."""
        self._force_now_n = arm.force_n
        # Written so that NaN is no contact.
        if arm.force_n >= self._least_n:
            self._lost_ns = None
            return
        if self._lost_ns is None:
            self._lost_ns = arm.time_ns
        lost_s = (arm.time_ns - self._lost_ns) * 1e-9
        if lost_s >= self._longest_s:
            self.refuse(lost_s)

    def refuse(self, lost_s: float = 0.0) -> None:
        """Raise ContactLost in a sentence."""
        since = f' for {lost_s * 1e3:.0f} ms' if lost_s else ''
        raise ContactLost(
            f'the contact with the surface was lost{since}: the force is {self._force_now_n:.2f} N of '
            f'{self._force_n:g} N; check that the surface goes on along the whole path, or raise '
            "'lost_contact_s' if it is rough"
        )


# --------------------
# Whether the finger moves along the surface as it is commanded to, and whether the slide was what was asked for.

PEAK_NS = 50_000_000  # speed and tangential force are means over so long: motors step, sensors are noisy
FORCES = 3  # newest normal forces, of which the middle one counts: one alone may be wrong
LONGEST_STEP_NS = 50_000_000  # a command that was given longer ago may have run out: the comparison starts again


class StallWatch:
    """Compare the way that the finger makes with the way that was commanded, over the last `stall_s`.

    Only the way in the commanded direction counts, so that noise of the position does not add up, and a finger that
    goes to and fro may turn. Time is that of the arm's states; after a pause of this machine the comparison starts
    again.
    """

    def __init__(self, touch: TouchParams) -> None:
        self._touch = touch
        self._ways: deque[tuple[int, float, float]] = deque()  # time, ns, and ways commanded and made so far, m
        self._velocity = (0.0, 0.0)  # commanded last
        self._place = (0.0, 0.0)

    def update(self, arm: ArmState, velocity_m_s: tuple[float, float]) -> None:
        """Take a state of the arm, and the velocity that is commanded from now on."""
        x, y, _ = arm.position
        if not self._ways or arm.time_ns - self._ways[-1][0] > LONGEST_STEP_NS:
            self._ways.clear()
            self._ways.append((arm.time_ns, 0.0, 0.0))
        elif arm.time_ns > self._ways[-1][0]:
            self._add(arm.time_ns, x - self._place[0], y - self._place[1])
            self._check(arm.time_ns)
        self._place, self._velocity = (x, y), velocity_m_s

    def _add(self, time_ns: int, x_m: float, y_m: float) -> None:
        before_ns, commanded_m, made_m = self._ways[-1]
        vx, vy = self._velocity
        speed = math.hypot(vx, vy)
        commanded_m += speed * (time_ns - before_ns) * 1e-9
        made_m += (vx * x_m + vy * y_m) / speed if speed > 0 else 0.0
        self._ways.append((time_ns, commanded_m, made_m))

    def _check(self, now_ns: int) -> None:
        begin_ns = now_ns - round(self._touch.stall_s * 1e9)
        if self._ways[0][0] > begin_ns:
            return
        while self._ways[1][0] <= begin_ns:
            self._ways.popleft()
        commanded_m, made_m = (now - then for now, then in zip(self._ways[-1][1:], self._ways[0][1:], strict=True))
        # Written so that NaN is a stall.
        if made_m >= self._touch.stall_speed_fraction * commanded_m:
            return
        raise MotionAborted(
            f'the finger stalled: in {self._touch.stall_s * 1e3:.0f} ms it moved by {made_m * 1e3:.2f} of '
            f'{commanded_m * 1e3:.2f} mm; see what holds it, and whether the robot or its operator slows it down'
        )


class SlideWatch:
    """Compare mean and peak of speed, normal and tangential force of a slide with what was asked for.

    The speed is that from place to place, where the path asks for a constant one: not in turns. The tangential force
    counts where the arm measures it.
    """

    def __init__(self, speed_m_s: float, force_n: float, touch: TouchParams) -> None:
        self._speed_m_s, self._force_n = speed_m_s, force_n
        self._touch = touch
        # A slide begins within twice the tolerance, so a smaller share would refuse what was let in.
        self._mean_force_fraction = max(touch.mean_force_fraction, 2 * touch.force_tolerance)
        self._recent: deque[ArmState] = deque()  # over PEAK_NS of constant speed
        self._forces: deque[float] = deque(maxlen=FORCES)
        self._chunk: ArmState | None = None  # where the present piece of the mean speed began
        self._way_m = self._way_s = 0.0
        self._force_sum_n = self._tangential_sum_n = 0.0
        self._states = self._tangential_states = 0
        self._peaks = [0.0, 0.0, 0.0]  # normal force, speed, tangential force

    def update(self, arm: ArmState, constant: bool) -> bool:
        """Take a state; return whether what it shows is within what was asked for."""
        last_ns = self._recent[-1].time_ns if self._recent else 0
        self._states += 1
        self._force_sum_n += arm.force_n
        self._forces.append(arm.force_n)
        if math.isfinite(arm.tangential_force_n):
            self._tangential_states += 1
            self._tangential_sum_n += abs(arm.tangential_force_n)
        if not (constant and 0 <= arm.time_ns - last_ns <= LONGEST_STEP_NS):  # below 0: a clock was set back
            self._recent.clear()
            self._chunk = None
        if not self._recent or arm.time_ns > last_ns:
            self._recent.append(arm)
        while arm.time_ns - self._recent[0].time_ns > PEAK_NS:
            self._recent.popleft()
        self._add_way(arm)
        now = [statistics.median(self._forces), self._fast_m_s(), self._tangential_n()]
        self._peaks = [max(peak, value) for peak, value in zip(self._peaks, now, strict=True)]
        return all(value <= most for value, most in zip(now, self._most, strict=True))

    def flaw(self) -> str:
        """Return in a sentence what was asked and what was measured if that differs too much, '' if not."""
        return '; '.join(self._differences())

    @property
    def _most(self) -> tuple[float, float, float]:
        """Largest normal force, speed and tangential force for a moment."""
        touch = self._touch
        return (
            (1 + touch.peak_force_fraction) * self._force_n,
            (1 + touch.peak_speed_fraction) * self._speed_m_s,
            touch.peak_friction * self._force_n,
        )

    def _differences(self) -> Iterator[str]:
        touch, asked_n, asked_m_s = self._touch, self._force_n, self._speed_m_s
        mean_n = self._force_sum_n / max(1, self._states)
        if not abs(mean_n - asked_n) <= self._mean_force_fraction * asked_n:  # so NaN is none
            yield (
                f'the mean force of the slide was {mean_n:.2f} N, more than {self._mean_force_fraction:.0%} off the '
                f'{asked_n:g} N that were asked for; slide more slowly, or check the force '
                'control of the arm'
            )
        mean_m_s = self._way_m / self._way_s if self._way_s else asked_m_s
        if not abs(mean_m_s - asked_m_s) <= touch.mean_speed_fraction * asked_m_s:
            yield (
                f'the mean speed of the slide was {mean_m_s:.4f} m/s, more than {touch.mean_speed_fraction:.0%} off '
                f"the {asked_m_s:g} m/s that were asked for ('mean_speed_fraction'); see what scales the speed of the "
                'arm'
            )
        mean_n = self._tangential_sum_n / max(1, self._tangential_states)
        if mean_n > touch.mean_friction * asked_n:
            yield (
                f'the mean force along the surface was {mean_n:.2f} N, and {touch.mean_friction * asked_n:.2f} N are '
                f'allowed with {asked_n:g} N asked for; see whether the finger catches on something'
            )
        measured = (
            ('force', 'N', f'{asked_n:g} N', 'peak_force_fraction'),
            ('speed', 'm/s', f'{asked_m_s:g} m/s', 'peak_speed_fraction'),
            ('force along the surface', 'N', f'a force of {asked_n:g} N', ''),
        )
        for (what, unit, asked, parameter), peak, most in zip(measured, self._peaks, self._most, strict=True):
            if not peak <= most:
                yield (
                    f'the {what} of the slide reached {peak:.3g} {unit}, and {most:.3g} {unit} are allowed with '
                    f'{asked} asked for' + (f" ('{parameter}')" if parameter else '')
                )

    def _add_way(self, arm: ArmState) -> None:
        """Add up the way in pieces of PEAK_NS: noise of the place makes shorter ones too long."""
        if self._chunk is None:
            self._chunk = arm
        took_ns = arm.time_ns - self._chunk.time_ns
        if took_ns >= PEAK_NS:
            self._way_m += math.dist(arm.position[:2], self._chunk.position[:2])
            self._way_s += took_ns * 1e-9
            self._chunk = arm

    def _fast_m_s(self) -> float:
        first, last = self._recent[0], self._recent[-1]
        took_s = (last.time_ns - first.time_ns) * 1e-9
        return math.dist(first.position[:2], last.position[:2]) / took_s if took_s >= 0.6e-9 * PEAK_NS else 0.0

    def _tangential_n(self) -> float:
        known = [abs(arm.tangential_force_n) for arm in self._recent if math.isfinite(arm.tangential_force_n)]
        return statistics.fmean(known) if len(known) >= FORCES else 0.0


# --------------------
# The stages of which motions are made: each knows what to command, and when it is over.

NEAR_M = 0.0005
GROWTH_M = 0.002
LEAST_LIFT_M_S = 0.005  # a lift that nothing has proven yet ends in time too
OVERSHOOT = 0.2  # of the wanted force, that pressing may exceed it
PRESSING_S = 0.1  # from contact to the wanted force: a step would swing on a stiff surface
STEADY_HORIZON_S = 0.1  # the longest time for which a slide guarantees speed and force; ending it early takes as long


class Stage:
    """One part of a motion.

    `ahead`: it lifts before the motion begins. `free`: whether it found the finger free, None if it did not look.
    """

    ahead = False
    free: bool | None = None
    # One row of the state machine (docs/motion.md): kinds of what it commands, what ends it, where an error leads.
    commands: tuple[str, ...] = ()
    ends = ''
    on_error = 'Lift'

    def __init__(self, phase: Phase, timeout_s: float, goal: str) -> None:
        self.phase = phase
        self.timeout_s = timeout_s
        self.goal = goal
        self.steady_s = 0.0
        self._begin_ns = 0

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Note time and place of the start."""
        self._begin_ns = time_ns

    def elapsed_s(self, time_ns: int) -> float:
        """Return the time since the start."""
        return (time_ns - self._begin_ns) * 1e-9

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Return what to do now, None when the stage is over; MotionAborted if its goal cannot be reached."""
        raise NotImplementedError

    def see(self, arm: ArmState) -> None:
        """Take note of a state after the end."""

    def way_out(self, error: MotionAborted) -> tuple[Stage, ...] | None:
        """Return which stages follow an error of this one, none if the finger stays where it is; None: the lift."""
        return None

    def timed_step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Return what to do now; MotionAborted also if the stage takes too long."""
        command = self.step(time_ns, arm)
        if command is not None and self.elapsed_s(time_ns) > self.timeout_s:
            raise MotionAborted(f'waited {self.timeout_s:.1f} s for {self.goal}; the force is {arm.force_n:.2f} N')
        return command


class GoHomeStage(Stage):
    """Rise to the height of the start, then go above the surface to where the motion begins."""

    commands = ('rest', 'up', 'along')
    ends = 'above the start of the motion'

    def __init__(self, home: Vector, touch: TouchParams, limits: SafetyLimits) -> None:
        super().__init__(Phase.APPROACH, limits.approach_timeout_s, 'the finger to reach the start')
        self._home = home
        self._touch = touch
        self._limits = limits
        self._speed_m_s = touch.travel_speed_m_s
        self._free_n: Vector | None = None

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Allow the time that the way needs."""
        super().begin(time_ns, arm)
        self._speed_m_s = self._touch.travel_m_s(self._limits.force_limit_n, arm.delay_s)
        self.timeout_s = self._limits.approach_timeout_s + math.dist(self._home, arm.position) / self._speed_m_s

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Rise first; then speed up and slow down at half the allowed acceleration."""
        x, y, z = (goal - at for goal, at in zip(self._home, arm.position, strict=True))
        # A sensor that is zeroed as the arm moves off shows an offset before, and a finger that leaves the surface a
        # contact: what counts is the change from the smallest force.
        if self._free_n is None or arm.force_size_n < math.hypot(*self._free_n):
            self._free_n = arm.force_vector_n
        met_n = math.dist(arm.force_vector_n, self._free_n)
        if not met_n <= self._touch.contact_force_n:
            raise MotionAborted(f'the finger met something on the way to the start, {met_n:.2f} N')
        if z > NEAR_M:
            return ArmCommand(normal_m_s=min(self._touch.lift_speed_m_s, self._speed_m_s))
        distance = math.hypot(x, y)
        if distance < NEAR_M:
            return None
        gentle_m_s2 = 0.5 * self._touch.acceleration_m_s2
        speed = min(self._speed_m_s, math.sqrt(2 * gentle_m_s2 * distance), gentle_m_s2 * self.elapsed_s(time_ns))
        return ArmCommand(tangential_m_s=(speed * x / distance, speed * y / distance))


class ApproachStage(Stage):
    """Come down until the force shows contact."""

    commands = ('down',)
    ends = 'the force shows contact that pushes the finger up'

    def __init__(self, force_n: float, touch: TouchParams, limits: SafetyLimits) -> None:
        super().__init__(Phase.APPROACH, limits.approach_timeout_s, 'the finger to meet the surface')
        self._touch = touch
        self._limits = limits
        self._force_n = force_n
        self._start_m = 0.0

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Note the height at the start."""
        super().begin(time_ns, arm)
        self._start_m = arm.position[2]

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Go down, but no further than allowed."""
        if not arm.force_size_n <= self._touch.contact_force_n:
            self._check_normal(arm)
            return None
        if self._start_m - arm.position[2] > self._touch.approach_travel_m:
            raise MotionAborted(
                f'no surface within {self._touch.approach_travel_m:g} m below the start; '
                "bring the finger closer or raise 'approach_travel_m'",
                ExplorationError.NO_SURFACE,
            )
        speed_m_s = self._touch.approach_m_s(self._force_n, arm.watchdog_s, arm.delay_s)
        if arm.watchdog_s:
            # The same way may be gone, however much slower the arm has to be.
            heard_m_s = self._touch.approach_m_s(self._force_n, delay_s=arm.delay_s)
            self.timeout_s = self._limits.approach_timeout_s * heard_m_s / speed_m_s
            self.goal = (
                f'the finger to meet the surface at {speed_m_s * 1e3:.2g} mm/s, as the arm goes on for '
                f'{arm.watchdog_s * 1e3:.0f} ms when it hears nothing'
            )
        return ArmCommand(normal_m_s=-speed_m_s)

    def _check_normal(self, arm: ArmState) -> None:
        """Raise MotionAborted if what the finger met does not push it up: pressing harder would not end."""
        x, y, z = arm.force_vector_n
        if z * math.hypot(1.0, self._limits.friction_limit) >= arm.force_size_n:
            return
        what = f'({x:.2f}, {y:.2f}, {z:.2f}) N in the frame of the surface'
        if -z > math.hypot(x, y):
            raise MotionAborted(
                f'the finger came down and its force became {what}: its sign is wrong', ExplorationError.FORCE_SENSOR
            )
        raise MotionAborted(
            f'the finger met something from the side as it came down, {what}; if there is nothing, the force is given '
            'in another frame than its name says'
        )


class OvershootWatch:
    """End what presses harder than was asked for, before the slide: the middle one of the newest forces counts."""

    def __init__(self, force_n: float, touch: TouchParams) -> None:
        self._force_n = force_n
        self._most_n = (1.0 + max(OVERSHOOT, touch.force_tolerance)) * force_n
        self._forces: deque[float] = deque(maxlen=FORCES)

    def update(self, arm: ArmState) -> None:
        """Take a state; MotionAborted if the force is too high."""
        self._forces.append(arm.force_n)
        reached_n = statistics.median(self._forces)
        if len(self._forces) == FORCES and reached_n > self._most_n:
            raise MotionAborted(
                f'the force reached {reached_n:.2f} N of {self._force_n:g} N wanted before the slide; the contact is '
                "stiffer than 'max_stiffness_n_m' or 'approach_stiffness_n_m', or arm or force later than "
                "'loop_delay_s'",
                ExplorationError.FORCE_LIMIT,
            )


class SettleForceStage(Stage):
    """Press gently harder, until the force has stayed within its tolerance for a while."""

    commands = ('press',)
    ends = 'the force stayed within its tolerance'

    def __init__(self, force_n: float, touch: TouchParams, limits: SafetyLimits) -> None:
        super().__init__(Phase.CONTACT, limits.contact_timeout_s, f'the force to settle at {force_n:g} N')
        self._force_n = force_n
        self._touch = touch
        self._outside_ns = 0
        self._first_n = force_n
        self._overshoot = OvershootWatch(force_n, touch)

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Nothing has settled yet."""
        super().begin(time_ns, arm)
        self._outside_ns = time_ns
        self._first_n = max(0.0, min(arm.force_n, self._force_n))

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Hold the force."""
        self._overshoot.update(arm)
        if abs(arm.force_n - self._force_n) > self._touch.force_tolerance * self._force_n:
            self._outside_ns = time_ns
        if (time_ns - self._outside_ns) * 1e-9 >= self._touch.settle_s and time_ns > self._outside_ns:
            return None
        rise = smooth(self.elapsed_s(time_ns) / PRESSING_S)
        return ArmCommand(force_n=self._first_n + (self._force_n - self._first_n) * rise)


class Along(NamedTuple):
    """What the stages along a path share: who steers, how fast, how hard, and who watches the contact."""

    follower: Follower
    speed_m_s: float
    force_n: float
    touch: TouchParams
    limits: SafetyLimits
    contact: ContactWatch

    @property
    def ramp_s(self) -> float:
        """How long it takes to gain or lose the speed."""
        return self.touch.ramp_s(self.speed_m_s)


class AccelerateStage(Stage):
    """Gain speed smoothly along the path; over when the arm really has the speed and the force."""

    commands = ('press',)
    ends = 'speed and force are reached'

    def __init__(self, along: Along) -> None:
        goal = f'the finger to slide at {along.speed_m_s:g} m/s with {along.force_n:g} N'
        super().__init__(Phase.CONTACT, along.ramp_s + along.limits.contact_timeout_s, goal)
        self._along = along
        self._overshoot = OvershootWatch(along.force_n, along.touch)

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Follow the ramp, then wait for the arm to follow."""
        self._overshoot.update(arm)
        self._along.follower.update(time_ns, arm)
        self._along.contact.update(arm)
        elapsed_s = self.elapsed_s(time_ns)
        if elapsed_s >= self._along.ramp_s + STEADY_S and self._reached(arm):
            return None
        speed = self._along.speed_m_s * smooth(elapsed_s / self._along.ramp_s)
        return ArmCommand(self._along.follower.velocity(speed), force_n=self._along.force_n)

    def _reached(self, arm: ArmState) -> bool:
        speed = math.hypot(*arm.velocity[:2])
        fast = abs(speed - self._along.speed_m_s) <= self._along.touch.speed_tolerance * self._along.speed_m_s
        # Sliding makes the force fluctuate: twice the tolerance of the finger at rest.
        return (
            fast
            and abs(arm.force_n - self._along.force_n) <= 2 * self._along.touch.force_tolerance * self._along.force_n
        )


class SlideStage(Stage):
    """Keep speed and force for the length of the path."""

    commands = ('press',)
    ends = 'the end of the path, or an early end'

    def __init__(self, along: Along) -> None:
        planned_s = along.follower.length_m / along.speed_m_s
        super().__init__(Phase.SLIDE, planned_s + along.limits.slide_overtime_s, 'the slide to end')
        self.along = along
        self._stall = StallWatch(along.touch)
        self._watch = SlideWatch(along.speed_m_s, along.force_n, along.touch)
        self._start_m = 0.0
        self._steady_until_ns = 0
        self._finish = False
        self.progress = 0.0

    @property
    def direction_rad(self) -> float:
        """Present direction of travel."""
        return self.along.follower.direction_rad

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """The slide counts from here."""
        super().begin(time_ns, arm)
        self._start_m = self.along.follower.travelled_m
        self.along.follower.begin_slide()

    def finish(self) -> None:
        """End as soon as the guaranteed time is over."""
        self._finish = True

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Keep on sliding, and update the guaranteed time: 0 while the finger does not touch, or not as asked."""
        self.along.follower.update(time_ns, arm)
        self.steady_s = 0.0
        self.along.contact.update(arm)
        steady_s = self.along.follower.steady_m / self.along.speed_m_s
        as_asked = self._watch.update(arm, constant=steady_s > 0.0)
        left_s = self._left_s(time_ns, arm)
        # Anything shorter than a microsecond is rounding, not sliding.
        if left_s < 1e-6:
            if flaw := self._watch.flaw():
                raise MotionAborted(flaw)
            return None
        if self.along.contact.touching and as_asked:
            self.steady_s = min(STEADY_HORIZON_S, left_s, steady_s)
            self._steady_until_ns = max(self._steady_until_ns, time_ns + int(self.steady_s * 1e9))
        velocity = self.along.follower.velocity(self.along.speed_m_s)
        self._stall.update(arm, velocity)
        return ArmCommand(velocity, force_n=self.along.force_n)

    def _left_s(self, time_ns: int, arm: ArmState) -> float:
        age_s = max(0.0, (time_ns - arm.time_ns) * 1e-9)
        slid_m = self.along.follower.travelled_m - self._start_m + self.along.speed_m_s * age_s
        length_m = self.along.follower.length_m
        self.progress = min(1.0, slid_m / length_m)
        by_length = (length_m - slid_m) / self.along.speed_m_s
        return min(by_length, (self._steady_until_ns - time_ns) * 1e-9) if self._finish else by_length


class BrakeStage(Stage):
    """Lose speed smoothly along the path, still pressing: a finger that lifts at speed is plucked off.

    The slide itself is over: a surface that ends here costs nothing, and the finger only keeps its height. A contact
    that was lost in the slide and does not come back aborts.
    """

    commands = ('press', 'along', 'rest')
    ends = 'at rest along the surface'

    def __init__(self, along: Along) -> None:
        super().__init__(Phase.LIFT, along.limits.lift_timeout_s, 'the finger to come to rest')
        self._along = along
        self._whole = False  # the slide ended with contact

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Note whether the slide ended with contact."""
        super().begin(time_ns, arm)
        self._whole = self._along.contact.touching

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Follow the ramp down."""
        self._along.follower.update(time_ns, arm)
        touching = self._touches(arm)
        share = self.elapsed_s(time_ns) / self._along.ramp_s
        if share >= 1.0:
            if not self._whole:
                self._along.contact.refuse()
            return None
        velocity = self._along.follower.velocity(self._along.speed_m_s * smooth(1.0 - share))
        return ArmCommand(velocity, force_n=self._along.force_n if touching else None)

    def _touches(self, arm: ArmState) -> bool:
        if not self._whole:
            self._along.contact.update(arm)
            self._whole = self._along.contact.touching
            return True  # may come back: keep pressing
        with suppress(ContactLost):
            self._along.contact.update(arm)
        return self._along.contact.touching


class LiftStage(Stage):
    """Leave the surface along its normal, to the height of the start or at least by the clearance.

    The clearance counts from where the finger came free: a soft surface follows it for a while. A force that does not
    fall, as that of a frozen sensor, does not lift the finger beyond `approach_travel_m`. It goes no faster than it
    came down until the force has fallen: only that proves that up is up.
    """

    commands = ('up',)
    ends = 'at the height of the start and clear of the surface'
    on_error = 'end, at rest'

    def __init__(self, home: Vector, force_n: float, touch: TouchParams, limits: SafetyLimits) -> None:
        super().__init__(Phase.LIFT, limits.lift_timeout_s, 'the finger to be lifted')
        self.free = False
        self._goal_m = home[2]
        self._highest_m = home[2]
        self._touch = touch
        self._base_timeout_s = limits.lift_timeout_s
        self._growth_n = max(touch.contact_force_n, limits.tangential_floor_n)
        self._gentle_m_s = min(touch.lift_speed_m_s, max(touch.approach_m_s(force_n), LEAST_LIFT_M_S))
        self._lowest_m = self._lowest_n = math.inf
        self._newly = (math.inf, math.inf)  # height and force a little lower
        self._proven = False

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Choose the height."""
        super().begin(time_ns, arm)
        self._highest_m = max(self._goal_m, arm.position[2] + self._touch.approach_travel_m)
        slower_s_m = 1.0 / self._gentle_m_s - 1.0 / self._touch.lift_speed_m_s
        self.timeout_s = self._base_timeout_s + (self._highest_m - arm.position[2]) * slower_s_m
        self._lowest_m, self._proven = math.inf, False

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Go up."""
        self.see(arm)
        self._watch_rise(arm)
        if arm.force_n > self._touch.contact_force_n:
            self._goal_m = min(self._highest_m, max(self._goal_m, arm.position[2] + self._touch.clearance_m))
        if arm.position[2] >= self._goal_m - NEAR_M:
            return None
        return ArmCommand(normal_m_s=self._touch.lift_speed_m_s if self._proven else self._gentle_m_s)

    def see(self, arm: ArmState) -> None:
        """Take note of the force, also after the lift."""
        self.free = arm.force_size_n <= self._touch.contact_force_n

    def _watch_rise(self, arm: ArmState) -> None:
        """See whether the force falls from what it was at the lowest place: a late arm goes on down for a while."""
        height_m, force_n = arm.position[2], arm.force_size_n
        if height_m <= self._lowest_m:
            self._lowest_m, self._lowest_n = height_m, force_n
        if height_m <= self._lowest_m or height_m - self._newly[0] > GROWTH_M:  # what grows more slowly is drift
            self._newly = height_m, force_n
        self._proven |= force_n < self._lowest_n - self._touch.contact_force_n
        grown_n = force_n - self._newly[1]
        if height_m - self._lowest_m > NEAR_M and grown_n > self._growth_n and not self._proven:
            raise MotionAborted(
                f'the force grew from {self._newly[1]:.2f} to {force_n:.2f} N while the finger rose; see that nothing '
                'is above it, the pose of the surface and the frame of the force'
            )


# --------------------
# Lift the finger before a motion begins: after a fault nobody knows whether it still presses.
#
# Nobody knows either whether frames and signs are what they are said to be, so that the lift begins with a probe, and
# is slow and watched to its end.

CALM_S = 0.15  # at rest; an arm that zeroes its force sensor does so now
PROBE_M = 0.0005
PROBE_M_S = 0.002
PROBE_TIMEOUT_S = 2.0
STILL_M, STILL_S = 0.00005, 0.06  # an arm that moves less in this time stands still
ASTRAY_M = 0.0002  # beside the commanded way: more than noise and play
MET_GROWTH = 2.0  # times the change in the first half of the way
MOST_FORCE_SHARE = 0.65  # of the force limit: no finger that was pressed as asked is left pressed harder
GO_BACK_S = 0.5
UNKNOWN_STATE = ArmState(0, (math.inf,) * 3, (0.0,) * 3, math.nan)
REST_STEP_M = 1e-5  # way between two states of an arm at rest
PATIENCE_S = 0.6  # an arm that has not zeroed its force sensor by then will not do so where it stands


class WrongWay(MotionAborted):
    """To rise makes it worse: the finger goes back the way it came instead, as far as the force was as before."""

    def __init__(self, reason: str, before_n: Vector) -> None:
        super().__init__(reason)
        self.before_n = before_n


class WrongSign(MotionAborted):
    """The force rises while the finger does; what touches it is left by rising all the same."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason, ExplorationError.FORCE_SENSOR)


class Rise(Stage):
    """Rise until the force has not changed over the clearance: then nothing touches the finger.

    It begins with a probe of half a millimetre, slowly: the finger must follow in direction, and its force must not
    rise. Then it rises no faster than the finger comes down, and slower where the force shows a stiffer contact.
    """

    commands = ('rest', 'up')
    ends = 'the force stayed the same over the clearance'
    on_error = 'GoBack, Rise again, or end at rest'
    ahead = True

    def __init__(
        self,
        force_n: float,
        touch: TouchParams,
        limits: SafetyLimits,
        signed: bool = True,
        zero_n: Vector | None = None,
    ) -> None:
        speed_m_s = touch.approach_m_s(force_n)
        longest_m = max(touch.approach_travel_m, 2 * touch.clearance_m)
        phase = Phase.APPROACH if signed else Phase.LIFT
        super().__init__(phase, limits.lift_timeout_s + longest_m / speed_m_s, 'the finger to be free')
        self._given = force_n, touch, limits
        self._touch = touch
        self._speed_m_s, self._longest_m = speed_m_s, longest_m
        self._first = UNKNOWN_STATE
        self._most_n = MOST_FORCE_SHARE * limits.force_limit_n
        self._impact_n = IMPACT * force_n
        self._signed = signed  # the sign of the force is not known to be wrong
        self._zero_n = zero_n  # from which the force counts: that before the first of several rises
        self._air = FreeAir(touch.clearance_m, touch.contact_force_n)
        self._start_ns: int | None = None  # of the probe
        self._rest_ns = 0
        self._heights_m: list[float] = []  # of the way so far, and the forces there
        self._forces_n: list[Vector] = []
        self.free = False

    def again(self) -> Rise:
        """Return a rise that comes after this one, whatever the sign of the force; it counts from the same zero."""
        return Rise(*self._given, signed=False, zero_n=self._zero_n)

    def way_out(self, error: MotionAborted) -> tuple[Stage, ...] | None:
        """Go back what made it worse, rise on with a force of the wrong sign, or stay."""
        if isinstance(error, WrongWay):
            return (GoBack(error.before_n, self._touch),)
        return (self.again(),) if isinstance(error, WrongSign) else ()

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Note height and force at the start."""
        super().begin(time_ns, arm)
        self._first, self._rest_ns = arm, time_ns

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Go up, but no further than a finger may come down to look for the surface."""
        if self._start_ns is None and not self._rests(time_ns, arm):
            return ArmCommand()
        self._check_way(time_ns, arm)
        self.free = self._air.update(arm.time_ns, arm.position, arm.force_n)
        if self.free:
            return None
        risen_m = arm.position[2] - self._first.position[2]
        if risen_m > self._longest_m:
            raise MotionAborted(
                f'the force changed all the while the finger rose by {risen_m:.3f} m; see that nothing touches it, and '
                "raise 'contact_force_n' above the noise of the force sensor",
                ExplorationError.FORCE_SENSOR,
            )
        if math.dist(arm.force_vector_n, self._zero_n or self._first.force_vector_n) > self._most_n:
            raise WrongWay(
                f'the force changed by more than {self._most_n:g} N while the finger rose by {1e3 * risen_m:.2f} mm: '
                'it is pressed harder than it may be, or something is above it; free it by hand',
                self._first.force_vector_n,
            )
        if self._signed and risen_m >= PROBE_M / 2:
            self._check_sign(arm)
        stiffness_n_m = self._watch_growth(arm)
        if risen_m < PROBE_M:
            return ArmCommand(normal_m_s=PROBE_M_S)
        gentle_m_s = stopping_m_s(self._impact_n, stiffness_n_m, REACTION_S) if stiffness_n_m else math.inf
        return ArmCommand(normal_m_s=max(PROBE_M_S, min(self._speed_m_s, gentle_m_s)))

    def _rests(self, time_ns: int, arm: ArmState) -> bool:
        """Wait until the arm stands still, as it may not do yet after a fault; note place and force."""
        if self.elapsed_s(time_ns) > PROBE_TIMEOUT_S:
            raise MotionAborted(
                'the arm moves although it was told to stand still; see who else moves it', ExplorationError.ARM_FAULT
            )
        if math.dist(arm.position, self._first.position) > STILL_M:
            self._first, self._rest_ns = arm, time_ns
        if (time_ns - self._rest_ns) * 1e-9 < STILL_S:
            return False
        self._first, self._start_ns = arm, time_ns
        self._zero_n = self._zero_n or arm.force_vector_n
        self._heights_m, self._forces_n = [arm.position[2]], [arm.force_vector_n]
        return True

    def _check_way(self, time_ns: int, arm: ArmState) -> None:
        """Compare the way of the finger with what was commanded."""
        assert self._start_ns is not None
        x, y, up = (now - then for now, then in zip(arm.position, self._first.position, strict=True))
        astray = up < -ASTRAY_M or math.hypot(x, y) > ASTRAY_M + abs(up)
        if not astray and (up >= PROBE_M or (time_ns - self._start_ns) * 1e-9 < PROBE_TIMEOUT_S):
            return
        reason = (
            f'the arm moved by ({1e3 * x:.2f}, {1e3 * y:.2f}, {1e3 * up:.2f}) mm in the frame of the surface where it '
            'was told to rise along z; check the frame and the sign of its velocities'
        )
        raise WrongWay(reason, self._first.force_vector_n) if astray else MotionAborted(reason)

    def _check_sign(self, arm: ArmState) -> None:
        first = self._first
        if arm.force_n - first.force_n > self._touch.contact_force_n:
            raise WrongSign(
                f'the force went from {first.force_n:.2f} to {arm.force_n:.2f} N while the finger rose: its sign is '
                'wrong, the z axis of the surface does not point away from it, or it is not steady'
            )

    def _watch_growth(self, arm: ArmState) -> float:
        """Return the stiffness of what the finger leaves, N/m, 0 in the air; WrongWay if it meets something.

        A surface that is left lets the force change less and less; what is met changes it more in the second half of
        the way than in the first.
        """
        height_m, force_n = arm.position[2], arm.force_vector_n
        if height_m > self._heights_m[-1]:
            self._heights_m.append(height_m)
            self._forces_n.append(force_n)
        half = bisect_right(self._heights_m, 0.5 * (self._heights_m[0] + height_m)) - 1
        middle_n, noise_n = self._forces_n[max(0, half)], self._touch.contact_force_n
        newly_n, before_n = math.dist(force_n, middle_n), math.dist(middle_n, self._forces_n[0])
        if height_m - self._heights_m[0] >= PROBE_M / 2 and newly_n > MET_GROWTH * before_n + noise_n:
            raise WrongWay(
                f'the finger met something while it rose, the force changed by {newly_n:.2f} N; see what is above it, '
                'and that the z axis of the surface points away from it',
                middle_n,
            )
        last = max(0, bisect_right(self._heights_m, height_m - PROBE_M) - 1)
        changed_n = math.dist(force_n, self._forces_n[last])
        rise_m = max(height_m - self._heights_m[last], 0.1 * PROBE_M)
        return changed_n / rise_m if changed_n > noise_n else 0.0


class GoBack(Stage):
    """Go back down, until the force is again what it was before the rise."""

    commands = ('down',)
    ends = 'the force is as before the rise'
    on_error = 'end, at rest'
    ahead = True

    def __init__(self, before_n: Vector, touch: TouchParams) -> None:
        super().__init__(Phase.LIFT, GO_BACK_S + 1.0, 'the finger to go back')
        self._before_n = before_n
        self._touch = touch

    def way_out(self, error: MotionAborted) -> tuple[Stage, ...] | None:
        """Stay: no direction helps."""
        return ()

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Go down for a short time at most."""
        left_n = math.dist(arm.force_vector_n, self._before_n)
        if left_n <= self._touch.contact_force_n or self.elapsed_s(time_ns) > GO_BACK_S:
            return None
        return ArmCommand(normal_m_s=-2 * PROBE_M_S)


class CalmDown(Stage):
    """Stand still, until the force sensor can be believed.

    An arm that proves free air by itself may have seen less of the lift than the explorer did, or its controller may
    not have taken the command to zero. Standing still would prove nothing more, so that the finger rises again, as long
    as the force stays what it was when it first stood.
    """

    commands = ('rest', 'up')
    ends = 'the force sensor is zeroed'
    on_error = 'GoBack, Rise again, or Lift'
    ahead = True

    def __init__(self, zeroed: Callable[[], bool], force_n: float, touch: TouchParams, limits: SafetyLimits) -> None:
        super().__init__(Phase.APPROACH, limits.lift_timeout_s, 'the arm to zero its force sensor')
        self._zeroed = zeroed
        self._speed_m_s = touch.approach_m_s(force_n)
        self._touch = touch
        self._believed = False
        self._rest_ns = 0
        self._start_m = self._rest_m = 0.0
        self._free_n = (0.0, 0.0, 0.0)
        self._before: ArmState | None = None

    def way_out(self, error: MotionAborted) -> tuple[Stage, ...] | None:
        """Go back from what the finger met."""
        return (GoBack(error.before_n, self._touch),) if isinstance(error, WrongWay) else None

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Note when and where the arm came to rest."""
        super().begin(time_ns, arm)
        self._rest_ns, self._start_m, self._rest_m = time_ns, arm.position[2], arm.position[2]
        self._free_n, self._before = arm.force_vector_n, arm

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Wait; rise by the clearance whenever the arm has not zeroed its force sensor within `PATIENCE_S`."""
        # A sensor that reads nothing at rest was zeroed, though the arm may not say so yet; a contact would be read
        before, self._before = self._before or arm, arm
        if (
            math.dist(before.position, arm.position) < REST_STEP_M
            and math.hypot(*arm.force_vector_n) <= self._touch.contact_force_n
        ):
            self._free_n = arm.force_vector_n
        rested_s = (time_ns - self._rest_ns) * 1e-9
        if rested_s >= CALM_S and self._zeroed():
            if self._believed:
                return None
            self._believed = True  # the arm tells so at once, and this state may still be without the zero
            return ArmCommand()
        height_m = arm.position[2]
        if rested_s < PATIENCE_S or height_m - self._start_m > self._touch.approach_travel_m:
            return ArmCommand()
        met_n = math.dist(arm.force_vector_n, self._free_n)
        if met_n > self._touch.contact_force_n and not self._zeroed():
            raise WrongWay(
                f'the finger met something while it rose for its force sensor to be zeroed, {met_n:.2f} N; see what is '
                'above it, and that the z axis of the surface points away from it',
                self._free_n,
            )
        if height_m - self._rest_m < self._touch.clearance_m:
            return ArmCommand(normal_m_s=self._speed_m_s)
        self._rest_ns, self._rest_m = time_ns, height_m
        return ArmCommand()


# --------------------
# A motion made of stages, one after the other, that can be aborted in any of them or finished early.


class Motion:
    """One planned exploration: go through the stages; on any error go to the last one, which lifts the finger.

    It knows no clock and no arm: it is stepped with the time and the state of the arm.

    Parameters
    ----------
    stages
        In their order; the last one lifts.
    slide
        The one among them that slides.

    Attributes
    ----------
    error
        Why the motion itself aborted; NONE if it did not, or was told to.
    """

    def __init__(self, stages: Sequence[Stage], slide: SlideStage) -> None:
        self._remaining_stages = list(stages)
        self._lift = stages[-1]
        self._slide = slide
        self._stage: Stage | None = None
        self._phase = Phase.IDLE
        self._abort_reason = ''
        self._finish_reason = ''
        self._zeroed: Callable[[], bool] | None = None  # while the stages ahead of the motion lift first
        self._ended_ahead = self._free_ahead = False  # it ends by them, and whether the finger was free in them
        self._rise: Rise | None = None  # the first
        self.error = ExplorationError.NONE

    def lift_first(self, zeroed: Callable[[], bool], zero_n: Vector | None = None) -> Motion:
        """Begin with a lift and a rest, and return itself.

        Parameters
        ----------
        zeroed
            Whether the force sensor of the arm can be believed once it stands still in free air.
        zero_n
            What it shows before the first lift since the arm was connected; None: before this one.
        """
        along = self._slide.along
        self._zeroed = zeroed
        self._rise = Rise(along.force_n, along.touch, along.limits, zero_n=zero_n)
        self._remaining_stages[:0] = [self._rise, CalmDown(zeroed, along.force_n, along.touch, along.limits)]
        return self

    def refuse_too_fast(self, motion: str, arm: ArmState) -> None:
        """Refuse a slide that would press too hard on a wall, as stiff and with an arm as late as declared."""
        along = self._slide.along
        limit_n, stiffness_n_m = along.limits.force_limit_n, along.touch.approach_stiffness_n_m
        allowed_m_s = along.touch.slide_m_s(limit_n, arm.delay_s)
        if along.speed_m_s > allowed_m_s:
            raise MotionRefused(
                f'{motion}: speed_m_s is {along.speed_m_s:g}; a wall of {stiffness_n_m:g} N/m '
                f"('approach_stiffness_n_m') could press with more than {WALL_SHARE * limit_n:g} N, {WALL_SHARE:g} "
                f"times 'force_limit_n', until an arm that is {1e3 * arm.delay_s:.0f} ms late stands; allowed is at "
                f'most {math.floor(allowed_m_s * 1e4) / 1e4:g} m/s',
                field='speed_m_s',
            )

    def step(self, time_ns: int, arm: ArmState) -> MotionStep:
        """Return what to do at `time_ns` (CLOCK_MONOTONIC), until the phase is DONE or ABORTED.

        A stage that is over hands on to the next within the same step.
        """
        command = self._try_stage(time_ns, arm)
        while command is None and self._remaining_stages:
            self._stage = self._remaining_stages.pop(0)
            if not self._stage.ahead:
                self._zeroed = None
            self._stage.begin(time_ns, arm)
            command = self._try_stage(time_ns, arm)
        if self._stage is None or command is None:
            self._stage, command = None, ArmCommand()
            self._lift.see(arm)
            self._phase = Phase.ABORTED if self._abort_reason else Phase.DONE
        else:
            self._phase = self._stage.phase
        return MotionStep(
            command=command,
            phase=self._phase,
            steady_s=self._stage.steady_s if self._stage else 0.0,
            direction_rad=self._slide.direction_rad,
            progress=self._slide.progress,
        )

    def abort(self, reason: str) -> None:
        """Lift the finger along the normal and end as ABORTED, from any phase; the first reason counts.

        As long as the force is not zeroed, a finger that lifts first must show free air by a rise.
        """
        if self._phase in (Phase.DONE, Phase.ABORTED):
            return
        if self._zeroed is not None and not self._zeroed():
            if not self._abort_reason and self._rise:
                self._end_ahead(reason, self._rise.again())
            return
        self._abort_reason = self._abort_reason or reason
        if self._stage is not self._lift:
            self._stage, self._remaining_stages = None, [] if self._ended_ahead else [self._lift]

    def finish(self, reason: str) -> None:
        """End the slide as soon as the guaranteed time is over; without effect before and after it."""
        if self._stage is self._slide and not self._finish_reason:
            self._finish_reason = reason
            self._slide.finish()

    def lift_from(self, place: Vector) -> LiftStage:
        """Return another lift from a place, for whoever cannot trust this motion any more."""
        along, (x, y, z) = self._slide.along, place
        return LiftStage((x, y, z + along.touch.clearance_m), along.force_n, along.touch, along.limits)

    @property
    def force_n(self) -> float:
        """The wanted force of the slide."""
        return self._slide.along.force_n

    @property
    def lifted(self) -> bool:
        """Whether the finger was lifted at the end, and the measured force says so."""
        if self._ended_ahead:
            return self._free_ahead
        return bool(self._lift.free)

    @property
    def message(self) -> str:
        """What happened, in one sentence."""
        if self._ended_ahead and not self._free_ahead:
            return f'{self._abort_reason}; the finger was not lifted'
        return self._abort_reason or self._finish_reason or 'the motion ended as asked'

    def _try_stage(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Return the command of the present stage; None if it is over, cannot go on, or there is none."""
        stage = self._stage
        if stage is None:
            return None
        try:
            return stage.timed_step(time_ns, arm)
        except MotionAborted as error:
            self._give_way(stage, error)
            return None
        finally:
            if stage.ahead and stage.free is not None:
                self._free_ahead = stage.free

    def _give_way(self, stage: Stage, error: MotionAborted) -> None:
        """Go on in the way that the stage leaves: back, further up, by the lift, or stay where the finger is."""
        reason, self.error = str(error), self.error or error.error
        if stage is self._lift:
            before = f'{self._abort_reason}; ' if self._abort_reason else ''
            self._abort_reason = f'{before}the finger was not lifted: {reason}'
        elif (way := stage.way_out(error)) is not None:
            self._end_ahead(reason, *way)
        else:
            self.abort(reason)

    def _end_ahead(self, reason: str, *stages: Stage) -> None:
        """End after some stages; what follows does not begin."""
        self._abort_reason = self._abort_reason or reason
        self._ended_ahead = True
        self._stage, self._remaining_stages = None, [*stages]


# Plans a motion from a request, whose numbers of 0 take the default; the place where the slide begins and to which
# height it lifts, m, in the frame of the surface; how the finger touches; and what is allowed. MotionRefused if a
# number is out of its range or does not belong to this motion, or the path leaves the workspace.
Planner = Callable[[ExplorationRequest, Vector, TouchParams, SafetyLimits], Motion]


# --------------------
# The state machine and the limits, each once: docs/motion.md shows both tables.

STATES: tuple[type[Stage], ...] = (
    Rise,
    CalmDown,
    GoBack,
    GoHomeStage,
    ApproachStage,
    SettleForceStage,
    AccelerateStage,
    SlideStage,
    BrakeStage,
    LiftStage,
)


class Limit(NamedTuple):
    """What is limited, by which value, who checks it, how fast, and what follows."""

    name: str
    quantity: str
    value: str
    checks: str
    soon: str
    follows: str


EVERY_STEP = 'each step, 10 ms'
LIMITS: tuple[Limit, ...] = (
    Limit(
        'MOST_FORCE_N, MOST_M', 'number of a sample', 'finite, 10 kN, 100 m', 'arm and Exploration', 'at once', 'lift'
    ),
    Limit('force_limit_n', 'force in any direction', '10 N', 'ForceGuard', EVERY_STEP, 'way back, lift'),
    Limit(
        'WALL_SHARE', 'force at a wall, foreseen', '4.5 × force_limit_n', 'Exploration', 'before it moves', 'refused'
    ),
    Limit('friction_limit', 'force along the surface', '2 × normal + 1 N', 'ForceGuard', EVERY_STEP, 'way back, lift'),
    Limit('x_low_m to z_high_m', 'place', '±0.2 m; −0.02 to 0.2 m', 'Exploration', EVERY_STEP, 'lift'),
    Limit('surface_tolerance_m', 'height of the contact', '20 mm', 'Exploration', EVERY_STEP, 'lift'),
    Limit('state_timeout_s', 'age of the state', '0.13 s', 'Exploration', EVERY_STEP, 'stop'),
    Limit('signal_timeout_s', 'silence of the sensor', '0.5 s', 'SignalWatch', EVERY_STEP, 'lift'),
    Limit('frozen_force_s', 'force that repeats', '0.06 s', 'ForceWatch', EVERY_STEP, 'lift'),
    Limit('force_drift_fraction', 'drift in free air', '30 %', 'ForceWatch', 'after the lift', 'no success'),
    Limit('OVERSHOOT', 'force before the slide', '20 % above the wanted', 'OvershootWatch', '3 steps', 'lift'),
    Limit('HARD, LATE_S', 'force after the first touch', '2 impacts; 30 ms', 'ForceLoop', 'delay + 0.13 s', 'lift'),
    Limit('peak_force_fraction', 'force in the slide', '50 % above the wanted', 'SlideWatch', '3 steps', 'no window'),
    Limit('peak_speed_fraction', 'speed in the slide', '50 % above the wanted', 'SlideWatch', '50 ms', 'no window'),
    Limit('lost_contact_s', 'time without contact', '0.1 s', 'ContactWatch', EVERY_STEP, 'lift'),
    Limit('stall_s', 'way by commanded way', '25 % in 0.25 s', 'StallWatch', '0.25 s', 'lift'),
    Limit('MOST_FORCE_SHARE', 'change of the force in a rise', '65 % of force_limit_n', 'Rise', EVERY_STEP, 'go back'),
    Limit('approach_travel_m', 'way down in search', '50 mm', 'ApproachStage', EVERY_STEP, 'lift'),
    Limit('approach_timeout_s, …', 'time of a stage', '10, 10, 2, 5 s', 'Stage', EVERY_STEP, 'lift'),
    Limit('command_speed_m_s, …', 'a single command', '1 m/s, 0.5 m/s, 50 N', 'arm', 'at once', 'refused, stop'),
)


def state_table() -> str:
    """Return the state machine as rows of a table."""
    rows = (
        f'| `{state.__name__}` | {", ".join(state.commands)} | {state.ends} | {state.on_error} |' for state in STATES
    )
    return '\n'.join(rows)


def limit_table() -> str:
    """Return the limits as rows of a table."""
    return '\n'.join(f'| `{row.name}` | {" | ".join(row[1:])} |' for row in LIMITS)
