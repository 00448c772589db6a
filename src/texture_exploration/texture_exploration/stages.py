# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The stages of motions: touch, press, slide, lift; each has its commands and its end."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import NamedTuple

from texture_core.errors import ExplorationError, MotionAborted
from texture_core.types import Phase
from texture_exploration.arms.arm import ArmCommand, ArmState, Vector
from texture_exploration.guards import WAY_S
from texture_exploration.paths import STEADY_S, Follower, smooth
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams
from texture_exploration.watches import ContactLost, ContactWatch, OvershootWatch, SlideWatch, StallWatch

NEAR_M = 0.0005
GROWTH_M = 0.002
LEAST_LIFT_M_S = 0.005  # a lift without proof of free air also ends in time
PRESSING_S = 0.1  # from contact to the wanted force: a step would oscillate on a stiff surface
STEADY_HORIZON_S = 0.1  # the longest time for which a slide guarantees speed and force; ending it early takes as long


class Stage:
    """One part of a motion.

    `ahead`: it lifts before the motion begins. `stays`: after an error of the stage the finger stays in place, as no
    direction is known to help. `free`: whether it found the finger free, None if it did not look.
    """

    ahead = stays = False
    free: bool | None = None

    def __init__(self, phase: Phase, timeout_s: float, goal: str) -> None:
        self.phase = phase
        self.timeout_s = timeout_s
        self.goal = goal
        self.steady_s = 0.0
        self._begin_ns, self._begin_m = 0, 0.0

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Note time and height of the start."""
        self._begin_ns, self._begin_m = time_ns, arm.position[2]

    def elapsed_s(self, time_ns: int) -> float:
        """Return the time since the start."""
        return (time_ns - self._begin_ns) * 1e-9

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Return the command, None when the stage is over; MotionAborted if its goal cannot be reached."""
        raise NotImplementedError

    def timed_step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Return the command; MotionAborted also if the stage takes too long."""
        command = self.step(time_ns, arm)
        if command is not None and self.elapsed_s(time_ns) > self.timeout_s:
            raise MotionAborted(f'waited {self.timeout_s:.1f} s for {self.goal}; the force is {arm.force_n:.2f} N')
        return command


class GoHomeStage(Stage):
    """Rise to the height of the start, then go above the surface to where the motion begins."""

    def __init__(self, home: Vector, touch: TouchParams, limits: SafetyLimits) -> None:
        super().__init__(Phase.APPROACH, limits.approach_timeout_s, 'the finger to reach the start')
        self._home = home
        self._touch = touch
        self._limits = limits
        self._speed_m_s = touch.travel_speed_m_s
        self._free_n: Vector | None = None

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Allow the time for the distance."""
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

    def __init__(self, force_n: float, touch: TouchParams, limits: SafetyLimits) -> None:
        super().__init__(Phase.APPROACH, limits.approach_timeout_s, 'the finger to meet the surface')
        self._touch = touch
        self._limits = limits
        self._force_n = force_n

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Go down, but no further than allowed."""
        if not arm.force_size_n <= self._touch.contact_force_n:
            self._check_normal(arm)
            return None
        if self._begin_m - arm.position[2] > self._touch.approach_travel_m:
            raise MotionAborted(
                f'no surface within {self._touch.approach_travel_m:g} m below the start; '
                "bring the finger closer or raise 'approach_travel_m'",
                ExplorationError.NO_SURFACE,
            )
        speed_m_s = self._touch.approach_m_s(self._force_n, arm.watchdog_s, arm.delay_s)
        if arm.watchdog_s:
            # The same distance is allowed, however slow the arm has to be.
            heard_m_s = self._touch.approach_m_s(self._force_n, delay_s=arm.delay_s)
            self.timeout_s = self._limits.approach_timeout_s * heard_m_s / speed_m_s
            self.goal = (
                f'the finger to meet the surface at {speed_m_s * 1e3:.2g} mm/s, as the arm continues for '
                f'{arm.watchdog_s * 1e3:.0f} ms without a command'
            )
        return ArmCommand(normal_m_s=-speed_m_s)

    def _check_normal(self, arm: ArmState) -> None:
        """Raise MotionAborted if the contact does not push the finger up: the force would grow without limit."""
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
            'in another frame than the declared one'
        )


class SettleForceStage(Stage):
    """Press gently harder, until the force has stayed within its tolerance for a while."""

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
        self._outside_ns = arm.time_ns
        self._first_n = max(0.0, min(arm.force_n, self._force_n))

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Hold the force."""
        self._overshoot.update(arm)
        if abs(arm.force_n - self._force_n) > self._touch.force_tolerance * self._force_n:
            self._outside_ns = arm.time_ns
        if (arm.time_ns - self._outside_ns) * 1e-9 >= self._touch.settle_s:  # a state that stays old has not settled
            return None
        rise = smooth(self.elapsed_s(time_ns) / PRESSING_S)
        return ArmCommand(force_n=self._first_n + (self._force_n - self._first_n) * rise)


