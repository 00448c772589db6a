"""The emulated controller without its network: program, robot, safety, in steps of its own time."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator

import numpy as np

from texture_simulation.devices.ur.motions import StopMove
from texture_simulation.devices.ur.params import UrControllerParams
from texture_simulation.devices.ur.program import ControlProgram
from texture_simulation.devices.ur.registers import Registers
from texture_simulation.devices.ur.robot import EmulatedRobot
from texture_simulation.devices.ur.tables import CONTROL_SCRIPT, VERSIONS, SafetyMode

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

    def play(self, name: str) -> None:
        """Run a program that somebody else brought; it takes no commands and does nothing."""
        self.stop_program()
        self._program, self.program_name = itertools.repeat(None), name

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
            self.robot.motion = StopMove(STOP_DECELERATION)
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
