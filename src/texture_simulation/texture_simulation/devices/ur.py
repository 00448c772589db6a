# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A UR controller emulated at protocol level: RTDE, dashboard, program, and a robot in contact."""

from __future__ import annotations

import asyncio
import dataclasses
import enum
import itertools
import json
import math
import os
import re
import select
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.errors import DeviceError, TextureError
from texture_core.types import Array, FingerSender, FingerState, loopback_address, rotation_matrix
from texture_simulation.devices.rails import FingerPipeParams
from texture_simulation.devices.twist_controller import TouchedSurfaceParams, approach, touch_force_n

# --------------------
# Facts about UR controllers and about the control script of ur-rtde.
#
# Sources: the RTDE and dashboard guides of Universal Robots; the source of ur-rtde 1.6.5.

RTDE_PORT = 30004
DASHBOARD_PORT = 29999
SCRIPT_PORT = 30003


# Control software: its version in numbers and its rate. An e-Series; one that RTDE asks for more variables; the older
# CB3; PolyScope X.
VERSIONS: Mapping[str, tuple[tuple[int, int, int, int], float]] = {
    '5.12': ((5, 12, 0, 0), 500.0),
    '5.23': ((5, 23, 0, 0), 500.0),
    '3.15': ((3, 15, 8, 0), 125.0),
    '10.10': ((10, 10, 0, 0), 500.0),
}
WITHOUT_DASHBOARD = 10  # PolyScope X has none


class RtdeMessage(enum.IntEnum):
    """Types of RTDE messages."""

    REQUEST_VERSION = 86
    CONTROLLER_VERSION = 118
    DATA = 85
    SETUP_OUTPUTS = 79
    SETUP_INPUTS = 73
    START = 83
    PAUSE = 80


# RTDE type -> format of `struct`, big-endian
FORMATS: Mapping[str, str] = {
    'UINT32': 'I',
    'UINT64': 'Q',
    'INT32': 'i',
    'DOUBLE': 'd',
    'VECTOR3D': '3d',
    'VECTOR6D': '6d',
    'VECTOR6INT32': '6i',
}
REGISTERS = 48  # of each kind


class SafetyMode(enum.IntEnum):
    """RTDE variable safety_mode."""

    NORMAL = 1
    PROTECTIVE_STOP = 3


RUNTIME_STATES = {'STOPPED': 1, 'PLAYING': 2, 'PAUSED': 4}
POWER_ON_BIT, PROGRAM_RUNNING_BIT = 1 << 0, 1 << 1  # robot_status_bits
ROBOT_RUNNING = 7  # robot_mode
CONTROL_SCRIPT = 'rtde_control'  # how the control script of ur-rtde calls itself


class ScriptCommand(enum.IntEnum):
    """Numbers in input_int_register_0 that the control script obeys, as far as the arm sends them."""

    NONE = 0
    FORCE_MODE = 6
    FORCE_MODE_STOP = 7
    ZERO_FT_SENSOR = 8
    SPEED_L = 10
    SPEED_STOP = 15
    SET_WATCHDOG = 35
    STOP_SCRIPT = 255


# The script processes these in every cycle and stays ready; the client does not wait for them.
REALTIME = frozenset({ScriptCommand.FORCE_MODE, ScriptCommand.SPEED_L})
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
        'Loopback address to listen on, as the ports are fixed; or a path, from which an address is derived.',
    )
    version: str = param('5.12', 'Version of the emulated control software.', choices=tuple(VERSIONS))
    force_noise_n: float = param(0.02, 'Standard deviation of the noise of the force sensor.', unit='N', low=0.0)
    stop_force_n: float = param(
        100.0, 'Force above which the controller goes into a protective stop.', unit='N', low=1.0
    )
    unlock_delay_s: float = param(
        5.0, 'Time after a protective stop before it can be unlocked.', unit='s', low=0.0, high=60.0
    )


# --------------------
# The emulated robot: a finger that follows motions exactly, complies under force control, and measures forces.
#
# Poses and velocities are arrays (6,): x, y, z in m, then a rotation vector in rad. Turning is only sketched: rotation
# vectors change component by component, and 1 rad counts as 1 m.