class Along(NamedTuple):
    """Common parts of the stages along a path: follower, speed, force and the watch of the contact."""

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
    """Gain speed smoothly along the path; over when the arm has reached speed and force."""

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
        elapsed_s, speed_m_s, force_n = self.elapsed_s(time_ns), self._along.speed_m_s, self._along.force_n
        fast = abs(math.hypot(*arm.velocity[:2]) - speed_m_s) <= self._along.touch.speed_tolerance * speed_m_s
        # Sliding makes the force fluctuate: twice the tolerance of the finger at rest.
        presses = abs(arm.force_n - force_n) <= 2 * self._along.touch.force_tolerance * force_n
        if elapsed_s >= self._along.ramp_s + STEADY_S and fast and presses:
            return None
        speed = speed_m_s * smooth(elapsed_s / self._along.ramp_s)
        return ArmCommand(self._along.follower.velocity(speed), force_n=force_n)


class SlideStage(Stage):
    """Keep speed and force for the length of the path."""

    def __init__(self, along: Along) -> None:
        planned_s = along.follower.length_m / along.speed_m_s
        super().__init__(Phase.SLIDE, planned_s + along.limits.slide_overtime_s, 'the slide to end')
        self.along = along
        self._stall = StallWatch(along.touch)
        self._watch = SlideWatch(along.speed_m_s, along.force_n, along.touch)
        self._start_m = 0.0
        self._steady_until_ns = 0
        self.finishing = False  # it ends as soon as the guaranteed time is over
        self.progress = 0.0

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """The slide counts from here."""
        super().begin(time_ns, arm)
        self._start_m = self.along.follower.travelled_m
        self.along.follower.begin_slide()

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Keep on sliding, and update the guaranteed time: 0 without contact, or off the requested speed and force."""
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
        return min(by_length, (self._steady_until_ns - time_ns) * 1e-9) if self.finishing else by_length


class BrakeStage(Stage):
    """Lose speed smoothly along the path, still pressing: a finger that lifts at speed comes off with a jerk.

    The slide is over: a surface may end here, and the finger only keeps its height. A contact
    that was lost in the slide and does not come back aborts.
    """

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
        touching = True  # a contact that was lost in the slide may come back: keep pressing
        if not self._whole:
            self._along.contact.update(arm)
            self._whole = self._along.contact.touching
        else:
            with suppress(ContactLost):
                self._along.contact.update(arm)
            touching = self._along.contact.touching
        fraction = self.elapsed_s(time_ns) / self._along.ramp_s
        if fraction >= 1.0:
            if not self._whole:
                self._along.contact.refuse()
            return None
        velocity = self._along.follower.velocity(self._along.speed_m_s * smooth(1.0 - fraction))
        return ArmCommand(velocity, force_n=self._along.force_n if touching else None)


class LiftStage(Stage):
    """Leave the surface along its normal, to the height of the start or at least by the clearance.

    The clearance counts from where the finger came free: a soft surface follows it for a while. A force that does not
    fall, as that of a frozen sensor, does not lift the finger beyond `approach_travel_m`. It goes no faster than it
    came down until the force has fallen: only that proves the direction of the normal.
    """

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
        self._top_ns: int | None = None  # since when it rests at the height with a force

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Choose the height."""
        super().begin(time_ns, arm)
        self._highest_m = max(self._goal_m, arm.position[2] + self._touch.approach_travel_m)
        slower_s_m = 1.0 / self._gentle_m_s - 1.0 / self._touch.lift_speed_m_s
        self.timeout_s = self._base_timeout_s + (self._highest_m - arm.position[2]) * slower_s_m
        self._lowest_m, self._proven, self._top_ns = math.inf, False, None

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Go up."""
        self.see(arm)
        self._watch_rise(arm)
        if arm.force_n > self._touch.contact_force_n:
            self._goal_m = min(self._highest_m, max(self._goal_m, arm.position[2] + self._touch.clearance_m))
        if arm.position[2] < self._goal_m - NEAR_M:
            self._top_ns = None
            return ArmCommand(normal_m_s=self._touch.lift_speed_m_s if self._proven else self._gentle_m_s)
        # A finger that meets something stops later than its command: only the force at rest, as long as the way back is
        # known, shows whether it must go back.
        self._top_ns = time_ns if self._top_ns is None else self._top_ns
        return None if self.free or time_ns - self._top_ns > WAY_S * 1e9 else ArmCommand()

    def watch_anew(self) -> None:
        """Watch the force from here on: that on the way back from an obstacle is no part of the rise."""
        self._lowest_m = math.inf

    def see(self, arm: ArmState) -> None:
        """Note the force, also after the lift."""
        self.free = arm.force_size_n <= self._touch.contact_force_n

    def _watch_rise(self, arm: ArmState) -> None:
        """Check whether the force falls from that at the lowest place: a late arm continues downwards for a while."""
        height_m, force_n = arm.position[2], arm.force_size_n
        if height_m <= self._lowest_m:
            self._lowest_m, self._lowest_n = height_m, force_n
        if height_m <= self._lowest_m or height_m - self._newly[0] > GROWTH_M:  # a slower increase is drift
            self._newly = height_m, force_n
        self._proven |= force_n < self._lowest_n - self._touch.contact_force_n
        grown_n = force_n - self._newly[1]
        if height_m - self._lowest_m > NEAR_M and grown_n > self._growth_n and not self._proven:
            raise MotionAborted(
                f'the force grew from {self._newly[1]:.2f} to {force_n:.2f} N while the finger rose; check that '
                'nothing is above it, the pose of the surface and the frame of the force'
            )
