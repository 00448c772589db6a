"""The frame of the surface, as an arm with a base frame of its own sees it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texture_core.arrays import Array
from texture_core.rotation import rotation_matrix
from texture_exploration.arms.protocol import Vector


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

    def to_base(self, direction: Sequence[float]) -> Vector:
        """Return a velocity or a force of the frame of the surface in the base frame."""
        return _vector(self._axes @ np.array(direction))


def _vector(values: Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
