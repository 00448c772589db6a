# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Interface of an arm to the explorer: commands, states, frame of the surface, zeroing of the force sensor."""

from __future__ import annotations

import contextlib
import fcntl
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import quote

import numpy as np

from texture_core.config import param
from texture_core.errors import CommandRefused, DeviceError
from texture_core.types import Array, rotation_matrix

# --------------------
# Interface of every arm that carries the finger.

Vector = tuple[float, float, float]  # x, y in the surface, z away from it
SLIDING_M_S = 1e-3  # below, noise dominates the direction of travel


@dataclass(frozen=True)
class ArmState:
    """Position, velocity and normal force of the fingertip in the frame of the surface.

    `time_ns` is when the arm measured it, of CLOCK_MONOTONIC; `position` in m, `velocity` in m/s; `force_n` is the
    force normal to the surface, positive when pressing; `along_n` that of the surroundings on the finger along x and y
    of the surface, NaN if the arm measures the normal force only. `fault` says why the arm
    cannot move; '' if it can. Without further commands the arm keeps its last velocity for `watchdog_s` at most; 0 if
    unknown. `delay_s` passes from a force to the motion that responds to it. `unsafe` says why the finger must be
    lifted although the arm obeys; '' if it need not. `place_ns` is when it was at `position`, by any clock; 0 if that
    was at `time_ns`.
    """

    time_ns: int
    position: Vector
    velocity: Vector
    force_n: float
    fault: str = ''
    watchdog_s: float = 0.0
    along_n: tuple[float, float] = (math.nan, math.nan)
    unsafe: str = ''
    delay_s: float = 0.0
    place_ns: int = 0

    @property
    def force_vector_n(self) -> Vector:
        """The whole force on the finger, as far as the arm measures it."""
        x, y = (0.0, 0.0) if all(map(math.isnan, self.along_n)) else self.along_n
        return x, y, self.force_n

    @property
    def force_size_n(self) -> float:
        """The size of the whole force, as far as the arm measures it."""
        return math.hypot(*self.force_vector_n)

    @property
    def tangential_force_n(self) -> float:
        """The force of the surface against the direction of travel; NaN if not measured, or if the finger rests."""
        (vx, vy, _), (x, y) = self.velocity, self.along_n
        speed_m_s = math.hypot(vx, vy)
        return -(x * vx + y * vy) / speed_m_s if speed_m_s >= SLIDING_M_S else math.nan


@dataclass(frozen=True)
class ArmCommand:
    """Command to the finger: a velocity along the surface, and a velocity or a force normal to it.

    `normal_m_s` is positive away from the surface. If `force_n` is given, the arm controls that pressing force instead
    and ignores `normal_m_s`: above the surface it comes down until it presses.
    """

    tangential_m_s: tuple[float, float] = (0.0, 0.0)
    normal_m_s: float = 0.0
    force_n: float | None = None


STANDSTILL = ArmCommand()

# Of a single command from any program; the explorer has tighter limits for requests.
MOST_COMMAND_M_S = 1.0  # along the surface: four times the limit of an exploration
MOST_NORMAL_COMMAND_M_S = 0.5
MOST_COMMAND_N = 50.0  # the limit of an exploration is not higher


def check_command(command: ArmCommand, stop: Callable[[], object]) -> None:
    """Stop the arm and raise CommandRefused if a command is out of range."""
    for what, value, low, high, unit in (
        ('the speed along the surface', math.hypot(*command.tangential_m_s), 0.0, MOST_COMMAND_M_S, 'm/s'),
        ('the speed along the normal', command.normal_m_s, -MOST_NORMAL_COMMAND_M_S, MOST_NORMAL_COMMAND_M_S, 'm/s'),
        ('the force', 0.0 if command.force_n is None else command.force_n, 0.0, MOST_COMMAND_N, 'N'),
    ):
        if not low <= value <= high:  # so is NaN
            stop()
            raise CommandRefused(
                f'the command was refused and the arm stopped: {what} is {value:g} {unit}; allowed is {low:g} to '
                f'{high:g} {unit}'
            )


