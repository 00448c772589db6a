"""Lift the finger before a motion begins: after a fault nobody knows whether it still presses.

Nobody knows either whether frames and signs are what they are said to be, so that the lift begins with a probe, and is
slow and watched to its end.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from texture_core.errors import MotionAborted
from texture_core.exploration import Phase
from texture_exploration.arms.protocol import ArmCommand, ArmState, Vector
from texture_exploration.free_air import FreeAir
from texture_exploration.motions.protocol import Motion, MotionStep
from texture_exploration.motions.stages import Stage
from texture_exploration.motions.touch import IMPACT, REACTION_S, TouchParams
from texture_exploration.safety import SafetyLimits

CALM_S = 0.15  # at rest; an arm that zeroes its force sensor does so now
PROBE_M = 0.0005
PROBE_M_S = 0.002
PROBE_TIMEOUT_S = 2.0
STILL_M, STILL_S = 0.00005, 0.06  # an arm that moves less in this time stands still
ASTRAY_M = 0.0002  # beside the commanded way: more than noise and play
MET = 4.0  # times the change of before: a surface that is left lets the force change less and less
MOST = 0.8  # of the force limit: no finger is left pressed harder
BACK_S = 0.5
NOWHERE = ArmState(0, (math.inf,) * 3, (0.0,) * 3, math.nan)
PATIENCE_S = 0.6  # an arm that has not zeroed its force sensor by then will not do so where it stands


class WrongWay(MotionAborted):
    """To rise makes it worse: the finger goes back the way it came instead, as far as the force was as before."""

    def __init__(self, reason: str, before_n: Vector) -> None:
        super().__init__(reason)
        self.before_n = before_n


class WrongSign(MotionAborted):
    """The force rises while the finger does; what touches it is left by rising all the same."""


class Rise(Stage):
    """Rise until the force has not changed over the clearance: then nothing touches the finger.

    It begins with a probe of half a millimetre, slowly: the finger must follow in direction, and its force must not
    rise. Then it rises no faster than the finger comes down, and slower where the force shows a stiffer contact.

    Attributes
    ----------
    free
        Whether that is proven.
    """

    def __init__(self, force_n: float, touch: TouchParams, limits: SafetyLimits, signed: bool = True) -> None:
        speed_m_s = touch.approach_m_s(force_n)
        longest_m = max(touch.approach_travel_m, 2 * touch.clearance_m)
        super().__init__(Phase.APPROACH, limits.lift_timeout_s + longest_m / speed_m_s, 'the finger to be free')
        self._touch = touch
        self._speed_m_s, self._longest_m = speed_m_s, longest_m
        self._first = NOWHERE
        self._most_n = MOST * limits.force_limit_n
        self._impact_n = IMPACT * force_n
        self._signed = signed  # the sign of the force is not known to be wrong
        self._air = FreeAir(touch.clearance_m, touch.contact_force_n)
        self._start_ns: int | None = None  # of the probe
        self._rest_ns = 0
        self._seen: list[ArmState] = []  # one in each half of PROBE_M
        self.free = False

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Note height and force at the start."""
        super().begin(time_ns, arm)
        self._first, self._rest_ns = arm, time_ns

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Go up, but no further than a finger may come down to look for the surface.

        Raises
        ------
        WrongWay
            If the finger goes another way, or meets something.
        WrongSign
            If the force rises.
        MotionAborted
            If the finger does not follow, or the force is not steady within the allowed rise.
        """
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
                "raise 'contact_force_n' above the noise of the force sensor"
            )
        if abs(arm.force_n - self._first.force_n) > self._most_n:
            raise WrongWay(
                f'the force changed by more than {self._most_n:g} N while the finger rose by {1e3 * risen_m:.2f} mm: '
                'it is pressed harder than it may be, or something is above it; free it by hand',
                self._first.force_vector_n,
            )
        if self._signed and risen_m >= PROBE_M / 2:
            self._check_sign(arm)
        return ArmCommand(normal_m_s=PROBE_M_S if risen_m < PROBE_M else self._allowed_m_s(arm))

    def _rests(self, time_ns: int, arm: ArmState) -> bool:
        """Wait until the arm stands still, as it may not do yet after a fault; note place and force."""
        if self.elapsed_s(time_ns) > PROBE_TIMEOUT_S:
            raise MotionAborted('the arm moves although it was told to stand still; see who else moves it')
        if math.dist(arm.position, self._first.position) > STILL_M:
            self._first, self._rest_ns = arm, time_ns
        if (time_ns - self._rest_ns) * 1e-9 < STILL_S:
            return False
        self._first, self._seen, self._start_ns = arm, [arm], time_ns
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

    def _allowed_m_s(self, arm: ArmState) -> float:
        """Return how fast the finger may rise; WrongWay if its force changes much more than in the rise just before."""
        if arm.position[2] - self._seen[-1].position[2] >= PROBE_M / 2:
            self._seen = [*self._seen[-3:], arm]
        middle = self._seen[max(0, len(self._seen) - 2)]
        newly_n = math.dist(arm.force_vector_n, middle.force_vector_n)
        before_n = math.dist(middle.force_vector_n, self._seen[0].force_vector_n)
        noise_n = self._touch.contact_force_n
        if len(self._seen) == 4 and newly_n > MET * max(before_n, 0.5 * noise_n):
            raise WrongWay(
                f'the finger met something while it rose, the force changed by {newly_n:.2f} N; see what is above it, '
                'and that the z axis of the surface points away from it',
                middle.force_vector_n,
            )
        if newly_n <= noise_n:
            return self._speed_m_s
        stiffness_n_m = newly_n / max(arm.position[2] - middle.position[2], 0.1 * PROBE_M)
        return max(PROBE_M_S, min(self._speed_m_s, self._impact_n / (stiffness_n_m * REACTION_S)))


class GoBack(Stage):
    """Go back down, until the force is again what it was before the rise."""

    def __init__(self, before_n: Vector, touch: TouchParams) -> None:
        super().__init__(Phase.LIFT, BACK_S + 1.0, 'the finger to go back')
        self._before_n = before_n
        self._touch = touch

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Go down for a short time at most."""
        left_n = math.dist(arm.force_vector_n, self._before_n)
        if left_n <= self._touch.contact_force_n or self.elapsed_s(time_ns) > BACK_S:
            return None
        return ArmCommand(normal_m_s=-2 * PROBE_M_S)


