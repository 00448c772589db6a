# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A UR controller emulated at the wire: RTDE, dashboard, program, and a robot in contact."""

from __future__ import annotations

import dataclasses
import enum
import itertools
import json
import math
import os
import re
import selectors
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from texture_core.config import param
from texture_core.errors import DeviceError, TextureError
from texture_core.types import Array, FingerSender, FingerState, loopback_address, rotation_matrix
from texture_simulation.devices.rails import FingerPipeParams
from texture_simulation.devices.twist_controller import TouchedSurfaceParams, coulomb_n

# --------------------
# What moves the emulated robot.
#
# Poses and velocities are arrays (6,): x, y, z in m, then a rotation vector in rad. Turning is only sketched: rotation
# vectors change component by component, and 1 rad counts as 1 m.


class SpeedMove:
    """Gain a velocity and keep it (speedl); `done` when it will not move any further by itself."""

    def __init__(self, wanted: Array, acceleration: float) -> None:
        self.done = False
        self._wanted = wanted
        self._acceleration = acceleration

    def velocity(self, velocity: Array, step_s: float) -> Array:
        """Return the velocity of the next step, (6,)."""
        led = approach(velocity, self._wanted, self._acceleration * step_s)
        self.done = not led.any() and not self._wanted.any()
        return led


def stop_move(deceleration: float) -> SpeedMove:
    """Return the loss of all speed (stopl)."""
    return SpeedMove(np.zeros(6), deceleration)


def approach(now: Array, wanted: Array, step: float) -> Array:
    """Return `now` led towards `wanted` by at most `step`."""
    offset = wanted - now
    distance = math.sqrt(offset @ offset)
    return wanted if distance <= step else now + step / distance * offset


# --------------------
# The registers through which a program on the controller and the world outside talk.

COUNT = 48


class Registers:
    """Input and output registers of integers and doubles.

    `last_command_s` is when the command register last came, and `excused_s` how much of the silence since then the
    client is not charged with.
    """

    def __init__(self) -> None:
        self.int_in = np.zeros(COUNT, dtype=np.int64)
        self.double_in = np.zeros(COUNT)
        self.int_out = np.zeros(COUNT, dtype=np.int64)
        self.double_out = np.zeros(COUNT)
        self.last_command_s = 0.0
        self.excused_s = 0.0

    def heard(self, time_s: float) -> None:
        """Take note that the command register came."""
        self.last_command_s, self.excused_s = time_s, 0.0

    def from_first(self, first: int) -> Registers:
        """Return the registers from a first one on, counted from there: what is written to them is written here."""
        shifted = Registers()
        for name in ('int_in', 'double_in', 'int_out', 'double_out'):
            setattr(shifted, name, getattr(self, name)[first:])
        return shifted


# --------------------
# Facts about UR controllers and about the control script of ur-rtde.
#
# Sources: the RTDE and dashboard guides of Universal Robots; the source of ur-rtde 1.6.5.

RTDE_PORT = 30004
DASHBOARD_PORT = 29999
SCRIPT_PORT = 30003


class ControllerVersion(NamedTuple):
    """What depends on the version of the control software."""

    numbers: tuple[int, int, int, int]
    rate_hz: float
    dashboard: bool  # PolyScope X, version 10, has none


VERSIONS: Mapping[str, ControllerVersion] = {
    '3.15': ControllerVersion((3, 15, 8, 0), 125.0, True),
    '5.12': ControllerVersion((5, 12, 0, 0), 500.0, True),
    '5.23': ControllerVersion((5, 23, 0, 0), 500.0, True),
    '10.10': ControllerVersion((10, 10, 0, 0), 500.0, False),
}


class RtdeMessage(enum.IntEnum):
    """Types of RTDE messages."""

    REQUEST_VERSION = 86
    CONTROLLER_VERSION = 118
    TEXT = 77
    DATA = 85
    SETUP_OUTPUTS = 79
    SETUP_INPUTS = 73
    START = 83
    PAUSE = 80


# RTDE type -> format of `struct`, big-endian
FORMATS: Mapping[str, str] = {
    'BOOL': 'B',
    'UINT8': 'B',
    'UINT32': 'I',
    'UINT64': 'Q',
    'INT32': 'i',
    'DOUBLE': 'd',
    'VECTOR3D': '3d',
    'VECTOR6D': '6d',
    'VECTOR6INT32': '6i',
    'VECTOR6UINT32': '6I',
}


class SafetyMode(enum.IntEnum):
    """RTDE variable safety_mode."""

    NORMAL = 1
    PROTECTIVE_STOP = 3


SAFETY_BITS: Mapping[SafetyMode, int] = {SafetyMode.NORMAL: 1 << 0, SafetyMode.PROTECTIVE_STOP: 1 << 2}
ROBOT_RUNNING = 7  # robot_mode
PROGRAM_STOPPED, PROGRAM_PLAYING, PROGRAM_PAUSED = 1, 2, 4  # runtime_state
CONTROL_SCRIPT = 'rtde_control'  # how the control script of ur-rtde calls itself
POWER_ON_BIT, PROGRAM_RUNNING_BIT = 1 << 0, 1 << 1  # robot_status_bits


class ScriptCommand(enum.IntEnum):
    """Numbers in input_int_register_0 that the control script obeys, as far as the arm sends them."""

    NONE = 0
    FORCE_MODE = 6
    FORCE_MODE_STOP = 7
    ZERO_FT_SENSOR = 8
    SPEED_L = 10
    SPEED_STOP = 15
    GET_STEPTIME = 26
    SET_WATCHDOG = 35
    STOP_SCRIPT = 255


