"""State of a fingertip from stamped poses and forces: frames, velocity, weight of the tool, zero and age."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from texture_core.arrays import Array
from texture_core.rotation import quaternion_matrix
from texture_exploration.arms.force_zero import ForceZero
from texture_exploration.arms.protocol import ArmState, Vector
from texture_exploration.arms.ros_controllers_params import RosControllersParams
from texture_exploration.arms.ros_controllers_topics import ForceSample, PoseSample
from texture_exploration.arms.surface_frame import SurfaceFrame
from texture_exploration.arms.tangential_force import tangential_force_n

GRAVITY_M_S2 = 9.81
VELOCITY_OVER_NS = 30_000_000
STILL_M_S = 1e-4  # a slower finger is at rest: what remains is the noise of its place
AGREE_NS = 1_000_000_000  # clocks by which a sample is older than this, or comes from the future, do not agree
REST: Vector = (0.0, 0.0, 0.0)


class ToolState:
    """Turn what the controllers report into the state of an arm.

    Parameters
    ----------
    params
        Frames, tool and surface.

    Attributes
    ----------
    zero : ForceZero
        Of the force sensor.
    pose_ns, force_ns : int
        When the newest pose and force were measured that differ from the ones before by their stamps: by the stamp
        where the clocks agree, else when they came; 0 before the first.
    misplaced : str
        In a sentence, that a pose or a force came in an unknown frame; '' if none did.
    """

    def __init__(self, params: RosControllersParams) -> None:
        self._params = params
        self._frame = SurfaceFrame(params.surface_pose)
        self.zero = ForceZero(params.zero_rise_m, params.zero_steady_n)
        self.pose_ns = self.force_ns = 0
        self._force_came_ns = 0
        self._late = {'pose': '', 'force': ''}
        self.misplaced = ''
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
        self.pose_ns = now_ns - self._age_ns('pose', sample.age_ns)
        self.rotation = quaternion_matrix(sample.rotation)
        self._position = self._frame.place(sample.position_m)
        self._update_velocity(sample.stamp_ns or now_ns)

    def take_force(self, now_ns: int, sample: ForceSample, *, moving: bool) -> None:
        """Take a force that came at `now_ns`, after the pose of that time; `moving` if the arm is told to move.

        Parameters
        ----------
        now_ns
            The time, ns.
        sample
            Force and its place.
        moving
            Whether the arm is commanded to move.
        """
        params = self._params
        if sample.frame_id not in (params.base_frame_id, params.tool_frame_id):
            self.misplaced = (
                f"the force on '{params.wrench_topic}' is given in the frame '{sample.frame_id}'; "
                f"'{params.tool_frame_id}' or '{params.base_frame_id}' is needed, see the parameter 'tool_frame_id'"
            )
            return
        if not self._is_new('force', sample.stamp_ns):
            return
        passed_s = (now_ns - self._force_came_ns) * 1e-9 if self._force_came_ns else math.inf
        self._force_came_ns = now_ns
        self.force_ns = now_ns - self._age_ns('force', sample.age_ns)
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

    def _age_ns(self, kind: str, age_ns: int) -> int:
        """Return the age of a sample as far as clocks agree, and note whether that is too much."""
        if not 0 <= age_ns <= AGREE_NS:
            age_ns = 0
        params = self._params
        topic = params.pose_topic if kind == 'pose' else params.wrench_topic
        self._late[kind] = (
            ''
            if age_ns * 1e-9 <= params.deadman_s
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
