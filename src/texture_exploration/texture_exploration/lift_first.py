# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Lift the finger before a motion begins: after a fault the contact state is unknown.

Frames and signs may also differ from the declared ones, so that the lift begins with a probe, and is
slow and watched to its end.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable

from texture_core.errors import ExplorationError, MotionAborted
from texture_core.types import Phase
from texture_exploration.arms.arm import ArmCommand, ArmState, FreeAir, Vector
from texture_exploration.force_control import stopping_m_s
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import Stage
from texture_exploration.touch import IMPACT, REACTION_S, TouchParams

CALM_S = 0.15  # at rest; an arm that zeroes its force sensor does so now
PROBE_M = 0.0005
PROBE_M_S = 0.002
PROBE_TIMEOUT_S = 2.0
STILL_M, STILL_S = 0.00005, 0.06  # an arm that moves less in this time is at rest
ASTRAY_M = 0.0002  # off the commanded path: more than noise and play
MET_GROWTH = 2.0  # times the change in the first half of the way
MOST_FORCE_SHARE = 0.65  # of the force limit: no finger with a permitted force is left pressed harder
GO_BACK_S = 0.5
UNKNOWN_STATE = ArmState(0, (math.inf,) * 3, (0.0,) * 3, math.nan)
REST_STEP_M = 1e-5  # way between two states of an arm at rest
PATIENCE_S = 0.6  # an arm that has not zeroed its force sensor by then will not do so at this place


class Detour(MotionAborted):
    """An end of a stage with other stages after it, which end the motion."""

    def __init__(self, reason: str, *stages: Stage, error: ExplorationError = ExplorationError.MOTION_FAILED) -> None:
        super().__init__(reason, error)
        self.stages = stages


class Rise(Stage):
    """Rise until the force has not changed over the clearance: then nothing touches the finger.

    It begins with a probe of half a millimetre, slowly: the finger must follow in direction, and its force must not
    rise. Then it rises no faster than the finger comes down, and slower where the force shows a stiffer contact.
    """

    ahead = stays = True

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
        self._signed = signed  # no wrong sign of the force was found
        self._zero_n = zero_n  # from which the force counts: that before the first of several rises
        self._air = FreeAir(touch.clearance_m, touch.contact_force_n)
        self._start_ns: int | None = None  # of the probe
        self._heights_m: list[float] = []  # along the rise, and the forces there
        self._forces_n: list[Vector] = []
        self.free = False

    def again(self) -> Rise:
        """Return a rise after this one, for any sign of the force; it counts from the same zero."""
        return Rise(*self._given, signed=False, zero_n=self._zero_n)

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Note height and force at the start."""
        super().begin(time_ns, arm)
        self._first = arm

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
                f'the force changed while the finger rose by {risen_m:.3f} m; check that nothing touches it, and '
                "raise 'contact_force_n' above the noise of the force sensor",
                ExplorationError.FORCE_SENSOR,
            )
        # Written so that NaN also exceeds the limit.
        if not math.dist(arm.force_vector_n, self._zero_n or self._first.force_vector_n) <= self._most_n:
            raise Detour(
                f'the force changed by more than {self._most_n:g} N while the finger rose by {1e3 * risen_m:.2f} mm: '
                'it is pressed harder than it may be, or something is above it; free it by hand',
                GoBack(self._first.force_vector_n, self._touch),
            )
        if self._signed and risen_m >= PROBE_M / 2:
            self._check_sign(arm)
        stiffness_n_m = self._watch_growth(arm)
        if risen_m < PROBE_M:
            return ArmCommand(normal_m_s=PROBE_M_S)
        gentle_m_s = stopping_m_s(self._impact_n, stiffness_n_m, REACTION_S) if stiffness_n_m else math.inf
        return ArmCommand(normal_m_s=max(PROBE_M_S, min(self._speed_m_s, gentle_m_s)))

    def _rests(self, time_ns: int, arm: ArmState) -> bool:
        """Wait until the arm is at rest, which may take time after a fault; note place and force."""
        if self.elapsed_s(time_ns) > PROBE_TIMEOUT_S:
            raise MotionAborted(
                'the arm moves although zero velocity is commanded; see what moves it', ExplorationError.ARM_FAULT
            )
        if math.dist(arm.position, self._first.position) > STILL_M:
            self._first = arm
        if (arm.time_ns - self._first.time_ns) * 1e-9 < STILL_S:  # a state that stays old is no rest
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
            f'the arm moved by ({1e3 * x:.2f}, {1e3 * y:.2f}, {1e3 * up:.2f}) mm in the frame of the surface although '
            'a rise along z is commanded; check the frame and the sign of its velocities'
        )
        back = GoBack(self._first.force_vector_n, self._touch)
        raise Detour(reason, back) if astray else MotionAborted(reason)

    def _check_sign(self, arm: ArmState) -> None:
        first = self._first
        if arm.force_n - first.force_n > self._touch.contact_force_n:
            raise Detour(
                f'the force went from {first.force_n:.2f} to {arm.force_n:.2f} N while the finger rose: its sign is '
                'wrong, the z axis of the surface does not point away from it, or it is not steady',
                self.again(),
                error=ExplorationError.FORCE_SENSOR,
            )

    def _watch_growth(self, arm: ArmState) -> float:
        """Return the stiffness of the contact that the finger leaves, N/m, 0 in the air; Detour if it meets something.

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
            raise Detour(
                f'the finger met something while it rose, the force changed by {newly_n:.2f} N; check what is above '
                'it, and that the z axis of the surface points away from it',
                GoBack(middle_n, self._touch),
            )
        last = max(0, bisect_right(self._heights_m, height_m - PROBE_M) - 1)
        changed_n = math.dist(force_n, self._forces_n[last])
        rise_m = max(height_m - self._heights_m[last], 0.1 * PROBE_M)
        return changed_n / rise_m if changed_n > noise_n else 0.0