class Arm:
    """An arm under hybrid control: velocity along the surface, velocity or force along its normal; a base of all arms.

    A command holds until the next one, but at most for a fraction of a second: an arm without commands stops.
    Any method but `close` raises DeviceError if the arm cannot be reached. What an arm can do beyond moving, it
    overrides.
    """

    Params: type[Any]
    noisy_force = False  # its measured force is never twice the same to the last bit, as that of a sensor with noise
    keeps_start = False  # nothing else moves it: explorations begin at the same place after a release

    def __init__(self, params: Any) -> None:
        """Take the parameters; nothing is reached yet."""

    def connect(self) -> None:
        """Reach the arm and clear its faults; may be called again after `close`."""
        raise NotImplementedError

    def close(self) -> None:
        """Stop, and release the arm; never raises, may be called twice."""
        raise NotImplementedError

    def state(self) -> ArmState:
        """Return the newest measured state at once; its age shows whether the arm still answers."""
        raise NotImplementedError

    def command(self, command: ArmCommand) -> None:
        """Take over a command at once; it does not wait for the arm to follow."""
        raise NotImplementedError

    def stop(self) -> None:
        """Stop and hold the position in any state; may be called from any thread."""
        raise NotImplementedError

    def check(self) -> None:
        """Return if the arm answers and could move, without keeping control; DeviceError with the reason if not."""
        try:
            self.connect()
            self.state()
        finally:
            self.close()

    def recover(self) -> None:
        """Release what the robot itself holds, such as a protective stop, before it is connected again."""

    def warning(self) -> str:
        """Return a warning in a sentence although the arm moves, '' if there is none."""
        return ''

    @property
    def zeroed(self) -> bool:
        """Whether the force is a measure of contact: not before an arm that zeroes its sensor itself has done so."""
        return True

    @property
    def base_frame_id(self) -> str:
        """Name of the base frame on tf, in which the surface has a pose; '' if the arm has none."""
        return ''

    @property
    def surface_pose(self) -> tuple[float, ...]:
        """Pose of the surface in the base frame: place in m, then a rotation vector in rad, (6,)."""
        raise NotImplementedError

    def move_surface(self, pose: Sequence[float]) -> None:
        """Release the arm and set another pose of the surface, (6,), from the next connection on."""
        raise NotImplementedError


# --------------------
# The frame of the surface in the base frame of an arm.

PoseParamsT = TypeVar('PoseParamsT', bound='SurfacePoseParams')


def _place(value: float, axis: str) -> Any:
    """Declare a coordinate of the surface."""
    return param(value, f'{axis} of the origin of the surface in the base frame.', unit='m', low=-3.0, high=3.0)


def _rotation(axis: str) -> Any:
    """Declare a component of the rotation of the surface."""
    text = f'{axis} of the rotation vector of the surface frame; its z axis points away from the surface.'
    return param(0.0, text, unit='rad', low=-7.0, high=7.0)


POSE = ('surface_x_m', 'surface_y_m', 'surface_z_m', 'surface_rx_rad', 'surface_ry_rad', 'surface_rz_rad')


@dataclass(frozen=True)
class SurfacePoseParams:
    """Pose of the surface in the base frame of an arm; a base of the parameters of each arm with a base frame."""

    surface_x_m: float = _place(0.4, 'X')
    surface_y_m: float = _place(0.0, 'Y')
    surface_z_m: float = _place(0.1, 'Z')
    surface_rx_rad: float = _rotation('X')
    surface_ry_rad: float = _rotation('Y')
    surface_rz_rad: float = _rotation('Z')

    def at_surface(self: PoseParamsT, pose: Sequence[float]) -> PoseParamsT:
        """Return the parameters with another pose of the surface, (6,) as `surface_pose`."""
        return replace(self, **dict(zip(POSE, map(float, pose), strict=True)))

    @property
    def surface_pose(self) -> tuple[float, ...]:
        """Pose of the surface in the base frame: place in m, then a rotation vector in rad, (6,)."""
        return tuple(getattr(self, name) for name in POSE)