FRICTION = 0.5  # of the surface
# Speed per force error, and the lag of the arm behind it. With 2 kN/m the error fades in about 0.1 s, which is of the
# order of a real arm's.
ADMITTANCE_M_S_N = 0.01
LAG_S = 0.01
HALT = 20.0  # deceleration of a protective stop, m/s²
# The sensor has an offset on all axes until it is zeroed.
OFFSET_DIRECTION = np.array([0.4, -0.3, 0.866, 0.0, 0.0, 0.0])


class SpeedMove:
    """Gain a velocity and keep it (speedl); `done` when it will not move any further."""

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


class ForceMode(NamedTuple):
    """Which axes of a frame, (3, 3) columns, yield, to which wrench of the robot, how fast at most; (6,) each."""

    axes: Array
    selection: Array
    wrench: Array
    limits: Array


class EmulatedRobot:
    """Physics of the robot, step by step.

    `pose`, `velocity` and `force`, (6,), are of the fingertip in the base frame; the force is that of the surroundings
    on the robot, as the sensor shows it. `motion` and `force_mode` move it. `speed_fraction` is the speed slider on the
    pendant, 0 to 1, which the force mode does not obey.
    """

    def __init__(self, params: UrControllerParams, rng: np.random.Generator) -> None:
        self.origin = np.array([params.surface_x_m, params.surface_y_m, params.surface_z_m])
        self.pose: Array = np.array([*self.origin, 0.0, 0.0, 0.0])
        self.pose[2] += params.start_height_m
        self.velocity: Array = np.zeros(6)
        self.force: Array = np.zeros(6)
        self.motion = stop_move(HALT)
        self.force_mode: ForceMode | None = None
        self.speed_fraction = 1.0
        self._params = params
        self._rng = rng
        self._unslowed: Array = np.zeros(6)  # velocity as it would be without the slider
        self._offset: Array = params.force_offset_n * OFFSET_DIRECTION
        self._contact: Array = np.zeros(3)
        self._compliant_m_s: Array = np.zeros(3)  # speed of the yielding axes in the frame of the force mode

    @property
    def pressing_n(self) -> float:
        """The true force of the surface on the finger, along the vertical."""
        return float(self._contact[2])

    def step(self, step_s: float) -> None:
        """Move for one step."""
        # What is led by the motion is slowed by the slider, what yields to the force is not.
        led = velocity = self.motion.velocity(self._unslowed, step_s)
        if self.force_mode is not None:
            led, velocity = self._comply(velocity, self.force_mode, step_s)
        self._unslowed = velocity
        self.velocity = velocity = velocity - (1.0 - self.speed_fraction) * led
        self.pose = self.pose + velocity * step_s
        # The contact, and what the sensor makes of it.
        from_origin = self.pose[:3] - self.origin
        self._contact = touch_force_n(self._params, FRICTION, np.eye(3), from_origin, velocity[:3])
        self.force = self._offset + self._params.force_noise_n * self._rng.standard_normal(6)
        self.force[:3] += self._contact

    def zero_force(self) -> None:
        """Take what the sensor shows for nothing from now on."""
        self._offset = np.array([*-self._contact, 0.0, 0.0, 0.0])

    def end_force_mode(self) -> None:
        """Yield no longer."""
        self.force_mode = None
        self._compliant_m_s = np.zeros(3)

    def halt(self, deceleration: float = HALT) -> None:
        """Stop, whatever it was doing."""
        self.end_force_mode()
        self.motion = stop_move(deceleration)

    def _comply(self, velocity: Array, mode: ForceMode, step_s: float) -> tuple[Array, Array]:
        """Return the velocity along the axes that do not yield, and that with those which seek the wanted force."""
        error = mode.wrench[:3] + mode.axes.T @ self.force[:3]
        wanted = np.clip(ADMITTANCE_M_S_N * error, -mode.limits[:3], mode.limits[:3])
        self._compliant_m_s = self._compliant_m_s - (wanted - self._compliant_m_s) * math.expm1(-step_s / LAG_S)
        yields, along = mode.selection > 0, mode.axes.T @ velocity[:3]
        stiff = mode.axes @ np.where(yields[:3], 0.0, along)
        complying = mode.axes @ np.where(yields[:3], self._compliant_m_s, along)
        turning = np.where(yields[3:], 0.0, velocity[3:])
        return np.concatenate([stiff, velocity[3:]]), np.concatenate([complying, turning])


# --------------------
# The emulated controller without its network: registers, program, robot, safety, in steps of virtual time.

