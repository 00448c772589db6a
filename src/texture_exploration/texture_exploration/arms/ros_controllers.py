# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""An arm that ROS drives: a twist controller, poses and wrenches on topics."""

from __future__ import annotations

import importlib
import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from texture_core.config import param
from texture_core.errors import DeviceError, InvalidParameter
from texture_core.types import Array, quaternion_matrix
from texture_exploration.arms.arm import (
    RISE_M_S,
    STANDSTILL,
    UNSTEADY,
    ArmCommand,
    ArmState,
    CommandedVelocity,
    ForceReading,
    ForceZero,
    SurfaceArm,
    SurfaceFrame,
    SurfacePoseParams,
    Vector,
    ZeroingParams,
    give_up_when_ending,
    tangential_force_n,
)
from texture_exploration.force_control import ForceLoopParams
from texture_exploration.safety import (
    GAP_NS,
    MOST_FORCE_N,
    MOST_M,
    WITHOUT_GAPS,
    CommandLimits,
    Listening,
    impossible,
)

# --------------------
# What can be chosen about an arm that is driven by ROS controllers.


@dataclass(frozen=True)
class RosControllersParams(ForceLoopParams, ZeroingParams, SurfacePoseParams, CommandLimits):
    """Topics, frames and rates of the controllers, the tool, the surface, and the supervision."""

    twist_topic: str = param(
        'twist_controller/twist',
        'Topic of the commanded velocities (geometry_msgs/TwistStamped).',
    )
    pose_topic: str = param(
        'tcp_pose_broadcaster/pose',
        'Topic of the measured pose of the fingertip in the base frame (geometry_msgs/PoseStamped).',
    )
    wrench_topic: str = param(
        'force_torque_sensor_broadcaster/wrench', 'Topic of the measured force (geometry_msgs/WrenchStamped).'
    )
    target_wrench_topic: str = param(
        '',
        'Topic of the commanded force (geometry_msgs/WrenchStamped) for a compliance controller that presses '
        "by itself; '' presses by velocities.",
    )
    base_frame_id: str = param('base', 'Name of the base frame, which the measured pose must carry in its header.')
    tool_frame_id: str = param(
        'tool0_controller',
        'Name of the frame of the fingertip; a force with another name than this and the base frame is refused.',
    )
    twist_frame_id: str = param(
        '', "Frame in which velocities are commanded, the base frame or that of the fingertip; '' is the base."
    )
    controller_manager: str = param(
        '',
        'Controller manager that is asked to switch controllers when the arm is connected and let go, such as '
        "'controller_manager'; '' switches nothing.",
    )
    activate_controllers: str = param(
        'twist_controller',
        'Controllers, separated by spaces, that are active only while the arm is connected.',
    )
    deactivate_controllers: str = param(
        'scaled_joint_trajectory_controller',
        'Controllers, separated by spaces, that are inactive only while the arm is connected.',
    )
    rate_hz: float = param(
        250.0,
        'Rate of commands; a higher rate reacts faster and costs more computing time.',
        unit='Hz',
        low=20.0,
        high=500.0,
    )
    loop_delay_s: float = param(
        0.02,
        'Largest delay from a measured force to the motion that answers it; a longer one is measured as the '
        'finger comes down. Larger values lower the gain.',
        unit='s',
        low=0.0,
        high=0.1,
    )
    command_timeout_s: float = param(
        0.1,
        'How long a command holds without a new one; afterwards the arm stands still.',
        unit='s',
        low=0.02,
        high=2.0,
    )
    controller_timeout_s: float = param(
        0.0,
        'Declares after which time without a command the controller itself stops the arm; 0 declares that it never '
        "does, which is refused unless 'accept_no_timeout' is set.",
        unit='s',
        low=0.0,
        high=0.5,
    )
    accept_no_timeout: bool = param(
        False,
        'Accepts a controller that holds the last velocity for ever: then nothing stops the arm when this machine or '
        'its network fails, but the limits of the robot.',
    )
    heartbeat_s: float = param(
        0.05,
        'Longest silence of the commanding process after which its guard commands zero velocity; a larger '
        'value bears a busier machine.',
        unit='s',
        low=0.02,
        high=1.0,
    )
    deadman_s: float = param(
        0.08,
        'Age of the newest pose or force above which zero velocity is commanded and a fault is reported; a '
        'larger value bears more jitter.',
        unit='s',
        low=0.01,
        high=2.0,
    )
    tool_mass_kg: float = param(
        0.0,
        'Mass of the tool whose weight is removed from the measured force; 0 if the sensor does so itself.',
        unit='kg',
        low=0.0,
        high=20.0,
    )
    invert_force: bool = param(
        False, 'Inverts the measured force, for a sensor that reports what the tool does to its surroundings.'
    )
    force_is_quantised: bool = param(
        False,
        'Lets a measured force repeat itself, as of a sensor that rounds; false takes a force that repeats itself for '
        'a frozen sensor.',
    )
    force_smoothing_s: float = param(
        0.0,
        'Time constant of the low-pass filter of the measured force; a longer one removes more noise and is '
        'added to the delay of the loop.',
        unit='s',
        low=0.0,
        high=0.1,
    )
    connect_timeout_s: float = param(
        5.0,
        'How long the first pose, the first force and the controller may take before connecting fails.',
        unit='s',
        low=0.1,
        high=60.0,
    )

    def __post_init__(self) -> None:
        if self.twist_frame_id not in ('', self.base_frame_id, self.tool_frame_id):
            raise InvalidParameter(
                f"parameter 'twist_frame_id' is '{self.twist_frame_id}'; it must be the base frame "
                f"'{self.base_frame_id}' or the frame of the fingertip '{self.tool_frame_id}'"
            )


