# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""An arm without a robot: a kinematic finger over an elastic surface; with or without a force mode."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from texture_core.config import param
from texture_core.errors import DeviceError
from texture_core.types import FingerSender, FingerState
from texture_exploration.arms.arm import STANDSTILL, Arm, ArmCommand, ArmState, CommandedVelocity, ForceReading, Vector
from texture_exploration.force_control import ForceLoopParams
from texture_exploration.safety import CommandLimits

# --------------------
# Surface under the simulated finger: an elastic surface with a tilt, a bump, a step, an edge or a soft layer.

STICK_M = 0.002  # way from slip to slip
BUMP_FROM_M, BUMP_LENGTH_M = 0.02, 0.04
BASE_STIFFNESS_N_M = 20000.0  # below a soft layer, and of a wall: as of wood under rubber


@dataclass(frozen=True)
class SurfaceShape:
    """Shape for tests of force control; programs choose it, a plane is the default."""

    tilt_rad: float = 0.0  # by which it rises along x
    bump_m: float = 0.0  # height of a round bump on the path along x
    step_m: float = 0.0  # height of a step along x
    step_from_m: float = 0.03
    edge_m: float = math.inf  # x where it ends
    layer_m: float = 0.0  # thickness of a soft layer on a hard base
    wall_m: float = math.inf  # x of a wall across the way of the finger
    adhesion_n: float = 0.0  # largest pulling force with which it holds the finger
    stick_slip_n: float = 0.0  # amplitude of the force while the finger sticks and slips


PLANE = SurfaceShape()


class SimulatedSurface:
    """Height and force; remembers whether the finger sticks."""

    def __init__(self, shape: SurfaceShape, stiffness_n_m: float) -> None:
        self._shape = shape
        self._stiffness_n_m = stiffness_n_m
        self._sticking = False

    def height_m(self, x_m: float) -> float:
        """Return the height of the untouched surface at x."""
        shape = self._shape
        fraction = (x_m - BUMP_FROM_M) / BUMP_LENGTH_M
        bump = 0.5 - 0.5 * math.cos(2 * math.pi * fraction) if 0 < fraction < 1 else 0.0
        step = shape.step_m if x_m >= shape.step_from_m else 0.0
        return x_m * math.tan(shape.tilt_rad) + shape.bump_m * bump + step

    def force_n(self, x_m: float, z_m: float) -> float:
        """Return the force of a finger at (x, z), positive when pressing: a spring that may stick."""
        if x_m >= self._shape.edge_m:
            self._sticking = False
            return 0.0
        depth = self.height_m(x_m) - z_m
        press = self._press_n(depth)
        # A sticky surface follows the finger until it comes off.
        self._sticking = depth > 0 or (self._sticking and press > -self._shape.adhesion_n)
        if not self._sticking:
            return 0.0
        return press + self._shape.stick_slip_n * (2 * ((x_m / STICK_M) % 1.0) - 1)

    def wall_n(self, x_m: float) -> float:
        """Return the force with which a wall pushes the finger back along x."""
        return -BASE_STIFFNESS_N_M * max(0.0, x_m - self._shape.wall_m)

    def _press_n(self, depth_m: float) -> float:
        """Return the force of the spring, or of the soft layer and the base below it."""
        layer_m = self._shape.layer_m
        if not layer_m or depth_m <= layer_m:
            return self._stiffness_n_m * depth_m
        return self._stiffness_n_m * layer_m + BASE_STIFFNESS_N_M * (depth_m - layer_m)


# --------------------
# The arm: ideal, or with velocities that take effect with a delay.

HOLDS_S = 0.02  # time for which an arm keeps a velocity without a new command


class DelayedVelocity:
    """A velocity that takes effect with a delay, and holds for a short time only."""

    def __init__(self, delay_s: float, now_ns: int) -> None:
        self._delay_ns = round(delay_s * 1e9)
        self._coming: deque[tuple[int, Vector]] = deque()
        self._now: Vector = (0.0, 0.0, 0.0)
        self._since_ns = self._done_ns = now_ns

    def ask(self, now_ns: int, velocity: Vector) -> None:
        """Command a velocity, m/s."""
        self._coming.append((now_ns + self._delay_ns, velocity))

    def moved_m(self, until_ns: int) -> Vector:
        """Return the distance since the last call."""
        travelled: Vector = (0.0, 0.0, 0.0)
        while self._coming and self._coming[0][0] <= until_ns:
            begin_ns, velocity = self._coming.popleft()
            travelled = self._go(travelled, begin_ns)
            self._now, self._since_ns = velocity, begin_ns
        return self._go(travelled, until_ns)

    def _go(self, travelled: Vector, until_ns: int) -> Vector:
        held_s = max(0, min(until_ns, self._since_ns + round(HOLDS_S * 1e9)) - self._done_ns) * 1e-9
        self._done_ns = max(self._done_ns, until_ns)
        x, y, z = (at + speed * held_s for at, speed in zip(travelled, self._now, strict=True))
        return x, y, z


