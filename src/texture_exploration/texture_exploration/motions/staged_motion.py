"""A motion made of stages, one after the other, that can be aborted in any of them or finished early."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from texture_core.errors import MotionAborted
from texture_core.exploration import Phase
from texture_exploration.arms.protocol import ArmCommand, ArmState
from texture_exploration.motions.contact import ContactLost
from texture_exploration.motions.protocol import MotionStep
from texture_exploration.motions.stages import LiftStage, SlideStage, Stage

SEEKS = 3  # a surface that is lost more often is not one to slide on


class StagedMotion:
    """Go through the stages; on any error go to the last one, which lifts the finger.

    Parameters
    ----------
    stages
        In their order; the last one lifts.
    slide
        The one among them that slides.
    seek
        Returns new stages that bring the finger back to the surface and to its speed after the contact was lost while
        it moved along; without it a lost contact aborts.
    """

    def __init__(
        self, stages: Sequence[Stage], slide: SlideStage, seek: Callable[[], Sequence[Stage]] | None = None
    ) -> None:
        self._remaining_stages = list(stages)
        self._lift = stages[-1]
        self._slide = slide
        self._seek = seek
        self._seeks = 0
        self._stage: Stage | None = None
        self._phase = Phase.IDLE
        self._abort_reason = ''
        self._finish_reason = ''

    def step(self, time_ns: int, arm: ArmState) -> MotionStep:
        """Return what to do now; a stage that is over hands on to the next within the same step."""
        command = self._try_stage(time_ns, arm)
        while command is None and self._remaining_stages:
            self._stage = self._remaining_stages.pop(0)
            self._stage.begin(time_ns, arm)
            command = self._try_stage(time_ns, arm)
        if self._stage is None or command is None:
            self._stage, command = None, ArmCommand()
            if isinstance(self._lift, LiftStage):
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
        """Go on with the last stage, which lifts; the first reason counts."""
        if self._phase in (Phase.DONE, Phase.ABORTED):
            return
        self._abort_reason = self._abort_reason or reason
        if self._stage is not self._lift:
            self._stage, self._remaining_stages = None, [self._lift]

    def finish(self, reason: str) -> None:
        """End the slide as soon as the guaranteed time is over; without effect before and after it."""
        if self._stage is self._slide and not self._finish_reason:
            self._finish_reason = reason
            self._slide.finish()

    @property
    def force_n(self) -> float:
        """The wanted force of the slide."""
        return self._slide.force_n

    @property
    def lifted(self) -> bool:
        """Whether the finger was lifted at the end, and the measured force says so."""
        return isinstance(self._lift, LiftStage) and self._lift.free

    @property
    def message(self) -> str:
        """What happened, in one sentence."""
        return self._abort_reason or self._finish_reason or 'the motion ended as asked'

    def _try_stage(self, time_ns: int, arm: ArmState) -> ArmCommand | None:
        """Return the command of the present stage; None if it is over, cannot go on, or there is none."""
        stage = self._stage
        if stage is None:
            return None
        try:
            command = stage.step(time_ns, arm)
            if command is not None and stage.elapsed_s(time_ns) > stage.timeout_s:
                waited = f'waited {stage.timeout_s:.1f} s for {stage.goal}'
                raise MotionAborted(f'{waited}; the force is {arm.force_n:.2f} N')
        except MotionAborted as error:
            if stage is self._lift:
                before = f'{self._abort_reason}; ' if self._abort_reason else ''
                self._abort_reason = f'{before}the finger was not lifted: {error}'
            elif not self._sought(error, stage):
                self.abort(str(error))
            return None
        return command

    def _sought(self, error: MotionAborted, stage: Stage) -> bool:
        """Put the stages ahead that bring a lost contact back; return whether there are any."""
        if self._seek is None or self._seeks >= SEEKS or not isinstance(error, ContactLost):
            return False
        if stage.phase is Phase.LIFT:  # the slide is over
            return False
        self._seeks += 1
        again = [stage] if stage is self._slide else []
        self._stage, self._remaining_stages = None, [*self._seek(), *again, *self._remaining_stages]
        return True