# --------------------
# What an arm driven by ROS controllers exchanges with them, without ROS.


class PoseSample(NamedTuple):
    """A measured pose: `position_m` in the frame `frame_id`, `rotation` as the quaternion x, y, z, w.

    `stamp_ns` is the time of its header, on the clock of the sender; 0 if there is none. `age_ns` is its age by that
    stamp and the clock of this machine, which may not agree; 0 if there is no stamp.
    """

    stamp_ns: int
    frame_id: str
    position_m: Vector
    rotation: tuple[float, float, float, float]
    age_ns: int = 0


class ForceSample(NamedTuple):
    """A measured force, N, in the frame `frame_id`; `stamp_ns` and `age_ns` as of a pose."""

    stamp_ns: int
    frame_id: str
    force_n: Vector
    age_ns: int = 0


class ControllerTopics(Protocol):
    """The topics of the controllers; `texture_exploration.ros.controllers` makes them."""

    def newest_pose(self) -> PoseSample | None:
        """Return the newest pose that came since the last call, None if none did."""

    def newest_force(self) -> ForceSample | None:
        """Return the newest force that came since the last call, None if none did."""

    def listeners(self) -> int:
        """Return how many nodes listen to the commanded velocities."""

    def unsafe(self) -> str:
        """Return why the arm must not go on although it obeys: another commands it, or no guard would stop it."""

    def beat(self, *, moving: bool) -> None:
        """Tell the guard that the commanding process lives, in each period, and whether the arm would go on alone."""

    def send_velocity(self, velocity_m_s: Vector) -> None:
        """Command a velocity in the frame `twist_frame_id`."""

    def send_force(self, force_n: Vector) -> None:
        """Command the force of the tool on its surroundings in the base frame; no effect without such a topic."""

    def switch_controllers(self, activate: Sequence[str], deactivate: Sequence[str]) -> None:
        """Let the controller manager switch both sets or nothing; DeviceError, with the reason, if it does not."""

    def close(self) -> None:
        """Wait until what was sent has arrived, at most for a fraction of a second, and leave."""


# --------------------
# Whether the controllers of an arm still work: pose and force are fresh, somebody listens, the arm follows.

FOLLOW_M = 0.002  # commanded, over which the arm must have followed
FOLLOW_NS = 300_000_000  # an arm with lag needs time to set off
LONGEST_NS = 3_000_000_000  # what is slower than `FOLLOW_M` in this time is no motion: a force being held
FOLLOWED_SHARE = 0.1  # a controller may limit speed and acceleration to its own
STOOD_SHARE = 0.3  # an arm that went less in any direction stood still, and may be told to lift


