# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""One exploration: the control loop of a motion and an arm with its supervision and its end."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from typing import Any

import numpy as np

from texture_core.errors import CommandRefused, DeviceError, ExplorationError, MotionRefused, TextureError, UnknownName
from texture_core.types import ENDED, ExplorationRequest, ExplorationState, Phase, TextureEstimate
from texture_exploration.arms.arm import Arm, ArmCommand, ArmState, SurfaceFrame
from texture_exploration.guards import GAP_NS, WITHOUT_GAPS, ForceGuard, ForceWatch, Listening, sound
from texture_exploration.motion import Motion, MotionStep
from texture_exploration.safety import SafetyLimits

LOGGER = logging.getLogger(__name__)
MOST_CHARACTERS = 200  # of the message of an error, which may hold a whole array
STATE_PERIOD_NS = 20_000_000
# A tick that comes a little early must not wait for the next one.
STATE_SLACK_NS = 5_000_000
NO_SLIDE_OBSERVED = (
    'the slide was shorter than the delay of the arm or than a pause of this machine, so no sample could be taken; '
    'slide longer or more slowly'
)


@dataclass(frozen=True)
class ExplorationOutcome:
    """How an exploration ended."""

    error: ExplorationError
    message: str
    slid: bool
    lifted: bool = True

    @property
    def success(self) -> bool:
        """Whether it was completed."""
        return self.error is ExplorationError.NONE

    def sentence(self, exploration_id: str) -> str:
        """Return the message for the log."""
        lifted = '' if self.success or not self.lifted else '; the finger was lifted'
        return f'{exploration_id}: {self.message}{lifted}'


STILL_MOVING = ExplorationOutcome(
    ExplorationError.INTERNAL,
    'the explorer ended before the finger was lifted; look at the robot',
    slid=False,
    lifted=False,
)


