"""Parallel ridges."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.surfaces.ridges import SHAPES, profile


@dataclass(frozen=True)
class Grating:
    """Parallel ridges, `angle_rad` from +x towards +y: a slide along +x meets v·cos(angle)/pitch of them a second."""

    pitch_m: float = param(
        2e-3,
        'Sets the distance between ridges; a larger pitch lowers the frequency of the signal.',
        unit='m',
        low=1e-5,
        high=0.1,
    )
    depth_m: float = param(
        2e-4,
        'Sets the height of the ridges above the grooves; a larger depth gives a stronger signal.',
        unit='m',
        low=0.0,
        high=0.01,
    )
    angle_rad: float = param(
        0.0, 'Sets the direction across the ridges, from +x towards +y.', unit='rad', low=-math.pi, high=math.pi
    )
    shape: str = param('sine', "Sets the cross-section of the ridges, 'sine' or 'square'.", choices=SHAPES)
    duty: float = param(0.5, 'Sets the share of the pitch that a square ridge takes.', low=0.05, high=0.95)

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions, (..., n)."""
        across_m = x_m * math.cos(self.angle_rad) + y_m * math.sin(self.angle_rad)
        return self.depth_m * profile(across_m, blur_m, self.pitch_m, self.shape, self.duty)
