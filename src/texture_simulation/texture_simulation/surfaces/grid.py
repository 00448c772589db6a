"""Bumps or hollows in rows and columns."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.surfaces.ridges import SHAPES, profile

MEAN = {'sine': 0.5}


@dataclass(frozen=True)
class Grid:
    """Posts in rows and columns, or a net of ribs between hollows.

    The relief is a product of two profiles; a round Gaussian blurs each of them by itself, so this is exact.
    """

    pitch_x_m: float = param(
        2e-3,
        'Sets the distance of posts along the first direction; a larger pitch lowers the frequency of the signal.',
        unit='m',
        low=1e-5,
        high=0.1,
    )
    pitch_y_m: float = param(
        2e-3,
        'Sets the distance of posts along the second direction, across the first one.',
        unit='m',
        low=1e-5,
        high=0.1,
    )
    depth_m: float = param(
        2e-4, 'Sets the height of posts or ribs; a larger depth gives a stronger signal.', unit='m', low=0.0, high=0.01
    )
    angle_rad: float = param(
        0.0, 'Sets the first direction, from +x towards +y.', unit='rad', low=-math.pi, high=math.pi
    )
    shape: str = param('sine', "Sets the cross-section of the posts or hollows, 'sine' or 'square'.", choices=SHAPES)
    duty: float = param(0.5, 'Sets the share of the pitch that a post or a hollow takes.', low=0.05, high=0.95)
    relief: str = param(
        'posts', "Sets what stands out: 'posts', or a 'net' of ribs between hollows.", choices=('posts', 'net')
    )

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions, (..., n)."""
        cosine, sine = math.cos(self.angle_rad), math.sin(self.angle_rad)
        mean = MEAN.get(self.shape, self.duty)
        along = profile(x_m * cosine + y_m * sine, blur_m, self.pitch_x_m, self.shape, self.duty)
        across = profile(y_m * cosine - x_m * sine, blur_m, self.pitch_y_m, self.shape, self.duty)
        sign = 1.0 if self.relief == 'posts' else -1.0
        # Less its own mean; in place, which costs half as much.
        along += mean
        across += mean
        along *= across
        along -= mean**2
        along *= sign * self.depth_m
        return along
