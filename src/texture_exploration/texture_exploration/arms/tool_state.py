# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""State of the finger from the poses and forces of ROS controllers, and the parameters of such an arm."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from texture_core.config import param
from texture_core.errors import InvalidParameter
from texture_core.types import Array, quaternion_matrix
from texture_exploration.arms.arm import (
    ArmState,
    ForceZero,
    RestWatch,
    SurfaceFrame,
    SurfacePoseParams,
    Vector,
    ZeroingParams,
)
from texture_exploration.force_control import ForceLoopParams
from texture_exploration.guards import WITHOUT_GAPS
from texture_exploration.safety import MOST_FORCE_N, MOST_M

# --------------------
# Parameters of an arm that is driven by ROS controllers.


@dataclass(frozen=True)
class RosControllersParams(ForceLoopParams, ZeroingParams, SurfacePoseParams):
    """Topics, frames and rates of the controllers, the tool, the surface, and the supervision."""

    twist_topic: str = param('twist_controller/twist', 'Topic of the commanded velocities (TwistStamped).')
    pose_topic: str = param(
        'tcp_pose_broadcaster/pose', 'Topic of the measured pose of the fingertip in the base frame (PoseStamped).'
    )
    wrench_topic: str = param('force_torque_sensor_broadcaster/wrench', 'Topic of the measured force (WrenchStamped).')
    base_frame_id: str = param('base', 'Name of the base frame, which the measured pose must carry in its header.')
    tool_frame_id: str = param(
        'tool0_controller', 'Name of the frame of the fingertip; a force is given in this frame or in the base frame.'
    )
    twist_frame_id: str = param(
        '', "Frame in which velocities are commanded, the base frame or that of the fingertip; '' is the base."
    )
    rate_hz: float = param(
        250.0, 'Rate of commands; higher: faster reaction, more computing.', unit='Hz', low=20.0, high=500.0
    )
    controller_timeout_s: float = param(
        0.0, 'Time without a command after which the controller stops the arm; 0: never.', unit='s', low=0.0, high=0.5
    )
    accept_no_timeout: bool = param(
        False,
        'Accepts a controller that keeps executing the last velocity: then nothing stops the arm when this machine or '
        'its network fails, but the limits of the robot.',
    )
    accept_shared_group: bool = param(
        False,
        'Accepts such a controller also where the guard has no separate control group, as in a container: what kills '
        'the whole group leaves the arm moving.',
    )
    deadman_s: float = param(
        0.08, 'Age of pose or force above which zero velocity is commanded.', unit='s', low=0.01, high=2.0
    )
    invert_force: bool = param(
        False, 'Inverts the measured force, for a sensor that reports what the tool does to its surroundings.'
    )
    force_smoothing_s: float = param(
        0.0, 'Time constant of the low-pass filter of the force; it delays the loop.', unit='s', low=0.0, high=0.1
    )
    connect_timeout_s: float = param(
        10.0, 'How long the first pose, the first force and the controller may take.', unit='s', low=0.1, high=60.0
    )

    def __post_init__(self) -> None:
        if self.twist_frame_id not in ('', self.base_frame_id, self.tool_frame_id):
            raise InvalidParameter(
                f"parameter 'twist_frame_id' is '{self.twist_frame_id}'; it must be the base frame "
                f"'{self.base_frame_id}' or the frame of the fingertip '{self.tool_frame_id}'"
            )


# --------------------
# What an arm driven by ROS controllers exchanges with them, without ROS.


HEARTBEAT_S = 0.05  # longest silence of the commanding process after which its guard commands zero velocity