class CalmDown(Stage):
    """Stand still, until the force sensor can be believed.

    An arm that proves free air by itself may have seen less of the lift than the explorer did, or its controller may
    not have taken the command to zero. Standing still would prove nothing more, so that the finger rises again.
    """

    def __init__(self, zeroed: Callable[[], bool], force_n: float, touch: TouchParams, limits: SafetyLimits) -> None:
        super().__init__(Phase.APPROACH, limits.lift_timeout_s, 'the arm to zero its force sensor')
        self._zeroed = zeroed
        self._speed_m_s = touch.approach_m_s(force_n)
        self._touch = touch
        self._rest_ns = 0
        self._start_m = self._rest_m = 0.0

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Note when and where the arm came to rest."""
        super().begin(time_ns, arm)
        self._rest_ns, self._start_m, self._rest_m = time_ns, arm.position[2], arm.position[2]

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Wait; rise by the clearance whenever the arm has not zeroed its force sensor within `PATIENCE_S`."""
        rested_s = (time_ns - self._rest_ns) * 1e-9
        if rested_s >= CALM_S and self._zeroed():
            return None
        height_m = arm.position[2]
        if rested_s < PATIENCE_S or height_m - self._start_m > self._touch.approach_travel_m:
            return ArmCommand()
        if height_m - self._rest_m < self._touch.clearance_m:
            return ArmCommand(normal_m_s=self._speed_m_s)
        self._rest_ns, self._rest_m = time_ns, height_m
        return ArmCommand()


