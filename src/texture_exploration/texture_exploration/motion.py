# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A motion made of stages, one after the other, that can be aborted in any of them or finished early."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from texture_core.errors import ExplorationError, MotionAborted, MotionRefused
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.arm import ArmCommand, ArmState, Vector
from texture_exploration.lift_first import CalmDown, Detour, Rise
from texture_exploration.paths import Follower
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import (
    AccelerateStage,
    Along,
    ApproachStage,
    BrakeStage,
    GoHomeStage,
    LiftStage,
    SettleForceStage,
    SlideStage,
    Stage,
)
from texture_exploration.touch import WALL_SHARE, TouchParams
from texture_exploration.watches import ContactWatch

# --------------------
# One step of a motion.


@dataclass(frozen=True)
class MotionStep:
    """Command for the arm at this time, and progress of the motion.

    `steady_s` guarantees phase, speed and force for this time from now on; `direction_rad` is the direction of travel;
    `progress` the fraction of the slide that is over.
    """

    command: ArmCommand
    phase: Phase
    steady_s: float
    direction_rad: float
    progress: float


# --------------------
# Sequence of the stages.


class Motion:
    """One planned exploration: go there, touch, press, speed up, slide along a path, brake and lift.

    On any error it goes to the last stage, which lifts the finger. It reads no clock and no arm: each step gets the
    time and the state of the arm. `follower` steers along the path, for a request with speed and force filled in and
    checked; `home` is the place above which the finger comes down, m, in the frame of the surface. `error` is why the
    motion aborted; NONE if it did not, or was aborted from outside.
    """

    def __init__(
        self, follower: Follower, request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits
    ) -> None:
        speed, force = request.speed_m_s, request.force_n
        along = Along(follower, speed, force, touch, limits, ContactWatch(force, touch))
        self._slide = SlideStage(along)
        self._lift = LiftStage(home, force, touch, limits)
        self._remaining_stages: list[Stage] = [
            GoHomeStage(home, touch, limits),
            ApproachStage(force, touch, limits),
            SettleForceStage(force, touch, limits),
            AccelerateStage(along),
            self._slide,
            BrakeStage(along),
            self._lift,
        ]
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

        `zeroed` tells whether the force sensor of the arm is valid once it is at rest in free air; `zero_n` is what it
        shows before the first lift since the arm was connected, None before this one.
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
                f"times 'force_limit_n', until an arm that is {1e3 * arm.delay_s:.0f} ms late has stopped; allowed is "
                f'at most {math.floor(allowed_m_s * 1e4) / 1e4:g} m/s',
                field='speed_m_s',
            )

    def step(self, time_ns: int, arm: ArmState) -> MotionStep:
        """Return what to do at `time_ns` (CLOCK_MONOTONIC), until the phase is DONE or ABORTED.

        After the end of a stage the next one begins within the same step.
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
            direction_rad=self._slide.along.follower.direction_rad,
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
            self._slide.finishing = True

    def note_way_back(self) -> None:
        """Note that the finger moved back from an obstacle instead of the last command."""
        self._lift.watch_anew()

    def lift_from(self, place: Vector) -> LiftStage:
        """Return another lift from a place, in case this motion has failed."""
        along, (x, y, z) = self._slide.along, place
        return LiftStage((x, y, z + along.touch.clearance_m), along.force_n, along.touch, along.limits)

    @property
    def force_n(self) -> float:
        """The wanted force of the slide."""
        return self._slide.along.force_n

    @property
    def lifted(self) -> bool:
        """Whether the finger was lifted at the end, confirmed by the measured force."""
        if self._ended_ahead:
            return self._free_ahead
        return bool(self._lift.free)

    @property
    def message(self) -> str:
        """The outcome in one sentence."""
        if self._ended_ahead and not self._free_ahead:
            return f'{self._abort_reason}; the finger was not lifted'
        return self._abort_reason or self._finish_reason or 'the motion was completed'

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
        """Continue as the stage allows: back, further up, by the lift, or stay in place."""
        reason, self.error = str(error), self.error or error.error
        if stage is self._lift:
            before = f'{self._abort_reason}; ' if self._abort_reason else ''
            self._abort_reason = f'{before}the finger was not lifted: {reason}'
        elif isinstance(error, Detour):
            self._end_ahead(reason, *error.stages)
        elif stage.stays:
            self._end_ahead(reason)
        else:
            self.abort(reason)

    def _end_ahead(self, reason: str, *stages: Stage) -> None:
        """End after some stages, without the following ones."""
        self._abort_reason = self._abort_reason or reason
        self._ended_ahead = True
        self._stage, self._remaining_stages = None, [*stages]


# Plans a motion from a request, whose numbers of 0 take the default; the place where the slide begins and to which
# height it lifts, m, in the frame of the surface; how the finger touches; and what is allowed. MotionRefused if a
# number is out of its range or does not belong to this motion, or the path leaves the workspace.
Planner = Callable[[ExplorationRequest, Vector, TouchParams, SafetyLimits], Motion]
