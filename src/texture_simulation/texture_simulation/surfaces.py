"""The shape of surfaces: heights over a plane, as a soft finger feels them.

A surface is a sum of terms. Each kind of term is a frozen dataclass and a function that gives its height at places
(x, y), blurred by a Gaussian of standard deviation `blur_m`: what is finer than the contact is not felt.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.errors import InvalidParameter
from texture_core.parameters import param

LEAST_FELT = 1e-3  # a harmonic blurred to less than this share is left out
TILE = 256  # points along each side of a tile of random roughness
POINTS_PER_WAVE = 4  # of the shortest wave
# The periodic tile lies askew at the golden slope, so that a slide along x or y never meets the same stretch again.
TILE_TURN_RAD = math.atan((math.sqrt(5) - 1) / 2)
BLURS_M = np.geomspace(5e-5, 2e-3, 10)  # tiles are made for these and interpolated between; no blur is less


@dataclass(frozen=True)
class Grating:
    """Parallel ridges, `angle_rad` from +x towards +y: a slide along +x meets v·cos(angle)/pitch of them a second."""

    pitch_m: float = param(2e-3, 'Distance between ridges.', unit='m', low=1e-5, high=0.1)
    depth_m: float = param(2e-4, 'Height of the ridges over the grooves.', unit='m', low=0.0, high=0.01)
    angle_rad: float = param(0.0, 'Direction across the ridges.', unit='rad', low=-math.pi, high=math.pi)
    shape: str = param('sine', 'Shape of the ridges.', choices=('sine', 'square'))
    duty: float = param(0.5, 'Share of the pitch that a square ridge takes.', low=0.05, high=0.95)


@dataclass(frozen=True)
class SelfAffine:
    """Random roughness: power ∝ k^(−2−2·hurst) between two wavelengths, the same in all directions."""

    rms_m: float = param(1e-5, 'Standard deviation of the height.', unit='m', low=0.0, high=1e-3)
    hurst: float = param(0.8, 'Hurst exponent: 1 is smooth on small scales, 0 jagged.', low=0.0, high=1.0)
    longest_m: float = param(6e-3, 'Longest wave.', unit='m', low=1e-4, high=0.1)
    shortest_m: float = param(4e-4, 'Shortest wave.', unit='m', low=1e-5, high=0.01)
    seed: int = param(0, 'Which of all such surfaces.', low=0)

    def __post_init__(self) -> None:
        if not 1 < self.longest_m / self.shortest_m <= TILE / POINTS_PER_WAVE / 2:
            raise InvalidParameter(
                f'roughness with waves from {self.shortest_m} m to {self.longest_m} m; the longest must be above the '
                f'shortest and at most {TILE // POINTS_PER_WAVE // 2} times as long'
            )


@dataclass(frozen=True)
class Surface:
    """A named sum of terms."""

    name: str
    terms: tuple[Any, ...]

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the height felt at places.

        Parameters
        ----------
        x_m, y_m, blur_m : (n,)

        Returns
        -------
        (n,) m, of zero mean over a large surface
        """
        blur_m = np.clip(blur_m, BLURS_M[0], BLURS_M[-1])
        height = np.zeros_like(x_m)
        for term in self.terms:
            height += HEIGHTS[type(term)](term, x_m, y_m, blur_m)
        return height


def grating_height(grating: Grating, x_m: Array, y_m: Array, blur_m: Array) -> Array:
    """Return the height of a grating: its Fourier series, harmonic n weakened by exp(−(2π·n·blur/pitch)²/2)."""
    across_m = x_m * math.cos(grating.angle_rad) + y_m * math.sin(grating.angle_rad)
    cosine, before = np.cos(2 * np.pi / grating.pitch_m * across_m), np.ones_like(across_m)
    first_share = np.exp(-0.5 * (2 * np.pi * blur_m / grating.pitch_m) ** 2)
    wave, share, ratio, square = cosine, first_share, first_share**3, first_share**2
    height = np.zeros_like(wave)
    for amplitude_m in _harmonics_m(grating, float(blur_m.min(initial=BLURS_M[-1]))):
        height += amplitude_m * share * wave
        # cos((n+1)φ) = 2·cos φ·cos nφ − cos((n−1)φ) and q^((n+1)²) = q^(n²)·q^(2n+1): far cheaper than cos and exp.
        wave, before = 2 * cosine * wave - before, wave
        share, ratio = share * ratio, ratio * square
    return height