class GoBack(Stage):
    """Go back down, until the force is again what it was before the rise."""

    ahead = stays = True

    def __init__(self, before_n: Vector, touch: TouchParams) -> None:
        super().__init__(Phase.LIFT, GO_BACK_S + 1.0, 'the finger to go back')
        self._before_n = before_n
        self._touch = touch

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Go down for a short time at most."""
        left_n = math.dist(arm.force_vector_n, self._before_n)
        if left_n <= self._touch.contact_force_n or self.elapsed_s(time_ns) > GO_BACK_S:
            return None
        return ArmCommand(normal_m_s=-2 * PROBE_M_S)


class CalmDown(Stage):
    """Rest until the force sensor is valid.

    An arm that detects free air may have observed less of the lift than the explorer, or its controller may
    not have accepted the command to zero. More rest would prove nothing, so that the finger rises again, as long
    as the force stays that of the first rest.
    """

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

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Note when and where the arm came to rest."""
        super().begin(time_ns, arm)
        self._rest_ns, self._start_m, self._rest_m = time_ns, arm.position[2], arm.position[2]
        self._free_n, self._before = arm.force_vector_n, arm

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Wait; rise by the clearance whenever the arm has not zeroed its force sensor within `PATIENCE_S`."""
        # A sensor that reads nothing at rest was zeroed, though the arm may not report it yet; a contact would be read
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
            self._believed = True  # the arm reports it at once, and this state may still be without the zero
            return ArmCommand()
        height_m = arm.position[2]
        if rested_s < PATIENCE_S or height_m - self._start_m > self._touch.approach_travel_m:
            return ArmCommand()
        met_n = math.dist(arm.force_vector_n, self._free_n)
        if met_n > self._touch.contact_force_n and not self._zeroed():
            raise Detour(
                f'the finger met something while it rose for its force sensor to be zeroed, {met_n:.2f} N; check what '
                'is above it, and that the z axis of the surface points away from it',
                GoBack(self._free_n, self._touch),
            )
        if height_m - self._rest_m < self._touch.clearance_m:
            return ArmCommand(normal_m_s=self._speed_m_s)
        self._rest_ns, self._rest_m = time_ns, height_m
        return ArmCommand()
