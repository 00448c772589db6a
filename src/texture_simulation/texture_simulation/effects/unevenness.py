"""No sample is everywhere the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.slow_field import interpolated_field
from texture_simulation.trajectory import Trajectory

# Plane waves of 16 to 45 mm in four directions, with phases of no meaning.
WAVES_1_M = 2 * np.pi * np.array([[38.0, 11.0], [-17.0, 57.0], [29.0, -33.0], [9.0, 20.0]])
PHASES = np.array([0.3, 1.9, 4.1, 5.2])
KNOT_M = 1e-3  # straight between such places it is wrong by 2 % of its variation at most


@dataclass(frozen=True)
class Unevenness:
    """The texture is measured more strongly in some places of a sample than in others."""

    relative: float = param(
        0.1, 'Sets the relative standard deviation of the texture strength over some centimetres.', low=0.0, high=1.0
    )

    def gain(self, path: Trajectory, finger: int) -> Array | float:
        """Return the gain at places, (..., n): mean 1, standard deviation `relative`, never below 0."""
        return interpolated_field(self._at, path.x_m, path.y_m, KNOT_M) if len(path) else 1.0

    def _at(self, x_m: Array, y_m: Array) -> Array:
        waves = sum(np.cos(kx * x_m + ky * y_m + phase) for (kx, ky), phase in zip(WAVES_1_M, PHASES, strict=True))
        gain: Array = np.maximum(1 + self.relative * np.sqrt(2 / len(PHASES)) * waves, 0.0)
        return gain
