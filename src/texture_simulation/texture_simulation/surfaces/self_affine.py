"""Random roughness on many scales."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidParameter
from texture_core.parameters import param
from texture_simulation.surfaces.tiles import POINTS_PER_WAVE, SIDE, tile_height, waves_1_m


@dataclass(frozen=True)
class SelfAffine:
    """Random roughness: power ∝ k^(−2−2·hurst) between two wavelengths, the same in all directions.

    Along any line its power falls as 1/f^s with s = 1 + 2·hurst.
    """

    rms_m: float = param(
        1e-5,
        'Sets the standard deviation of the height; a larger value gives a stronger signal.',
        unit='m',
        low=0.0,
        high=1e-3,
    )
    hurst: float = param(0.8, 'Sets the Hurst exponent: 1 is smooth on small scales, 0 is jagged.', low=0.0, high=1.0)
    longest_m: float = param(6e-3, 'Sets the longest wavelength of the relief.', unit='m', low=1e-4, high=0.1)
    shortest_m: float = param(4e-4, 'Sets the shortest wavelength of the relief.', unit='m', low=1e-5, high=0.01)
    seed: int = param(0, 'Sets the seed of the random relief.', low=0)

    def __post_init__(self) -> None:
        if not 1 < self.longest_m / self.shortest_m <= SIDE / POINTS_PER_WAVE / 2:
            raise InvalidParameter(
                f'roughness with waves from {self.shortest_m} m to {self.longest_m} m; the longest must be above the '
                f'shortest and at most {SIDE // POINTS_PER_WAVE // 2} times as long'
            )

    @property
    def spacing_m(self) -> float:
        """Distance of the tile's points."""
        return self.shortest_m / POINTS_PER_WAVE

    def sharp(self) -> Array:
        """Return the height over one tile, (SIDE, SIDE) m."""
        wave = waves_1_m(self.spacing_m)
        present = (wave >= 1 / self.longest_m) & (wave <= 1 / self.shortest_m)
        amplitude = np.where(present, np.where(present, wave, 1.0) ** (-1.0 - self.hurst), 0.0)
        noise = np.fft.rfft2(np.random.default_rng(self.seed).standard_normal((SIDE, SIDE)))
        height = np.fft.irfft2(noise * amplitude, s=(SIDE, SIDE))
        return np.asarray(height * (self.rms_m / height.std()))

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions, (..., n)."""
        return tile_height(self, x_m, y_m, blur_m)
