"""What the control script of ur-rtde does on the controller, without being URScript.

The script looks at its command register, input_int_register_0 or 24, once per cycle. Realtime commands are obeyed in
every cycle in which they stand there; others once, until the client has written 0 in between. A command that is
overwritten within a cycle is lost, as on the real controller.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from typing import Protocol

import numpy as np

from texture_core.arrays import Array
from texture_core.rotation import rotation_matrix
from texture_simulation.devices.ur.motions import LinearMove, ServoMove, SpeedMove, StopMove
from texture_simulation.devices.ur.registers import Registers
from texture_simulation.devices.ur.robot import EmulatedRobot, ForceMode
from texture_simulation.devices.ur.tables import DONE, READY, REALTIME, SLOW, ScriptCommand

CONTACT_N = 3.0  # what tool_contact takes for a contact
RETRACT_STOP = 3.0  # m/s², as in the script
RETRACT_SPEED, RETRACT_ACCELERATION = 0.25, 1.2  # defaults of movel
FORCE_MODE_STOP = 10.0  # m/s², as in the script
RUNNING_BIT = 1 << 15
COUNTER_SIZE = 128


class Host(Protocol):
    """What the program asks of the controller that runs it."""

    def set_watchdog(self, min_frequency_hz: float) -> None:
        """Stop the program when its command register comes less often."""

    def protective_stop(self) -> None:
        """Stop hard."""

    @property
    def acknowledge_s(self) -> float:
        """So much later than it is done a stop, the end of force control or a zeroing is acknowledged."""


Steps = Iterator[None]


class ControlProgram:
    """The running script; `cycles` is advanced once per cycle of the controller and ends with the script."""

    def __init__(self, robot: EmulatedRobot, registers: Registers, host: Host, step_s: float) -> None:
        self._robot = robot
        self._registers = registers
        self._host = host
        self._step_s = step_s
        self._goal = robot.pose
        self._operation: LinearMove | StopMove | None = None  # what runs without the script waiting for it
        self._operations = 0
        self._writes = 0
        self._contact_direction: Array | None = None
        self._contact_seen = False
        self._unknown: set[int] = set()

    def cycles(self) -> Steps:
        """Obey until told to end; one item per cycle."""
        registers = self._registers
        executed = False
        self._report_progress(False)
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
            yield from self._check_background()
            yield

    def _wait(self, seconds: float) -> Steps:
        for _ in range(round(seconds / self._step_s)):
            yield

    def _execute(self, number: int) -> Steps:
        handler = COMMANDS.get(number)
        if handler is None:
            if number not in self._unknown:
                self._unknown.add(number)
                print(f'emulated UR controller: command {number} does nothing here', file=sys.stderr)
            return
        steps = handler(self)
        if steps is not None:
            yield from steps

    def _check_background(self) -> Steps:
        """Notice the end of an operation in the background, and contacts."""
        if self._operation is not None and self._operation.done:
            self._operation = None
            self._report_progress(False)
        direction = self._contact_direction
        if direction is not None and self._robot.touches(direction, CONTACT_N):
            self._contact_direction = None
            self._contact_seen = True
            yield from self._retract()

    def _vector(self, start: int) -> Array:
        return np.array(self._registers.double_in[start : start + 6])

    def _run(self, motion: LinearMove | StopMove, in_background: bool) -> Steps:
        self._robot.motion = motion
        if self._operation is not None:
            self._operation = None
            self._report_progress(False)
        if in_background:
            self._operations = (self._operations + 1) % COUNTER_SIZE
            self._operation = motion
            self._report_progress(True)
            return
        while not motion.done:
            yield

    def _report_progress(self, running: bool) -> None:
        self._writes = (self._writes + 1) % COUNTER_SIZE
        word = self._operations << 24 | self._writes << 16 | (RUNNING_BIT if running else 0)
        self._registers.int_out[2] = word

    def _retract(self) -> Steps:
        """Stop, and go back to where the contact began."""
        yield from self._run(StopMove(RETRACT_STOP), False)
        yield from self._run(LinearMove(self._robot.touched_at, RETRACT_SPEED, RETRACT_ACCELERATION), False)

    def move_l(self) -> Steps:
        """d0-5 pose, d6 speed, d7 acceleration, i1 in the background."""
        self._goal = self._vector(0)
        line = LinearMove(self._goal, *self._registers.double_in[6:8])
        return self._run(line, self._registers.int_in[1] == 1)

    def stop_l(self) -> Steps:
        """d0 deceleration, i1 in the background."""
        return self._run(StopMove(self._registers.double_in[0]), self._registers.int_in[1] == 1)

    def speed_l(self) -> None:
        """d0-5 velocity, d6 acceleration."""
        self._robot.motion = SpeedMove(self._vector(0), self._registers.double_in[6])

    def speed_stop(self) -> Steps:
        """d0 deceleration."""
        return self._run(StopMove(self._registers.double_in[0]), False)

    def servo_l(self) -> None:
        """d0-5 pose, d9 look-ahead time."""
        self._robot.motion = ServoMove(self._vector(0), self._registers.double_in[9])

    def force_mode(self) -> None:
        """i1 type, i2-7 selection, d0-5 frame, d6-11 wrench, d12-17 limits; only type 2, the frame as it is."""
        self._robot.force_mode = ForceMode(
            axes=rotation_matrix(self._vector(0)[3:]),
            selection=np.array(self._registers.int_in[2:8]),
            wrench=self._vector(6),
            limits=self._vector(12),
        )

    def force_mode_stop(self) -> Steps:
        """End yielding, then stop. What speedl was told goes on afterwards: its thread lives."""
        speeding = self._robot.motion
        self._robot.end_force_mode()
        yield from self._run(StopMove(FORCE_MODE_STOP), False)
        if isinstance(speeding, SpeedMove):
            self._robot.motion = speeding

    def zero_ft_sensor(self) -> None:
        """Take the present force for nothing."""
        self._robot.zero_force()

    def tool_contact(self) -> None:
        """d0-5 direction; result i1: cycles since the contact, here 1 or 0."""
        self._registers.int_out[1] = int(self._robot.touches(self._vector(0)[:3], CONTACT_N))

    def get_steptime(self) -> None:
        """Result d0."""
        self._registers.double_out[0] = self._step_s

    def get_target_waypoint(self) -> None:
        """Result d0-5."""
        self._registers.double_out[:6] = self._goal.tolist()

    def protective_stop(self) -> None:
        """Stop hard."""
        self._host.protective_stop()

    def set_watchdog(self) -> None:
        """d0 lowest frequency."""
        self._host.set_watchdog(self._registers.double_in[0])

    def is_pose_within_safety_limits(self) -> None:
        """Result i1: always, there are none here."""
        self._registers.int_out[1] = 1

    def is_steady(self) -> None:
        """Result i1."""
        self._registers.int_out[1] = int(not self._robot.velocity.any())

    def move_until_contact(self) -> Steps:
        """d0-5 velocity, d6-11 direction of the contact, d12 acceleration."""
        direction = self._vector(6)[:3]
        self._robot.motion = SpeedMove(self._vector(0), self._registers.double_in[12])
        while not self._robot.touches(direction, CONTACT_N):
            yield
        yield from self._retract()

    def start_contact_detection(self) -> None:
        """d0-5 direction."""
        self._contact_direction = self._vector(0)[:3]
        self._contact_seen = False

    def stop_contact_detection(self) -> None:
        """Result i1: whether there was one."""
        self._contact_direction = None
        self.read_contact_detection()

    def read_contact_detection(self) -> None:
        """Result i1: whether there was one."""
        self._registers.int_out[1] = int(self._contact_seen)


COMMANDS: Mapping[int, Callable[[ControlProgram], Steps | None]] = {
    ScriptCommand.MOVE_L: ControlProgram.move_l,
    ScriptCommand.FORCE_MODE: ControlProgram.force_mode,
    ScriptCommand.FORCE_MODE_STOP: ControlProgram.force_mode_stop,
    ScriptCommand.ZERO_FT_SENSOR: ControlProgram.zero_ft_sensor,
    ScriptCommand.SPEED_L: ControlProgram.speed_l,
    ScriptCommand.SPEED_STOP: ControlProgram.speed_stop,
    ScriptCommand.SERVO_STOP: ControlProgram.speed_stop,
    ScriptCommand.SERVO_L: ControlProgram.servo_l,
    ScriptCommand.TOOL_CONTACT: ControlProgram.tool_contact,
    ScriptCommand.GET_STEPTIME: ControlProgram.get_steptime,
    ScriptCommand.GET_TARGET_WAYPOINT: ControlProgram.get_target_waypoint,
    ScriptCommand.PROTECTIVE_STOP: ControlProgram.protective_stop,
    ScriptCommand.STOP_L: ControlProgram.stop_l,
    ScriptCommand.SET_WATCHDOG: ControlProgram.set_watchdog,
    ScriptCommand.IS_POSE_WITHIN_SAFETY_LIMITS: ControlProgram.is_pose_within_safety_limits,
    ScriptCommand.IS_STEADY: ControlProgram.is_steady,
    ScriptCommand.MOVE_UNTIL_CONTACT: ControlProgram.move_until_contact,
    ScriptCommand.START_CONTACT_DETECTION: ControlProgram.start_contact_detection,
    ScriptCommand.STOP_CONTACT_DETECTION: ControlProgram.stop_contact_detection,
    ScriptCommand.READ_CONTACT_DETECTION: ControlProgram.read_contact_detection,
}
