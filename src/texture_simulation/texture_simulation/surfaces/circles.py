"""Concentric rings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.surfaces.ridges import SHAPES, profile


@dataclass(frozen=True)
class Circles:
    """Concentric rings: blurred as straight ridges are, which is right but within a pitch or so of the centre."""

    pitch_m: float = param(
        2e-3,
        'Sets the distance between rings; a larger pitch lowers the frequency of the signal.',
        unit='m',
        low=1e-5,
        high=0.1,
    )
    depth_m: float = param(
        2e-4,
        'Sets the height of the rings above the grooves; a larger depth gives a stronger signal.',
        unit='m',
        low=0.0,
        high=0.01,
    )
    centre_x_m: float = param(
        0.05, 'Sets the x coordinate of the centre; slides begin within 0.1 m of the origin.', unit='m'
    )
    centre_y_m: float = param(
        0.05, 'Sets the y coordinate of the centre; slides begin within 0.1 m of the origin.', unit='m'
    )
    shape: str = param('sine', "Sets the cross-section of the rings, 'sine' or 'square'.", choices=SHAPES)
    duty: float = param(0.5, 'Sets the share of the pitch that a square ring takes.', low=0.05, high=0.95)

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions, (..., n)."""
        radius_m = np.hypot(x_m - self.centre_x_m, y_m - self.centre_y_m)
        return self.depth_m * profile(radius_m, blur_m, self.pitch_m, self.shape, self.duty)