# The script processes these in every cycle and stays ready; the client does not wait for them.
REALTIME = frozenset({6, 9, 10, 11, 24, 25, 26, 27, 38, 58, 66, 67, 68, 69, 70, 71})
# What the robot does for some time; a real controller may acknowledge it late.
SLOW = frozenset({ScriptCommand.SPEED_STOP, ScriptCommand.FORCE_MODE_STOP, ScriptCommand.ZERO_FT_SENSOR})
READY, DONE = 1, 2  # output_int_register_0


# --------------------
# What can be chosen about the emulated controller.


@dataclass(frozen=True)
class UrControllerParams(FingerPipeParams, TouchedSurfaceParams):
    """The emulated controller, its robot and the surface under the finger."""

    ip: str = param(
        '127.0.0.2',
        'Loopback address to listen on, as the ports are fixed; or a path, which stands for one of its own.',
    )
    version: str = param('5.12', 'Version of the emulated control software.', choices=tuple(VERSIONS))
    stiffness_n_m: float = param(
        2000.0,
        'Stiffness of finger and surface in contact; 0 removes the surface.',
        unit='N/m',
        low=0.0,
        high=20000.0,
    )
    friction: float = param(
        0.5, 'Coefficient of Coulomb friction; larger values drag the finger more.', low=0.0, high=3.0
    )
    force_noise_n: float = param(0.02, 'Standard deviation of the noise of the force sensor.', unit='N', low=0.0)
    stop_force_n: float = param(
        100.0, 'Force above which the controller goes into a protective stop.', unit='N', low=1.0
    )
    unlock_delay_s: float = param(
        5.0, 'How long a protective stop cannot be unlocked after it occurred.', unit='s', low=0.0, high=60.0
    )


# --------------------
# The surface under the robot's finger: a level plane, elastic and with friction; a wall.


UP = np.array([0.0, 0.0, 1.0])


class ContactPlane:
    """Contact force on a finger at a position and velocity, in the base frame of the robot."""

    def __init__(self, params: UrControllerParams) -> None:
        self._params = params
        self.drop_m = 0.0
        self.friction = params.friction
        self.origin = np.array([params.surface_x_m, params.surface_y_m, params.surface_z_m])

    def force_n(self, position_m: Array, velocity_m_s: Array) -> Array:
        """Return the force of the surface on the finger."""
        behind_m = max(0.0, float(position_m[0] - self.origin[0]) - self._params.wall_m)
        wall: Array = np.array([-self._params.wall_stiffness_n_m * behind_m, 0.0, 0.0])
        depth_m = float(self.origin[2] - self.drop_m - position_m[2])
        pressing = self._params.stiffness_n_m * max(0.0, depth_m)
        if pressing == 0.0:
            return wall
        return wall + pressing * UP + coulomb_n(self.friction, pressing, UP, velocity_m_s)


# --------------------
# The emulated controller as a process of its own, for demonstrations and tests.
#
# It cannot run in the process of its client: the constructors of ur-rtde hold Python's global lock until they are
# answered.

START_S = 20.0
ANSWER_S = 10.0