STARTING_S = 0.05  # between the upload of a program and its start, in which the client clears its registers
STOP_DECELERATION = 5.0  # of a program that ends, m/s²
FORCE_MODE_STOP = 10.0  # m/s², as in the script
ENDED = object()
MAX_EXCUSED_S = 0.1  # for which the watchdog waits longer because this process was held up
# As in the control script of ur-rtde; the client puts the number behind a comment.
FIRST_REGISTER = re.compile(r'reg_offset_int\s*=\D{0,60}?(\d+)')
Steps = Iterator[None]


class Registers(NamedTuple):
    """Through which a program and the world outside talk."""

    int_in: NDArray[np.int64]
    double_in: Array
    int_out: NDArray[np.int64]
    double_out: Array


class EmulatedController:
    """A controller without a clock: each `tick` is one cycle of `step_s`."""

    def __init__(self, params: UrControllerParams, rng: np.random.Generator) -> None:
        self.version, rate_hz = VERSIONS[params.version]
        self.step_s = 1.0 / rate_hz
        self.time_s = 0.0  # since it was switched on
        whole, real = np.zeros((2, REGISTERS), dtype=np.int64), np.zeros((2, REGISTERS))
        self.registers = Registers(whole[0], real[0], whole[1], real[1])
        self.first_register = 0  # that the program uses
        self.robot = EmulatedRobot(params, rng)
        self.safety = SafetyMode.NORMAL
        self.acknowledge_s = 0.0  # how much later than done stops and zeroing are acknowledged
        self.silent_s = 0.0  # for how much longer nothing is heard or answered
        self.program_name = CONTROL_SCRIPT  # of the one that runs, or ran last
        self.paused = False
        self._params = params
        self._loaded = ''  # name of the program that `play` starts
        self._starts_s = math.inf  # when an uploaded program starts
        self._program: Iterator[None] | None = None
        self._watchdog_s = math.inf  # longest silence
        self._heard_s = self._excused_s = 0.0  # when the command register last came; silence that is not the client's
        self._stopped_s = 0.0  # when the protective stop happened

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
        self.time_s += self.step_s
        self.silent_s = max(0.0, self.silent_s - self.step_s)
        if self.time_s >= self._starts_s:
            self._starts_s, self.program_name, self._program = math.inf, CONTROL_SCRIPT, self._control_script()
        if self.time_s - self._heard_s > self._watchdog_s:
            self.stop_program()
        if self.playing and next(self._program or iter(()), ENDED) is ENDED:
            self.stop_program()
        self.robot.step(self.step_s)
        if np.linalg.norm(self.robot.force[:3]) > self._params.stop_force_n:
            self.protective_stop()

    def catch_up(self) -> None:
        """Do a cycle that should have been done before; it is not the client that was silent in it.

        A silent client gains `MAX_EXCUSED_S` at most by that: a moving arm needs its watchdog.
        """
        if self._excused_s < MAX_EXCUSED_S:
            self._excused_s += self.step_s
            self._heard_s += self.step_s
        self.tick()

    def write(self, name: str, index: int, value: float) -> None:
        """Write an input register; the watchdog watches that of the program's commands."""
        getattr(self.registers, name)[index] = value
        if name == 'int_in' and index == self.first_register:
            self._heard_s, self._excused_s = self.time_s, 0.0

    def upload(self, script: str) -> None:
        """Take over a program, which starts a little later; in a protective stop none starts."""
        if CONTROL_SCRIPT in script and self.safety is SafetyMode.NORMAL:
            self.stop_program()
            first = FIRST_REGISTER.search(script)
            self.first_register = int(first.group(1)) if first else 0
            self._starts_s = self.time_s + STARTING_S

    def load(self, name: str) -> str:
        """Take note of what `play` runs, and return the answer of the dashboard."""
        self._loaded = name
        return f'Loading program: {name}'

    def play(self) -> None:
        """Run the loaded program, which takes no commands and does nothing."""
        self.stop_program()
        self._program, self.program_name = itertools.repeat(None), self._loaded

    def pause(self) -> None:
        """Let the program wait."""
        self.paused = self._program is not None

    def stop_program(self) -> None:
        """End the program, and with it every motion and the watchdog."""
        if self._program is not None:
            self.robot.halt(STOP_DECELERATION)
        self._program, self.paused = None, False
        self._starts_s = self._watchdog_s = math.inf

    def protective_stop(self) -> None:
        """Stop hard; the program ends."""
        if self.safety is SafetyMode.NORMAL:
            self.safety, self._stopped_s = SafetyMode.PROTECTIVE_STOP, self.time_s
            self.stop_program()
            self.robot.halt()

    def unlock(self) -> bool:
        """End a protective stop; return whether it was old enough for that."""
        if self.time_s - self._stopped_s < self._params.unlock_delay_s:
            return False
        self.safety = SafetyMode.NORMAL
        return True

    # What the control script of ur-rtde does, without being URScript. It looks at its command register, number 0 or
    # 24, once per cycle. Realtime commands are obeyed in every cycle in which they are there; others once, until the
    # client has written 0 in between. A command that is overwritten within a cycle is lost, as on the real controller.

    def _control_script(self) -> Steps:
        """Obey until the command to end; one item per cycle."""
        whole_in, real_in, whole_out, real_out = self.registers
        here = slice(self.first_register, None)
        registers = Registers(whole_in[here], real_in[here], whole_out[here], real_out[here])
        executed = False
        registers.int_out[0] = READY
        while (number := int(registers.int_in[0])) != ScriptCommand.STOP_SCRIPT:
            if number in REALTIME:
                yield from self._execute(number, registers)
                registers.int_out[0] = READY
            elif number == ScriptCommand.NONE:
                executed = False
                registers.int_out[0] = READY
            elif not executed:
                yield from self._execute(number, registers)
                if number in SLOW:
                    yield from itertools.repeat(None, round(self.acknowledge_s / self.step_s))
                executed = True
                registers.int_out[0] = DONE
            yield

    def _execute(self, number: int, registers: Registers) -> Steps:
        """Do one command with the arguments in its registers: d are doubles, i integers."""
        robot, doubles = self.robot, registers.double_in.copy()
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
            if not speeding.done:  # a speed continues afterwards: its thread lives
                robot.motion = speeding
        elif number == ScriptCommand.ZERO_FT_SENSOR:
            robot.zero_force()
        elif number == ScriptCommand.SET_WATCHDOG:  # d0 lowest frequency
            self._watchdog_s, self._heard_s, self._excused_s = 1.0 / doubles[0], self.time_s, 0.0

    def _stop(self, deceleration: float) -> Steps:
        self.robot.motion = motion = stop_move(deceleration)
        while not motion.done:
            yield


