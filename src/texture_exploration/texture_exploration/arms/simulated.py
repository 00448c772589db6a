# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""An arm without a robot: a kinematic finger with an ideal force mode over an elastic plane."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from texture_core.config import param
from texture_core.errors import DeviceError
from texture_core.types import FingerSender, FingerState
from texture_exploration.arms.arm import STANDSTILL, Arm, ArmCommand, ArmState, Vector, check_command

RATE_HZ = 250.0


@dataclass(frozen=True)
class SimulatedArmParams:
    """Parameters of the simulated arm and of its contact with the surface."""

    stiffness_n_m: float = param(
        2000.0, 'Stiffness of finger and surface in contact; 0 removes the surface.', unit='N/m', low=0.0
    )
    edge_m: float = param(0.0, 'Place along x where the surface ends; 0: nowhere.', unit='m', low=0.0, high=1.0)
    admittance_m_s_n = 0.01  # normal speed per force error of the arm's force mode
    start_height_m: float = param(
        0.01, 'Height of the finger above the surface at the start.', unit='m', low=0.0, high=0.2
    )
    command_timeout_s = 0.1  # that a command holds without a new one; afterwards the arm stops
    finger_pipe: str = param('', "Named pipe for the finger position that the emulator reads; '' for none.")


class SimulatedArm(Arm):
    """A finger that follows velocities exactly and approaches a wanted force exponentially.

    Parameters
    ----------
    params
        The arm and its contact.
    clock
        CLOCK_MONOTONIC in ns.
    own_thread
        Move in a thread at 250 Hz once connected. If False, the owner of the arm calls `step`.
    """

    Params = SimulatedArmParams
    keeps_start = True

    def __init__(
        self,
        params: SimulatedArmParams = SimulatedArmParams(),
        clock: Callable[[], int] = time.monotonic_ns,
        own_thread: bool = True,
    ) -> None:
        self._params = params
        self._clock = clock
        self._own_thread = own_thread
        self._last_command = (STANDSTILL, clock())  # the command, and when it came
        start: Vector = (0.0, 0.0, params.start_height_m)
        self._state = ArmState(clock(), start, (0.0, 0.0, 0.0), 0.0)
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._emulator = FingerSender(params.finger_pipe)

    def connect(self) -> None:
        """Start the thread."""
        self.close()
        self._closing.clear()
        self.step(0.0)
        if self._own_thread:
            self._thread = threading.Thread(target=self._run, name='simulated_arm', daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Stop and end the thread."""
        self.stop()
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._emulator.close()

    def state(self) -> ArmState:
        """Return the newest state."""
        return self._state

    def command(self, command: ArmCommand) -> None:
        """Follow a command from the next step on.

        Raises
        ------
        DeviceError
            If the arm is not connected.
        """
        if self._closing.is_set():
            raise DeviceError('the simulated arm is not connected; connect it first')
        check_command(command, self.stop)
        self._last_command = (command, self._clock())

    def stop(self) -> None:
        """Stop."""
        self._last_command = (STANDSTILL, self._clock())

    def step(self, dt_s: float) -> None:
        """Move for `dt_s` up to the clock's present time, as commanded and as long as the command holds."""
        now_ns = self._clock()
        command, given_ns = self._last_command
        left_s = self._params.command_timeout_s + (given_ns - now_ns) * 1e-9
        # After a pause the newest command holds at most for the usual time.
        moving_s = min(max(0.0, dt_s + min(0.0, left_s)), self._params.command_timeout_s)
        moved = self._moved_m(command, moving_s)
        x, y, z = (at + step_m for at, step_m in zip(self._state.position, moved, strict=True))
        vx, vy, vz = (step_m / moving_s if moving_s > 0.0 and left_s >= 0.0 else 0.0 for step_m in moved)
        if left_s < 0:
            self._last_command = (STANDSTILL, now_ns)
        force_n = self._force_n(x, z)
        self._state = replace(self._state, time_ns=now_ns, position=(x, y, z), velocity=(vx, vy, vz), force_n=force_n)
        self._emulator.send(FingerState(now_ns, x, y, z, vx, vy, vz, force_n))

    def _force_n(self, x_m: float, z_m: float) -> float:
        """Return the force of a finger at (x, z), positive when pressing: a spring up to the edge of the surface."""
        edge_m = self._params.edge_m or math.inf
        return self._params.stiffness_n_m * max(0.0, -z_m) if x_m < edge_m else 0.0

    def _moved_m(self, command: ArmCommand, dt_s: float) -> Vector:
        """Return the motion in one step, m.

        Admittance control, vz = a·(F − F_wanted), solved exactly over the step: with F = k·depth the force error
        decays as exp(−a·k·t), which no step size makes unstable.
        """
        vx, vy = command.tangential_m_s
        if command.force_n is None:
            return vx * dt_s, vy * dt_s, command.normal_m_s * dt_s
        admittance = self._params.admittance_m_s_n
        decay_s = admittance * self._params.stiffness_n_m
        effective_s = -math.expm1(-decay_s * dt_s) / decay_s if decay_s > 0 else dt_s
        return vx * dt_s, vy * dt_s, admittance * (self._state.force_n - command.force_n) * effective_s

    def _run(self) -> None:
        last_ns = self._clock()
        while not self._closing.wait(1 / RATE_HZ):
            now_ns = self._clock()
            self.step((now_ns - last_ns) * 1e-9)
            last_ns = now_ns
