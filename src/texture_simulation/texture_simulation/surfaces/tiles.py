"""Random relief, made once as periodic tiles and interpolated in them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_simulation.surfaces.surface import LEAST_BLUR_M, MOST_BLUR_M

SIDE = 256  # points along each side of a tile; a power of two
POINTS_PER_WAVE = 4  # of the shortest wave
# The periodic tile lies askew at the golden slope, so that a slide along x or y never meets the same stretch again.
TURN_RAD = math.atan((math.sqrt(5) - 1) / 2)
BLURS_M = np.geomspace(LEAST_BLUR_M, MOST_BLUR_M, 10)  # tiles are made for these and interpolated between


class Random(Protocol):
    """A kind of random relief; hashable, so that its tiles are made once."""

    @property
    def spacing_m(self) -> float:
        """Distance of the tile's points."""

    def sharp(self) -> Array:
        """Return the height over one tile, (SIDE, SIDE) m, not blurred, going on periodically."""

    def __hash__(self) -> int:
        """Return what tells it from others."""


def tile_height(random: Random, x_m: Array, y_m: Array, blur_m: Array) -> Array:
    """Return the height of random relief at places, (..., n); `blur_m` is (..., n) or (..., 1)."""
    cosine, sine = math.cos(TURN_RAD) / random.spacing_m, math.sin(TURN_RAD) / random.spacing_m
    rows, columns = x_m * cosine - y_m * sine, x_m * sine + y_m * cosine
    level = np.interp(np.log(blur_m), np.log(BLURS_M), np.arange(len(BLURS_M)))
    low = np.minimum(level, len(BLURS_M) - 1.001).astype(np.intp)
    share = level - low
    if low.min() == low.max():
        return _mixed(random, int(low.flat[0]), share, rows, columns)
    # What has one blur along its way is picked out way by way: far cheaper than point by point.
    shape = rows.shape[: rows.ndim - (low.shape[-1] == 1)]
    low, share = (
        np.broadcast_to(values[..., 0] if len(shape) < rows.ndim else values, shape) for values in (low, share)
    )
    height = np.empty_like(rows)
    for value in np.unique(low):
        here = low == value
        part = share[here][..., None] if len(shape) < rows.ndim else share[here]
        height[here] = _mixed(random, int(value), part, rows[here], columns[here])
    return height


def _mixed(random: Random, low: int, share: Array, rows: Array, columns: Array) -> Array:
    """Return the height between the tiles of two blurs: `share` of the blunter."""
    both = _bilinear(_pair(random, low), rows, columns)
    return np.asarray(both.real + share * (both.imag - both.real), dtype=np.float64)


def _bilinear(tile: NDArray[np.complex64], rows: Array, columns: Array) -> NDArray[np.complex64]:
    """Return a tile, with its first row and column again at its end, between its points; rows and columns go on.

    Written in place, which takes two thirds of the time.
    """
    row, column = np.floor(rows), np.floor(columns)
    down, right = (rows - row).astype(np.float32), (columns - column).astype(np.float32)
    at = (row.astype(np.intp) & (SIDE - 1)) * (SIDE + 1)
    at += column.astype(np.intp) & (SIDE - 1)
    upper = _between(tile, at, right)
    at += SIDE + 1
    lower = _between(tile, at, right)
    lower -= upper
    lower *= down
    upper += lower
    return upper


def _between(tile: NDArray[np.complex64], at: NDArray[np.intp], share: NDArray[np.float32]) -> NDArray[np.complex64]:
    """Return values between points and those after them."""
    value, after = tile.take(at), tile.take(at + 1)
    after -= value
    after *= share
    value += after
    return value


@lru_cache(maxsize=256)
def _pair(random: Random, low: int) -> NDArray[np.complex64]:
    """Return the tiles of a blur and of the next blunter one as real and imaginary part: found at once.

    Flat, ((SIDE + 1)²,), the first row and column again at the end.
    """
    spectrum, wave_1_m = _spectrum(random)
    sharp, blunt = (
        np.fft.irfft2(spectrum * np.exp(-0.5 * (2 * np.pi * wave_1_m * blur) ** 2), s=(SIDE, SIDE))
        for blur in BLURS_M[low : low + 2]
    )
    return np.pad((sharp + 1j * blunt).astype(np.complex64), ((0, 1), (0, 1)), mode='wrap').ravel()


@lru_cache(maxsize=64)
def _spectrum(random: Random) -> tuple[NDArray[np.complex128], Array]:
    return np.fft.rfft2(random.sharp()), waves_1_m(random.spacing_m)


def waves_1_m(spacing_m: float) -> Array:
    """Return the wave number of each coefficient of a tile's spectrum, (SIDE, SIDE // 2 + 1) 1/m."""
    waves: Array = np.hypot(np.fft.fftfreq(SIDE, spacing_m)[:, None], np.fft.rfftfreq(SIDE, spacing_m)[None, :])
    return waves