def _harmonics_m(grating: Grating, blur_m: float) -> list[float]:
    """Return the amplitudes of the harmonics that are felt at all, from the first on."""
    if grating.shape == 'sine':
        return [grating.depth_m / 2]
    finest = grating.pitch_m / (2 * np.pi * blur_m) * math.sqrt(-2 * math.log(LEAST_FELT))
    orders = range(1, max(2, math.ceil(finest)))
    return [grating.depth_m * 2 / (np.pi * order) * math.sin(np.pi * order * grating.duty) for order in orders]


def rough_height(rough: SelfAffine, x_m: Array, y_m: Array, blur_m: Array) -> Array:
    """Return the height of random roughness, interpolated in its periodic tiles."""
    spacing_m = rough.shortest_m / POINTS_PER_WAVE
    cosine, sine = math.cos(TILE_TURN_RAD) / spacing_m, math.sin(TILE_TURN_RAD) / spacing_m
    level = np.interp(np.log(blur_m), np.log(BLURS_M), np.arange(len(BLURS_M)))
    level = np.minimum(level, len(BLURS_M) - 1.001)
    low = level.astype(np.intp)
    share = level - low
    tiles, rows, columns = _tiles(rough), x_m * cosine - y_m * sine, x_m * sine + y_m * cosine
    height: Array = (1 - share) * _bilinear(tiles, low, rows, columns)
    height += share * _bilinear(tiles, low + 1, rows, columns)
    return height


def _bilinear(tiles: NDArray[np.float32], level: NDArray[np.intp], rows: Array, columns: Array) -> Array:
    """Return tiles[level] between its points, (n,); rows and columns go on periodically."""
    row, column = np.floor(rows).astype(np.intp), np.floor(columns).astype(np.intp)
    down, right = rows - row, columns - column
    flat, column, beside = tiles.ravel(), column % TILE, (column + 1) % TILE
    upper, lower = (level * TILE + row % TILE) * TILE, (level * TILE + (row + 1) % TILE) * TILE
    above = (1 - right) * flat.take(upper + column) + right * flat.take(upper + beside)
    below = (1 - right) * flat.take(lower + column) + right * flat.take(lower + beside)
    height: Array = (1 - down) * above + down * below
    return height


@lru_cache(maxsize=64)
def _tiles(rough: SelfAffine) -> NDArray[np.float32]:
    """Return one tile for each of BLURS_M, (n_blurs, TILE, TILE); 2.6 MB."""
    spacing_m = rough.shortest_m / POINTS_PER_WAVE
    wave = np.hypot(np.fft.fftfreq(TILE, spacing_m)[:, None], np.fft.rfftfreq(TILE, spacing_m)[None, :])
    present = (wave >= 1 / rough.longest_m) & (wave <= 1 / rough.shortest_m)
    amplitude = np.where(present, np.where(present, wave, 1.0) ** (-1.0 - rough.hurst), 0.0)
    noise = np.fft.rfft2(np.random.default_rng(rough.seed).standard_normal((TILE, TILE)))
    sharp = np.fft.irfft2(noise * amplitude, s=(TILE, TILE))
    spectrum = noise * amplitude * (rough.rms_m / sharp.std())
    blurred = [
        np.fft.irfft2(spectrum * np.exp(-0.5 * (2 * np.pi * wave * blur) ** 2), s=(TILE, TILE)) for blur in BLURS_M
    ]
    return np.array(blurred, dtype=np.float32)


KINDS: Mapping[str, type] = {'grating': Grating, 'self_affine': SelfAffine}
HEIGHTS: Mapping[type, Callable[[Any, Array, Array, Array], Array]] = {
    Grating: grating_height,
    SelfAffine: rough_height,
}
