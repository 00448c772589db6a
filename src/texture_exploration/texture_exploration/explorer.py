# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Owner of the arm: runs explorations, one at a time, each in a thread of its own."""

from __future__ import annotations

import contextlib
import logging
import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timezone
from typing import Any, Literal, NamedTuple

import numpy as np

from texture_core.config import find, param, place_of
from texture_core.errors import (
    DeviceError,
    ExplorationError,
    InvalidData,
    MotionAborted,
    MotionRefused,
    TextureError,
    UnknownName,
)
from texture_core.types import (
    ENDED,
    Array,
    ExplorationRequest,
    ExplorationState,
    Phase,
    RoughnessEstimate,
    TextureEstimate,
    rotation_vector,
)
from texture_exploration.arms.arm import (
    Arm,
    ArmCommand,
    ArmState,
    SurfaceFrame,
    Vector,
)
from texture_exploration.motions import MOTIONS
from texture_exploration.safety import (
    GAP_NS,
    WITHOUT_GAPS,
    ForceGuard,
    ForceWatch,
    Listening,
    SafetyLimits,
    SurfacePatch,
    sound,
)
from texture_exploration.stages import Motion, MotionStep, Rise, TouchParams

# --------------------
# Collect the estimates of one exploration.


@dataclass(frozen=True)
class EarlyStoppingParams:
    """When a slide may end early, and how long to wait for the final estimates."""

    min_confidence: float = param(
        0.0,
        'Lowest confidence that ends a slide early, besides the stopping rule of the model; a '
        'higher value slides longer.',
        low=0.0,
        high=1.0,
    )
    estimate_timeout_s: float = param(
        1.0, 'How long to wait for the final estimates after the finger was lifted.', unit='s', low=0.0, high=60.0
    )

    def may_stop(self, estimate: TextureEstimate) -> bool:
        """Return whether the texture estimate may end the slide."""
        return estimate.known and estimate.decided and estimate.confidence >= self.min_confidence


class ExplorationEstimates:
    """The newest texture and roughness estimate of one exploration; safe for threads."""

    def __init__(self, exploration_id: str) -> None:
        self.texture = TextureEstimate(0, exploration_id)
        self.roughness = RoughnessEstimate(0, exploration_id)
        self._changed = threading.Condition()
        self._cancelled = False

    def update(self, estimate: TextureEstimate | RoughnessEstimate) -> None:
        """Take over a newer estimate."""
        with self._changed:
            if isinstance(estimate, TextureEstimate):
                self.texture = estimate
            else:
                self.roughness = estimate
            self._changed.notify_all()

    def wait_until_final(self, kinds: Collection[str], timeout_s: float) -> bool:
        """Wait until the estimates of these kinds ('texture', 'roughness') are final; return whether they are."""
        with self._changed:
            self._changed.wait_for(lambda: self._cancelled or self._final(kinds), timeout_s)
            return self._final(kinds)

    def cancel(self) -> None:
        """End the waiting: no further estimate will arrive."""
        with self._changed:
            self._cancelled = True
            self._changed.notify_all()

    def _final(self, kinds: Collection[str]) -> bool:
        return all(getattr(self, kind).final for kind in kinds)


