"""The surface under the robot's finger: a plane that may slope and have a bump, elastic and with friction; a wall."""

from __future__ import annotations

import math

import numpy as np

from texture_core.arrays import Array
from texture_simulation.devices.ur.params import UrControllerParams

STICTION_M_S = 5e-4  # below this speed friction grows in proportion: it has no direction at rest


class ContactPlane:
    """Contact force on a finger at a position and velocity, in the base frame of the robot.

    Attributes
    ----------
    drop_m
        The whole surface lies lower by this: set while the finger slides, the surface is lost as behind an edge.
    friction
        Coefficient of Coulomb friction: another sample has another one.
    """

    def __init__(self, params: UrControllerParams) -> None:
        self._params = params
        self.drop_m = 0.0
        self.friction = params.friction
        self.origin = np.array([params.surface_x_m, params.surface_y_m, params.surface_z_m])

    def force_n(self, position_m: Array, velocity_m_s: Array) -> Array:
        """Return the force of the surface on the finger.

        Parameters
        ----------
        position_m, velocity_m_s : (3,)

        Returns
        -------
        (3,)
            Stiffness × depth along the normal, Coulomb friction against the movement, and the push of the wall.
        """
        behind_m = max(0.0, float(position_m[0] - self.origin[0]) - self._params.wall_m)
        wall: Array = np.array([-self._params.wall_stiffness_n_m * behind_m, 0.0, 0.0])
        depth, normal = self._depth_and_normal(position_m)
        pressing = self._params.stiffness_n_m * max(0.0, depth)
        if pressing == 0.0:
            return wall
        along = velocity_m_s - (velocity_m_s @ normal) * normal
        speed = math.sqrt(along @ along)
        force: Array = wall + pressing * normal - self.friction * pressing * along / max(speed, STICTION_M_S)
        return force

    def _depth_and_normal(self, position_m: Array) -> tuple[float, Array]:
        params = self._params
        x, y, z = position_m - self.origin
        width = params.bump_width_m
        bump = params.bump_height_m * math.exp(-(x * x + y * y) / (2 * width * width))
        slope_x = params.slope_x - bump * x / (width * width)
        slope_y = params.slope_y - bump * y / (width * width)
        steepness = math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        height = params.slope_x * x + params.slope_y * y + bump - self.drop_m
        normal = np.array([-slope_x, -slope_y, 1.0]) / steepness
        return float(height - z) / steepness, normal