class FollowWatch:
    """Compare the way that was commanded with the way that the finger has gone.

    The comparison begins again when the commanded velocity turns back: a late arm still goes the old way for its lag,
    which is no sign of a lost controller.
    """

    def __init__(self) -> None:
        self.stood = True
        self._begin: tuple[int, Array] | None = None
        self._asked_m: Array = np.zeros(3)

    def restart(self) -> None:
        """Begin again: nothing was commanded, or nobody looked."""
        self._begin = None

    def update(self, now_ns: int, position: Vector, velocity_m_s: Vector, held_s: float) -> str:
        """Return in a sentence that the arm does not follow, '' if it does."""
        place, velocity = np.array(position), np.array(velocity_m_s)
        if self._begin is None or velocity @ self._asked_m < 0.0:
            self._begin, self._asked_m = (now_ns, place), np.zeros(3)
        self._asked_m = self._asked_m + velocity * held_s
        begin_ns, start = self._begin
        asked_m = float(np.linalg.norm(self._asked_m))
        if asked_m < FOLLOW_M or now_ns - begin_ns < FOLLOW_NS:
            if now_ns - begin_ns > LONGEST_NS:
                self.restart()
            return ''
        self.stood = float(np.linalg.norm(place - start)) <= STOOD_SHARE * asked_m
        gone_m = float((place - start) @ self._asked_m) / asked_m
        took_s = (now_ns - begin_ns) * 1e-9
        self.restart()
        if gone_m >= FOLLOWED_SHARE * asked_m:
            return ''
        return f'the arm went {1e3 * gone_m:.1f} mm of the {1e3 * asked_m:.1f} mm commanded in {took_s:.1f} s'


# --------------------
# State of a fingertip from stamped poses and forces: frames, velocity, weight of the tool, zero and age.

GRAVITY_M_S2 = 9.81
VELOCITY_OVER_NS = 30_000_000
STILL_M_S = 1e-4  # a slower finger is at rest: what remains is the noise of its place
AGREE_NS = 1_000_000_000  # clocks by which a sample is older than this, or comes from the future, do not agree
REST: Vector = (0.0, 0.0, 0.0)
LEAST_ROTATION = 0.5  # of the length of a quaternion, which is 1


