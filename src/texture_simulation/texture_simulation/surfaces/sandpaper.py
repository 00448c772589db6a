"""Grains glued to a sheet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.surfaces.tiles import SIDE, tile_height

POINTS_PER_GRAIN = 4
SIZES = (0.5, 1.5)  # range of the grains' heights, of the mean


@dataclass(frozen=True)
class Sandpaper:
    """Round grains at random places, of random height; where they overlap they add up.

    Sizes of FEPA grades: P60 269 µm, P80 201, P120 125, P240 58.5, P400 35 (ISO 6344).
    """

    grain_m: float = param(
        2e-4, 'Sets the diameter of a grain; a larger grain gives lower frequencies.', unit='m', low=2e-5, high=0.01
    )
    grain_height_m: float = param(
        5e-5,
        'Sets the mean height of a grain above the sheet; a larger height gives a stronger signal.',
        unit='m',
        low=0.0,
        high=0.005,
    )
    cover: float = param(0.5, 'Sets the share of the sheet that lies under grains.', low=0.02, high=2.0)
    seed: int = param(0, 'Sets the seed of the places and heights of the grains.', low=0)

    @property
    def spacing_m(self) -> float:
        """Distance of the tile's points."""
        return self.grain_m / POINTS_PER_GRAIN

    def sharp(self) -> Array:
        """Return the height over one tile, (SIDE, SIDE) m, less its mean."""
        rng = np.random.default_rng(self.seed)
        grain_points = np.pi / 4 * POINTS_PER_GRAIN**2
        tops = np.zeros((SIDE, SIDE))
        count = round(self.cover * SIDE**2 / grain_points)
        np.add.at(tops, tuple(rng.integers(0, SIDE, (2, count))), rng.uniform(*SIZES, count))
        away = np.minimum(np.arange(SIDE), SIDE - np.arange(SIDE))
        dome = np.maximum(0.0, 1 - (away[:, None] ** 2 + away**2) / (POINTS_PER_GRAIN / 2) ** 2)
        height = self.grain_height_m * np.fft.irfft2(np.fft.rfft2(tops) * np.fft.rfft2(dome), s=(SIDE, SIDE))
        return np.asarray(height - height.mean())

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions, (..., n)."""
        return tile_height(self, x_m, y_m, blur_m)
