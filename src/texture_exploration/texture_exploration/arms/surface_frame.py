"""The frame of the surface, as an arm with a base frame of its own sees it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_core.rotation import rotation_matrix
from texture_exploration.arms.protocol import Vector

PoseParamsT = TypeVar('PoseParamsT', bound='SurfacePoseParams')


@dataclass(frozen=True)
class SurfacePoseParams:
    """Where the surface is, seen from the base of an arm; a base of the parameters of each arm with a base frame."""

    surface_x_m: float = param(
        0.4, 'Sets the x coordinate of the origin of the surface frame in the base frame.', unit='m', low=-3.0, high=3.0
    )
    surface_y_m: float = param(
        0.0, 'Sets the y coordinate of the origin of the surface frame in the base frame.', unit='m', low=-3.0, high=3.0
    )
    surface_z_m: float = param(
        0.1, 'Sets the z coordinate of the origin of the surface frame in the base frame.', unit='m', low=-3.0, high=3.0
    )
    surface_rx_rad: float = param(
        0.0,
        'Sets the x component of the rotation vector of the surface frame; its z axis points away from the surface.',
        unit='rad',
        low=-7.0,
        high=7.0,
    )
    surface_ry_rad: float = param(
        0.0, 'Sets the y component of the rotation vector of the surface frame.', unit='rad', low=-7.0, high=7.0
    )
    surface_rz_rad: float = param(
        0.0, 'Sets the z component of the rotation vector of the surface frame.', unit='rad', low=-7.0, high=7.0
    )

    def at_surface(self: PoseParamsT, pose: Sequence[float]) -> PoseParamsT:
        """Return the parameters with another pose of the surface, (6,) as `surface_pose`."""
        names = ('surface_x_m', 'surface_y_m', 'surface_z_m', 'surface_rx_rad', 'surface_ry_rad', 'surface_rz_rad')
        return replace(self, **dict(zip(names, map(float, pose), strict=True)))

    @property
    def surface_pose(self) -> tuple[float, ...]:
        """Pose of the surface in the base frame: place in m, then a rotation vector in rad, (6,)."""
        origin = (self.surface_x_m, self.surface_y_m, self.surface_z_m)
        return (*origin, self.surface_rx_rad, self.surface_ry_rad, self.surface_rz_rad)


class SurfaceFrame:
    """Turn places and directions from the base frame of an arm to the frame of the surface and back.

    Parameters
    ----------
    pose : (6,)
        Of the surface in the base frame: x, y, z in m of a point in it, then a rotation vector in rad. The z axis
        points away from the surface.
    """

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