RATE_HZ = 250.0
RESTING_PERIOD_S = 0.05  # a finger at rest is still reported, at little cost
STEEPEST = 1.0  # slope that the force mode of the arm follows


@dataclass(frozen=True)
class SimulatedArmParams(ForceLoopParams, CommandLimits):
    """Parameters of the simulated arm and of its contact with the surface."""

    force_mode: bool = param(
        True, 'Lets the arm control forces itself, ideally; false gives a delayed velocity interface.'
    )
    force_noise_n: float = param(
        0.001, 'Standard deviation of the force noise of an arm without force mode.', unit='N', low=0.0, high=1.0
    )
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


SEED = 1  # of the noise: equal runs are equal


class SimulatedArm(Arm):
    """A finger that follows velocities exactly and, if it has a force mode, approaches a wanted force exponentially.

    Without a force mode velocities come into effect after `loop_delay_s`.

    Parameters
    ----------
    params
        The arm and its contact.
    clock
        CLOCK_MONOTONIC in ns.
    own_thread
        Move in a thread at 250 Hz once connected. If False, the owner of the arm calls `step`.
    shape
        Of the surface under the finger.
    """

    Params = SimulatedArmParams
    keeps_start = True

    def __init__(
        self,
        params: SimulatedArmParams = SimulatedArmParams(),
        clock: Callable[[], int] = time.monotonic_ns,
        own_thread: bool = True,
        shape: SurfaceShape = PLANE,
    ) -> None:
        self._params = params
        self._clock = clock
        self._own_thread = own_thread
        self._last_command = (STANDSTILL, clock())  # the command, and when it came
        delay_s = 0.0 if params.force_mode else params.loop_delay_s
        start: Vector = (0.0, 0.0, params.start_height_m)
        self._state = ArmState(clock(), start, (0.0, 0.0, 0.0), 0.0, delay_s=delay_s)
        self._frozen = self._jammed = False
        self._fault = ''
        self._push_n = 0.0
        self._true_n = 0.0
        self._stuck_n: float | None = None  # reading of a frozen force sensor
        self._drift_n = self._drift_n_s = 0.0
        self._noise_n = 0.0 if params.force_mode else params.force_noise_n
        self._rng = np.random.default_rng(SEED)
        self.force_reading = _force_reading(params)
        self._wake = threading.Event()
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._emulator = FingerSender(params.finger_pipe)
        shape = replace(shape, edge_m=params.edge_m) if params.edge_m else shape
        self._surface = SimulatedSurface(shape, params.stiffness_n_m)
        self._velocity = None if params.force_mode else CommandedVelocity(params, 1 / RATE_HZ)
        self._delayed = DelayedVelocity(params.loop_delay_s, clock())

    def connect(self) -> None:
        """Start the thread; clear injected faults."""
        self.close()
        self._frozen, self._fault, self._push_n = False, '', 0.0
        self._jammed = False
        self._stuck_n, self._drift_n, self._drift_n_s = None, 0.0, 0.0
        self._closing.clear()
        self.step(0.0)
        if self._own_thread:
            self._thread = threading.Thread(target=self._run, name='simulated_arm', daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Stop and end the thread."""
        self.stop()
        self._closing.set()
        self._wake.set()
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
        self._params.check(command, self.stop)
        was_idle = self._is_idle
        self._last_command = (command, self._clock())
        if was_idle:
            self._wake.set()

    def stop(self) -> None:
        """Stop."""
        self._last_command = (STANDSTILL, self._clock())

    def doubt(self) -> str:
        """Return in a sentence that the force is too late for force control, '' if not."""
        return self._velocity.doubt() if self._velocity else ''

    def freeze(self) -> None:
        """Behave like a controller that hangs: an old state, no effect of commands, until connected again."""
        self._frozen = True

    def jam(self) -> None:
        """Behave like an arm whose finger is blocked along the surface, until connected again."""
        self._jammed = True

    def fail(self, reason: str) -> None:
        """Behave like an arm in a protective stop: stop and report the reason, until connected again."""
        self._fault = reason
        self._state = replace(self._state, velocity=(0.0, 0.0, 0.0), fault=reason)

    def push(self, force_n: float) -> None:
        """Add an external force on the finger, until connected again."""
        self._push_n = force_n

    def freeze_force(self) -> None:
        """Behave like an arm whose force sensor hangs: it shows the same force, until connected again."""
        self._stuck_n = self._state.force_n

    def drift_force(self, rate_n_s: float) -> None:
        """Let the measured force drift at a constant rate, N/s, until connected again."""
        self._drift_n_s = rate_n_s

    @property
    def true_force_n(self) -> float:
        """True force of the finger, independent of the force sensor."""
        return self._true_n

    def displace(self, distance_m: Vector) -> None:
        """Displace the finger, as by an external push."""
        x, y, z = (at + step_m for at, step_m in zip(self._state.position, distance_m, strict=True))
        self._state = replace(self._state, position=(x, y, z))

    def step(self, dt_s: float) -> None:
        """Move for `dt_s` up to the clock's present time, as commanded and as long as the command holds."""
        if self._frozen:
            return
        now_ns = self._clock()
        command, given_ns = self._last_command if not self._fault else (STANDSTILL, now_ns)
        left_s = self._params.command_timeout_s + (given_ns - now_ns) * 1e-9
        # After a pause the newest command holds at most for the usual time.
        moving_s = min(max(0.0, dt_s + min(0.0, left_s)), self._params.command_timeout_s)
        moved = self._delayed.moved_m(now_ns) if self._velocity else self._moved_m(command, moving_s)
        moved = (0.0, 0.0, moved[2]) if self._jammed else moved
        x, y, z = (at + step_m for at, step_m in zip(self._state.position, moved, strict=True))
        velocity = _speed(moved, moving_s)
        if left_s < 0:
            velocity = (0.0, 0.0, 0.0)
            command = STANDSTILL
            self._last_command = (STANDSTILL, now_ns)
        self._true_n = self._surface.force_n(x, z) + self._push_n
        along_n = (self._surface.wall_n(x), 0.0)
        force_n = self._measured_n(dt_s)
        self._state = replace(
            self._state,
            time_ns=now_ns,
            position=(x, y, z),
            velocity=velocity,
            force_n=force_n,
            along_n=along_n,
            fault=self._fault,
        )
        if self._velocity:
            self._delayed.ask(now_ns, self._velocity.choose(command, self._state, min(dt_s, HOLDS_S)))
        self._emulator.send(FingerState(now_ns, x, y, z, *velocity, self._true_n))

    @property
    def _is_idle(self) -> bool:
        return self._last_command[0] == STANDSTILL

    def _measured_n(self, dt_s: float) -> float:
        """Return the reading of the force sensor for the true force."""
        if self._stuck_n is not None:
            return self._stuck_n
        self._drift_n += self._drift_n_s * dt_s
        noise_n = self._noise_n * self._rng.standard_normal() if self._noise_n else 0.0
        return self._true_n + self._drift_n + noise_n

    def _moved_m(self, command: ArmCommand, dt_s: float) -> Vector:
        vx, vy = command.tangential_m_s
        return vx * dt_s, vy * dt_s, self._normal_step(command, dt_s)

    def _normal_step(self, command: ArmCommand, dt_s: float) -> float:
        """Return the change of height in one step, m.

        Admittance control, vz = a·(F − F_wanted), solved exactly over the step: with F = k·depth the force error
        decays as exp(−a·k·t), which no step size makes unstable. In contact the finger also follows the surface.
        """
        if command.force_n is None:
            return command.normal_m_s * dt_s
        admittance = self._params.admittance_m_s_n
        decay_s = admittance * self._params.stiffness_n_m
        effective_s = -math.expm1(-decay_s * dt_s) / decay_s if decay_s > 0 else dt_s
        x = self._state.position[0]
        step_m = command.tangential_m_s[0] * dt_s
        rise = self._surface.height_m(x + step_m) - self._surface.height_m(x)
        # A step is met or lost, not followed.
        follow = rise if self._state.force_n > 0 and abs(rise) <= STEEPEST * abs(step_m) else 0.0
        return admittance * (self._state.force_n - command.force_n) * effective_s + follow

    def _run(self) -> None:
        last_ns = self._clock()
        while not self._closing.is_set():
            if self._is_idle:
                # A command ends the rest at once, and counts from now on.
                self._wake.wait(RESTING_PERIOD_S)
                self._wake.clear()
                last_ns = self._clock()
            else:
                self._closing.wait(1 / RATE_HZ)
            now_ns = self._clock()
            self.step((now_ns - last_ns) * 1e-9)
            last_ns = now_ns


def _speed(moved_m: Vector, dt_s: float) -> Vector:
    if dt_s <= 0:
        return 0.0, 0.0, 0.0
    x, y, z = (step_m / dt_s for step_m in moved_m)
    return x, y, z


def _force_reading(params: SimulatedArmParams) -> ForceReading:
    if params.force_mode:
        return ForceReading.CONTROLLED
    return ForceReading.NOISY if params.force_noise_n else ForceReading.MEASURED