class ControllerProcess:
    """Runs from `start` to `stop`, or as a context."""

    def __init__(self, params: UrControllerParams) -> None:
        self.params = dataclasses.replace(params, ip=loopback_address(params.ip))
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> ControllerProcess:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self) -> None:
        """Return when its ports are open."""
        command = [sys.executable, '-m', 'texture_simulation.devices.ur', json.dumps(dataclasses.asdict(self.params))]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C is for the owner; the process sees that it has ended
        )
        if not self._ready(self._process):
            self._process.kill()
            _, stderr = self._process.communicate()
            raise DeviceError(stderr.strip() or 'the emulated UR controller did not start')

    @property
    def running(self) -> bool:
        """Whether it is there."""
        return self._process is not None and self._process.poll() is None

    @property
    def pid(self) -> int:
        """Number of the process."""
        assert self._process is not None
        return self._process.pid

    def freeze(self) -> None:
        """Let it hang."""
        os.kill(self.pid, signal.SIGSTOP)

    def resume(self) -> None:
        """Let it go on."""
        os.kill(self.pid, signal.SIGCONT)

    def stop(self) -> None:
        """Kill it; may be called twice."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def ask(self, line: str) -> str:
        """Return the answer of its dashboard."""
        with socket.create_connection((self.params.ip, DASHBOARD_PORT), ANSWER_S) as connection:
            lines = connection.makefile('rw', encoding='utf-8')
            lines.readline()  # the banner
            lines.write(line + '\n')
            lines.flush()
            return lines.readline().strip()

    @staticmethod
    def _ready(process: subprocess.Popen[str]) -> bool:
        assert process.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            return bool(selector.select(START_S)) and process.stdout.readline() == 'ready\n'


# --------------------
# The emulated robot: a finger that follows motions exactly, complies under force control, and measures forces.

# Force control of the emulated robot: speed per force error, and the lag of the arm behind it. With 2 kN/m the error
# fades in about 0.1 s, which is of the order of a real arm's.
ADMITTANCE_M_S_N = 0.01
LAG_S = 0.01
HALT = 20.0  # deceleration of a protective stop, m/s²
# The sensor drifts apart on all axes when it is not zeroed.
OFFSET_DIRECTION = np.array([0.4, -0.3, 0.866, 0.0, 0.0, 0.0])


class ForceMode(NamedTuple):
    """Which axes of a frame yield (selection, (6,)), to which wrench, and how fast at most; see force_mode in URScript.

    `axes` is (3, 3), the axes of the frame as columns, in the base frame. The wrench is what the robot does to its
    surroundings.
    """

    axes: Array
    selection: Array
    wrench: Array
    limits: Array


class EmulatedRobot:
    """Physics of the robot, step by step.

    Attributes
    ----------
    pose, velocity, force : (6,)
        Of the fingertip in the base frame: m and rad, m/s, N. The force is that of the surroundings on the robot, as
        the sensor shows it, with offset and noise.
    motion, force_mode
        What moves it; set from outside.
    speed_share
        Position of the speed slider on the pendant, 0 to 1; the force mode does not obey it.
    """

    def __init__(self, params: UrControllerParams, rng: np.random.Generator) -> None:
        self.surface = ContactPlane(params)
        x, y, z = self.surface.origin
        self.pose: Array = np.array([x, y, z + params.start_height_m, 0.0, 0.0, 0.0])
        self.velocity: Array = np.zeros(6)
        self.speed_share = 1.0
        self._unslowed: Array = np.zeros(6)  # velocity as it would be without the slider
        self.force: Array = np.zeros(6)
        self.motion = stop_move(HALT)
        self.force_mode: ForceMode | None = None
        self._offset: Array = params.force_offset_n * OFFSET_DIRECTION
        self._noise_n = params.force_noise_n
        self._rng = rng
        self._contact: Array = np.zeros(3)
        self._compliant_m_s: Array = np.zeros(3)  # speed of the yielding axes in the frame of the force mode

    @property
    def pressing_n(self) -> float:
        """The true force of the surface on the finger, along the vertical."""
        return float(self._contact[2])

    def step(self, step_s: float) -> None:
        """Move for one step."""
        led = velocity = self.motion.velocity(self._unslowed, step_s)
        if self.force_mode is not None:
            velocity = self._comply(velocity, self.force_mode, step_s)
            led = _stiff(led, self.force_mode)
        self._unslowed = velocity
        velocity = velocity - (1.0 - self.speed_share) * led
        self.velocity = velocity
        self.pose = self.pose + velocity * step_s
        self._contact = self.surface.force_n(self.pose[:3], velocity[:3])
        self.force = self._offset + self._noise_n * self._rng.standard_normal(6)
        self.force[:3] += self._contact

    def zero_force(self) -> None:
        """Take what the sensor shows for nothing from now on."""
        self._offset = np.zeros(6)
        self._offset[:3] = -self._contact

    def end_force_mode(self) -> None:
        """Yield no longer."""
        self.force_mode = None
        self._compliant_m_s = np.zeros(3)

    def halt(self) -> None:
        """Stop hard, whatever it was doing."""
        self.end_force_mode()
        self.motion = stop_move(HALT)

    def _comply(self, velocity: Array, mode: ForceMode, step_s: float) -> Array:
        """Replace the velocity along yielding axes by one that brings the force to what is wanted."""
        error = mode.wrench[:3] + mode.axes.T @ self.force[:3]
        wanted = np.clip(ADMITTANCE_M_S_N * error, -mode.limits[:3], mode.limits[:3])
        self._compliant_m_s = self._compliant_m_s - (wanted - self._compliant_m_s) * math.expm1(-step_s / LAG_S)
        along = mode.axes.T @ velocity[:3]
        along = np.where(mode.selection[:3] > 0, self._compliant_m_s, along)
        turning = np.where(mode.selection[3:] > 0, 0.0, velocity[3:])
        return np.concatenate([mode.axes @ along, turning])


def _stiff(velocity: Array, mode: ForceMode) -> Array:
    """Return the part of a velocity along the axes that do not yield, (6,)."""
    along = np.where(mode.selection[:3] > 0, 0.0, mode.axes.T @ velocity[:3])
    return np.concatenate([mode.axes @ along, velocity[3:]])


# --------------------
# What the control script of ur-rtde does on the controller, without being URScript.
#
# The script looks at its command register, input_int_register_0 or 24, once per cycle. Realtime commands are obeyed in
# every cycle in which they stand there; others once, until the client has written 0 in between. A command that is
# overwritten within a cycle is lost, as on the real controller.

FORCE_MODE_STOP = 10.0  # m/s², as in the script
Steps = Iterator[None]


class ControlProgram:
    """The running script; `cycles` is advanced once per cycle of the controller and ends with the script."""

    def __init__(self, robot: EmulatedRobot, registers: Registers, host: EmulatedController, step_s: float) -> None:
        self._robot = robot
        self._registers = registers
        self._host = host
        self._step_s = step_s
        self._unknown: set[int] = set()

    def cycles(self) -> Steps:
        """Obey until told to end; one item per cycle."""
        registers = self._registers
        executed = False
        registers.int_out[0] = READY
        while (number := int(registers.int_in[0])) != ScriptCommand.STOP_SCRIPT:
            if number in REALTIME:
                yield from self._execute(number)
                registers.int_out[0] = READY
            elif number == ScriptCommand.NONE:
                executed = False
                registers.int_out[0] = READY
            elif not executed:
                yield from self._execute(number)
                if number in SLOW:
                    yield from self._wait(self._host.acknowledge_s)
                registers.int_out[0] = DONE
                executed = True
            yield

    def _wait(self, seconds: float) -> Steps:
        for _ in range(round(seconds / self._step_s)):
            yield

    def _execute(self, number: int) -> Steps:
        """Do one command with the arguments in its registers: d are doubles, i integers."""
        registers, robot = self._registers, self._robot
        doubles = registers.double_in.copy()
        if number == ScriptCommand.SPEED_L:  # d0-5 velocity, d6 acceleration
            robot.motion = SpeedMove(doubles[:6], doubles[6])
        elif number == ScriptCommand.SPEED_STOP:  # d0 deceleration
            yield from self._stop(doubles[0])
        elif number == ScriptCommand.FORCE_MODE:  # i2-7 selection, d0-5 frame, d6-11 wrench, d12-17 limits; type 2 only
            axes, selection = rotation_matrix(doubles[3:6]), registers.int_in[2:8].astype(float)
            robot.force_mode = ForceMode(axes, selection, doubles[6:12], doubles[12:18])
        elif number == ScriptCommand.FORCE_MODE_STOP:
            speeding = robot.motion
            robot.end_force_mode()
            yield from self._stop(FORCE_MODE_STOP)
            if not speeding.done:  # a speed goes on afterwards: its thread lives
                robot.motion = speeding
        elif number == ScriptCommand.ZERO_FT_SENSOR:
            robot.zero_force()
        elif number == ScriptCommand.GET_STEPTIME:
            registers.double_out[0] = self._step_s
        elif number == ScriptCommand.SET_WATCHDOG:  # d0 lowest frequency
            self._host.set_watchdog(doubles[0])
        elif number not in self._unknown:
            self._unknown.add(number)
            print(f'emulated UR controller: command {number} does nothing here', file=sys.stderr)

    def _stop(self, deceleration: float) -> Steps:
        self._robot.motion = motion = stop_move(deceleration)
        while not motion.done:
            yield


# --------------------
# The emulated controller without its network: program, robot, safety, in steps of its own time.

STARTING_S = 0.05  # between the upload of a program and its start
STOP_DECELERATION = 5.0  # of a program that ends, m/s²
ENDED = object()
MAX_EXCUSED_S = 0.1  # for which the watchdog waits longer because this process was held up
# So the control script of ur-rtde says it; the client puts the number behind a comment.
FIRST_REGISTER = re.compile(r'reg_offset_int\s*=\D{0,60}?(\d+)')


class EmulatedController:
    """A controller that knows no clock: each `tick` is one cycle of `step_s`."""

    def __init__(self, params: UrControllerParams, rng: np.random.Generator) -> None:
        self.version = VERSIONS[params.version]
        self.step_s = 1.0 / self.version.rate_hz
        self.ticks = 0
        self.registers = Registers()
        self.first_register = 0  # that the program uses
        self.robot = EmulatedRobot(params, rng)
        self.safety = SafetyMode.NORMAL
        self.acknowledge_s = 0.0  # see `Host`; set from outside
        self.program_name = CONTROL_SCRIPT  # of the one that runs, or ran last
        self.loaded = ''  # name of the program that `play` starts
        self.paused = False
        self._params = params
        self._starts_s: float | None = None  # when an uploaded program starts
        self._program: Iterator[None] | None = None
        self._watchdog_s = 0.0  # longest silence, 0: no watchdog
        self._stopped_s = 0.0  # when the protective stop happened

    @property
    def time_s(self) -> float:
        """Time since the controller was switched on."""
        return self.ticks * self.step_s

    @property
    def playing(self) -> bool:
        """Whether a program runs."""
        return self._program is not None and not self.paused

    @property
    def state(self) -> str:
        """State of the program, as the dashboard names it."""
        return 'PAUSED' if self.paused else 'PLAYING' if self.playing else 'STOPPED'

    def tick(self) -> None:
        """Do one cycle."""
        self.ticks += 1
        if self._starts_s is not None and self.time_s >= self._starts_s:
            self._start_program()
        if self._watchdog_s and self.time_s - self.registers.last_command_s > self._watchdog_s:
            self.stop_program()
        if self._program is not None and not self.paused and next(self._program, ENDED) is ENDED:
            self.stop_program()
        self.robot.step(self.step_s)
        if np.linalg.norm(self.robot.force[:3]) > self._params.stop_force_n:
            self.protective_stop()

    def catch_up(self) -> None:
        """Do a cycle that should have been done before; it is not the client who was silent in it.

        A client that is heard no more gains `MAX_EXCUSED_S` at most by that: a moving arm needs its watchdog.
        """
        registers = self.registers
        if registers.excused_s < MAX_EXCUSED_S:
            registers.excused_s += self.step_s
            registers.last_command_s += self.step_s
        self.tick()

    def upload(self, script: str) -> None:
        """Take over a program, which starts a little later; in a protective stop none starts."""
        if 'rtde_control' in script and self.safety is SafetyMode.NORMAL:
            self.stop_program()
            self._starts_s = self.time_s + STARTING_S
            first = FIRST_REGISTER.search(script)
            self.first_register = int(first.group(1)) if first else 0

    def load(self, name: str) -> str:
        """Take note of what `play` runs, and return the answer of the dashboard."""
        self.loaded = name
        return f'Loading program: {name}'

    def play(self) -> bool:
        """Run the loaded program, which takes no commands and does nothing; return whether there is one."""
        if self.loaded:
            self.stop_program()
            self._program, self.program_name = itertools.repeat(None), self.loaded
        return bool(self.loaded)

    def pause(self) -> None:
        """Let the program wait."""
        self.paused = self._program is not None

    def _start_program(self) -> None:
        self._starts_s = None
        self.program_name = CONTROL_SCRIPT
        self._program = ControlProgram(
            self.robot, self.registers.from_first(self.first_register), self, self.step_s
        ).cycles()

    def stop_program(self) -> None:
        """End the program, and with it every motion and the watchdog."""
        if self._program is not None:
            self.robot.end_force_mode()
            self.robot.motion = stop_move(STOP_DECELERATION)
        self._program = None
        self.paused = False
        self._starts_s = None
        self._watchdog_s = 0.0

    def set_watchdog(self, min_frequency_hz: float) -> None:
        """Stop the program when input_int_register_0 comes less often."""
        self._watchdog_s = 1.0 / min_frequency_hz
        self.registers.heard(self.time_s)

    def protective_stop(self) -> None:
        """Stop hard; the program ends."""
        if self.safety is SafetyMode.NORMAL:
            self.safety = SafetyMode.PROTECTIVE_STOP
            self._stopped_s = self.time_s
            self.stop_program()
            self.robot.halt()

    def unlock(self) -> bool:
        """End a protective stop; return whether it was old enough for that."""
        if self.time_s - self._stopped_s < self._params.unlock_delay_s:
            return False
        self.safety = SafetyMode.NORMAL
        return True


# --------------------
# The dashboard server: one line asks, one line answers.
#
# Beside the real commands it obeys the fault switches of the emulator: `emulate protective stop`,
# `emulate offline SECONDS`, `emulate slow SECONDS`, which lets stops, the end of force control and zeroing be
# acknowledged so much later, `emulate drop METRES`, which lowers the surface under the finger by so much, and
# `emulate friction COEFFICIENT`, as of another sample under the finger.
# `load NAME` and `play` start a program of somebody else, which takes no commands.

BANNER = b'Connected: Universal Robots Dashboard Server\n'
SERIAL_NUMBER = '20205500001'
TOO_EARLY = (
    'Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before unlocking'
)


class Session:
    """One conversation with one client; by itself it says nothing."""

    def greeting(self) -> bytes:
        """Return what the server says first."""
        return b''

    def receive(self, data: bytes) -> bytes:
        """Take over what came; return the answer."""
        raise NotImplementedError

    def package(self) -> bytes:
        """Return what is sent unasked in this cycle."""
        return b''

    def close(self) -> None:
        """Leave nothing behind."""


FIXED_ANSWERS: Mapping[str, str] = {
    'get serial number': SERIAL_NUMBER,
    'get robot model': 'UR5',
    'is in remote control': 'true',
    'robotmode': 'Robotmode: RUNNING',
    'close safety popup': 'closing safety popup',
    'quit': 'Disconnected',
}


class DashboardSession(Session):
    """The conversation on the dashboard."""

    def __init__(
        self, controller: EmulatedController, go_offline: Callable[[float], None], go_silent: Callable[[float], None]
    ) -> None:
        self._controller = controller
        self._received = b''
        robot, plane = controller.robot, controller.robot.surface
        numbers = '.'.join(str(number) for number in controller.version.numbers)
        # Command: its answer, or what does it and returns the answer.
        self._answers: Mapping[str, str | Callable[[str], str]] = {
            **FIXED_ANSWERS,
            'polyscopeversion': f'URSoftware {numbers} (emulated)',
            'safetystatus': lambda _: f'Safetystatus: {controller.safety.name}',
            'safetymode': lambda _: f'Safetymode: {controller.safety.name}',
            'running': lambda _: f'Program running: {str(controller.playing).lower()}',
            'programstate': lambda _: f'{controller.state} {controller.program_name}',
            'load': controller.load,
            'play': lambda _: 'Starting program' if controller.play() else 'Failed to execute: play',
            'stop': partial(_do, controller.stop_program, 'Stopped'),
            'pause': partial(_do, controller.pause, 'Pausing program'),
            'unlock protective stop': lambda _: 'Protective stop releasing' if controller.unlock() else TOO_EARLY,
            'emulate protective stop': partial(_do, controller.protective_stop, 'Stopped'),
        }
        # Fault switch: what takes the number, and its unit.
        self._switches: Mapping[str, tuple[Callable[[float], None], str]] = {
            'emulate offline': (go_offline, 'seconds'),
            'emulate silence': (go_silent, 'seconds'),
            'emulate slow': (partial(setattr, controller, 'acknowledge_s'), 'seconds'),
            'emulate speed': (partial(setattr, robot, 'speed_share'), 'shares'),
            'emulate drop': (partial(setattr, plane, 'drop_m'), 'metres'),
            'emulate friction': (partial(setattr, plane, 'friction'), 'newtons per N'),
        }

    def greeting(self) -> bytes:
        """Return the line with which the server begins."""
        return BANNER

    def receive(self, data: bytes) -> bytes:
        """Take over what came; return the answers."""
        *lines, self._received = (self._received + data).split(b'\n')
        return b''.join(self._answer(line.decode('utf-8', 'replace').strip()).encode() + b'\n' for line in lines)

    def _answer(self, line: str) -> str:
        for command, answer in self._answers.items():
            if line.lower() == command or line.lower().startswith(command + ' '):
                return answer if isinstance(answer, str) else answer(line[len(command) :].strip())
        for command, (use, unit) in self._switches.items():
            if line.lower().startswith(command):
                return _set(use, unit, line[len(command) :].strip())
        return f'could not understand: {line}'


def _do(action: Callable[[], None], answer: str, _argument: str) -> str:
    action()
    return answer


def _set(use: Callable[[float], None], unit: str, argument: str) -> str:
    """Set what a fault switch sets by a number, and return the answer."""
    try:
        number = float(argument)
    except ValueError:
        number = math.nan
    if not 0 <= number < math.inf:
        return f"came '{argument}'; a number of {unit} is needed"
    use(number)
    return f'set to {number:g} {unit}'


# --------------------
# The port that takes programs in URScript.

LONGEST_SCRIPT = 1_000_000
END = b'\nend\n'


class ScriptSession(Session):
    """The conversation with one client, who sends programs and gets no answer."""

    def __init__(self, controller: EmulatedController) -> None:
        self._controller = controller
        self._received = b''

    def receive(self, data: bytes) -> bytes:
        """Start a program once its last line is there."""
        self._received = (self._received + data)[-LONGEST_SCRIPT:]
        if self._received.endswith(END):
            self._controller.upload(self._received.decode('utf-8', 'replace'))
            self._received = b''
        return b''


# --------------------
# The variables that RTDE offers: name, type and how to read it.
#
# The robot has no joints: joint variables stand still at a usual pose. What no client of the suite looks at is
# constant.

Getter = Callable[[EmulatedController], Sequence[Any]]
Variable = tuple[str, Getter]

JOINTS = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
JOINT_RUNNING = 253
STATES = {'PAUSED': PROGRAM_PAUSED, 'PLAYING': PROGRAM_PLAYING, 'STOPPED': PROGRAM_STOPPED}
ZEROS = (0.0,) * 6
# What stands still: type, values, and the names that have them.
CONSTANTS: Sequence[tuple[str, Sequence[float], str]] = (
    ('INT32', (ROBOT_RUNNING,), 'robot_mode'),
    ('VECTOR6INT32', (JOINT_RUNNING,) * 6, 'joint_mode'),
    ('VECTOR3D', (0.0, 0.0, -9.81), 'actual_tool_accelerometer'),
    ('VECTOR3D', ZEROS[:3], 'payload_cog'),
    ('VECTOR6D', JOINTS, 'target_q actual_q'),
    (
        'VECTOR6D',
        ZEROS,
        'payload_inertia target_qd target_qdd target_current target_moment actual_qd actual_current '
        'actual_current_as_torque joint_control_output',
    ),
    ('VECTOR6D', (30.0,) * 6, 'joint_temperatures'),
    ('VECTOR6D', (48.0,) * 6, 'actual_joint_voltage'),
    ('UINT64', (0,), 'actual_digital_input_bits actual_digital_output_bits'),
    (
        'DOUBLE',
        (0.0,),
        'payload actual_momentum standard_analog_input0 standard_analog_input1 standard_analog_output0 '
        'standard_analog_output1',
    ),
    ('DOUBLE', (1.0,), 'speed_scaling target_speed_fraction actual_robot_current'),
    ('DOUBLE', (48.0,), 'actual_main_voltage actual_robot_voltage'),
    ('DOUBLE', (0.1,), 'actual_execution_time'),
)


def _constant(values: Sequence[float]) -> Getter:
    return lambda _controller: values


def _register(name: str, index: int) -> Getter:
    return lambda controller: (getattr(controller.registers, name)[index],)


def _of_robot(name: str) -> Variable:
    return 'VECTOR6D', lambda controller: getattr(controller.robot, name).tolist()


OUTPUTS: Mapping[str, Variable] = {
    **{name: (kind, _constant(values)) for kind, values, names in CONSTANTS for name in names.split()},
    'timestamp': ('DOUBLE', lambda controller: (controller.time_s,)),
    **dict.fromkeys(('actual_TCP_pose', 'target_TCP_pose'), _of_robot('pose')),
    **dict.fromkeys(('actual_TCP_speed', 'target_TCP_speed'), _of_robot('velocity')),
    **dict.fromkeys(('actual_TCP_force', 'ft_raw_wrench'), _of_robot('force')),
    'safety_mode': ('INT32', lambda controller: (int(controller.safety),)),
    'safety_status_bits': ('UINT32', lambda controller: (SAFETY_BITS[controller.safety],)),
    'robot_status_bits': ('UINT32', lambda controller: (POWER_ON_BIT | PROGRAM_RUNNING_BIT * controller.playing,)),
    'runtime_state': ('UINT32', lambda controller: (STATES[controller.state],)),
    **{f'output_int_register_{index}': ('INT32', _register('int_out', index)) for index in range(COUNT)},
    **{f'output_double_register_{index}': ('DOUBLE', _register('double_out', index)) for index in range(COUNT)},
}

Setter = Callable[[EmulatedController, Sequence[Any]], None]


def _write(name: str, index: int) -> Setter:
    def setter(controller: EmulatedController, values: Sequence[Any]) -> None:
        getattr(controller.registers, name)[index] = values[0]
        if name == 'int_in' and index == controller.first_register:  # the watchdog watches that of the program
            controller.registers.heard(controller.time_s)

    return setter


INPUTS: Mapping[str, tuple[str, Setter]] = {
    **{f'input_int_register_{index}': ('INT32', _write('int_in', index)) for index in range(COUNT)},
    **{f'input_double_register_{index}': ('DOUBLE', _write('double_in', index)) for index in range(COUNT)},
    'external_force_torque': ('VECTOR6D', lambda _controller, _values: None),
}


# --------------------
# RTDE, protocol version 2, as the controller speaks it: one session per connection.

HEADER = struct.Struct('>HB')
PROTOCOL_VERSION = 2
OUTPUT_RECIPE = 1


class RtdeSession(Session):
    """The conversation with one client; `package` is what it gets each cycle once it has asked for it."""

    def __init__(self, controller: EmulatedController, claims: dict[str, RtdeSession]) -> None:
        self._controller = controller
        self._claims = claims
        self._received = b''
        self._output_format = struct.Struct('>')
        self._getters: list[Getter] = []
        self._every_s = controller.step_s
        self._due_s = 0.0
        self._started = False
        self._inputs: list[list[str]] = []

    def receive(self, data: bytes) -> bytes:
        """Take over what came; return the answers."""
        self._received += data
        answers = b''
        while (packet := self._take_packet()) is not None:
            kind, payload = packet
            answer = self._answer(kind, payload)
            answers += _message(kind, answer) if answer is not None else b''
        return answers

    def _take_packet(self) -> tuple[int, bytes] | None:
        """Return the kind and the content of the next packet; None if it is not complete."""
        if len(self._received) < HEADER.size:
            return None
        size, kind = HEADER.unpack_from(self._received)
        if size < HEADER.size:
            self._received = b''
        if len(self._received) < size or size < HEADER.size:
            return None
        payload, self._received = self._received[HEADER.size : size], self._received[size:]
        return kind, payload

    def close(self) -> None:
        """Give the inputs free."""
        for name in [name for name, owner in self._claims.items() if owner is self]:
            del self._claims[name]

    def package(self) -> bytes:
        """Return the data message if one is due, else nothing."""
        controller = self._controller
        if not self._started or controller.time_s < self._due_s - 0.5 * controller.step_s:
            return b''
        self._due_s = max(self._due_s + self._every_s, controller.time_s)
        values = [value for getter in self._getters for value in getter(controller)]
        return _message(RtdeMessage.DATA, bytes([OUTPUT_RECIPE]) + self._output_format.pack(*values))

    def _answer(self, kind: int, payload: bytes) -> bytes | None:
        if kind == RtdeMessage.REQUEST_VERSION:
            return bytes([payload == struct.pack('>H', PROTOCOL_VERSION)])
        if kind == RtdeMessage.CONTROLLER_VERSION:
            return struct.pack('>4I', *self._controller.version.numbers)
        if kind == RtdeMessage.SETUP_OUTPUTS:
            return self._on_setup_outputs(payload)
        if kind == RtdeMessage.SETUP_INPUTS:
            return self._on_setup_inputs(payload)
        if kind in (RtdeMessage.START, RtdeMessage.PAUSE):
            self._started = kind == RtdeMessage.START
            return b'\x01'
        if kind == RtdeMessage.DATA and payload and 1 <= payload[0] <= len(self._inputs):
            write_inputs(self._controller, self._inputs[payload[0] - 1], payload[1:])
        return None

    def _on_setup_outputs(self, payload: bytes) -> bytes | None:
        if len(payload) < 8:
            return None
        (frequency_hz,) = struct.unpack_from('>d', payload)
        self._every_s = max(1.0 / frequency_hz if frequency_hz > 0 else 0.0, self._controller.step_s)
        names = _names(payload[8:])
        types = [OUTPUTS[name][0] if name in OUTPUTS else 'NOT_FOUND' for name in names]
        if 'NOT_FOUND' not in types:
            self._getters = [OUTPUTS[name][1] for name in names]
            self._output_format = _format(types)
        return bytes([OUTPUT_RECIPE]) + ','.join(types).encode()

    def _on_setup_inputs(self, payload: bytes) -> bytes:
        names = _names(payload)
        types = [self._input_type(name) for name in names]
        if not {'NOT_FOUND', 'IN_USE'} & set(types):
            self._claims.update(dict.fromkeys(names, self))
            self._inputs.append(names)
        return bytes([len(self._inputs)]) + ','.join(types).encode()

    def _input_type(self, name: str) -> str:
        if name not in INPUTS:
            return 'NOT_FOUND'
        return INPUTS[name][0] if self._claims.get(name, self) is self else 'IN_USE'


def write_inputs(controller: EmulatedController, names: Sequence[str], data: bytes) -> None:
    """Write the values in `data` to inputs; what has another length is not taken."""
    if len(data) != _format([INPUTS[name][0] for name in names]).size:
        return
    start = 0
    for name in names:
        kind, setter = INPUTS[name]
        fields = struct.Struct('>' + FORMATS[kind])
        setter(controller, fields.unpack_from(data, start))
        start += fields.size


def _message(kind: int, payload: bytes) -> bytes:
    return HEADER.pack(HEADER.size + len(payload), kind) + payload


def _names(data: bytes) -> list[str]:
    """Return the names of a list, which may end with a comma."""
    return [name for name in data.decode('ascii', 'replace').split(',') if name]


def _format(types: list[str]) -> struct.Struct:
    return struct.Struct('>' + ''.join(FORMATS[name] for name in types))


# --------------------
# The network of the emulated controller, and its clock.
#
# One thread: it sleeps until the next cycle is due, looks what has come, lets the controller do its cycles, and
# sends.

# That are made up for; a process that was held up for longer has lost the time. Meanwhile it hears no commands, and no
# real controller moves for longer than its watchdog waits without one.
MAX_MISSED_CYCLES = 50
CHUNK = 65536


class Server:
    """Serve a controller on its ports."""

    def __init__(self, controller: EmulatedController, ip: str, finger_pipe: str) -> None:
        self._controller = controller
        self._ip = ip
        claims: dict[str, RtdeSession] = {}
        self._kinds: dict[int, Callable[[], Session]] = {
            RTDE_PORT: partial(RtdeSession, controller, claims),
            SCRIPT_PORT: partial(ScriptSession, controller),
        }
        if controller.version.dashboard:
            self._kinds[DASHBOARD_PORT] = partial(DashboardSession, controller, self._go_offline, self._go_silent)
        self._selector = selectors.DefaultSelector()
        self._listeners: list[socket.socket] = []
        self._sessions: dict[socket.socket, Session] = {}
        self._online_ns = 0
        self._offline_s = 0.0  # asked for
        self._silent_until_ns = 0
        self._emulator = FingerSender(finger_pipe)
        self._open()

    def run(self, stopped: Callable[[], bool]) -> None:
        """Serve until told to stop."""
        step_ns = round(self._controller.step_s * 1e9)
        due_ns = time.monotonic_ns()
        while not stopped():
            time.sleep(max(0, due_ns - time.monotonic_ns()) * 1e-9)
            missed = max(0, time.monotonic_ns() - due_ns) // step_ns
            due_ns += (1 + missed) * step_ns
            self._serve()
            for _ in range(min(missed, MAX_MISSED_CYCLES)):
                self._controller.catch_up()
            self._controller.tick()
            self._publish()

    def close(self) -> None:
        """Close all ports and connections."""
        for connection in list(self._sessions):
            self._hang_up(connection)
        for listener in self._listeners:
            self._selector.unregister(listener)
            listener.close()
        self._listeners = []

    def _open(self) -> None:
        for port, make_session in self._kinds.items():
            try:
                listener = socket.create_server((self._ip, port), backlog=8)
            except OSError as error:
                self.close()
                raise DeviceError(
                    f'the emulated UR controller cannot listen on {self._ip}:{port}: {error}; give each controller '
                    "a loopback address of its own, such as '127.0.0.3'"
                ) from error
            listener.setblocking(False)
            self._listeners.append(listener)
            self._selector.register(listener, selectors.EVENT_READ, partial(self._accept, listener, make_session))

    def _go_offline(self, seconds: float) -> None:
        self._offline_s = seconds

    def _go_silent(self, seconds: float) -> None:
        self._silent_until_ns = time.monotonic_ns() + int(seconds * 1e9)

    @property
    def _silent(self) -> bool:
        return time.monotonic_ns() < self._silent_until_ns

    def _serve(self) -> None:
        """Deal with what has come."""
        if self._silent:
            return
        for key, _ in self._selector.select(timeout=0):
            key.data()
        if self._offline_s:
            self.close()
            self._online_ns = time.monotonic_ns() + int(self._offline_s * 1e9)
            self._offline_s = 0.0
        if not self._listeners and time.monotonic_ns() >= self._online_ns:
            self._open()

    def _accept(self, listener: socket.socket, make_session: Callable[[], Session]) -> None:
        with suppress(BlockingIOError):
            connection, _ = listener.accept()
            connection.setblocking(False)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            session = self._sessions[connection] = make_session()
            self._selector.register(connection, selectors.EVENT_READ, partial(self._receive, connection, session))
            self._send(connection, session.greeting())

    def _receive(self, connection: socket.socket, session: Session) -> None:
        try:
            data = connection.recv(CHUNK)
        except OSError:
            data = b''
        if data:
            self._send(connection, session.receive(data))
        else:
            self._hang_up(connection)

    def _publish(self) -> None:
        if not self._silent:
            for connection, session in list(self._sessions.items()):
                self._send(connection, session.package())
        robot = self._controller.robot
        x, y, z = (robot.pose[:3] - robot.surface.origin).tolist()
        vx, vy, vz = robot.velocity[:3].tolist()
        self._emulator.send(FingerState(time.monotonic_ns(), x, y, z, vx, vy, vz, robot.pressing_n))

    def _send(self, connection: socket.socket, data: bytes) -> None:
        """Send all of it, or hang up on a client that does not read."""
        if not data:
            return
        try:
            sent = connection.send(data)
        except OSError:
            sent = 0
        if sent < len(data):
            self._hang_up(connection)

    def _hang_up(self, connection: socket.socket) -> None:
        session = self._sessions.pop(connection, None)
        if session is not None:
            self._selector.unregister(connection)
            session.close()
            connection.close()


# --------------------
# Run the emulated controller as a process, whose argument is the JSON of its parameters.


def main() -> int:
    """Serve until SIGINT, SIGTERM or the end of the parent process; 'ready' is printed once the ports are open."""
    signals: list[int] = []
    parent = os.getppid()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _frame: signals.append(number))
    params = UrControllerParams(**json.loads(sys.argv[1]))
    controller = EmulatedController(params, np.random.default_rng(params.seed))
    try:
        server = Server(controller, params.ip, params.finger_pipe)
    except TextureError as error:
        print(f'emulated UR controller: {error}', file=sys.stderr)
        return 2
    print('ready', flush=True)
    server.run(lambda: bool(signals) or os.getppid() != parent)
    server.close()
    return 0


if __name__ == '__main__':
    sys.exit(main())