# --------------------
# The sessions: what the ports of dashboard, scripts and RTDE answer.


class Session(asyncio.Protocol):
    """One conversation with one client; `greeting` is sent first, `package` unrequested in each cycle."""

    greeting = b''

    def __init__(self, controller: EmulatedController, sessions: set[Session]) -> None:
        self._controller = controller
        self._sessions = sessions  # all that are open
        self._coming = self._received = b''

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Greet."""
        assert isinstance(transport, asyncio.WriteTransport)
        self.transport = transport
        self.transport.write(self.greeting)
        self._sessions.add(self)

    def data_received(self, data: bytes) -> None:
        """Keep what comes for the next cycle."""
        self._coming += data

    def connection_lost(self, error: Exception | None) -> None:
        """Give free what it held."""
        self._sessions.discard(self)

    def answer(self) -> None:
        """Take over what has come, and answer."""
        coming, self._coming = self._coming, b''
        self.transport.write(self.receive(coming))

    def receive(self, data: bytes) -> bytes:
        """Take over what came; return the answer."""
        raise NotImplementedError

    def package(self) -> bytes:
        """Return what is sent unasked in this cycle."""
        return b''


# The dashboard: one line asks, one line answers. Next to the real commands it obeys the fault switches of the emulator:
# `emulate protective stop`, `emulate silence SECONDS`, in which nothing is answered, `emulate slow SECONDS`,
# which lets stops, the end of force control and zeroing be acknowledged so much later, and `emulate speed FRACTION`, as
# of the slider on the pendant.
# `load NAME` and `play` start a foreign program, which takes no commands.

SERIAL_NUMBER = '20205500001'
BANNER = b'Connected: Universal Robots Dashboard Server\n'
TOO_EARLY = (
    'Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before unlocking'
)


class DashboardSession(Session):
    """The conversation on the dashboard."""

    greeting = BANNER

    def __init__(self, controller: EmulatedController, sessions: set[Session]) -> None:
        super().__init__(controller, sessions)
        numbers = '.'.join(str(number) for number in controller.version)
        # Command: what answers the rest of the line.
        self._answers: Mapping[str, Callable[[str], str]] = {
            'get serial number': lambda _: SERIAL_NUMBER,
            'polyscopeversion': lambda _: f'URSoftware {numbers} (emulated)',
            'robotmode': lambda _: 'Robotmode: RUNNING',
            'is in remote control': lambda _: 'true',
            'safetymode': lambda _: f'Safetymode: {controller.safety.name}',
            'running': lambda _: f'Program running: {str(controller.playing).lower()}',
            'programstate': lambda _: f'{controller.state} {controller.program_name}',
            'load': controller.load,
            'play': partial(_do, controller.play, 'Starting program'),
            'stop': partial(_do, controller.stop_program, 'Stopped'),
            'pause': partial(_do, controller.pause, 'Pausing program'),
            'unlock protective stop': lambda _: 'Protective stop releasing' if controller.unlock() else TOO_EARLY,
            'emulate protective stop': partial(_do, controller.protective_stop, 'Stopped'),
            'emulate silence': partial(_set, partial(setattr, controller, 'silent_s'), 'seconds'),
            'emulate slow': partial(_set, partial(setattr, controller, 'acknowledge_s'), 'seconds'),
            'emulate speed': partial(_set, partial(setattr, controller.robot, 'speed_fraction'), 'times full speed'),
        }

    def receive(self, data: bytes) -> bytes:
        """Take over what came; return the answers."""
        *lines, self._received = (self._received + data).split(b'\n')
        return b''.join(self._answer(line.decode('utf-8', 'replace').strip()).encode() + b'\n' for line in lines)

    def _answer(self, line: str) -> str:
        for command, answer in self._answers.items():
            if line.lower() == command or line.lower().startswith(command + ' '):
                return answer(line[len(command) :].strip())
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


END = b'\nend\n'


class ScriptSession(Session):
    """The conversation with one client, which sends programs in URScript and gets no answer."""

    def receive(self, data: bytes) -> bytes:
        """Start a program once its last line is there."""
        self._received += data
        if self._received.endswith(END):
            self._controller.upload(self._received.decode('utf-8', 'replace'))
            self._received = b''
        return b''


# The variables that RTDE offers: name, type and how to read it. The robot has no joints, and what no client of the
# suite looks at is 0.

Variable = tuple[str, Callable[[EmulatedController], Sequence[Any]]]
UNUSED: Mapping[str, str] = {
    'VECTOR6INT32': 'joint_mode',
    'VECTOR3D': 'actual_tool_accelerometer payload_cog',
    'VECTOR6D': 'target_q actual_q target_qd actual_qd target_qdd target_current actual_current target_moment '
    'actual_current_as_torque joint_control_output joint_temperatures actual_joint_voltage payload_inertia',
    'UINT64': 'actual_digital_input_bits actual_digital_output_bits',
    'DOUBLE': 'payload actual_momentum standard_analog_input0 standard_analog_input1 standard_analog_output0 '
    'standard_analog_output1 speed_scaling target_speed_fraction actual_robot_current actual_main_voltage '
    'actual_robot_voltage actual_execution_time',
}


def _zeros(kind: str) -> Variable:
    zeros = (0,) * len(struct.unpack(f'>{FORMATS[kind]}', bytes(struct.calcsize(f'>{FORMATS[kind]}'))))
    return kind, lambda _controller: zeros


def _of_robot(name: str) -> Variable:
    return 'VECTOR6D', lambda controller: getattr(controller.robot, name).tolist()


def _of_register(kind: str, name: str, index: int) -> Variable:
    return kind, lambda controller: (getattr(controller.registers, name)[index],)


OUTPUTS: Mapping[str, Variable] = {
    **{name: _zeros(kind) for kind, names in UNUSED.items() for name in names.split()},
    'robot_mode': ('INT32', lambda _controller: (ROBOT_RUNNING,)),
    'timestamp': ('DOUBLE', lambda controller: (controller.time_s,)),
    **dict.fromkeys(('actual_TCP_pose', 'target_TCP_pose'), _of_robot('pose')),
    **dict.fromkeys(('actual_TCP_speed', 'target_TCP_speed'), _of_robot('velocity')),
    **dict.fromkeys(('actual_TCP_force', 'ft_raw_wrench'), _of_robot('force')),
    'safety_mode': ('INT32', lambda controller: (int(controller.safety),)),
    'safety_status_bits': ('UINT32', lambda controller: (1 << controller.safety - 1,)),
    'robot_status_bits': ('UINT32', lambda controller: (POWER_ON_BIT | PROGRAM_RUNNING_BIT * controller.playing,)),
    'runtime_state': ('UINT32', lambda controller: (RUNTIME_STATES[controller.state],)),
    **{f'output_int_register_{index}': _of_register('INT32', 'int_out', index) for index in range(REGISTERS)},
    **{f'output_double_register_{index}': _of_register('DOUBLE', 'double_out', index) for index in range(REGISTERS)},
}
# Name: type, registers and index; what has no registers is taken and not used.
INPUTS: Mapping[str, tuple[str, str, int]] = {
    **{f'input_int_register_{index}': ('INT32', 'int_in', index) for index in range(REGISTERS)},
    **{f'input_double_register_{index}': ('DOUBLE', 'double_in', index) for index in range(REGISTERS)},
    'external_force_torque': ('VECTOR6D', '', 0),
}

# RTDE, protocol version 2: one session per connection, `package` is what it gets each cycle once requested.

HEADER = struct.Struct('>HB')
PROTOCOL_VERSION = 2
OUTPUT_RECIPE = 1


class RtdeSession(Session):
    """The conversation with one client."""

    def __init__(self, controller: EmulatedController, sessions: set[Session]) -> None:
        super().__init__(controller, sessions)
        self.inputs: list[list[str]] = []  # its recipes; no other client may write these
        self._outputs: list[Variable] = []
        self._started = False

    def receive(self, data: bytes) -> bytes:
        """Take over what came; return the answers."""
        self._received += data
        answers = b''
        while len(self._received) >= HEADER.size:
            size, kind = HEADER.unpack_from(self._received)
            if size < HEADER.size:
                self._received = b''
            if len(self._received) < max(size, HEADER.size):
                break
            payload, self._received = self._received[HEADER.size : size], self._received[size:]
            answer = self._answer(kind, payload)
            answers += _message(kind, answer) if answer else b''
        return answers

    def package(self) -> bytes:
        """Return the data message, if they were requested."""
        if not self._started:
            return b''
        values = [value for _, read in self._outputs for value in read(self._controller)]
        packed = struct.pack(_format(kind for kind, _ in self._outputs), *values)
        return _message(RtdeMessage.DATA, bytes([OUTPUT_RECIPE]) + packed)

    def _answer(self, kind: int, payload: bytes) -> bytes:
        """Return the content of the answer, b'' if there is none."""
        if kind == RtdeMessage.REQUEST_VERSION:
            return bytes([payload == struct.pack('>H', PROTOCOL_VERSION)])
        if kind == RtdeMessage.CONTROLLER_VERSION:
            return struct.pack('>4I', *self._controller.version)
        if kind == RtdeMessage.SETUP_OUTPUTS and len(payload) >= 8:
            return self._on_setup_outputs(_names(payload[8:]))  # behind the frequency: data come in each cycle
        if kind == RtdeMessage.SETUP_INPUTS:
            return self._on_setup_inputs(_names(payload))
        if kind in (RtdeMessage.START, RtdeMessage.PAUSE):
            self._started = kind == RtdeMessage.START
            return b'\x01'
        if kind == RtdeMessage.DATA and payload and 1 <= payload[0] <= len(self.inputs):
            self._write_inputs(self.inputs[payload[0] - 1], payload[1:])
        return b''

    def _on_setup_outputs(self, names: list[str]) -> bytes:
        if all(name in OUTPUTS for name in names):
            self._outputs = [OUTPUTS[name] for name in names]
        types = [OUTPUTS[name][0] if name in OUTPUTS else 'NOT_FOUND' for name in names]
        return bytes([OUTPUT_RECIPE]) + ','.join(types).encode()

    def _on_setup_inputs(self, names: list[str]) -> bytes:
        others = [other for other in self._sessions if isinstance(other, RtdeSession) and other is not self]
        held = {name for other in others for recipe in other.inputs for name in recipe}
        types = ['IN_USE' if name in held else INPUTS[name][0] if name in INPUTS else 'NOT_FOUND' for name in names]
        if not {'NOT_FOUND', 'IN_USE'} & set(types):
            self.inputs.append(names)
        return bytes([len(self.inputs)]) + ','.join(types).encode()

    def _write_inputs(self, names: list[str], data: bytes) -> None:
        """Write the values in `data` to inputs; what has another length is not taken."""
        if len(data) != struct.calcsize(_format(INPUTS[name][0] for name in names)):
            return
        start = 0
        for kind, registers, index in (INPUTS[name] for name in names):
            value, *_ = struct.unpack_from(_format([kind]), data, start)
            start += struct.calcsize(_format([kind]))
            if registers:
                self._controller.write(registers, index, value)


def _message(kind: int, payload: bytes) -> bytes:
    return HEADER.pack(HEADER.size + len(payload), kind) + payload


def _names(data: bytes) -> list[str]:
    """Return the names of a list, which may end with a comma."""
    return [name for name in data.decode('ascii', 'replace').split(',') if name]


def _format(kinds: Iterable[str]) -> str:
    return '>' + ''.join(FORMATS[kind] for kind in kinds)


# --------------------
# The network of the emulated controller, and its clock.
#
# It sleeps until the next cycle is due, looks what has come, lets the controller do its cycles, and sends.

# That are made up for; a process that was held up for longer has lost the time. Meanwhile it hears no commands, and no
# real controller moves for longer than its watchdog waits without one.
MAX_MISSED_CYCLES = 50


async def serve(controller: EmulatedController, params: UrControllerParams, stopped: Callable[[], bool]) -> None:
    """Listen on the ports, print 'ready', and serve until `stopped`."""
    sessions: set[Session] = set()
    kinds: dict[int, type[Session]] = {RTDE_PORT: RtdeSession, SCRIPT_PORT: ScriptSession}
    if controller.version[0] < WITHOUT_DASHBOARD:
        kinds[DASHBOARD_PORT] = DashboardSession
    try:
        for port, kind in kinds.items():
            await asyncio.get_running_loop().create_server(partial(kind, controller, sessions), params.ip, port)
    except OSError as error:
        raise DeviceError(
            f'the emulated UR controller cannot listen on {params.ip}:{port}: {error}; give each controller '
            "a separate loopback address, such as '127.0.0.3'"
        ) from error
    print('ready', flush=True)
    emulator, robot = FingerSender(params.finger_pipe), controller.robot
    step_ns, due_ns = round(controller.step_s * 1e9), time.monotonic_ns()
    while not stopped():
        await asyncio.sleep(max(0, due_ns - time.monotonic_ns()) * 1e-9)
        missed = max(0, time.monotonic_ns() - due_ns) // step_ns
        due_ns += (1 + missed) * step_ns
        heard = [] if controller.silent_s else list(sessions)
        for session in heard:
            session.answer()
        for _ in range(min(missed, MAX_MISSED_CYCLES)):
            controller.catch_up()
        controller.tick()
        for session in heard:
            session.transport.write(session.package())
        x, y, z = (robot.pose[:3] - robot.origin).tolist()
        vx, vy, vz = robot.velocity[:3].tolist()
        emulator.send(FingerState(time.monotonic_ns(), x, y, z, vx, vy, vz, robot.pressing_n))


# --------------------
# The emulated controller as a separate process, whose argument is the JSON of its parameters.
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
        # In a session without the terminal: Ctrl-C is for the owner; the process sees that it has ended.
        pipes: Any = {'stdin': subprocess.DEVNULL, 'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE}
        self._process = subprocess.Popen(command, text=True, start_new_session=True, **pipes)
        assert self._process.stdout is not None
        answered, _, _ = select.select([self._process.stdout], [], [], START_S)
        if not answered or self._process.stdout.readline() != 'ready\n':
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


def main() -> int:
    """Serve until the parent process ends; 'ready' is printed once the ports are open."""
    parent = os.getppid()
    params = UrControllerParams(**json.loads(sys.argv[1]))
    controller = EmulatedController(params, np.random.default_rng(params.seed))
    try:
        asyncio.run(serve(controller, params, lambda: os.getppid() != parent))
    except TextureError as error:
        print(f'emulated UR controller: {error}', file=sys.stderr)
        return 2
    return 0


if __name__ == '__main__':
    sys.exit(main())
