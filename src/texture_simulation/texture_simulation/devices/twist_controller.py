# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A twist controller with poses and wrenches, as a ROS arm offers them."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from texture_core.config import param
from texture_core.types import Array, FingerState, rotation_matrix
from texture_simulation.devices.rails import ContactParams

# --------------------
# The surface under the finger of an emulated arm, and a wall.


@dataclass(frozen=True)
class TouchedSurfaceParams(ContactParams):
    """Position of the surface and of obstacles."""

    surface_x_m: float = param(0.4, 'X coordinate of the centre of the surface in the base frame.', unit='m')
    surface_y_m: float = param(0.0, 'Y coordinate of the centre of the surface in the base frame.', unit='m')
    surface_z_m: float = param(0.1, 'Z coordinate of the centre of the surface in the base frame.', unit='m')
    wall_m: float = param(
        2.0,
        'X coordinate, in the surface frame, of a wall across the path of the finger.',
        unit='m',
        low=-2.0,
        high=2.0,
    )
    wall_stiffness_n_m: float = param(20000.0, 'Stiffness of finger and wall.', unit='N/m', low=0.0, high=200000.0)
    force_offset_n: float = param(1.5, 'Offset of the force sensor until it is zeroed.', unit='N')
    seed: int = param(1, 'Seed of noise and jitter; equal seeds give equal noise.', low=0)


STICTION_M_S = 5e-4  # below this speed friction grows in proportion: it has no direction at rest


def approach(now: Array, wanted: Array, most: float) -> Array:
    """Return a vector led towards a wanted one by at most so much."""
    change = wanted - now
    size = math.sqrt(float(change @ change))
    return wanted if size <= most else now + change * (most / size)


def touch_force_n(
    params: TouchedSurfaceParams, friction: float, axes: Array, from_origin_m: Array, velocity_m_s: Array
) -> Array:
    """Return the force on a finger, (3,): an elastic plane with Coulomb friction across axis z, a wall across x."""
    normal = axes[:, 2]
    pressing_n = params.stiffness_n_m * max(0.0, -float(from_origin_m @ normal))
    behind_m = max(0.0, float(from_origin_m @ axes[:, 0]) - params.wall_m)
    along = velocity_m_s - (velocity_m_s @ normal) * normal
    dragging = along / max(math.sqrt(float(along @ along)), STICTION_M_S)
    return pressing_n * (normal - friction * dragging) - params.wall_stiffness_n_m * behind_m * axes[:, 0]


# --------------------
# The parameters of an emulated arm with a Cartesian velocity controller.


@dataclass(frozen=True)
class TwistControllerParams(TouchedSurfaceParams):
    """The emulated controller, its arm, its force sensor and the surface under the finger."""

    lag_s: float = param(
        0.02,
        'Time after which a commanded velocity comes into effect.',
        unit='s',
        low=0.0,
        high=0.2,
    )
    jitter_s: float = param(
        0.002,
        'Largest random delay that is added to the lag and to the period of the measurements.',
        unit='s',
        low=0.0,
        high=0.1,
    )
    max_speed_m_s: float = param(
        0.25, 'Highest speed of the arm; faster commands are scaled down.', unit='m/s', low=0.001, high=3.0
    )
    max_acceleration_m_s2: float = param(
        10.0,
        'Highest acceleration of the arm.',
        unit='m/s²',
        low=0.1,
        high=150.0,
    )
    command_timeout_s: float = param(
        0.1,
        'How long a command holds without a new one; 0 keeps executing the last one.',
        unit='s',
        low=0.0,
        high=5.0,
    )
    active: bool = param(True, 'Lets the controller follow commands; false makes it listen without moving the arm.')
    surface_rx_rad: float = param(
        0.0, 'X component of the rotation vector of the surface in the base frame.', unit='rad'
    )
    surface_ry_rad: float = param(
        0.0, 'Y component of the rotation vector of the surface in the base frame.', unit='rad'
    )
    surface_rz_rad: float = param(
        0.0, 'Z component of the rotation vector of the surface in the base frame.', unit='rad'
    )
    friction: float = param(0.3, 'Coefficient of Coulomb friction.', low=0.0, high=3.0)
    tool_mass_kg: float = param(
        0.2, 'Mass of the tool, whose weight the force sensor shows.', unit='kg', low=0.0, high=20.0
    )
    force_noise_n: float = param(
        0.002, 'Standard deviation of the noise of the force sensor.', unit='N', low=0.0, high=5.0
    )
    invert_twist: bool = param(False, 'Moves against each commanded velocity, as behind a frame that is upside down.')
    invert_force: bool = param(
        False, 'Shows the force of the tool on its surroundings, as a sensor of the other convention.'
    )
    turn_force_rad: float = param(
        0.0,
        'Angle about y by which the frame of the measured force is turned against its name.',
        unit='rad',
        low=-4.0,
        high=4.0,
    )


