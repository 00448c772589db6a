"""No sample is everywhere the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.path import Path

# Plane waves of 16 to 45 mm in four directions, with phases of no meaning.
WAVES_1_M = 2 * np.pi * np.array([[38.0, 11.0], [-17.0, 57.0], [29.0, -33.0], [9.0, 20.0]])
PHASES = np.array([0.3, 1.9, 4.1, 5.2])
KNOT_M, KNOT_POINTS = 1e-3, 16  # the gain is reckoned so often and interpolated between


@dataclass(frozen=True)
class Unevenness:
    """The texture is felt more strongly in some places of a sample than in others."""

    relative: float = param(0.1, 'Relative variation of the texture over some centimetres.', low=0.0, high=1.0)

    def gain(self, path: Path, finger: int) -> Array | float:
        """Return the gain at places, (..., n): mean 1, standard deviation `relative`, never below 0."""
        if not len(path):
            return 1.0
        longest_m = np.abs(np.diff(path.x_m)).max(initial=0.0) + np.abs(np.diff(path.y_m)).max(initial=0.0)
        every = KNOT_POINTS if longest_m * KNOT_POINTS <= KNOT_M else max(1, int(KNOT_M / longest_m))
        knots = np.unique(np.append(np.arange(0, len(path), every), len(path) - 1))
        x_m, y_m = path.x_m[..., knots], path.y_m[..., knots]
        waves = sum(np.cos(kx * x_m + ky * y_m + phase) for (kx, ky), phase in zip(WAVES_1_M, PHASES, strict=True))
        gain = np.maximum(1 + self.relative * np.sqrt(2 / len(PHASES)) * waves, 0.0)
        return _between(gain, knots, len(path))


def _between(values: Array, knots: Array, n_points: int) -> Array:
    """Return values at all of the points, (..., n_points), straight from knot to knot."""
    points = np.arange(n_points)
    left = np.clip(np.searchsorted(knots, points, side='right') - 1, 0, max(0, len(knots) - 2))
    right = np.minimum(left + 1, len(knots) - 1)
    share = (points - knots[left]) / np.maximum(knots[right] - knots[left], 1)
    low = values[..., left]
    between: Array = low + (values[..., right] - low) * share
    return between