def new_id(time_ns: int, number: int, rng: np.random.Generator) -> str:
    """Return a readable unique id such as '20261120T235959-001-ab12': UTC since 1970, a running number, a random end.

    The random end distinguishes two nodes that begin in the same second.
    """
    begin = datetime.fromtimestamp(time_ns // 1_000_000_000, tz=timezone.utc)
    return f'{begin:%Y%m%dT%H%M%S}-{number:03d}-{rng.integers(0x10000):04x}'


def may_stop(estimate: TextureEstimate) -> bool:
    """Return whether a texture estimate may end the slide; one with unknown confidence may not."""
    return estimate.accepted and estimate.decided and estimate.confidence >= 0.0


def refusal(error: TextureError) -> ExplorationError:
    """Return the code of what `Explorer.begin` raises, or of a request that cannot be read."""
    if isinstance(error, MotionRefused):
        return error.error
    if isinstance(error, DeviceError):
        return ExplorationError.ARM_NOT_READY
    return ExplorationError.UNKNOWN_MOTION if isinstance(error, UnknownName) else ExplorationError.INVALID_REQUEST


def no_signal_watch(_listening: Listening) -> str:
    """Return '': the sensor is not watched."""
    return ''


class Exploration:
    """Step a motion until it ends, also after faults of the arm."""

    def __init__(
        self,
        exploration_id: str,
        request: ExplorationRequest,
        *,
        arm: Arm,
        motion: Motion,
        limits: SafetyLimits,
        clock: Callable[[], int],
        on_state: Callable[[ExplorationState], None],
        signal_fault: Callable[[Listening], str] = no_signal_watch,
    ) -> None:
        motion.refuse_too_fast(request.motion, arm.state())
        self.exploration_id = exploration_id
        self.request = request
        self.outcome = ExplorationOutcome(
            ExplorationError.INTERNAL, 'it was aborted by an internal error; see the log', False, False
        )
        self.ended = threading.Event()
        self.gaps = 0
        self.state = ExplorationState(clock(), exploration_id, request.motion, Phase.IDLE)
        self._arm = arm
        self._motion = motion
        self._limits = limits
        self._clock = clock
        self._on_state = on_state
        self._signal_fault = signal_fault
        self._force_watch = ForceWatch(limits, arm.noisy_force, motion.force_n)
        self._guard = ForceGuard(limits)
        self._commanded = ArmCommand()
        self._arm_state: ArmState | None = None  # the newest with plausible numbers
        self._stop: tuple[ExplorationError, str] | None = None
        self._finish_reason = ''
        self._abort: tuple[ExplorationError, str] | None = None  # the first reason counts
        self._slid = False
        self._entered = False  # the workspace
        self._next_state_ns = 0
        self._begin_ns = self._last_ns = clock()
        self._listening = Listening(self._begin_ns)

    def run(self, pace: Callable[[], None]) -> ExplorationOutcome:
        """Go through the whole motion; `pace` returns when the next step is due."""
        try:
            while not self._tick():
                pace()
        except CommandRefused as error:  # the arm obeys
            self._escape(ExplorationError.ARM_FAULT, str(error), pace)
        except DeviceError as error:
            self._give_up(ExplorationError.ARM_FAULT, f'{error}; the finger was not lifted')
        except Exception as error:
            self._escape(ExplorationError.INTERNAL, f'internal error, {type(error).__name__}: {error}', pace)
        finally:
            with contextlib.suppress(DeviceError):
                self._arm.stop()
        return self.outcome

    def _escape(self, error: ExplorationError, reason: str, pace: Callable[[], None]) -> None:
        """Command zero and lift by a separate stage without the failed part; report it."""
        LOGGER.exception('an exploration failed')
        reason, lifted = reason[:MOST_CHARACTERS], False
        try:
            self._arm.stop()
            lifted = self._lift_alone(pace)
        except Exception as second:
            reason += f'; then {type(second).__name__}: {second}'[:MOST_CHARACTERS]
        how = 'see the log' if lifted else 'the finger was not lifted'
        self.outcome = ExplorationOutcome(error, f'{reason}; {how}', self._slid, lifted)
        with contextlib.suppress(Exception):  # the receiver of the states may be the failed part
            self._report(self._clock(), Phase.ABORTED, progress=self.state.progress)

    def _lift_alone(self, pace: Callable[[], None]) -> bool:
        """Lift without other parts of the exploration; return whether the finger is free."""
        arm, lift = self._sound_state(), self._motion.lift_from(self._sound_state().position)
        lift.begin(self._clock(), arm)
        while not arm_fault(arm, self._clock(), self._limits):
            command = lift.timed_step(self._clock(), arm)
            if command is None:
                return bool(lift.free)
            self._arm.command(command)
            pace()
            arm = self._sound_state()
        return False

    def _sound_state(self) -> ArmState:
        """Return the newest state of the arm; implausible numbers are replaced and make it unsafe."""
        arm = self._arm.state()
        if self._arm_state is None:
            self._arm_state = arm
            if bad := sound(replace(arm, unsafe=''), arm).unsafe:
                raise DeviceError(bad)
        self._arm_state = sound(arm, self._arm_state)
        return self._arm_state

    def stop(self, reason: str, error: ExplorationError = ExplorationError.STOPPED) -> None:
        """Lift the finger and abort, from any phase; from any thread."""
        self._stop = self._stop or (error, reason)

    def finish(self, reason: str) -> None:
        """End the slide early with success; from any thread."""
        self._finish_reason = self._finish_reason or reason

    def _tick(self) -> bool:
        """Do one step; return whether the exploration has ended."""
        arm, now_ns = self._sound_state(), self._clock()
        if now_ns - self._last_ns > GAP_NS:
            self._listening = Listening(self._begin_ns, self._last_ns, now_ns)
            self.gaps += 1
        self._last_ns = now_ns
        fault = arm_fault(arm, now_ns, self._limits, self._listening)
        if fault:
            self._give_up(ExplorationError.ARM_FAULT, f'{fault}; the finger was not lifted')
            return True
        relative = self._guard.relative(arm, self._arm.zeroed)
        reason = self._stop or self._reason_to_abort(now_ns, arm, relative)
        if reason:
            self._abort = self._abort or reason
            self._motion.abort(reason[1])
        if self._finish_reason:
            self._motion.finish(self._finish_reason)
        step = self._motion.step(now_ns, arm)
        command = self._guard.yielding(relative, step.command, step.phase in (Phase.LIFT, Phase.ABORTED))
        if self._guard.blocked:
            self._abort = (self._error or ExplorationError.FORCE_LIMIT, self._motion.message)
            self._give_up(ExplorationError.FORCE_LIMIT, f'{self._guard.blocked}; the finger was not lifted')
            return True
        if command is not step.command:
            self._motion.note_way_back()
            step = replace(step, command=command, phase=Phase.LIFT)
        self._arm.command(step.command)
        self._commanded = step.command
        self._force_watch.note(step.phase, arm, step.command)
        self._publish_state(now_ns, step, arm)
        return step.phase in ENDED

    @property
    def _error(self) -> ExplorationError:
        """Why it is aborted, by the loop or by its motion."""
        return self._abort[0] if self._abort else self._motion.error

    def _reason_to_abort(self, now_ns: int, arm: ArmState, relative: ArmState) -> tuple[ExplorationError, str] | None:
        """Return why it must end; a finger that was pushed out of the workspace may return first."""
        outside = self._limits.outside(arm.position)
        self._entered |= not outside
        left = f'the finger left the workspace: {outside}' if outside and self._entered else ''
        frozen = self._force_watch.frozen(arm, self._commanded)
        reasons = (
            (ExplorationError.ARM_FAULT, arm.unsafe),
            (ExplorationError.FORCE_LIMIT, self._guard.violation(relative, self.state.phase)),
            (ExplorationError.FORCE_SENSOR, frozen),
            (ExplorationError.NO_SURFACE, self._off_surface(arm)),
            (ExplorationError.WORKSPACE, left),
            (ExplorationError.NO_SIGNAL, self._signal_fault(self._listening)),
            (ExplorationError.TIMEOUT, self._overdue(now_ns)),
        )
        return next(((error, text) for error, text in reasons if text), None)

    def _off_surface(self, arm: ArmState) -> str:
        """Return in a sentence that the finger presses on something far from the declared surface, '' if not."""
        height_m, most_m = arm.position[2], self._limits.surface_tolerance_m
        if self.state.phase is not Phase.CONTACT or not self._arm.base_frame_id or abs(height_m) <= most_m:
            return ''
        pose = self._arm.surface_pose
        x, y, z = SurfaceFrame(pose).place_to_base(arm.position)
        return (
            f'contact was at ({x:.3f}, {y:.3f}, {z:.3f}) m in the base frame, {1e3 * abs(height_m):.0f} mm '
            f'{"above" if height_m > 0 else "below"} the surface declared at ({pose[0]:g}, {pose[1]:g}, {pose[2]:g}) '
            f"m, and {1e3 * most_m:g} mm are allowed ('surface_tolerance_m'); correct its pose ('surface_z_m'), or "
            'remove what the finger met'
        )

    def _overdue(self, now_ns: int) -> str:
        """Return in a sentence that the exploration exceeds the timeout of its caller, '' if it does not."""
        timeout_s = self.request.timeout_s
        late = timeout_s > 0.0 and (now_ns - self._begin_ns) * 1e-9 > timeout_s
        return f'the exploration took longer than its timeout of {timeout_s:g} s' if late else ''

    def _publish_state(self, now_ns: int, step: MotionStep, arm: ArmState) -> None:
        """Report the state if its phase is new or the time has come."""
        self._slid |= step.phase is Phase.SLIDE
        if step.phase in ENDED:
            error, message = self._end_of(step.phase)
            self.outcome = ExplorationOutcome(error, message, self._slid, self._motion.lifted)
            step = replace(step, phase=Phase.DONE if self.outcome.success else Phase.ABORTED)
        # A withdrawn guarantee is published at once: until then windows may be cut by it.
        as_before = step.phase is self.state.phase and (step.steady_s > 0) is (self.state.steady_s > 0)
        if as_before and now_ns < self._next_state_ns:
            return
        self._next_state_ns = now_ns + STATE_PERIOD_NS - STATE_SLACK_NS
        vx, vy, _ = arm.velocity
        x, y, z = arm.position
        self._report(
            now_ns,
            step.phase,
            steady_s=step.steady_s,
            speed_m_s=(vx * vx + vy * vy) ** 0.5,
            force_n=arm.force_n,
            tangential_force_n=arm.tangential_force_n,
            direction_rad=step.direction_rad,
            progress=step.progress,
            x_m=x,
            y_m=y,
            z_m=z,
        )

    def _end_of(self, phase: Phase) -> tuple[ExplorationError, str]:
        """Return the outcome of an exploration after its motion; a completed motion may still be no success."""
        if phase is not Phase.DONE:
            return self._error or ExplorationError.INTERNAL, self._motion.message
        if not self._slid:
            return ExplorationError.NO_SAMPLES, NO_SLIDE_OBSERVED
        drifted = self._force_watch.drifted()
        return (ExplorationError.FORCE_SENSOR, drifted) if drifted else (ExplorationError.NONE, self._motion.message)

    def _give_up(self, error: ExplorationError, reason: str) -> None:
        """End at once: an arm that does not follow cannot be lifted, only stopped."""
        error, message = (self._abort[0], f'{self._abort[1]}; {reason}') if self._abort else (error, reason)
        self.outcome = ExplorationOutcome(error, message, self._slid, lifted=False)
        self._report(self._clock(), Phase.ABORTED, progress=self.state.progress)

    def _report(self, stamp_ns: int, phase: Phase, **numbers: Any) -> None:
        request = self.request
        self.state = ExplorationState(
            stamp_ns, self.exploration_id, request.motion, phase, surface=request.surface, **numbers
        )
        if phase in ENDED:
            self.state = replace(self.state, error_code=int(self.outcome.error), lifted=self.outcome.lifted)
        self._on_state(self.state)


def arm_fault(arm: ArmState, now_ns: int, limits: SafetyLimits, listening: Listening = WITHOUT_GAPS) -> str:
    """Return why the arm would not follow a command, as text, '' if it would."""
    age_s = listening.silence_s(arm.time_ns, now_ns)
    if arm.fault:
        return f'the arm reports a fault: {arm.fault}'
    if age_s > limits.state_timeout_s:
        return f'the arm has not answered for {age_s * 1e3:.0f} ms'
    return ''
