"""The emulated robot: a finger that follows motions exactly, complies under force control, and measures forces."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_simulation.devices.ur.contact_plane import ContactPlane
from texture_simulation.devices.ur.motions import RobotMove, StopMove
from texture_simulation.devices.ur.params import UrControllerParams

# Force control of the emulated robot: speed per force error, and the lag of the arm behind it. With 2 kN/m the error
# fades in about 0.1 s, which is of the order of a real arm's.
ADMITTANCE_M_S_N = 0.01
LAG_S = 0.01
HALT = 20.0  # deceleration of a protective stop, m/s²
# The sensor drifts apart on all axes when it is not zeroed.
OFFSET_DIRECTION = np.array([0.4, -0.3, 0.866, 0.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class ForceMode:
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
    touched_at : (6,)
        Where the last contact began.
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
        self.motion: RobotMove = StopMove(HALT)
        self.force_mode: ForceMode | None = None
        self.touched_at = self.pose
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
        led = velocity = self.motion.velocity(self.pose, self._unslowed, step_s)
        if self.force_mode is not None:
            velocity = self._comply(velocity, self.force_mode, step_s)
            led = _stiff(led, self.force_mode)
        self._unslowed = velocity
        velocity = velocity - (1.0 - self.speed_share) * led
        self.velocity = velocity
        self.pose = self.pose + velocity * step_s
        touched = self._contact.any()
        self._contact = self.surface.force_n(self.pose[:3], velocity[:3])
        if not touched and self._contact.any():
            self.touched_at = self.pose
        self.force = self._offset + self._noise_n * self._rng.standard_normal(6)
        self.force[:3] += self._contact

    def zero_force(self) -> None:
        """Take what the sensor shows for nothing from now on."""
        self._offset = np.zeros(6)
        self._offset[:3] = -self._contact

    def touches(self, direction: Array, threshold_n: float) -> bool:
        """Return whether a force against a direction, (3,), is measured; a direction of 0 means any.

        Parameters
        ----------
        direction : (3,)
            Direction of the movement; 0 for any.
        threshold_n
            Force from which on it counts.
        """
        force = self.force[:3]
        length = math.sqrt(direction @ direction)
        against = math.sqrt(force @ force) if length == 0 else -(force @ direction) / length
        return float(against) > threshold_n

    def end_force_mode(self) -> None:
        """Yield no longer."""
        self.force_mode = None
        self._compliant_m_s = np.zeros(3)

    def halt(self) -> None:
        """Stop hard, whatever it was doing."""
        self.end_force_mode()
        self.motion = StopMove(HALT)

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