class ToolState:
    """Turn what the controllers report into the state of an arm."""

    def __init__(self, params: RosControllersParams) -> None:
        self._params = params
        self._frame = SurfaceFrame(params.surface_pose)
        self.zero = ForceZero(params.zero_rise_m, params.zero_steady_n)
        self.pose_ns = self.force_ns = 0
        self._force_came_ns = 0
        self._late = {'pose': '', 'force': ''}
        self.misplaced = ''
        self.impossible = ''  # what no sensor can have measured came; it was not taken
        self.listening = WITHOUT_GAPS
        self.rotation: Array = np.eye(3)  # of the tool in the base frame
        self._position: Vector = (math.nan, math.nan, math.nan)
        self._velocity = REST
        self._force_n = math.nan
        self._force_vector_n: Vector = (math.nan, math.nan, math.nan)  # zeroed, without the weight, not smoothed
        self._reading_n: Array | None = None  # of the sensor, as it came
        self._stamps_ns = {'pose': -1, 'force': -1}
        self._track: deque[tuple[int, Vector]] = deque()

    def take_pose(self, now_ns: int, sample: PoseSample) -> None:
        """Take a pose that came at `now_ns`."""
        params = self._params
        if sample.frame_id != params.base_frame_id:
            self.misplaced = (
                f"the pose on '{params.pose_topic}' is given in the frame '{sample.frame_id}'; "
                f"'{params.base_frame_id}' is needed, see the parameter 'base_frame_id'"
            )
            return
        if not self._is_new('pose', sample.stamp_ns):
            return
        bad = impossible('place', sample.position_m, MOST_M, 'm') or impossible('rotation', sample.rotation, 2.0, '')
        if not bad and math.hypot(*sample.rotation) < LEAST_ROTATION:
            bad = 'the arm reports a quaternion of zeros, which is no rotation'
        if bad:  # it grows old if it stays so
            self.impossible = f"{bad}, on '{params.pose_topic}'"
            return
        self.pose_ns = now_ns - self._age_ns('pose', now_ns, sample.age_ns)
        self.rotation = quaternion_matrix(sample.rotation)
        self._position = self._frame.place(sample.position_m)
        self._update_velocity(sample.stamp_ns or now_ns)

    def take_force(self, now_ns: int, sample: ForceSample, *, moving: bool) -> None:
        """Take a force that came at `now_ns`, after the pose of that time; `moving` if the arm is told to move."""
        params = self._params
        if sample.frame_id not in (params.base_frame_id, params.tool_frame_id):
            self.misplaced = (
                f"the force on '{params.wrench_topic}' is given in the frame '{sample.frame_id}'; "
                f"'{params.tool_frame_id}' or '{params.base_frame_id}' is needed, see the parameter 'tool_frame_id'"
            )
            return
        if not self._is_new('force', sample.stamp_ns):
            return
        if bad := impossible('force', sample.force_n, MOST_FORCE_N, 'N'):
            self.impossible = f"{bad}, on '{params.wrench_topic}'"
            self.force_ns = now_ns  # the finger can be lifted without a force
            return
        passed_s = (now_ns - self._force_came_ns) * 1e-9 if self._force_came_ns else math.inf
        self._force_came_ns = now_ns
        self.force_ns = now_ns - self._age_ns('force', now_ns, sample.age_ns)
        to_base = self.rotation if sample.frame_id == params.tool_frame_id else np.eye(3)
        reading = np.array(sample.force_n) * (-1.0 if params.invert_force else 1.0)
        repeated = self._reading_n is not None and bool((reading == self._reading_n).all())
        self._reading_n = reading
        # What the sensor shows of the weight turns with it; what is left in free air is its offset.
        unweighted = reading - to_base.T @ np.array([0.0, 0.0, -params.tool_mass_kg * GRAVITY_M_S2])
        normal_n = self._at_surface(to_base, unweighted)[2]
        zeroings = self.zero.zeroings
        self.zero.update(now_ns, self._position, normal_n, unweighted, moving=moving)
        self._force_vector_n = self._at_surface(to_base, unweighted - self.zero.offset_n)
        zeroed_n = self._force_vector_n[2]
        if self.zero.zeroings != zeroings:
            self._force_n = zeroed_n  # what was smoothed had another zero
        elif not repeated:  # a frozen reading must stay one to the last bit
            self._force_n = self._smoothed(zeroed_n, passed_s)

    def state(self, fault: str) -> ArmState:
        """Return the newest state; its time is that of the older of pose and force."""
        return ArmState(
            min(self.pose_ns, self.force_ns),
            self._position,
            self._velocity,
            self._force_n,
            fault,
            tangential_force_n=tangential_force_n(self._force_vector_n, self._velocity),
            along_n=self._force_vector_n[:2],
        )

    def _is_new(self, kind: str, stamp_ns: int) -> bool:
        """Return whether a sample differs from the one before; a broadcaster may repeat what it had."""
        new = stamp_ns == 0 or stamp_ns != self._stamps_ns[kind]
        self._stamps_ns[kind] = stamp_ns
        return new

    def _age_ns(self, kind: str, now_ns: int, age_ns: int) -> int:
        """Return the age of a sample as far as clocks agree, and note whether that is too much."""
        if not 0 <= age_ns <= AGREE_NS:
            age_ns = 0
        params = self._params
        topic = params.pose_topic if kind == 'pose' else params.wrench_topic
        self._late[kind] = (
            ''
            if self.listening.silence_s(now_ns - age_ns, now_ns) <= params.deadman_s
            else (
                f"the {kind} on '{topic}' comes {age_ns * 1e-6:.0f} ms after its stamp, and "
                f"{1e3 * params.deadman_s:.0f} ms are allowed ('deadman_s'), so zero velocity was commanded; find what "
                'holds it up, or set the clocks of both machines by each other (chrony)'
            )
        )
        return age_ns

    @property
    def late(self) -> str:
        """In a sentence, that the newest pose or force came too late after its stamp; '' if not."""
        return self._late['pose'] or self._late['force']

    def stale(self, now_ns: int) -> str:
        """Return in a sentence that pose or force are older than the parameters allow, '' if they are not."""
        params = self._params
        measured = (('pose', params.pose_topic, self.pose_ns), ('force', params.wrench_topic, self.force_ns))
        for what, topic, time_ns in measured:
            age_s = self.listening.silence_s(time_ns, now_ns)
            if age_s > params.deadman_s:
                if what == 'pose' and self.impossible:
                    return f'{self.impossible}, and no other has come for {1e3 * age_s:.0f} ms'
                return (
                    f"no {what} has come on '{topic}' for {1e3 * age_s:.0f} ms, so zero velocity was commanded; check "
                    'that its broadcaster is active'
                )
        return ''

    def _at_surface(self, to_base: Array, force_n: Array) -> Vector:
        return self._frame.direction((to_base @ force_n).tolist())

    def _smoothed(self, force_n: float, passed_s: float) -> float:
        smoothing_s = self._params.force_smoothing_s
        if smoothing_s == 0.0 or not math.isfinite(self._force_n) or not math.isfinite(passed_s):
            return force_n
        return self._force_n - (force_n - self._force_n) * math.expm1(-passed_s / smoothing_s)

    def _update_velocity(self, time_ns: int) -> None:
        """Take the velocity from the places of the last moment, by the clock of the sender."""
        track = self._track
        if track and time_ns <= track[-1][0]:  # its clock was set back
            track.clear()
        track.append((time_ns, self._position))
        while len(track) > 2 and time_ns - track[1][0] >= VELOCITY_OVER_NS:
            track.popleft()
        (begin_ns, first), (end_ns, last) = track[0], track[-1]
        if end_ns == begin_ns:
            return
        vx, vy, vz = ((b - a) / ((end_ns - begin_ns) * 1e-9) for a, b in zip(first, last, strict=True))
        self._velocity = (vx, vy, vz) if math.hypot(vx, vy, vz) > STILL_M_S else REST