# --------------------
# One exploration: the loop that ties a motion to an arm and watches over both.

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
        """Whether it was done as requested."""
        return self.error is ExplorationError.NONE

    @property
    def severity(self) -> Literal['info', 'warning', 'error']:
        """Level of the log: an abort is a warning, a finger that was not lifted is an error."""
        if self.success:
            return 'info'
        return 'warning' if self.lifted else 'error'

    def sentence(self, exploration_id: str) -> str:
        """Return what the log says."""
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

    The random end keeps two nodes apart that begin in the same second.
    """
    begin = datetime.fromtimestamp(time_ns // 1_000_000_000, tz=timezone.utc)
    return f'{begin:%Y%m%dT%H%M%S}-{number:03d}-{rng.integers(0x10000):04x}'


def refusal(error: TextureError) -> ExplorationError:
    """Return the code of what `Explorer.begin` raises, or of a request that cannot be read."""
    if isinstance(error, MotionRefused):
        return error.error
    return ExplorationError.UNKNOWN_MOTION if isinstance(error, UnknownName) else ExplorationError.INVALID_REQUEST


def no_signal_watch(_listening: Listening) -> str:
    """Return '': the sensor is not watched."""
    return ''


class Exploration:
    """Step a motion until it ends, whatever happens to the arm."""

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
            ExplorationError.INTERNAL, 'it broke off through an internal error; see the log', False, False
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
        self._force_watch = ForceWatch(limits, arm.force_reading, motion.force_n)
        self._guard = ForceGuard(limits)
        self._commanded = ArmCommand()
        self._arm_state: ArmState | None = None  # the newest with numbers that can be meant
        self._stop: tuple[ExplorationError, str] | None = None
        self._finish_reason = ''
        self._abort: tuple[ExplorationError, str] | None = None  # the first reason counts
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
            self._give_up(ExplorationError.ARM_FAULT, f'{error}; the finger was not lifted')
        except Exception as error:
            self._escape(error, pace)
        finally:
            with contextlib.suppress(DeviceError):
                self._arm.stop()
        return self.outcome

    def _escape(self, error: Exception, pace: Callable[[], None]) -> None:
        """Command zero and lift by a stage of its own, as what failed is not asked again; say so."""
        LOGGER.exception('an exploration failed')
        reason, lifted = f'internal error, {type(error).__name__}: {error}'[:MOST_CHARACTERS], False
        try:
            self._arm.stop()
            lifted = self._lift_alone(pace)
        except Exception as second:
            reason += f'; then {type(second).__name__}: {second}'[:MOST_CHARACTERS]
        how = 'see the log' if lifted else 'the finger was not lifted'
        self.outcome = ExplorationOutcome(ExplorationError.INTERNAL, f'{reason}; {how}', self._slid, lifted)
        with contextlib.suppress(Exception):  # whoever takes the states may be what failed
            self._report(self._clock(), Phase.ABORTED, progress=self.state.progress)

    def _lift_alone(self, pace: Callable[[], None]) -> bool:
        """Lift without anything else of the exploration; return whether the finger is free."""
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
        """Return the newest state of the arm; numbers that cannot be meant are replaced and make it unsafe."""
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
        self._detect_gap(now_ns)
        fault = arm_fault(arm, now_ns, self._limits, self._listening)
        if fault:
            self._give_up(ExplorationError.ARM_FAULT, f'{fault}; the finger was not lifted')
            return True
        relative = self._guard.relative(arm, self._arm.zeroed)
        trouble = self._stop or self._trouble(now_ns, arm, relative)
        if trouble:
            self._abort = self._abort or trouble
            self._motion.abort(trouble[1])
        if self._awaits_samples():
            self._arm.command(ArmCommand())
            return False
        if self._finish_reason:
            self._motion.finish(self._finish_reason)
        step = self._motion.step(now_ns, arm)
        command = self._guard.yielding(relative, step.command, step.phase in (Phase.LIFT, Phase.ABORTED))
        if self._guard.blocked:
            self._abort = (self._error or ExplorationError.FORCE_LIMIT, self._motion.message)
            self._give_up(ExplorationError.FORCE_LIMIT, f'{self._guard.blocked}; the finger was not lifted')
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
        self._signal_seen = self._signal_seen or bool(self._abort) or not self._signal_fault(WITHOUT_GAPS)
        return not self._signal_seen

    @property
    def _error(self) -> ExplorationError:
        """Why it is aborted so far, by itself or by its motion."""
        return self._abort[0] if self._abort else self._motion.error

    def _trouble(self, now_ns: int, arm: ArmState, relative: ArmState) -> tuple[ExplorationError, str] | None:
        """Return why it must end; a finger that was pushed out of the workspace may come home first."""
        workspace_violation = self._limits.workspace_violation(arm)
        self._entered |= not workspace_violation
        frozen = self._force_watch.frozen(arm, self._commanded)
        reasons = (
            (ExplorationError.ARM_FAULT, arm.unsafe),
            (ExplorationError.FORCE_LIMIT, self._guard.violation(relative, self.state.phase)),
            (ExplorationError.FORCE_SENSOR, frozen),
            (ExplorationError.NO_SURFACE, self._off_surface(arm)),
            (ExplorationError.WORKSPACE, workspace_violation if self._entered else ''),
            (ExplorationError.ARM_FAULT, self._arm.doubt()),
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
        if step.phase in ENDED:
            error, message = self._end_of(step.phase)
            self.outcome = ExplorationOutcome(error, message, self._slid, self._motion.lifted)
            step = replace(step, phase=Phase.DONE if self.outcome.success else Phase.ABORTED)
        # A promise that is withdrawn is told at once: until then windows may be cut on it.
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
        """Return how an exploration ended whose motion did; one that ended as planned may still be no success."""
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
    """Return in words why the arm would not follow a command, '' if it would."""
    age_s = listening.silence_s(arm.time_ns, now_ns)
    if arm.fault:
        return f'the arm reports a fault: {arm.fault}'
    if age_s > limits.state_timeout_s:
        return f'the arm has not answered for {age_s * 1e3:.0f} ms'
    return ''


# --------------------
# The frame of a surface from places where the fingertip touched it.

MAKE_A_PLANE = 3
TOUCHES = 4  # three always lie in a plane: only a further one shows whether it is the surface
NARROWEST_M = 0.01  # spread of the touches across their longest direction, and distance between any two
LARGEST_RESIDUAL_M = 0.002  # a surface that is bent more than this is no plane
EDGES = (np.min, np.max)
LARGEST_TURN_RAD = math.radians(15.0)  # against the pose before: beyond, a touch is more likely wrong than the pose


class SurfaceFit(NamedTuple):
    """A plane through touches: `pose` as `SurfaceFrame` takes it, (6,); distances of the touches from the plane in m.

    `residual_m` is their root mean square and `largest_m` the largest; both are 0 for three touches, which always lie
    in one plane and so prove nothing.
    """

    pose: tuple[float, ...]
    residual_m: float
    largest_m: float
    patch: SurfacePatch  # The rectangle around the touches


def fit_surface(
    touches: Sequence[Sequence[float] | Array], normal: Sequence[float], along: Sequence[float]
) -> SurfaceFit:
    """Return the plane that fits touches best, by least squares of the distances (total least squares).

    The origin is the middle of the touches, z the normal, x the direction `along` the surface as far as it lies in the
    plane.
    """
    points = np.array(touches, dtype=float)
    if len(points) < MAKE_A_PLANE:
        raise InvalidData(f'there are {len(points)} touches; {MAKE_A_PLANE} are needed')
    middle = points.mean(axis=0)
    _, _sizes, directions = np.linalg.svd(points - middle, full_matrices=False)
    spread_m = float(np.ptp((points - middle) @ directions[1]))
    if spread_m < NARROWEST_M:
        raise InvalidData(
            f'the touches lie nearly in a line: across it they spread over {1e3 * spread_m:.1f} mm, and '
            f'{1e3 * NARROWEST_M:g} mm are needed; touch at the corners of a triangle'
        )
    axis = np.cross(directions[0], directions[1])
    distances = (points - middle) @ axis
    largest_m = float(np.abs(distances).max())
    if largest_m > LARGEST_RESIDUAL_M:
        raise InvalidData(
            f'the touches do not lie in a plane: one is {1e3 * largest_m:.1f} mm off, and {1e3 * LARGEST_RESIDUAL_M:g} '
            'mm are allowed; touch one flat part of the surface'
        )
    before = np.array(normal, dtype=float) / np.linalg.norm(normal)
    up = axis * (1.0 if axis @ before >= 0.0 else -1.0)
    turn_rad = math.acos(min(1.0, float(up @ before)))
    if turn_rad > LARGEST_TURN_RAD:
        raise InvalidData(
            f'the touched plane is turned by {math.degrees(turn_rad):.0f} degrees against the pose of the surface '
            f'before, and {math.degrees(LARGEST_TURN_RAD):.0f} are allowed; see that every touch is on the surface, '
            'or give its pose as parameters first'
        )
    x_axis = np.array(along, dtype=float)
    x_axis = x_axis - (x_axis @ up) * up
    length = float(np.linalg.norm(x_axis))
    axes = np.column_stack([x_axis / length, np.cross(up, x_axis / length), up])
    pose = (*middle.tolist(), *rotation_vector(axes).tolist())
    (x_low, y_low), (x_high, y_high) = (edge(np.round((points - middle) @ axes[:, :2], 5), axis=0) for edge in EDGES)
    patch = SurfacePatch(float(x_low), float(x_high), float(y_low), float(y_high))
    return SurfaceFit(pose, float(np.sqrt(np.mean(distances**2))), largest_m, patch)


class SurfaceTouches:
    """Collects touches until they make a plane that one more confirms; further ones refine it."""

    def __init__(self) -> None:
        self._places: list[Array] = []
        self._normal: Sequence[float] = ()  # of the pose before the first touch, so that the plane cannot creep

    def __len__(self) -> int:
        return len(self._places)

    def forget(self) -> int:
        """Begin again; return how many touches there were."""
        count, self._places = len(self._places), []
        return count

    def add(self, place: Sequence[float], normal: Sequence[float], along: Sequence[float]) -> SurfaceFit | None:
        """Take a touch; return the plane, None if there are too few."""
        newest = np.array(place, dtype=float)
        for number, other in enumerate(self._places, start=1):
            apart_m = float(np.linalg.norm(newest - other))
            if apart_m < NARROWEST_M:
                raise InvalidData(
                    f'it is {1e3 * apart_m:.1f} mm from touch {number}, and {1e3 * NARROWEST_M:g} mm are needed; touch '
                    'another place'
                )
        places = [*self._places, newest]
        self._normal = self._normal if self._places else normal
        fit = fit_surface(places, self._normal, along) if len(places) >= MAKE_A_PLANE else None
        self._places = places
        return fit if len(places) >= TOUCHES else None


PERIOD_S = 0.01
CLOSING_S = 10.0  # longer than any motion needs to lift


GENTLE_N = 1.0  # nobody says how hard a finger found pressed presses: it rises as before a gentle slide


class Explorer:
    """Own an arm and explore with it.

    Parameters
    ----------
    arm
        Not yet connected.
    touch, limits
        How to touch, and what is allowed.
    on_state
        Called with each state of each exploration, in the thread that moves; stamps are of `clock`.
    clock
        CLOCK_MONOTONIC in ns.
    signal_fault
        Watches over the sensor; see `Exploration`.
    """

    def __init__(
        self,
        arm: Arm,
        touch: TouchParams,
        limits: SafetyLimits,
        on_state: Callable[[ExplorationState], None],
        clock: Callable[[], int] = time.monotonic_ns,
        *,
        signal_fault: Callable[[Listening], str] = no_signal_watch,
    ) -> None:
        self.arm = arm
        # These may be replaced; a running exploration keeps its own.
        self.touch, self.limits, self.patch = touch, limits, SurfacePatch()
        self.counts: Counter[str] = Counter(done=0, aborted=0, refused=0, internal_errors=0, late_steps=0)
        self._on_state = on_state
        self._signal_fault = signal_fault
        self._clock = clock
        self._lock = threading.Lock()
        self._home: Vector | None = None
        self._lift_first = True  # nobody knows whether the finger presses
        self._zero_n: Vector | None = None  # what the sensor showed before the first lift, until it is zeroed
        self.lifted = False  # known to be free of the surface
        self._current: Exploration | None = None
        self._thread: threading.Thread | None = None
        self._closed = self._released = False
        self._lift_ends = threading.Event()
        self._touches = SurfaceTouches()

    def connect(self) -> Vector:
        """Reach the arm, or reach it again after a fault; return where explorations begin.

        The next exploration lifts first, as nobody knows whether the finger presses.

        Raises
        ------
        DeviceError
            If it cannot be reached.
        """
        self._lift_first, self.lifted, self._zero_n = True, False, None
        self.arm.close()
        self.arm.connect()
        self._released = False
        # After a fault the finger may hang anywhere; the first place is the one that the operator chose.
        self._home = self._home or self.arm.state().position
        return self._home

    def check_start(self) -> None:
        """Return if explorations may begin where they would, so that nobody learns it from the first request.

        Raises
        ------
        MotionRefused
            If that place is outside the workspace, along which axes.
        """
        if self._home is not None:
            self._check_inside(self._home)

    def release(self) -> None:
        """Abort, wait until the finger is lifted, let the arm go; until `connect`, requests are refused.

        Explorations begin where the finger is at that `connect`: whoever had the arm meanwhile may have moved it, and
        the way back to the old place may be blocked.
        """
        self._lift_ends.set()
        with self._lock:
            self._released = True
        self._end_motion('the explorer let go of the arm')
        if not self.arm.keeps_start:
            self._home = None

    def now_ns(self) -> int:
        """Return the time on the clock of the states."""
        return self._clock()

    def arm_age_s(self) -> float:
        """Return the age of the newest state of the arm, s; NaN if it cannot be reached."""
        try:
            return (self._clock() - self.arm.state().time_ns) * 1e-9
        except DeviceError:
            return math.nan

    def arm_counts(self) -> Mapping[str, int]:
        """Return what the arm counts by itself, nothing if it counts nothing or cannot be reached."""
        with contextlib.suppress(DeviceError):
            return self.arm.counts
        return {}

    def fault(self) -> str:
        """Return in a sentence why the arm cannot move now, '' if it can."""
        try:
            state = self.arm.state()
        except DeviceError as error:
            return str(error)
        return arm_fault(state, self._clock(), self.limits) or state.unsafe

    @property
    def current(self) -> Exploration | None:
        """The exploration that is running, None if none is."""
        current = self._current
        return current if current is not None and not current.ended.is_set() else None

    def begin(self, exploration_id: str, request: ExplorationRequest) -> Exploration:
        """Begin an exploration in a thread of its own; wait for its event `ended`.

        Raises
        ------
        MotionRefused, UnknownName
            If the request, the arm or a running exploration does not allow it.
        """
        with self._lock:
            try:
                exploration = self._prepare(exploration_id, request)
            except TextureError:
                self.counts['refused'] += 1
                raise
            except Exception as error:  # a fault of a user's planner; nothing has moved
                self.counts['refused'] += 1
                told = place_of(error, request.motion.partition(':')[0]) or f'{type(error).__name__}: {error}'
                raise MotionRefused(
                    f"planning '{request.motion}' failed with {told}; mend it there", ExplorationError.INVALID_REQUEST
                ) from error
            self._current, self.lifted = exploration, False
            self._thread = threading.Thread(target=self._run, args=(exploration,), name='exploration', daemon=True)
            self._thread.start()
            return exploration

    def stop(self, reason: str) -> bool:
        """Abort the running exploration; return whether there was one. Without one, the arm stands still anyway."""
        self._lift_ends.set()
        current = self.current
        if current is None:
            with contextlib.suppress(DeviceError):
                self.arm.stop()
            return False
        current.stop(reason)
        return True

    def recover(self) -> None:
        """Free the arm from a fault, as it knows itself or by connecting again; whoever asks sees that it may move.

        The next exploration lifts first, as the finger may still press.

        Raises
        ------
        MotionRefused
            If an exploration is running.
        DeviceError
            If the fault remains.
        """
        with self._lock:
            self._check_idle()
            self._lift_first = True
            if self.fault():
                with contextlib.suppress(DeviceError):  # connecting again tells it too
                    self.arm.recover()
            if self.fault():
                self.connect()

    def lift(self) -> float:
        """Lift a finger that a killed explorer may have left pressed, until nothing touches it; return the rise, m.

        Whoever asks sees that the finger may rise; `stop` ends it.

        Raises
        ------
        MotionRefused
            If an exploration is running, or the finger does not come free.
        DeviceError
            If the arm cannot be reached, or reports a fault.
        """
        with self._lock:
            self._check_idle()
            self._lift_ends.clear()
            if self._home is None or self.fault():
                self._home = self.connect()
            begin_m = self.arm.state().position[2]
            try:
                self._rise()
            except MotionAborted as trouble:
                raise MotionRefused(f'the finger was not lifted: {trouble}') from trouble
            finally:
                self.arm.stop()
            height_m, self.lifted = self.arm.state().position[2], True
            x_m, y_m, z_m = self._home
            self._home = (x_m, y_m, max(z_m, height_m))  # a finger found pressed is no place to begin at
            return height_m - begin_m

    def _rise(self) -> None:
        rise, pace = Rise(GENTLE_N, self.touch, self.limits), Pacer(PERIOD_S, self._clock)
        rise.begin(self._clock(), self.arm.state())
        while True:
            if fault := self.fault():
                raise DeviceError(f'the finger was not lifted: {fault}')
            if self._lift_ends.is_set():
                raise MotionAborted('it was stopped')
            now_ns, state = self._clock(), self.arm.state()
            command = rise.timed_step(now_ns, state)
            if command is None:
                return
            self.arm.command(command)
            pace()

    def reboot(self) -> str:
        """Reboot the motors that report an error; return what was done. The arm lets go, the next request connects.

        Raises
        ------
        MotionRefused
            If an exploration is running, or the arm has no motors that could be rebooted.
        DeviceError
            If a motor stays in its error.
        """
        with self._lock:
            self._check_idle()
            return self.arm.reboot()

    def touch_surface(self) -> str:
        """Take the place of the finger, which touches the surface, for the surface frame; return what came of it.

        From the fourth touch on the plane through all touches is the surface. The next exploration connects again and
        begins where the finger is then: lift it before.

        Raises
        ------
        MotionRefused
            If an exploration is running, the arm has no base frame, the finger does not press with
            `contact_force_n`, or the touches make no plane.
        DeviceError
            If the arm cannot be reached.
        """
        with self._lock:
            self._check_idle()
            arm = self.arm
            self._check_surface()
            if self.fault():
                self.connect()
            state, frame = self.arm.state(), SurfaceFrame(arm.surface_pose)
            self._check_touch(state.force_n)
            self._home = None
            try:
                fit = self._touches.add(
                    frame.place_to_base(state.position), frame.to_base((0.0, 0.0, 1.0)), frame.to_base((1.0, 0.0, 0.0))
                )
            except InvalidData as error:
                raise MotionRefused(f'the touch was not taken: {error}') from error
            count = f'touch {len(self._touches)} taken with {state.force_n:.2f} N'
            missing = TOUCHES - len(self._touches)
            if fit is None:
                last = ', away from the others: it shows whether the first three are right' if missing == 1 else 's'
                return f'{count}; touch the surface at {missing} more place{last}'
            arm.move_surface(fit.pose)
            self.patch = fit.patch
            names = (f'surface_{name}' for name in ('x_m', 'y_m', 'z_m', 'rx_rad', 'ry_rad', 'rz_rad'))
            numbers = {**dict(zip(names, fit.pose, strict=True)), **asdict(fit.patch)}
            values = ', '.join(f'{name}: {value:.5f}' for name, value in numbers.items())
            return (
                f'{count}; the surface is {values}; residual {1e3 * fit.residual_m:.2f} mm rms, largest '
                f'{1e3 * fit.largest_m:.2f} mm. Write these into your parameter file, and lift the finger by 10 mm'
            )

    def _check_touch(self, force_n: float) -> None:
        """Refuse a touch that the force does not prove."""
        least_n = self.touch.contact_force_n
        if not self.arm.zeroed:
            raise MotionRefused(
                'the touch was not taken: the force sensor is not zeroed, so it proves no contact; lift the finger by '
                '10 mm, let it rest in the air for a second, and touch again'
            )
        if not force_n >= least_n:  # so NaN is no touch either
            raise MotionRefused(
                f'the touch was not taken: the force is {force_n:.2f} N, and {least_n:g} N are needed '
                "('contact_force_n'); press the finger on the surface"
            )

    def forget_touches(self) -> int:
        """Begin the touches of the surface again; return how many are forgotten. The surface stays as it is.

        Raises
        ------
        MotionRefused
            If the arm has no base frame.
        """
        with self._lock:
            self._check_surface()
            return self._touches.forget()

    def _check_surface(self) -> None:
        if not self.arm.base_frame_id:
            raise MotionRefused('this arm has no base frame in which a surface could be placed')

    def close(self) -> None:
        """Abort, wait until the finger is lifted, let the arm go."""
        self._lift_ends.set()
        with self._lock:
            self._closed = True
        self._end_motion('the explorer was shut down')

    def _end_motion(self, reason: str) -> None:
        self.stop(reason)
        if self._thread is not None:
            self._thread.join(CLOSING_S)
        self.arm.close()

    def _prepare(self, exploration_id: str, request: ExplorationRequest) -> Exploration:
        if self._closed:
            raise MotionRefused('the explorer is shutting down', ExplorationError.NOT_ACTIVE)
        self._check_idle()
        plan = find(MOTIONS, request.motion, 'motion')
        start = self.patch.start(request, self._ready(), self.limits)
        self._check_inside(start)
        motion = plan(request, start, self.touch, self.limits)
        if request.use_start:
            try:
                plan(request, start, self.touch, self.patch.within(self.limits))
            except MotionRefused as error:
                sentence = f'{error}; the workspace of a request with a start is the surface patch'
                raise MotionRefused(sentence, error.error, error.field) from error
        if self._lift_first:
            if self._zero_n is None or self.arm.zeroed:
                self._zero_n = self.arm.state().force_vector_n
            motion.lift_first(lambda: self.arm.zeroed, self._zero_n)
        return Exploration(
            exploration_id,
            request,
            arm=self.arm,
            motion=motion,
            limits=self.limits,
            clock=self._clock,
            on_state=self._on_state,
            signal_fault=self._signal_fault,
        )

    def _check_inside(self, start: Vector) -> None:
        """Refuse a motion that begins outside: it would never be seen to leave, as with a wrong pose of the surface."""
        if outside := self.limits.outside(start):
            self._home = None  # the next request begins where the finger is then, as it has to be moved
            raise MotionRefused(
                f'the start of the motion lies outside the workspace: {outside}; bring the finger inside and take '
                'control again, or correct the pose of the surface or the limits',
                ExplorationError.OUTSIDE_WORKSPACE,
            )

    def _check_idle(self) -> None:
        if self._released:
            raise MotionRefused(
                'the explorer has no control of the arm; run `texture activate`, or '
                '`ros2 lifecycle set` with configure and activate',
                ExplorationError.NOT_ACTIVE,
            )
        if self.current is not None:
            raise MotionRefused(
                f"exploration '{self.current.exploration_id}' is still running; wait for its end or stop it",
                ExplorationError.BUSY,
            )

    def _ready(self) -> Vector:
        """Return where explorations begin, once the arm can move."""
        if self._home is None or self.fault():
            try:
                self._home = self.connect()
            except DeviceError as error:
                raise MotionRefused(f'the arm is not ready: {error}', ExplorationError.ARM_NOT_READY) from error
        return self._home

    def _run(self, exploration: Exploration) -> None:
        try:
            exploration.run(Pacer(PERIOD_S, self._clock))
        finally:
            self._lift_first, self.lifted = not exploration.outcome.success, exploration.outcome.lifted
            self.counts['done' if exploration.outcome.success else 'aborted'] += 1
            self.counts['internal_errors'] += exploration.outcome.error is ExplorationError.INTERNAL
            self.counts['late_steps'] += exploration.gaps
            exploration.ended.set()


class Pacer:
    """Wait until the next step is due; steps that were missed are not made up for."""

    def __init__(self, period_s: float, clock: Callable[[], int]) -> None:
        self._period_ns = round(period_s * 1e9)
        self._clock = clock
        self._due_ns = clock()

    def __call__(self) -> None:
        """Sleep."""
        now_ns = self._clock()
        self._due_ns = max(self._due_ns + self._period_ns, now_ns)
        time.sleep((self._due_ns - now_ns) * 1e-9)
