# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Owner of the arm: runs explorations, one at a time, each in a separate thread."""

from __future__ import annotations

import contextlib
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict

from texture_core.config import look_up, place_of
from texture_core.errors import DeviceError, ExplorationError, InvalidData, MotionAborted, MotionRefused, TextureError
from texture_core.types import ExplorationRequest, ExplorationState
from texture_exploration.arms.arm import POSE, Arm, SurfaceFrame, Vector
from texture_exploration.exploration import Exploration, arm_fault, no_signal_watch
from texture_exploration.guards import WITHOUT_GAPS, Listening, sound
from texture_exploration.lift_first import Rise
from texture_exploration.motion import Planner
from texture_exploration.motions import MOTIONS
from texture_exploration.safety import SafetyLimits, SurfacePatch
from texture_exploration.surface import TOUCHES, SurfaceTouches
from texture_exploration.touch import TouchParams

PERIOD_S = 0.01
CLOSING_S = 10.0  # longer than any motion needs to lift
NO_CONTROL = (
    'the explorer has no control of the arm; run `texture activate`, or `ros2 lifecycle set` with configure and '
    'activate'
)
CONNECTING = 'the explorer is connecting to the arm'
GENTLE_N = 1.0  # the force of a finger found in contact is unknown: it rises as before a gentle slide


