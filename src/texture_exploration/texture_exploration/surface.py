# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The frame of a surface from places where the fingertip touched it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from texture_core.errors import InvalidData
from texture_core.types import Array, rotation_vector
from texture_exploration.safety import SurfacePatch

MAKE_A_PLANE = 3
TOUCHES = 4  # three are always in a plane: only a further one verifies it
NARROWEST_M = 0.01  # spread of the touches across their longest direction, and distance between any two
LARGEST_RESIDUAL_M = 0.002  # a surface that is bent more than this is no plane
LARGEST_TURN_RAD = math.radians(15.0)  # against the pose before: beyond, a touch is more likely wrong than the pose


class SurfaceFit(NamedTuple):
    """A plane through touches: `pose` as `SurfaceFrame` takes it, (6,); distances of the touches from the plane in m.

    `residual_m` is their root mean square and `largest_m` the largest; both are 0 for three touches, which are always
    in one plane and verify nothing.
    """

    pose: tuple[float, ...]
    residual_m: float
    largest_m: float
    patch: SurfacePatch  # The rectangle around the touches


def fit_surface(
    touches: Sequence[Sequence[float] | Array], normal: Sequence[float], along: Sequence[float]
) -> SurfaceFit:
    """Return the plane that fits at least three touches best, by least squares of the distances (total least squares).

    The origin is the middle of the touches, z the normal, x the direction `along` the surface, projected on the
    plane.
    """
    points = np.array(touches, dtype=float)
    middle = points.mean(axis=0)
    _, _sizes, directions = np.linalg.svd(points - middle, full_matrices=False)
    spread_m = float(np.ptp((points - middle) @ directions[1]))
    if spread_m < NARROWEST_M:
        raise InvalidData(
            f'the touches lie nearly in a line: across it they spread over {1e3 * spread_m:.1f} mm, and '
            f'{1e3 * NARROWEST_M:g} mm are needed; touch at the corners of a triangle'
        )
    axis = np.cross(directions[0], directions[1])
    distances = (points - middle) @ axis
    largest_m = float(np.abs(distances).max())
    if largest_m > LARGEST_RESIDUAL_M:
        raise InvalidData(
            f'the touches do not lie in a plane: one is {1e3 * largest_m:.1f} mm off, and {1e3 * LARGEST_RESIDUAL_M:g} '
            'mm are allowed; touch one flat part of the surface'
        )
    before = np.array(normal, dtype=float) / np.linalg.norm(normal)
    up = axis * (1.0 if axis @ before >= 0.0 else -1.0)
    turn_rad = math.acos(min(1.0, float(up @ before)))
    if turn_rad > LARGEST_TURN_RAD:
        raise InvalidData(
            f'the touched plane is turned by {math.degrees(turn_rad):.0f} degrees against the pose of the surface '
            f'before, and {math.degrees(LARGEST_TURN_RAD):.0f} are allowed; see that every touch is on the surface, '
            'or give its pose as parameters first'
        )
    x_axis = np.array(along, dtype=float)
    x_axis = x_axis - (x_axis @ up) * up
    length = float(np.linalg.norm(x_axis))
    axes = np.column_stack([x_axis / length, np.cross(up, x_axis / length), up])
    pose = (*middle.tolist(), *rotation_vector(axes).tolist())
    x_m, y_m = np.round((points - middle) @ axes[:, :2], 5).T.tolist()
    patch = SurfacePatch(min(x_m), max(x_m), min(y_m), max(y_m))
    return SurfaceFit(pose, float(np.sqrt(np.mean(distances**2))), largest_m, patch)


class SurfaceTouches:
    """Collects touches until they define a plane that one more confirms; further ones refine it."""

    def __init__(self) -> None:
        self._places: list[Array] = []
        self._normal: Sequence[float] = ()  # of the pose before the first touch, so that the plane cannot creep

    def __len__(self) -> int:
        return len(self._places)

    def forget(self) -> int:
        """Discard all touches; return their number."""
        count, self._places = len(self._places), []
        return count

    def add(self, place: Sequence[float], normal: Sequence[float], along: Sequence[float]) -> SurfaceFit | None:
        """Add a touch; return the plane, None if there are too few."""
        newest = np.array(place, dtype=float)
        for number, other in enumerate(self._places, start=1):
            apart_m = float(np.linalg.norm(newest - other))
            if apart_m < NARROWEST_M:
                raise InvalidData(
                    f'it is {1e3 * apart_m:.1f} mm from touch {number}, and {1e3 * NARROWEST_M:g} mm are needed; touch '
                    'another place'
                )
        places = [*self._places, newest]
        self._normal = self._normal if self._places else normal
        fit = fit_surface(places, self._normal, along) if len(places) >= MAKE_A_PLANE else None
        self._places = places
        return fit if len(places) >= TOUCHES else None