# --------------------
# An arm behind a velocity controller: it follows late, with its own limits, and presses on an elastic surface.

STEP_NS = 1_000_000
MAX_STEPS = 100  # in one go, after the machine was busy
GRAVITY_M_S2 = 9.81
TOOL_DOWN = (1.0, 0.0, 0.0, 0.0)  # quaternion x, y, z, w: the tool's z axis points against that of the base
TOOL_AXES = np.diag([1.0, -1.0, -1.0])


class EmulatedTwistArm:
    """The arm: commands in, pose and force out; time goes by `advance`."""

    def __init__(self, params: TwistControllerParams, now_ns: int) -> None:
        self.params = params
        self._rng = np.random.default_rng(params.seed)
        self._axes = rotation_matrix((params.surface_rx_rad, params.surface_ry_rad, params.surface_rz_rad))
        self._origin = np.array([params.surface_x_m, params.surface_y_m, params.surface_z_m])
        self.position: Array = self._origin + params.start_height_m * self._axes[:, 2]
        self.velocity: Array = np.zeros(3)
        self._coming: deque[tuple[int, Array]] = deque()
        self._wanted: Array = np.zeros(3)
        self._since_ns = self._now_ns = now_ns

    def command(self, now_ns: int, velocity_m_s: Array) -> None:
        """Take a velocity in the base frame, (3,), m/s; it comes into effect later."""
        if self.params.active:
            delay_s = self.params.lag_s + self.jitter_s()
            sign = -1.0 if self.params.invert_twist else 1.0
            self._coming.append((now_ns + round(delay_s * 1e9), sign * velocity_m_s))

    def jitter_s(self) -> float:
        """Return a random delay."""
        return float(self._rng.uniform(0.0, self.params.jitter_s)) if self.params.jitter_s else 0.0

    def advance(self, now_ns: int) -> None:
        """Let time pass; what a busy machine has missed for too long is left out."""
        steps = (now_ns - self._now_ns) // STEP_NS
        if steps > MAX_STEPS:
            self._now_ns = now_ns - MAX_STEPS * STEP_NS
            steps = MAX_STEPS
        for _ in range(steps):
            self._now_ns += STEP_NS
            self._step(STEP_NS * 1e-9)

    @property
    def force_n(self) -> Array:
        """Force on the finger in the base frame, (3,), N."""
        from_origin_m = self.position - self._origin
        return touch_force_n(self.params, self.params.friction, self._axes, from_origin_m, self.velocity)

    def reading_n(self) -> Array:
        """Return what the force sensor shows in the frame of the tool, (3,): with weight, offset and noise."""
        weight = np.array([0.0, 0.0, -self.params.tool_mass_kg * GRAVITY_M_S2])
        noise = self.params.force_noise_n * self._rng.standard_normal(3)
        turned = rotation_matrix((0.0, self.params.turn_force_rad, 0.0))
        reading: Array = turned @ TOOL_AXES.T @ (self.force_n + weight) + self.params.force_offset_n + noise
        return -reading if self.params.invert_force else reading

    def finger(self) -> FingerState:
        """Return the true state of the finger in the frame of the surface."""
        x, y, z = (self._axes.T @ (self.position - self._origin)).tolist()
        vx, vy, vz = (self._axes.T @ self.velocity).tolist()
        return FingerState(self._now_ns, x, y, z, vx, vy, vz, float(self.force_n @ self._axes[:, 2]))

    def _step(self, dt_s: float) -> None:
        params = self.params
        while self._coming and self._coming[0][0] <= self._now_ns:
            self._since_ns, self._wanted = self._coming.popleft()
        if params.command_timeout_s and self._now_ns - self._since_ns > params.command_timeout_s * 1e9:
            self._wanted = np.zeros(3)
        wanted = self._wanted
        speed = math.sqrt(float(wanted @ wanted))
        if speed > params.max_speed_m_s:
            wanted = wanted * (params.max_speed_m_s / speed)
        self.velocity = approach(self.velocity, wanted, params.max_acceleration_m_s2 * dt_s)
        self.position = self.position + self.velocity * dt_s
