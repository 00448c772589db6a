"""Random relief, made once as periodic tiles and interpolated in them."""

from __future__ import annotations

import itertools
import math
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import AnyArray, Array
from texture_simulation.surfaces.surface import MAX_BLUR_M, MIN_BLUR_M

SIDE = 256  # points along each side of a tile; a power of two
POINTS_PER_WAVE = 4  # of the shortest wave
# The periodic tile lies askew at the golden slope, so that a slide along x or y never meets the same stretch again.
TURN_RAD = math.atan((math.sqrt(5) - 1) / 2)
BLURS_M = np.geomspace(MIN_BLUR_M, MAX_BLUR_M, 10)  # tiles are made for these and interpolated between
MIN_POINTS_FOR_OWN_TILE = (
    20_000  # points under one blur, from which on a tile of its own is cheaper than mixing point by point
)
TILE_POINTS = (SIDE + 1) ** 2


class RandomRelief(Protocol):
    """A kind of random relief; hashable, so that its tiles are made once."""

    @property
    def spacing_m(self) -> float:
        """Distance of the tile's points."""

    def sharp(self) -> Array:
        """Return the height over one tile, (SIDE, SIDE) m, not blurred, going on periodically.

        Returns
        -------
        (SIDE, SIDE)
            m.
        """

    def __hash__(self) -> int:
        """Return what tells it from others."""


def tile_height(random: RandomRelief, x_m: Array, y_m: Array, blur_m: Array) -> Array:
    """Return the height of random relief at places, (..., n); `blur_m` is (..., n) or (..., 1).

    Parameters
    ----------
    random
        Kind of relief.
    x_m : (..., n)
        Positions along x.
    y_m : (..., n)
        Positions along y.
    blur_m : (..., n) or (..., 1)
        Standard deviation of the contact that averages.

    Returns
    -------
    (..., n)
        m.
    """
    cosine, sine = math.cos(TURN_RAD) / random.spacing_m, math.sin(TURN_RAD) / random.spacing_m
    rows, columns = x_m * cosine - y_m * sine, x_m * sine + y_m * cosine
    level = np.minimum(np.interp(np.log(blur_m), np.log(BLURS_M), np.arange(len(BLURS_M))), len(BLURS_M) - 1.001)
    many = level.shape[-1] == 1 and rows.size >= MIN_POINTS_FOR_OWN_TILE
    if many and len(levels := np.unique(level)) * MIN_POINTS_FOR_OWN_TILE <= rows.size:
        height = _bilinear(_mixed(random, tuple(levels.tolist())), np.searchsorted(levels, level), rows, columns)
        return np.asarray(height, dtype=np.float64)
    low = level.astype(np.intp)
    both = _bilinear(_pairs(random), low, rows, columns)
    return np.asarray(both.real + (level - low) * (both.imag - both.real), dtype=np.float64)


def _bilinear(tiles: AnyArray, number: NDArray[np.intp], rows: Array, columns: Array) -> AnyArray:
    """Return tiles between their points; rows and columns go on periodically.

    Written in place, which takes two thirds of the time.

    Parameters
    ----------
    tiles : (n_tiles * (SIDE + 1)**2,) in single precision, real or complex
        Flat, one after the other, the first row and column of each again at its end.
    number : (..., n) or (..., 1)
        Which of the tiles.
    rows, columns : (..., n)
    """
    row, column = np.floor(rows), np.floor(columns)
    down, right = (rows - row).astype(np.float32), (columns - column).astype(np.float32)
    at = row.astype(np.intp)
    at &= SIDE - 1
    at *= SIDE + 1
    place = column.astype(np.intp)
    place &= SIDE - 1
    at += place
    if len(tiles) > TILE_POINTS:
        at += TILE_POINTS * number
    upper = _between(tiles, at, right)
    at += SIDE + 1
    lower = _between(tiles, at, right)
    lower -= upper
    lower *= down
    upper += lower
    return upper


def _between(tiles: AnyArray, at: NDArray[np.intp], share: NDArray[np.float32]) -> AnyArray:
    """Return values between points and those after them."""
    value, after = tiles.take(at), tiles[1:].take(at)
    after -= value
    after *= share
    value += after
    return value


@lru_cache(maxsize=64)
def _mixed(random: RandomRelief, levels: tuple[float, ...]) -> AnyArray:
    """Return one tile for each of some levels of blur."""
    tiles = []
    for level in levels:
        low = int(level)
        share = level - low
        pair = _pairs(random)[low * TILE_POINTS : (low + 1) * TILE_POINTS].view(np.float32).reshape(-1, 2)
        tiles.append(pair @ np.array([1.0 - share, share], dtype=np.float32))
    return np.concatenate(tiles)


@lru_cache(maxsize=32)
def _pairs(random: RandomRelief) -> AnyArray:
    """Return the tiles of all levels of blur, each with the next blunter one as imaginary part: found at once.

    All are made at once, 4.8 MB a relief: what a emulator holds does not grow with what it has measured.
    """
    spectrum, wave_1_m = np.fft.rfft2(random.sharp()), waves_1_m(random.spacing_m)
    blurred = [_blurred(spectrum, wave_1_m, blur_m) for blur_m in BLURS_M]
    return _flat([sharp + 1j * blunt for sharp, blunt in itertools.pairwise(blurred)]).astype(np.complex64)


def _flat(tiles: list[AnyArray]) -> AnyArray:
    """Return tiles one after the other, each with its first row and column again at its end."""
    return np.concatenate([np.pad(tile, ((0, 1), (0, 1)), mode='wrap').ravel() for tile in tiles])


def _blurred(spectrum: NDArray[np.complex128], wave_1_m: Array, blur_m: float) -> Array:
    """Return a tile, (SIDE, SIDE) m, under one of the blurs."""
    weak = np.exp(-0.5 * (2 * np.pi * wave_1_m * blur_m) ** 2)
    return np.asarray(np.fft.irfft2(spectrum * weak, s=(SIDE, SIDE)))


def waves_1_m(spacing_m: float) -> Array:
    """Return the wave number of each coefficient of a tile's spectrum, (SIDE, SIDE // 2 + 1) 1/m.

    Parameters
    ----------
    spacing_m
        Distance of two points of the tile.

    Returns
    -------
    (SIDE, SIDE // 2 + 1)
        1/m.
    """
    waves: Array = np.hypot(np.fft.fftfreq(SIDE, spacing_m)[:, None], np.fft.rfftfreq(SIDE, spacing_m)[None, :])
    return waves
