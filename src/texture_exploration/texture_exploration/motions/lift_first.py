"""Lift the finger before a motion begins: after a fault nobody knows whether it still presses."""

from __future__ import annotations

from collections.abc import Callable

from texture_core.errors import MotionAborted
from texture_core.exploration import Phase
from texture_exploration.arms.protocol import ArmCommand, ArmState
from texture_exploration.free_air import FreeAir
from texture_exploration.motions.protocol import Motion, MotionStep
from texture_exploration.motions.stages import Stage
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits

CALM_S = 0.15  # at rest; an arm that zeroes its force sensor does so now
PATIENCE_S = 0.6  # an arm that has not zeroed its force sensor by then will not do so where it stands


class Rise(Stage):
    """Rise until the force has not changed over the clearance: then nothing touches the finger."""

    def __init__(self, touch: TouchParams, limits: SafetyLimits) -> None:
        super().__init__(Phase.APPROACH, limits.lift_timeout_s, 'the finger to be free')
        self._touch = touch
        self._air = FreeAir(touch.clearance_m, touch.contact_force_n)
        self._start_m = 0.0

    def begin(self, time_ns: int, arm: ArmState) -> None:
        """Note the height at the start."""
        super().begin(time_ns, arm)
        self._start_m = arm.position[2]

    def step(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Go up, but no further than a finger may come down to look for the surface.

        Raises
        ------
        MotionAborted
            If the force is not steady within the allowed rise.
        """
        if self._air.update(arm.time_ns, arm.position, arm.force_n):
            return None
        risen_m = arm.position[2] - self._start_m
        if risen_m > max(self._touch.approach_travel_m, 2 * self._touch.clearance_m):
            raise MotionAborted(
                f'the force changed all the while the finger rose by {risen_m:.3f} m; see that nothing touches it, and '
                "raise 'contact_force_n' above the noise of the force sensor"
            )
        return ArmCommand(normal_m_s=self._touch.lift_speed_m_s)


class CalmDown(Stage):
    """Stand still, until the force sensor can be believed.

    An arm that proves free air by itself may have seen less of the lift than the explorer did, or its controller may
    not have taken the command to zero. Standing still would prove nothing more, so that the finger rises again.
    """

    def __init__(self, zeroed: Callable[[], bool], touch: TouchParams, limits: SafetyLimits) -> None:
        super().__init__(Phase.APPROACH, limits.lift_timeout_s, 'the arm to zero its force sensor')
        self._zeroed = zeroed
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
            return ArmCommand(normal_m_s=self._touch.lift_speed_m_s)
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
        self._ahead: list[Stage] = [Rise(touch, limits), CalmDown(zeroed, touch, limits)]
        self._stage: Stage | None = None

    def step(self, time_ns: int, arm: ArmState) -> MotionStep:
        """Return what to do now."""
        while self._ahead:
            command = self._try_stage(self._ahead[0], time_ns, arm)
            if command is not None:
                return MotionStep(command, Phase.APPROACH, steady_s=0.0, direction_rad=0.0, progress=0.0)
            self._ahead = self._ahead[1:]
        return self._motion.step(time_ns, arm)

    def abort(self, reason: str) -> None:
        """Let the motion lift, and end as aborted."""
        self._ahead = []
        self._motion.abort(reason)

    def finish(self, reason: str) -> None:
        """End the slide early."""
        self._motion.finish(reason)

    @property
    def force_n(self) -> float:
        """The wanted force of the slide."""
        return self._motion.force_n

    @property
    def message(self) -> str:
        """What happened, in one sentence."""
        return self._motion.message

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
            self.abort(str(trouble))
            return None
        return command
