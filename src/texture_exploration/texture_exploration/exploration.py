"""One exploration: the loop that ties a motion to an arm and watches over both."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

from texture_core.errors import DeviceError
from texture_core.exploration import ENDED, ExplorationRequest, ExplorationState, Phase
from texture_exploration.arms.protocol import Arm, ArmCommand, ArmState, Doubting, ForceReading, Zeroing
from texture_exploration.force_watch import ForceGuard, ForceWatch
from texture_exploration.listening import WITHOUT_GAPS, Listening
from texture_exploration.motions.protocol import Motion, MotionStep
from texture_exploration.safety import SafetyLimits

STATE_PERIOD_NS = 20_000_000
# After a longer gap between two steps it was we who slept: the age of the arm's state says nothing about the arm.
GAP_NS = 50_000_000
# A tick that comes a little early must not wait for the next one.
STATE_SLACK_NS = 5_000_000
NO_SLIDE_OBSERVED = (
    'the slide was shorter than the delay of the arm or than a pause of this machine, so no sample could be taken;  '
    'slide longer or more slowly'
)


@dataclass(frozen=True)
class ExplorationOutcome:
    """How an exploration ended.

    Attributes
    ----------
    success
        Whether it was done as requested.
    message
        What happened, in a sentence.
    slid
        Whether the finger slid, so that there are samples.
    lifted
        Whether the finger was lifted at the end, and the measured force says so; an arm with a fault can only be
        stopped.
    """

    success: bool
    message: str
    slid: bool
    lifted: bool = True


def no_signal_watch(_listening: Listening) -> str:
    """Return '': the sensor is not watched."""
    return ''


class Exploration:
    """Step a motion until it ends, whatever happens to the arm.

    Parameters
    ----------
    exploration_id, request
        What is explored; repeated in each state.
    arm, motion, limits
        Who moves, how, and what ends it at once.
    clock
        CLOCK_MONOTONIC in ns.
    signal_fault
        Returns in a sentence why the sensor delivers no samples, '' if it does; it is told since when the loop listens.
    on_state
        Called in the thread of `run` with each new phase and 50 times a second; stamps are of `clock`.

    Attributes
    ----------
    ended : threading.Event
        Set by whoever calls `run` when all is over, for those who wait.
    outcome, state
        How it ended, and the newest state.
    gaps
        How often a step came far too late, because the machine was busy.
    """

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
        self.exploration_id = exploration_id
        self.request = request
        self.outcome = ExplorationOutcome(False, 'it broke off through an internal error; see the log', False, False)
        self.ended = threading.Event()
        self.gaps = 0
        self.state = ExplorationState(clock(), exploration_id, request.motion, Phase.IDLE)
        self._arm = arm
        self._motion = motion
        self._limits = limits
        self._clock = clock
        self._on_state = on_state
        self._signal_fault = signal_fault
        reading = getattr(arm, 'force_reading', ForceReading.CONTROLLED)
        self._force_watch = ForceWatch(limits, reading, motion.force_n)
        self._guard = ForceGuard(limits)
        self._commanded = ArmCommand()
        self._stop_reason = ''
        self._finish_reason = ''
        self._abort_reason = ''
        self._signal_seen = False
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
        except DeviceError as error:
            self._give_up(f'{error}; the finger was not lifted')
        finally:
            # Also when a bug ends the loop: no arm is left moving.
            with contextlib.suppress(DeviceError):
                self._arm.stop()
        return self.outcome

    def stop(self, reason: str) -> None:
        """Lift the finger and abort, from any phase; from any thread."""
        self._stop_reason = self._stop_reason or reason

    def finish(self, reason: str) -> None:
        """End the slide early with success; from any thread."""
        self._finish_reason = self._finish_reason or reason

    def _tick(self) -> bool:
        """Do one step; return whether the exploration has ended."""
        arm, now_ns = self._arm.state(), self._clock()
        self._detect_gap(now_ns)
        fault = arm_fault(arm, now_ns, self._limits, self._listening)
        if fault:
            self._give_up(f'{fault}; the finger was not lifted')
            return True
        relative = self._guard.relative(arm, self._zeroed, self._commanded)
        doubt = self._arm.doubt() if isinstance(self._arm, Doubting) else ''
        reason = (
            self._stop_reason
            or self._violation(arm, relative)
            or doubt
            or self._signal_fault(self._listening)
            or self._overdue(now_ns)
        )
        if reason:
            self._abort_reason = self._abort_reason or reason
            self._motion.abort(reason)
        if self._awaits_samples():
            self._arm.command(ArmCommand())
            return False
        if self._finish_reason:
            self._motion.finish(self._finish_reason)
        step = self._motion.step(now_ns, arm)
        command = self._guard.yielding(relative, step.command, step.phase in (Phase.LIFT, Phase.ABORTED))
        if self._guard.blocked:
            self._abort_reason = self._motion.message
            self._give_up(f'{self._guard.blocked}; the finger was not lifted')
            return True
        if command is not step.command:
            step = replace(step, command=command, phase=Phase.LIFT)
        self._arm.command(step.command)
        self._commanded = step.command
        self._force_watch.note(step.phase, arm, step.command)
        self._publish_state(now_ns, step, arm)
        return step.phase in ENDED

    def _awaits_samples(self) -> bool:
        """Return whether the finger rests until the sensor delivers; silence from before the request counts."""
        self._signal_seen = self._signal_seen or bool(self._abort_reason) or not self._signal_fault(WITHOUT_GAPS)
        return not self._signal_seen

    @property
    def _zeroed(self) -> bool:
        return self._arm.zeroed if isinstance(self._arm, Zeroing) else True

    def _violation(self, arm: ArmState, relative: ArmState) -> str:
        """Return which limit was passed; a finger that was pushed out of the workspace may come home first."""
        workspace_violation = self._limits.workspace_violation(arm)
        self._entered |= not workspace_violation
        frozen = self._force_watch.frozen(arm, self._commanded)
        return (
            arm.unsafe
            or self._guard.violation(relative, self.state.phase)
            or frozen
            or (workspace_violation if self._entered else '')
        )

    def _overdue(self, now_ns: int) -> str:
        """Return in a sentence that the exploration takes longer than its caller allows, '' if it does not."""
        timeout_s = self.request.timeout_s
        late = timeout_s > 0.0 and (now_ns - self._begin_ns) * 1e-9 > timeout_s
        return f'the exploration took longer than its timeout of {timeout_s:g} s' if late else ''

    def _detect_gap(self, now_ns: int) -> None:
        if now_ns - self._last_ns > GAP_NS:
            self._listening = Listening(self._begin_ns, self._last_ns, now_ns)
            self.gaps += 1
        self._last_ns = now_ns

    def _publish_state(self, now_ns: int, step: MotionStep, arm: ArmState) -> None:
        """Report the state if its phase is new or the time has come."""
        self._slid |= step.phase is Phase.SLIDE
        flaw = self._flaw() if step.phase is Phase.DONE else ''
        if flaw:
            lifted = self._motion.lifted
            self.outcome, step = ExplorationOutcome(False, flaw, self._slid, lifted), replace(step, phase=Phase.ABORTED)
        elif step.phase in ENDED:
            success = step.phase is Phase.DONE
            self.outcome = ExplorationOutcome(success, self._motion.message, self._slid, self._motion.lifted)
        # A promise that is withdrawn is told at once: until then windows may be cut on it.
        as_before = step.phase is self.state.phase and (step.steady_s > 0) is (self.state.steady_s > 0)
        if as_before and now_ns < self._next_state_ns:
            return
        self._next_state_ns = now_ns + STATE_PERIOD_NS - STATE_SLACK_NS
        vx, vy, _ = arm.velocity
        x, y, z = arm.position
        self._report(
            ExplorationState(
                stamp_ns=now_ns,
                exploration_id=self.exploration_id,
                motion=self.request.motion,
                phase=step.phase,
                steady_s=step.steady_s,
                speed_m_s=(vx * vx + vy * vy) ** 0.5,
                force_n=arm.force_n,
                tangential_force_n=arm.tangential_force_n,
                direction_rad=step.direction_rad,
                progress=step.progress,
                surface=self.request.surface,
                x_m=x,
                y_m=y,
                z_m=z,
            )
        )

    def _flaw(self) -> str:
        """Return why an exploration whose motion ended as planned is no success, '' if it is."""
        return self._force_watch.drifted() if self._slid else NO_SLIDE_OBSERVED

    def _give_up(self, reason: str) -> None:
        """End at once: an arm that does not follow cannot be lifted, only stopped."""
        message = f'{self._abort_reason}; {reason}' if self._abort_reason else reason
        self.outcome = ExplorationOutcome(False, message, self._slid, lifted=False)
        self._report(
            ExplorationState(
                stamp_ns=self._clock(),
                exploration_id=self.exploration_id,
                motion=self.request.motion,
                phase=Phase.ABORTED,
                progress=self.state.progress,
                surface=self.request.surface,
            )
        )

    def _report(self, state: ExplorationState) -> None:
        self.state = state
        self._on_state(state)


def arm_fault(arm: ArmState, now_ns: int, limits: SafetyLimits, listening: Listening = WITHOUT_GAPS) -> str:
    """Return in words why the arm would not follow a command, '' if it would.

    Parameters
    ----------
    arm
        Newest state of the arm.
    now_ns
        Time of the same clock, ns.
    limits
        Longest allowed silence of the arm.
    listening
        Since when the caller listens, and its newest gap.

    Returns
    -------
    str
        A sentence without a full stop, or ''.
    """
    age_s = listening.silence_s(arm.time_ns, now_ns)
    if arm.fault:
        return f'the arm reports a fault: {arm.fault}'
    if age_s > limits.state_timeout_s:
        return f'the arm has not answered for {age_s * 1e3:.0f} ms'
    return ''
