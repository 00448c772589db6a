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

    pitch_m: float = param(2e-3, 'Distance between rings.', unit='m', low=1e-5, high=0.1)
    depth_m: float = param(2e-4, 'Height of the rings over the grooves.', unit='m', low=0.0, high=0.01)
    centre_x_m: float = param(0.05, 'Their centre; slides begin within 0.1 m of the origin.', unit='m')
    centre_y_m: float = param(0.05, 'The same across.', unit='m')
    shape: str = param('sine', 'Shape of the rings.', choices=SHAPES)
    duty: float = param(0.5, 'Share of the pitch that a square ring takes.', low=0.05, high=0.95)

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the height felt at places, (..., n)."""
        radius_m = np.hypot(x_m - self.centre_x_m, y_m - self.centre_y_m)
        return self.depth_m * profile(radius_m, blur_m, self.pitch_m, self.shape, self.duty)