class PoseSample(NamedTuple):
    """A measured pose: `rotation` is the quaternion x, y, z, w; `stamp_ns` of its sender, 0 if there is none.

    `age_ns` is its age by that stamp and the clock of this machine, which may not agree; 0 if there is no stamp.
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


# --------------------
# Whether the controllers of an arm still work: pose and force are fresh, commands have a subscriber, the arm follows.

FOLLOW_M = 0.002  # commanded, over which the arm must have followed
FOLLOW_NS = 300_000_000  # an arm with lag needs time to set off
LONGEST_NS = 3_000_000_000  # what is slower than `FOLLOW_M` in this time is no motion: a force being held
FOLLOWED_FRACTION = 0.1  # of the commanded distance; a controller may limit speed and acceleration
REST_FRACTION = 0.3  # of the commanded distance; an arm that moved less is at rest and may be lifted


class FollowWatch:
    """Compare the commanded distance with that of the finger.

    The comparison begins again when the commanded velocity turns back: a late arm still goes the old way for its lag,
    which is no sign of a lost controller.
    """

    def __init__(self) -> None:
        self.at_rest = True
        self._begin: tuple[int, Array] | None = None
        self._asked_m: Array = np.zeros(3)

    def restart(self) -> None:
        """Restart: nothing was commanded, or the arm was not observed."""
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
        self.at_rest = float(np.linalg.norm(place - start)) <= REST_FRACTION * asked_m
        gone_m = float((place - start) @ self._asked_m) / asked_m
        took_s = (now_ns - begin_ns) * 1e-9
        self.restart()
        if gone_m >= FOLLOWED_FRACTION * asked_m:
            return ''
        return f'the arm went {1e3 * gone_m:.1f} mm of the {1e3 * asked_m:.1f} mm commanded in {took_s:.1f} s'


# --------------------
# State of a fingertip from stamped poses and forces: frames, velocity, zero, age and rest.

VELOCITY_OVER_NS = 30_000_000
STILL_M_S = 1e-4  # a slower finger is at rest: below is the noise of its position
AGREE_NS = 1_000_000_000  # clocks by which a sample is older than this, or comes from the future, do not agree
SKEW_NS = 5_000_000  # by which a sample may come from the future without a warning
REST: Vector = (0.0, 0.0, 0.0)


class ToolState:
    """Convert the messages of the controllers to the state of an arm."""

    def __init__(self, params: RosControllersParams) -> None:
        self._params = params
        self._topics = {'pose': params.pose_topic, 'force': params.wrench_topic}
        self._frame = SurfaceFrame(params.surface_pose)
        self.zero = ForceZero(params.zero_steady_n)
        self.rest = RestWatch()
        self.came_ns = {'pose': 0, 'force': 0}  # when the newest was measured, as far as clocks agree
        self._taken_ns = {'pose': 0, 'force': 0}
        self._stamps_ns = {'pose': -1, 'force': -1}
        self._late = {'pose': '', 'force': ''}
        self._ahead_ns = {'pose': 0, 'force': 0}  # stamps that come from the future
        # A frame that is not known; a sample that is no measurement, and was not taken.
        self.misplaced = self.garbled = ''
        self.listening = WITHOUT_GAPS
        self.rotation: Array = np.eye(3)  # of the tool in the base frame
        self._position: Vector = (math.nan, math.nan, math.nan)
        self._place_ns = 0
        self._velocity = REST
        self._force_n = math.nan
        self._force_vector_n: Vector = (math.nan, math.nan, math.nan)  # zeroed, not smoothed
        self._reading_n: Array | None = None  # of the sensor, as it came
        self._track: deque[tuple[int, Vector]] = deque()

    def take_pose(self, now_ns: int, sample: PoseSample) -> None:
        """Take a pose that came at `now_ns`."""
        base = self._params.base_frame_id
        norm = math.hypot(*sample.rotation)
        if sample.frame_id != base:
            self._refuse('pose', f"is given in the frame '{sample.frame_id}'; '{base}' is needed ('base_frame_id')")
        elif not (math.hypot(*sample.position_m) <= MOST_M and abs(norm - 1.0) <= 0.1):  # so NaN is invalid
            numbers = f'{_shown(sample.position_m)} m, quaternion {_shown(sample.rotation)}'
            self.garbled = f"a pose on '{self._topics['pose']}' is invalid: {numbers}; check its sender"
        elif self._is_new('pose', now_ns, sample):
            self.rotation = quaternion_matrix(sample.rotation)
            self._position = self._frame.place(sample.position_m)
            self.rest.update(now_ns, self._position)
            self._place_ns = sample.stamp_ns or now_ns
            self._update_velocity(self._place_ns)

    def take_force(self, now_ns: int, sample: ForceSample, *, moving: bool) -> None:
        """Take a force that came at `now_ns`, after the pose of that time; `moving` if the arm is commanded to move."""
        params = self._params
        if sample.frame_id not in (params.base_frame_id, params.tool_frame_id):
            allowed = f"'{params.tool_frame_id}' or '{params.base_frame_id}'"
            self._refuse('force', f"is given in the frame '{sample.frame_id}'; {allowed} is needed ('tool_frame_id')")
            return
        if not math.hypot(*sample.force_n) <= MOST_FORCE_N:  # so NaN is invalid
            numbers = f'{_shown(sample.force_n)} N'
            self.garbled = f"a force on '{self._topics['force']}' is invalid: {numbers}; check its sender"
            self.came_ns['force'] = now_ns  # the finger can be lifted without a force
            return
        before_ns = self._taken_ns['force']
        if not self._is_new('force', now_ns, sample):
            return
        to_base = self.rotation if sample.frame_id == params.tool_frame_id else np.eye(3)
        reading = np.array(sample.force_n) * (-1.0 if params.invert_force else 1.0)
        repeated = self._reading_n is not None and bool((reading == self._reading_n).all())
        self._reading_n = reading
        zeroings = self.zero.zeroings
        # What is left in free air is the offset of the sensor, and the weight of the tool, which never turns.
        self.zero.update(now_ns, self._position, self._at_surface(to_base, reading)[2], reading, moving=moving)
        self._force_vector_n = self._at_surface(to_base, reading - self.zero.offset_n)
        # What was smoothed had another zero; and a frozen reading must stay one to the last bit.
        if self.zero.zeroings != zeroings or not before_ns:
            self._force_n = self._force_vector_n[2]
        elif not repeated:
            self._force_n = self._smoothed(self._force_vector_n[2], (now_ns - before_ns) * 1e-9)

    def state(self, fault: str) -> ArmState:
        """Return the newest state; its time is that of the older of pose and force."""
        return ArmState(
            min(self.came_ns.values()),
            self._position,
            self._velocity,
            self._force_n,
            fault,
            along_n=self._force_vector_n[:2],
            delay_s=self._params.loop_delay_s + self._params.force_smoothing_s,
            place_ns=self._place_ns,
        )

    @property
    def late(self) -> str:
        """In a sentence, that the newest pose or force came too late after its stamp; '' if not."""
        return self._late['pose'] or self._late['force']

    @property
    def skew(self) -> str:
        """In a sentence, that stamps come from the future: the clocks do not agree; '' if not."""
        for kind, ahead_ns in self._ahead_ns.items():
            if ahead_ns > SKEW_NS:
                return (
                    f"the clock that stamps the {kind} on '{self._topics[kind]}' is {ahead_ns * 1e-6:.0f} ms ahead of "
                    'the clock of this machine: a late sample is not detected; synchronise the two clocks (chrony)'
                )
        return ''

    def stale(self, now_ns: int) -> str:
        """Return in a sentence that pose or force are older than the parameters allow, '' if they are not."""
        for kind, time_ns in self.came_ns.items():
            age_s = self.listening.silence_s(time_ns, now_ns)
            if age_s > self._params.deadman_s:
                return (
                    f"no {kind} has arrived on '{self._topics[kind]}' for {1e3 * age_s:.0f} ms, so zero velocity was "
                    'commanded; check that its broadcaster is active'
                )
        return ''

    def _refuse(self, kind: str, why: str) -> None:
        self.misplaced = f"the {kind} on '{self._topics[kind]}' {why}"

    def _is_new(self, kind: str, now_ns: int, sample: PoseSample | ForceSample) -> bool:
        """Note the age of a sample; return whether it differs from the one before, as a broadcaster may repeat."""
        if sample.stamp_ns and sample.stamp_ns == self._stamps_ns[kind]:
            return False
        age_ns, deadman_s = sample.age_ns, self._params.deadman_s
        self._ahead_ns[kind] = max(0, -age_ns)
        if not 0 <= age_ns <= AGREE_NS:
            age_ns = 0
        self._stamps_ns[kind], self._taken_ns[kind], self.came_ns[kind] = sample.stamp_ns, now_ns, now_ns - age_ns
        self._late[kind] = ''
        if self.listening.silence_s(now_ns - age_ns, now_ns) > deadman_s:
            self._late[kind] = (
                f"the {kind} on '{self._topics[kind]}' arrives {age_ns * 1e-6:.0f} ms after its stamp, and "
                f"{1e3 * deadman_s:.0f} ms are allowed ('deadman_s'), so zero velocity was commanded; find the cause "
                'of the delay, or synchronise the clocks of both machines (chrony)'
            )
        return True

    def _at_surface(self, to_base: Array, force_n: Array) -> Vector:
        return self._frame.direction((to_base @ force_n).tolist())

    def _smoothed(self, force_n: float, passed_s: float) -> float:
        smoothing_s = self._params.force_smoothing_s
        if smoothing_s == 0.0:
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


def _shown(numbers: tuple[float, ...]) -> str:
    return f'({", ".join(f"{number:.4g}" for number in numbers)})'