# --------------------
# An arm that ROS controllers drive: it commands velocities, and reads pose and force, over standard topics.
#
# The force is controlled by the velocity loop of the suite, or by a compliance controller if one is named. This file
# knows no ROS: the topics are behind `texture_exploration.arms.ros_controllers.ControllerTopics`.

HALTING_NS = 500_000_000  # so long zero velocity is repeated; afterwards others may command the controller
GONE_NS = 300_000_000  # a controller that nobody hears of for so long is lost; a shorter time may be one of discovery
POLL_S = 0.005
LOGGER = logging.getLogger(__name__)
NOT_CONNECTED = 'the arm is not connected; connect it first'


def open_topics(params: RosControllersParams) -> ControllerTopics:
    """Return the topics over ROS."""
    try:
        module = importlib.import_module('texture_exploration.ros.controllers')
    except ImportError as error:
        raise DeviceError(
            f"the arm 'ros_controllers' needs ROS 2, which is not installed here ({error}); see docs/index.md"
        ) from error
    topics: ControllerTopics = module.RosTopics(params)
    return topics


class RosControllersArm(SurfaceArm):
    """An arm that ROS drives by a Cartesian velocity controller; see `texture_exploration.arms.arm.Arm`.

    Zero velocity is commanded on every way out: a stop, a fault, a command that is too old, `close`, and by a process
    of its own if this one is killed.

    Parameters
    ----------
    params
        Topics, frames, force control and supervision.
    clock
        CLOCK_MONOTONIC in ns.
    open_topics
        Makes the topics when connecting.
    own_thread
        Command by itself at `rate_hz` once connected. If False, whoever owns the arm calls `step`.
    """

    Params = RosControllersParams
    _params: RosControllersParams

    def __init__(
        self,
        params: RosControllersParams = RosControllersParams(),
        clock: Callable[[], int] = time.monotonic_ns,
        open_topics: Callable[[RosControllersParams], ControllerTopics] = open_topics,
        own_thread: bool = True,
    ) -> None:
        super().__init__(params)
        self._clock = clock
        self._open_topics = open_topics
        self._own_thread = own_thread
        self._switches = params.activate_controllers.split(), params.deactivate_controllers.split()
        self.force_reading = ForceReading.MEASURED if params.force_is_quantised else ForceReading.NOISY
        self._topics: ControllerTopics | None = None
        self._thread: threading.Thread | None = None
        self._closing = threading.Event()
        self._late = 0
        self._command: tuple[ArmCommand, int] | None = None  # and when it came
        self._commanded: Vector = REST
        self._moved_ns = self._sent_ns = 0
        self._pressing = False  # a compliance controller was commanded a force
        self._switched = False  # controllers were switched for this connection
        self._hand_over_fault = ''
        self._unsafe = ''  # why it may only be lifted, likewise
        self._state: ArmState
        self._failed = ''  # with an internal error
        self._lost = ''  # a fault that stays until the arm is recovered or connected again
        self._restart()

    def check(self) -> None:
        """Wait for the first pose, the first force and a controller that listens; nothing is commanded.

        Raises
        ------
        DeviceError
            If one of them does not come within `connect_timeout_s`; it names which.
        """
        topics = self._begin()
        try:
            self._wait_for_controllers(topics)
        finally:
            topics.close()

    def connect(self) -> None:
        """Wait for the first pose, the first force and a controller that listens, and begin to command.

        Raises
        ------
        DeviceError
            If one of them does not come within `connect_timeout_s`; it names which.
        """
        topics = self._begin()
        try:
            self._take_over(topics)
            self._wait_for_controllers(topics)
        except DeviceError:
            self._give_back(topics)
            topics.close()
            raise
        self._closing.clear()
        self._topics = topics
        if self._own_thread:
            self._thread = threading.Thread(target=self._run, name='ros_controllers', daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Command zero velocity, and leave the topics."""
        self._command = None
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        topics, self._topics = self._topics, None
        if topics is not None:
            self._stop_pressing(topics)
            topics.send_velocity(REST)
            self._give_back(topics)
            topics.close()

    def state(self) -> ArmState:
        """Return the newest state.

        Raises
        ------
        DeviceError
            If the thread that commands the arm has ended.
        """
        self._connected()
        if self._thread is not None and not self._thread.is_alive():
            raise DeviceError('the thread that commands the arm has ended through an internal error; see the log')
        return self._state

    def command(self, command: ArmCommand) -> None:
        """Follow a command from the next period on.

        A command with a force lifts the finger first until the force sensor is zeroed, which takes proven free air.

        Raises
        ------
        CommandRefused
            If a number is not finite or out of its range; the arm stops.
        DeviceError
            If the arm is not connected.
        """
        self._connected()
        self._params.check(command, self.stop)
        self._command = (command, self._clock())

    def stop(self) -> None:
        """Command zero velocity from the next period on."""
        self._command = None

    def recover(self) -> None:
        """Clear a fault; the force sensor is zeroed again before the next contact.

        Whoever calls this has made sure that the arm may move.

        Raises
        ------
        DeviceError
            If the fault is still there.
        """
        self._connected()
        self.stop()
        self._lost = self._unsafe = self._failed = self._tool.misplaced = self._tool.impossible = ''
        self._tool.zero.forget()
        self._zeroed = False
        self._follow.restart()
        if fault := self._fault(self._clock()) or self._connected().unsafe():
            raise DeviceError(f'the arm did not recover: {fault}')

    @property
    def base_frame_id(self) -> str:
        """Name of the base frame on tf."""
        return self._params.base_frame_id

    @property
    def zeroed(self) -> bool:
        """Whether the force sensor was zeroed since the arm was connected or recovered."""
        return self._zeroed

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals of this connection."""
        self._connected()
        return {
            'zeroed': self._tool.zero.zeroings,
            'late_periods': self._late,
        }

    def step(self) -> None:
        """Take what was measured, and send what the newest command needs now; zero velocity if that fails.

        After a first error the arm may only be lifted; one that comes again leaves it at rest for good.
        """
        topics = self._connected()
        try:
            self._step(topics)
        except Exception as error:
            LOGGER.exception('a step of the arm failed')
            reason = f'internal error, {type(error).__name__}: {error}'[:200]
            self._lost = self._lost or (self._failed and reason)
            self._failed = self._unsafe = reason
            self._command = None
            self._commanded = REST
            self._stop_pressing(topics)
            topics.send_velocity(REST)
            self._state = replace(self._state, unsafe=reason, fault=self._lost)

    def _step(self, topics: ControllerTopics) -> None:
        """Take what was measured, and send what the newest command needs now."""
        now_ns = self._clock()
        held_s = (now_ns - self._sent_ns) * 1e-9 if self._sent_ns else 0.0
        if self._sent_ns and now_ns - self._sent_ns > GAP_NS:
            self._tool.listening = Listening(gap_start_ns=self._sent_ns, gap_end_ns=now_ns)
        self._sent_ns = now_ns
        self._take(topics, now_ns)
        if not self._lost:
            self._lost = self._lost_controller(topics, now_ns, held_s)
        self._unsafe = self._unsafe or topics.unsafe() or self._tool.impossible
        fault = self._fault(now_ns)
        if fault:
            self._command = None
            self._tool.zero.forget()
        self._state = replace(self._tool.state(fault), unsafe=self._unsafe)
        self._zeroed = self._tool.zero.zeroed  # after the state, so that who reads it finds the zeroed force
        if fault:
            self._halt(topics, now_ns)
        else:
            self._carry_out(topics, self._due(now_ns), now_ns, held_s)
        topics.beat(moving=self._commanded != REST or self._pressing)

    def _begin(self) -> ControllerTopics:
        """Let go of an earlier connection, and open the topics of a new one."""
        self.close()
        self._restart()
        return self._open_topics(self._params)

    def _restart(self) -> None:
        params = self._params
        loop = replace(params, loop_delay_s=min(0.1, params.loop_delay_s + params.force_smoothing_s))
        self._tool = ToolState(params)
        self._velocity = CommandedVelocity(loop, 1.0 / params.rate_hz)
        self._follow = FollowWatch()
        self._state = self._tool.state('')
        self._command = None
        self._commanded = REST
        self._moved_ns = self._sent_ns = self._gone_ns = 0
        self._pressing = self._zeroed = False
        self._lost = self._unsafe = self._failed = ''

    def _take_over(self, topics: ControllerTopics) -> None:
        if self._params.controller_manager:
            topics.switch_controllers(*self._switches)
            self._switched, self._hand_over_fault = True, ''

    def _give_back(self, topics: ControllerTopics) -> None:
        """Switch back what was switched; who let go cannot do more about it than to say so."""
        if not self._switched:
            return
        self._switched = False
        try:
            topics.switch_controllers(*reversed(self._switches))
        except DeviceError as error:
            self._hand_over_fault = f'the controllers were not switched back: {error}'

    def doubt(self) -> str:
        """Return in a sentence that the force comes too late to press by it, '' if not."""
        return '' if self._params.target_wrench_topic else self._velocity.doubt()

    def warning(self) -> str:
        """Return in a sentence that the controllers were not switched back when the arm was let go, '' if they were."""
        return self._hand_over_fault

    def _connected(self) -> ControllerTopics:
        if self._topics is None:
            raise DeviceError(NOT_CONNECTED)
        return self._topics

    def _wait_for_controllers(self, topics: ControllerTopics) -> None:
        params, tool = self._params, self._tool
        end_s = time.monotonic() + params.connect_timeout_s
        while True:
            give_up_when_ending()
            self._take(topics, self._clock())
            missing = {
                f"no pose comes on '{params.pose_topic}'": tool.pose_ns == 0,
                f"no force comes on '{params.wrench_topic}'": tool.force_ns == 0,
                f"nobody listens on '{params.twist_topic}'": topics.listeners() == 0,
            }
            faults = [what for what, is_missing in missing.items() if is_missing]
            if unsafe := topics.unsafe():
                faults.append(unsafe)
            if tool.late:
                faults.append(tool.late)
            if not faults:
                self._state = tool.state('')
                return
            if tool.misplaced or time.monotonic() > end_s:
                raise DeviceError(
                    f'{tool.misplaced or "; ".join(faults)}. Check that the controllers are active, that they use '
                    'these topics, and that ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE are those of the robot'
                )
            time.sleep(POLL_S)

    def _take(self, topics: ControllerTopics, now_ns: int) -> None:
        """Take over what came; the pose first, as it tells how the force is turned."""
        pose = topics.newest_pose()
        if pose is not None:
            self._tool.take_pose(now_ns, pose)
        force = topics.newest_force()
        if force is not None and self._tool.pose_ns:
            self._tool.take_force(now_ns, force, moving=self._commanded != REST)

    def _lost_controller(self, topics: ControllerTopics, now_ns: int, held_s: float) -> str:
        """Return in a sentence that the controller is lost, '' if it is not."""
        topic = self._params.twist_topic
        if topics.listeners() == 0:
            self._gone_ns = self._gone_ns or now_ns
            if now_ns - self._gone_ns > GONE_NS:
                return f"nobody listens on '{topic}' any more: the controller has ended"
            self._unsafe = self._unsafe or f"for a moment nobody listened on '{topic}'; see why its controller left"
            self._follow.restart()
            return ''
        self._gone_ns = 0
        if self._commanded == REST or held_s > self._params.heartbeat_s:  # the guard has commanded zero meanwhile
            self._follow.restart()
            return ''
        late = self._follow.update(now_ns, self._tool.state('').position, self._commanded, held_s)
        if not late:
            return ''
        reason = f"{late}: the controller on '{topic}' is not active or holds back, or something is in the way"
        if self._unsafe or not self._follow.stood:  # nor did it follow the lift, or where it goes nobody knows
            return reason
        self._unsafe = reason  # it may only have been held up: a lift is tried
        return ''

    def _fault(self, now_ns: int) -> str:
        tool = self._tool
        return self._lost or tool.misplaced or tool.late or tool.stale(now_ns)

    def _due(self, now_ns: int) -> ArmCommand | None:
        """Return the command that holds now, None if none does."""
        command = self._command
        if command is None or (now_ns - command[1]) * 1e-9 > self._params.command_timeout_s:
            return None
        if self._unsafe:  # the way out alone is open
            up_m_s = 0.0 if command[0].force_n is not None else max(0.0, command[0].normal_m_s)
            return ArmCommand(normal_m_s=up_m_s)
        return self._lifted_first(command[0])

    def _lifted_first(self, command: ArmCommand) -> ArmCommand | None:
        """Return the command, or what comes before it as long as the force sensor is not zeroed."""
        zero, height_m = self._tool.zero, self._state.position[2]
        if command.force_n is None or zero.zeroed:
            zero.air.seek(None)
            return command
        if zero.air.proven:
            return None  # at rest it is zeroed
        if zero.air.seek(height_m):
            self._lost = UNSTEADY
            return None
        return ArmCommand(normal_m_s=RISE_M_S)

    def _carry_out(self, topics: ControllerTopics, command: ArmCommand | None, now_ns: int, held_s: float) -> None:
        state = self._state
        if command is not None and command.force_n is not None:
            self._tool.zero.presume_contact()
            self._press(topics, command)
        else:
            self._stop_pressing(topics)
        velocity = self._chosen(command or STANDSTILL, state, held_s)
        if velocity == REST and (command is None or command.force_n is None):
            self._halt(topics, now_ns)
        else:
            self._send(topics, velocity, now_ns)

    def _press(self, topics: ControllerTopics, command: ArmCommand) -> None:
        if self._params.target_wrench_topic:
            topics.send_force(self._frame.to_base((0.0, 0.0, -(command.force_n or 0.0))))
            self._pressing = True

    def _stop_pressing(self, topics: ControllerTopics) -> None:
        if self._pressing:
            topics.send_force(REST)
            self._pressing = False

    def _chosen(self, command: ArmCommand, state: ArmState, held_s: float) -> Vector:
        if command.force_n is not None and self._params.target_wrench_topic:
            command = replace(command, force_n=None, normal_m_s=0.0)
        return self._velocity.choose(command, state, held_s)

    def _send(self, topics: ControllerTopics, velocity: Vector, now_ns: int) -> None:
        self._commanded, self._moved_ns = velocity, now_ns
        in_base = self._frame.to_base(velocity)
        if self._params.twist_frame_id == self._params.tool_frame_id:
            x, y, z = (self._tool.rotation.T @ in_base).tolist()
            in_base = (x, y, z)
        topics.send_velocity(in_base)

    def _halt(self, topics: ControllerTopics, now_ns: int) -> None:
        """Command zero velocity, for a while: a controller may hold the last velocity for ever."""
        self._commanded = REST
        self._stop_pressing(topics)
        if self._moved_ns and now_ns - self._moved_ns <= HALTING_NS:
            topics.send_velocity(REST)

    def _run(self) -> None:
        topics = self._connected()
        period_s = 1.0 / self._params.rate_hz
        due_s = time.monotonic()
        try:
            while not self._closing.is_set():
                self.step()
                due_s += period_s
                left_s = due_s - time.monotonic()
                if left_s < -period_s:
                    self._late += 1
                    due_s = time.monotonic()
                self._closing.wait(max(0.0, left_s))
        finally:
            # Also when a bug ends the loop: no arm is left moving.
            self._stop_pressing(topics)
            topics.send_velocity(REST)