class LiftFirst:
    """A motion that begins with a lift and a rest; see `texture_exploration.motions.protocol.Motion`.

    Parameters
    ----------
    motion
        What follows.
    touch, limits
        How fast, and how far.
    zeroed
        Whether the force sensor of the arm can be believed once it stands still in free air.
    """

    def __init__(self, motion: Motion, touch: TouchParams, limits: SafetyLimits, zeroed: Callable[[], bool]) -> None:
        self._motion = motion
        self._touch, self._limits = touch, limits
        self._zeroed = zeroed
        force_n = motion.force_n
        self._ahead: list[Stage] = [
            Rise(force_n, touch, limits),
            CalmDown(zeroed, force_n, touch, limits),
        ]
        self._stage: Stage | None = None
        self._reason = ''  # why it ends before the motion has begun
        self._free = False

    def step(self, time_ns: int, arm: ArmState) -> MotionStep:
        """Return what to do now."""
        while self._ahead:
            stage = self._ahead[0]
            command = self._try_stage(stage, time_ns, arm)
            if command is not None:
                phase = Phase.LIFT if self._reason else Phase.APPROACH
                return MotionStep(command, phase, steady_s=0.0, direction_rad=0.0, progress=0.0)
            if self._ahead[:1] == [stage]:
                self._ahead = self._ahead[1:]
        if self._reason:
            return MotionStep(ArmCommand(), Phase.ABORTED, steady_s=0.0, direction_rad=0.0, progress=0.0)
        return self._motion.step(time_ns, arm)

    def abort(self, reason: str) -> None:
        """Let the motion lift, and end as aborted; a force that is not zeroed yet must show free air by a rise."""
        if not self._ahead or self._zeroed():
            self._ahead = []
            self._motion.abort(reason)
        elif not self._reason:
            self._end(reason, Rise(self._motion.force_n, self._touch, self._limits, signed=False))

    def finish(self, reason: str) -> None:
        """End the slide early."""
        self._motion.finish(reason)

    @property
    def force_n(self) -> float:
        """The wanted force of the slide."""
        return self._motion.force_n

    @property
    def lifted(self) -> bool:
        """Whether the finger was lifted at the end, and the measured force says so."""
        return self._free if self._reason else self._motion.lifted

    @property
    def message(self) -> str:
        """What happened, in one sentence."""
        if not self._reason:
            return self._motion.message
        return self._reason if self._free else f'{self._reason}; the finger was not lifted'

    def _end(self, reason: str, *stages: Stage) -> None:
        """End after some stages; the motion does not begin."""
        self._reason = self._reason or reason
        self._ahead, self._stage = [*stages], None

    def _try_stage(self, stage: Stage, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Return the command of a stage; None if it is over or cannot go on."""
        if stage is not self._stage:
            self._stage = stage
            stage.begin(time_ns, arm)
        try:
            command = stage.step(time_ns, arm)
            if command is not None and stage.elapsed_s(time_ns) > stage.timeout_s:
                raise MotionAborted(f'waited {stage.timeout_s:.1f} s for {stage.goal}')
        except MotionAborted as trouble:
            self._give_way(stage, trouble)
            return None
        finally:
            self._free = stage.free if isinstance(stage, Rise) else self._free
        return command

    def _give_way(self, stage: Stage, trouble: MotionAborted) -> None:
        """End in the way that is left: back, further up, by the lift of the motion, or where the finger is."""
        reason = str(trouble)
        if isinstance(trouble, WrongWay):
            self._end(reason, GoBack(trouble.before_n, self._touch))
        elif isinstance(trouble, WrongSign):
            self._end(reason, Rise(self._motion.force_n, self._touch, self._limits, signed=False))
        elif isinstance(stage, CalmDown):
            self.abort(reason)
        else:
            self._end(reason)