class SurfaceFrame:
    """Turn places and directions from the base frame of an arm to the frame of the surface and back."""

    def __init__(self, pose: Sequence[float]) -> None:
        self._origin = np.array(pose[:3])
        self._axes = rotation_matrix(pose[3:])

    def place(self, in_base_m: Sequence[float]) -> Vector:
        """Return a place in the frame of the surface."""
        return _vector(self._axes.T @ (np.array(in_base_m) - self._origin))

    def direction(self, in_base: Sequence[float]) -> Vector:
        """Return a velocity or a force in the frame of the surface."""
        return _vector(self._axes.T @ np.array(in_base))

    def place_to_base(self, place_m: Sequence[float]) -> Vector:
        """Return a place of the frame of the surface in the base frame."""
        return _vector(self._axes @ np.array(place_m) + self._origin)

    def to_base(self, direction: Sequence[float]) -> Vector:
        """Return a velocity or a force of the frame of the surface in the base frame."""
        return _vector(self._axes @ np.array(direction))


def _vector(values: Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


class SurfaceArm(Arm):
    """An arm with a base frame; its parameters are `SurfacePoseParams`."""

    def __init__(self, params: Any) -> None:
        self._params = params
        self._frame = SurfaceFrame(params.surface_pose)

    @property
    def surface_pose(self) -> tuple[float, ...]:
        """Pose of the surface in the base frame."""
        pose: tuple[float, ...] = self._params.surface_pose
        return pose

    def move_surface(self, pose: Sequence[float]) -> None:
        """Release the arm and set another pose of the surface, from the next connection on."""
        self.close()
        self._params = self._params.at_surface(pose)
        self._frame = SurfaceFrame(self._params.surface_pose)

    def _check(self, command: ArmCommand) -> None:
        """Refuse a command that is out of range, or has a force before the force sensor is zeroed; the arm stops."""
        check_command(command, self.stop)
        if command.force_n is not None and not self.zeroed and not self.state().fault:
            self.stop()
            raise CommandRefused(
                'the command was refused and the arm stopped: a force is wanted, and the force sensor is not zeroed; '
                f'rise by {1e3 * ZERO_RISE_M:g} mm in free air and rest, until the arm is zeroed'
            )


# --------------------
# One commander per robot: a lock that the kernel frees at any end of its holders, and the process that stops the robot.

# One per host, for all users; independent of environment variables and private folders of services.
RUNTIME = Path('/dev/shm')
DONE = b'.'
LEAVE_S = 2.0
ENDING = threading.Event()  # set once this process was asked to end


def give_up_when_ending() -> None:
    """Raise DeviceError once this process was asked to end; called while waiting for a robot to be ready."""
    if ENDING.is_set():
        raise DeviceError('connecting was aborted, as this process was asked to end')


def claim(resource: str, patience_s: float) -> int:
    """Return a descriptor that locks a robot by its command interface; DeviceError if another process has it.

    The lock lasts until every process that inherited the descriptor has closed it or ended; `patience_s` is for the
    guard of a process that was killed.
    """
    path = RUNTIME / f'tactile_texture_{quote(resource, safe="")[:200]}'
    flags = os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW
    try:
        with contextlib.suppress(FileExistsError):
            os.close(os.open(path, flags | os.O_CREAT | os.O_EXCL, 0o644))
        lock = os.open(path, flags)  # without O_CREAT: the kernel may refuse that for a file of another user
    except OSError as error:
        raise DeviceError(
            f"the lock '{path}' of the arm cannot be opened ({error}); see that the folder exists"
        ) from error
    try:
        lock_within(lock, patience_s)
    except BlockingIOError as error:
        raise DeviceError(
            f'another process on this machine commands the arm ({resource}), or its guard still stops it: '
            f"it holds '{path}', and fuser names the process; end it first"
        ) from error
    return lock


def lock_within(descriptor: int, patience_s: float) -> None:
    """Lock an open file; if another process holds it for longer, close it and raise BlockingIOError."""
    end_s = time.monotonic() + patience_s
    while True:
        try:
            return fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > end_s or ENDING.is_set():
                os.close(descriptor)
                raise
        time.sleep(0.02)


class GuardProcess:
    """A process at a socket whose other end only the commanding process holds; it may also hold its lock.

    The kernel closes that end at any end of the process, also by SIGKILL; a regular end is announced before. The
    socket is no stdout, so that the output of a library is no message.
    """

    def __init__(self, module: str, *arguments: str, start: Sequence[str] = (), holds: Sequence[int] = ()) -> None:
        self.line, end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.line.setblocking(False)
        with end:
            # A separate session: what ends all processes of a terminal or a launch file must not end the guard first.
            self._process = subprocess.Popen(
                [*start, sys.executable, '-m', module, str(end.fileno()), *arguments],
                pass_fds=[end.fileno(), *holds],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )

    def dismiss(self) -> None:
        """End the guard: the robot is at rest or released, or the connection is lost."""
        with contextlib.suppress(OSError, subprocess.TimeoutExpired):  # of a guard that has ended
            self.line.send(DONE)
            self._process.wait(LEAVE_S)
        self._process.kill()
        self._process.wait()
        self.line.close()


def guard_socket() -> socket.socket:
    """Return the guard's end of the socket: the first argument of its process, which no signal of a terminal ends."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    with contextlib.suppress(OSError):  # without the permission it keeps the usual priority
        os.setpriority(os.PRIO_PROCESS, 0, GUARD_NICENESS)
    return socket.socket(fileno=int(sys.argv[1]))


GUARD_NICENESS = -10  # before other load of the machine


# --------------------
# Detect free air from the force while the finger rises.


@dataclass(frozen=True)
class ZeroingParams:
    """When a finger counts as in free air; a base of the parameters of each arm that zeroes its force sensor there."""

    zero_steady_n: float = param(
        0.5, 'Change of the force that counts as none; above the noise of its sensor.', unit='N', low=0.05, high=5.0
    )


ZERO_RISE_M = 0.003  # through which a constant force proves free air; it notices contacts of zero_steady_n / 3 mm
SMOOTHING_S = 0.02  # time constant over which the force is averaged: noise is no contact


class FreeAir:
    """Detect free air, independent of the offset of the force sensor.

    In contact the force changes while the finger rises: a stiffness k times the rise. Free air is proven by a rise
    through which the force stays the same, and until the force changes again. So a contact of at least
    `steady_n / rise_m` is noticed. A force sensor that was never zeroed does not matter, as only changes count.
    """

    def __init__(self, rise_m: float, steady_n: float) -> None:
        self._rise_m = rise_m
        self._steady_n = steady_n
        self._force_n = math.nan  # smoothed
        self._time_ns = 0
        self._start: Vector | None = None  # from where the rise counts
        self._start_n = math.nan
        self.proven = False

    def presume_contact(self) -> None:
        """Discard the proof: the finger was pressed on something, or was not observed."""
        self._start = None
        self._force_n = math.nan
        self.proven = False

    def update(self, time_ns: int, position: Vector, force_n: float) -> bool:
        """Note a state of the arm in the frame of the surface, and return whether free air is proven."""
        passed_s, self._time_ns = (time_ns - self._time_ns) * 1e-9, time_ns
        if math.isfinite(self._force_n):
            force_n = self._force_n - (force_n - self._force_n) * math.expm1(-max(0.0, passed_s) / SMOOTHING_S)
        self._force_n = force_n
        start = self._start
        # Written so that NaN also counts as a change.
        if start is None or not abs(self._force_n - self._start_n) <= self._steady_n:
            self._restart(position)
        elif not self.proven:
            self._rise(start, position)
        return self.proven

    def _restart(self, position: Vector) -> None:
        self._start, self._start_n = position, self._force_n
        self.proven = False

    def _rise(self, start: Vector, position: Vector) -> None:
        """Count the rise from the lowest place; a finger that goes sideways may follow a slope."""
        x, y, z = (at - begin for at, begin in zip(position, start, strict=True))
        if z < 0.0 or math.hypot(x, y) > self._rise_m:
            self._start = position
        self.proven = z >= self._rise_m


# --------------------
# Zero a force sensor that cannot do so itself: in free air, at rest.

CALM_NS = 100_000_000  # an arm with lag may still move this long after a stop
AVERAGED_NS = 100_000_000  # of readings whose mean becomes the zero
READINGS = 200


class ForceZero:
    """Keep the reading of the sensor in free air.

    Free air is proven by a rise through which the force stays the same (`texture_exploration.arms.arm`). At rest after
    such a rise the mean of the readings becomes the new zero; any contact, and any command to press, requires a new
    rise first.
    """

    def __init__(self, steady_n: float) -> None:
        self.air = FreeAir(ZERO_RISE_M, steady_n)
        self._readings: deque[Array] = deque(maxlen=READINGS)
        self._rest_ns: int | None = None
        self.zeroed = False
        self.offset_n: Array = np.zeros(3)
        self.zeroings = 0

    def forget(self) -> None:
        """The sensor or the arm was lost for a while: discard all proofs."""
        self.zeroed = False
        self.presume_contact()

    def presume_contact(self) -> None:
        """The finger presses, or was commanded to: the next zero needs another rise."""
        self.air.presume_contact()
        self._rest_ns = None
        self._readings.clear()

    def update(self, time_ns: int, position: Vector, normal_n: float, reading_n: Array, *, moving: bool) -> None:
        """Take a reading."""
        if not self.air.update(time_ns, position, normal_n) or moving:
            self._rest_ns = None
            self._readings.clear()
            return
        if self._rest_ns is None:
            self._rest_ns = time_ns
        rested_ns = time_ns - self._rest_ns
        if rested_ns >= CALM_NS:
            self._readings.append(reading_n)
        if rested_ns >= CALM_NS + AVERAGED_NS:
            self.offset_n = np.mean(np.array(self._readings), axis=0)
            self.zeroed = True
            self.zeroings += 1
            self.presume_contact()


# --------------------
# Whether the finger is at rest, by its pose alone.

REST_NS = 200_000_000  # over which rest is decided
REST_POSES = 4  # at least
RESTING_M = 3e-5  # between the mean places of both halves of that time: slower than 0.3 mm/s, above the noise of a pose


class RestWatch:
    """Detect rest by the pose since the last `forget`: an arm is not left before."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """The arm was commanded to move, or no pose arrived for a while."""
        self.at_rest = False
        self._poses: deque[tuple[int, Vector]] = deque()

    def update(self, now_ns: int, position: Vector) -> None:
        """Take a new pose, by the time of its arrival."""
        if self.at_rest:
            return
        poses = self._poses
        poses.append((now_ns, position))
        if now_ns - poses[0][0] < REST_NS:
            return
        half_ns = now_ns - REST_NS // 2
        halves = [[at for time_ns, at in poses if (time_ns > half_ns) is late] for late in (False, True)]
        while now_ns - poses[0][0] >= REST_NS:
            poses.popleft()
        if min(map(len, halves)) >= REST_POSES // 2:
            before, after = (np.mean(np.array(half), axis=0) for half in halves)
            self.at_rest = bool(np.linalg.norm(after - before) <= RESTING_M)