class Explorer:
    """Own an arm, not yet connected, and explore with it.

    `on_state` is called with each state of each exploration, in the thread that moves; its stamps are of `clock`,
    CLOCK_MONOTONIC in ns. `signal_fault` watches over the sensor; a request names one of `motions`. What cannot be done
    now raises MotionRefused, an arm that cannot be reached DeviceError.
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
        motions: Mapping[str, Planner] = MOTIONS,
    ) -> None:
        self.arm, self.motions = arm, motions
        # These may be replaced; a running exploration keeps those of its start.
        self.touch, self.limits, self.patch = touch, limits, SurfacePatch()
        self.counts: Counter[str] = Counter(done=0, aborted=0, refused=0, internal_errors=0, late_steps=0)
        self._on_state = on_state
        self._signal_fault = signal_fault
        self.clock = clock
        self._lock = threading.Lock()
        self._home: Vector | None = None
        self._lift_first = True  # contact state unknown
        self._zero_n: Vector | None = None  # reading of the sensor before the first lift, until it is zeroed
        self.lifted = False  # known to be free of the surface
        self._current: Exploration | None = None
        self._thread: threading.Thread | None = None
        self._refuses = ''  # in a sentence, why requests are refused
        self._stopped_ns = clock()  # what was requested before it is refused
        self._touches = SurfaceTouches()

    def connect(self) -> Vector:
        """Reach the arm, or reach it again after a fault; return where explorations begin.

        The next exploration lifts first, as the contact state is unknown.
        """
        self._lift_first, self.lifted, self._zero_n = True, False, None
        self.arm.close()
        self.arm.connect()
        if self._refuses == NO_CONTROL:  # one that is shut down stays so
            self._refuses = ''
        # After a fault the finger may hang anywhere; the first place is the one that the operator chose.
        self._home = self._home or self.arm.state().position
        return self._home

    def check_start(self) -> None:
        """Return if explorations may begin at the present start, so that this is known before the first request."""
        if self._home is not None:
            self._check_inside(self._home)

    def release(self) -> None:
        """Abort, wait until the finger is lifted, release the arm; until `connect`, requests are refused.

        Explorations begin where the finger is at that `connect`: another controller may have moved it meanwhile, and
        the way back to the old place may be blocked.
        """
        self._end_motion('the explorer released the arm', NO_CONTROL)
        if not self.arm.keeps_start:
            self._home = None

    def fault(self) -> str:
        """Return in a sentence why the arm cannot move now, '' if it can."""
        try:
            state = self.arm.state()
        except DeviceError as error:
            return str(error)
        return arm_fault(state, self.clock(), self.limits) or sound(state, state).unsafe

    @property
    def current(self) -> Exploration | None:
        """The exploration that is running, None if none is."""
        current = self._current
        return current if current is not None and not current.ended.is_set() else None

    def begin(
        self, exploration_id: str, request: ExplorationRequest, cancelled: Callable[[], bool] = lambda: False
    ) -> Exploration:
        """Begin an exploration in a separate thread, unless it was stopped or cancelled; wait for its event `ended`."""
        came_ns = self.clock()  # before other requests are waited for
        with self._lock:
            try:
                self._current = exploration = self._prepare(exploration_id, request)  # what `stop` now finds
                if self._stopped_ns > came_ns or cancelled():
                    self._current = None
                    error = ExplorationError.STOPPED if self._stopped_ns > came_ns else ExplorationError.CANCELLED
                    raise MotionRefused(f'the request was {error.name.lower()} before anything moved', error)
            except Exception as error:
                self.counts['refused'] += 1
                if isinstance(error, TextureError):
                    raise
                # A fault of a user's planner; nothing has moved.
                why = place_of(error, request.motion.partition(':')[0]) or f'{type(error).__name__}: {error}'
                raise MotionRefused(
                    f"planning '{request.motion}' failed with {why}; correct it there", ExplorationError.INVALID_REQUEST
                ) from error
            self.lifted = False
            self._thread = threading.Thread(target=self._run, args=(exploration,), name='exploration', daemon=True)
            self._thread.start()
            return exploration

    def stop(self, reason: str, covers_s: float = 0.0) -> str:
        """Abort the exploration and all requests that came before or come within `covers_s`; return a sentence."""
        self._stopped_ns = self.clock() + round(covers_s * 1e9)
        if (current := self.current) is not None:
            current.stop(reason)
            return 'stopping; the finger is being lifted'
        with contextlib.suppress(DeviceError):
            self.arm.stop()
        return 'no exploration is running; earlier requests are cancelled'

    def recover(self) -> None:
        """Free the arm from a fault by connecting again; the caller makes sure that it may move.

        The next exploration lifts first, as the finger may still press.
        """
        with self._lock:
            self._check_idle()
            self._lift_first = True
            if self.fault():
                with contextlib.suppress(DeviceError):  # connecting again also reports it
                    self.arm.recover()
                self.connect()

    def lift(self) -> float:
        """Lift a finger that a killed explorer may have left pressed, until nothing touches it; return the rise, m.

        The caller makes sure that the finger may rise; `stop` ends it.
        """
        came_ns = self.clock()
        with self._lock:
            self._check_idle()
            if self._home is None or self.fault():
                self._home = self.connect()
            begin_m = self.arm.state().position[2]
            rise, pace = Rise(GENTLE_N, self.touch, self.limits), Pacer(PERIOD_S, self.clock)
            rise.begin(self.clock(), self.arm.state())
            try:
                while (command := rise.timed_step(self.clock(), self.arm.state())) is not None:
                    if self._stopped_ns > came_ns:
                        raise MotionAborted('it was stopped')
                    self.arm.command(command)
                    pace()
                    if fault := self.fault():
                        raise DeviceError(f'the finger was not lifted: {fault}')
            except MotionAborted as error:
                raise MotionRefused(f'the finger was not lifted: {error}') from error
            finally:
                self.arm.stop()
            height_m, self.lifted = self.arm.state().position[2], True
            self._home = (*self._home[:2], max(self._home[2], height_m))  # a place in contact is no start
            return height_m - begin_m

    def touch_surface(self) -> str:
        """Record the position of the finger in contact for the surface frame; return the result as text.

        From the fourth touch on the plane through all touches is the surface. The next exploration connects again and
        begins where the finger is then: lift it before.
        """
        with self._lock:
            self._check_idle()
            self._check_surface()
            if self.fault():
                self.connect()
            state, frame, least_n = self.arm.state(), SurfaceFrame(self.arm.surface_pose), self.touch.contact_force_n
            if not self.arm.zeroed:
                raise MotionRefused(
                    'the touch was not recorded: the force sensor is not zeroed, so contact cannot be shown; lift the '
                    'finger by 10 mm, let it rest in the air for a second, and touch again'
                )
            if not state.force_n >= least_n:  # so NaN is also no touch
                raise MotionRefused(
                    f'the touch was not recorded: the force is {state.force_n:.2f} N, and {least_n:g} N are needed '
                    "('contact_force_n'); press the finger on the surface"
                )
            self._home = None
            try:
                fit = self._touches.add(
                    frame.place_to_base(state.position), frame.to_base((0.0, 0.0, 1.0)), frame.to_base((1.0, 0.0, 0.0))
                )
            except InvalidData as error:
                raise MotionRefused(f'the touch was not recorded: {error}') from error
            count = f'touch {len(self._touches)} taken with {state.force_n:.2f} N'
            missing = TOUCHES - len(self._touches)
            if fit is None:
                last = ', far from the others: it checks the first three' if missing == 1 else 's'
                return f'{count}; touch the surface at {missing} more place{last}'
            self.arm.move_surface(fit.pose)
            self.patch = fit.patch
            numbers = {**dict(zip(POSE, fit.pose, strict=True)), **asdict(fit.patch)}
            values = ', '.join(f'{name}: {value:.5f}' for name, value in numbers.items())
            return (
                f'{count}; the surface is {values}; residual {1e3 * fit.residual_m:.2f} mm rms, largest '
                f'{1e3 * fit.largest_m:.2f} mm. Write these into your parameter file, and lift the finger by 10 mm'
            )

    def forget_touches(self) -> int:
        """Begin the touches of the surface again; return how many are forgotten. The surface stays as it is."""
        with self._lock:
            self._check_surface()
            return self._touches.forget()

    def _check_surface(self) -> None:
        if not self.arm.base_frame_id:
            raise MotionRefused('this arm has no base frame in which a surface could be placed')

    def close(self) -> None:
        """Abort, wait until the finger is lifted, release the arm."""
        self._end_motion('the explorer was shut down', 'the explorer is shutting down')

    def _end_motion(self, reason: str, refuses: str) -> None:
        self._stopped_ns = self.clock()
        with self._lock:
            self._refuses = refuses
        self.stop(reason)
        if self._thread is not None:
            self._thread.join(CLOSING_S)
        self.arm.close()

    def _prepare(self, exploration_id: str, request: ExplorationRequest) -> Exploration:
        self._check_idle()
        plan = look_up(self.motions, request.motion, 'motion')
        start = self.patch.start(request, self._ready(), self.limits)
        self._check_inside(start)
        limits = self.patch.within(self.limits) if request.use_start else self.limits
        try:
            motion = plan(request, start, self.touch, limits)
        except MotionRefused as error:
            if not request.use_start or error.error is not ExplorationError.OUTSIDE_WORKSPACE:
                raise
            sentence = f'{error}; the workspace of a request with a start is the surface patch'
            raise MotionRefused(sentence, error.error, error.field) from error
        if self._lift_first or not self.arm.zeroed:
            if self._zero_n is None or self.arm.zeroed:
                self._zero_n = self.arm.state().force_vector_n
            motion.lift_first(lambda: self.arm.zeroed, self._zero_n)
        self._wait_for_signal()
        return Exploration(
            exploration_id,
            request,
            arm=self.arm,
            motion=motion,
            limits=self.limits,
            clock=self.clock,
            on_state=self._on_state,
            signal_fault=self._signal_fault,
        )

    def _check_inside(self, start: Vector) -> None:
        """Refuse a motion that begins outside, as with a wrong pose of the surface: leaving would not be detected."""
        if outside := self.limits.outside(start):
            self._home = None  # the next request begins where the finger is then, as it has to be moved
            raise MotionRefused(
                f'the start of the motion lies outside the workspace: {outside}; bring the finger inside and take '
                'control again, or correct the pose of the surface or the limits',
                ExplorationError.OUTSIDE_WORKSPACE,
            )

    def _wait_for_signal(self) -> None:
        """Refuse to move before samples arrive; a sensor that has just been found is waited for."""
        listening, pace = Listening(self.clock()), Pacer(PERIOD_S, self.clock)
        while self._signal_fault(WITHOUT_GAPS) and self._stopped_ns <= listening.since_ns:
            if silent := self._signal_fault(listening):
                raise MotionRefused(f'{silent}; nothing has moved', ExplorationError.NO_SIGNAL)
            pace()

    def _check_idle(self) -> None:
        if self._refuses:
            raise MotionRefused(self._refuses, ExplorationError.NOT_ACTIVE)
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
            exploration.run(Pacer(PERIOD_S, self.clock))
        finally:
            self._lift_first, self.lifted = not exploration.outcome.success, exploration.outcome.lifted
            if exploration.outcome.success:  # zeroed and free: what the sensor showed before is of no use
                self._zero_n = None
            self.counts['done' if exploration.outcome.success else 'aborted'] += 1
            self.counts['internal_errors'] += exploration.outcome.error is ExplorationError.INTERNAL
            self.counts['late_steps'] += exploration.gaps
            exploration.ended.set()


class Pacer:
    """Wait until the next step is due; missed steps are not repeated."""

    def __init__(self, period_s: float, clock: Callable[[], int]) -> None:
        self._period_ns = round(period_s * 1e9)
        self._clock = clock
        self._due_ns = clock()

    def __call__(self) -> None:
        """Sleep."""
        now_ns = self._clock()
        self._due_ns = max(self._due_ns + self._period_ns, now_ns)
        time.sleep((self._due_ns - now_ns) * 1e-9)
