# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Height profiles of simulated surfaces."""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.errors import InvalidParameter
from texture_core.types import AnyArray, Array
from texture_simulation.path import interpolated_field

# --------------------
# The shape of an object below its relief: how it is curved where a finger slides.


@dataclass(frozen=True)
class Curved:
    """An object that is a ball, or curved like one, where the finger slides."""

    radius_m: float = param(
        0.035,
        'Radius of curvature of the object; a smaller one makes the contact smaller and softer.',
        unit='m',
        low=0.002,
        high=10.0,
    )


FLAT = Curved(math.inf)


# --------------------
# No sample is the same everywhere: slow random fields over the surface change its relief and its friction.

FIELD_WAVES = 8  # plane waves of each field
FIELD_KNOT_M = 1e-3
# Standard deviations at a strength of 1: level and blur of the relief and the friction as logarithms, and the local
# stretch of all lengths. A larger blur makes the spectrum steeper. The strength of a scene is set by one anchor.
LEVEL_SPREAD, BLUR_SPREAD, FRICTION_SPREAD, STRETCH_SPREAD = 0.28, 0.28, 0.14, 0.028


@dataclass(frozen=True)
class PlaceVariation:
    """How the statistics of a sample vary from place to place; such a sample lies still under the surface frame."""

    strength: float = param(
        1.0, 'Strength of the variation; 0 is a sample that is the same everywhere.', low=0.0, high=5.0
    )
    length_m: float = param(0.04, 'Length over which the statistics of a sample change.', unit='m', low=0.005, high=1.0)

    def at(self, surface: str, x_m: Array, y_m: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return factors of level, blur and friction, and shifts of x and y in m, (..., n) each.

        The fields are drawn by the name of the surface: each surface of a scene has separate ones.
        """
        if not x_m.shape[-1]:
            return (np.ones_like(x_m), np.ones_like(x_m), np.ones_like(x_m), np.zeros_like(x_m), np.zeros_like(x_m))
        waves_1_m, phases = _field_waves(zlib.crc32(surface.encode()), self.length_m)
        shape = (-1, FIELD_WAVES, *[1] * max(x_m.ndim, y_m.ndim))

        def fields(x_m: Array, y_m: Array) -> Array:
            kx, ky, phase = (values.reshape(shape) for values in (waves_1_m[0], waves_1_m[1], phases))
            return np.cos(kx * x_m + ky * y_m + phase).sum(axis=1) * math.sqrt(2 / FIELD_WAVES)

        level, blur, friction, shift_x, shift_y = self.strength * interpolated_field(fields, x_m, y_m, FIELD_KNOT_M)
        # The gradient of a field of unit variance has a standard deviation of k/√2 along each axis.
        shift_m = STRETCH_SPREAD * math.sqrt(2.0) * self.length_m / (2 * math.pi)
        return (
            np.exp(LEVEL_SPREAD * level),
            np.exp(BLUR_SPREAD * blur),
            np.exp(FRICTION_SPREAD * friction),
            shift_m * shift_x,
            shift_m * shift_y,
        )


@lru_cache(maxsize=64)
def _field_waves(seed: int, length_m: float) -> tuple[Array, Array]:
    """Return wave vectors, (2, 5, FIELD_WAVES) rad/m, and phases, (5, FIELD_WAVES), of five fields."""
    angle, phase, size = np.random.default_rng(seed).uniform(0.0, 1.0, (3, 5, FIELD_WAVES))
    k = 2 * np.pi / length_m * (0.6 + 0.8 * size)
    return k * np.stack([np.cos(2 * np.pi * angle), np.sin(2 * np.pi * angle)]), 2 * np.pi * phase


# --------------------
# The profile across ridges that all have the same pitch, as its Fourier series.

MIN_TRANSFER = 1e-3  # a harmonic blurred to less than this fraction is left out
SHAPES = ('sine', 'square')


def profile(across_m: Array, blur_m: Array, pitch_m: float, shape: str, duty: float) -> Array:
    """Return the height of ridges one unit high, less its mean, (..., n).

    Harmonic n is weakened by exp(−(2π·n·blur/pitch)²/2), the transfer function of the Gaussian.
    """
    cosine = np.cos(2 * np.pi / pitch_m * across_m)
    first_fraction = np.exp(-0.5 * (2 * np.pi * blur_m / pitch_m) ** 2)
    amplitudes = _amplitudes(pitch_m, shape, duty, float(blur_m.min(initial=pitch_m)))
    height = amplitudes[0] * first_fraction * cosine
    if len(amplitudes) == 1:
        return np.asarray(height)
    twice, wave, before = 2 * cosine, cosine, np.ones_like(cosine)
    fraction, ratio, square = first_fraction, first_fraction**3, first_fraction**2
    for amplitude in amplitudes[1:]:
        # cos((n+1)φ) = 2·cos φ·cos nφ − cos((n−1)φ) and q^((n+1)²) = q^(n²)·q^(2n+1): far cheaper than cos and exp.
        wave, before = twice * wave - before, wave
        fraction, ratio = fraction * ratio, ratio * square
        height += amplitude * fraction * wave
    return np.asarray(height)


def _amplitudes(pitch_m: float, shape: str, duty: float, blur_m: float) -> list[float]:
    """Return the amplitudes of the harmonics that are measured at all, from the first on."""
    if shape == 'sine':
        return [0.5]
    finest = pitch_m / (2 * np.pi * blur_m) * math.sqrt(-2 * math.log(MIN_TRANSFER))
    orders = range(1, max(2, math.ceil(finest)))
    return [2 / (np.pi * order) * math.sin(np.pi * order * duty) for order in orders]


# --------------------
# Kinds of relief: each is a frozen dataclass that gives its height at places (x, y), blurred by a Gaussian of standard
# deviation `blur_m`: detail finer than the contact is averaged out.


class Relief:
    """A kind of relief."""

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at (..., n); `blur_m` is (..., n), or (..., 1) where it stays the same."""
        raise NotImplementedError


@dataclass(frozen=True)
class Cut(Relief):
    """A relief as a tool cuts it: its depth and the cross-section of the ridges or posts."""

    depth_m: float = param(2e-4, 'Height above the grooves.', unit='m', low=0.0, high=0.01)
    shape: str = param('sine', "Cross-section, 'sine' or 'square'.", choices=SHAPES)
    duty: float = param(0.5, 'Fraction of the pitch that a square ridge, post or hollow takes.', low=0.05, high=0.95)


@dataclass(frozen=True)
class Ridges(Cut):
    """What ridges of one pitch have in common, be they straight or rings."""

    pitch_m: float = param(
        2e-3,
        'Distance between ridges; a larger pitch lowers the frequency of the signal.',
        unit='m',
        low=1e-5,
        high=0.1,
    )

    def across_m(self, distance_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at distances across the ridges, (..., n)."""
        return self.depth_m * profile(distance_m, blur_m, self.pitch_m, self.shape, self.duty)


CENTRE_M = 0.05  # of rings, along x and y: slides begin within 0.1 m of the origin


@dataclass(frozen=True)
class Circles(Ridges):
    """Concentric rings: blurred as straight ridges are, which is right but within a pitch or so of the centre."""

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions, (..., n)."""
        return self.across_m(np.hypot(x_m - CENTRE_M, y_m - CENTRE_M), blur_m)


@dataclass(frozen=True)
class Grating(Ridges):
    """Parallel ridges, `angle_rad` from +x towards +y: a slide along +x meets v·cos(angle)/pitch of them a second."""

    angle_rad: float = param(
        0.0, 'Direction across the ridges, from +x towards +y.', unit='rad', low=-math.pi, high=math.pi
    )

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions, (..., n)."""
        return self.across_m(x_m * math.cos(self.angle_rad) + y_m * math.sin(self.angle_rad), blur_m)


# --------------------
# Bumps or hollows in rows and columns.

MEAN = {'sine': 0.5}


@dataclass(frozen=True)
class Grid(Cut):
    """Posts in rows and columns, or a net of ribs between hollows.

    The relief is a product of two profiles; a round Gaussian blurs each of them separately, so this is exact.
    """

    pitch_x_m: float = param(
        2e-3,
        'Distance of posts along the first direction; a larger pitch lowers the frequency of the signal.',
        unit='m',
        low=1e-5,
        high=0.1,
    )
    pitch_y_m: float = param(
        2e-3, 'Distance of posts along the second direction, across the first one.', unit='m', low=1e-5, high=0.1
    )
    angle_rad: float = param(0.0, 'First direction, from +x towards +y.', unit='rad', low=-math.pi, high=math.pi)
    relief: str = param('posts', "Raised part: 'posts', or a 'net' of ribs between hollows.", choices=('posts', 'net'))

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions, (..., n)."""
        cosine, sine = math.cos(self.angle_rad), math.sin(self.angle_rad)
        mean = MEAN.get(self.shape, self.duty)
        along = profile(x_m * cosine + y_m * sine, blur_m, self.pitch_x_m, self.shape, self.duty)
        across = profile(y_m * cosine - x_m * sine, blur_m, self.pitch_y_m, self.shape, self.duty)
        sign = 1.0 if self.relief == 'posts' else -1.0
        # Less its mean; in place, which costs half as much.
        along += mean
        across += mean
        along *= across
        along -= mean**2
        along *= sign * self.depth_m
        return along


# --------------------
# A surface: the sum of its kinds of relief.

MIN_BLUR_M, MAX_BLUR_M = 5e-5, 2e-3


@dataclass(frozen=True)
class Surface:
    """A named sum of terms, the friction on it (without one, the skin glides), its curvature, and how it varies."""

    name: str
    terms: tuple[Relief, ...]
    friction: Any = None
    shape: Curved = FLAT
    variation: PlaceVariation | None = None

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions."""
        level: Array | float = 1.0
        if self.variation is not None:
            level, blur, _, shift_x_m, shift_y_m = self.variation.at(self.name, *np.broadcast_arrays(x_m, y_m))
            x_m, y_m, blur_m = x_m + shift_x_m, y_m + shift_y_m, blur_m * blur
        blur_m = np.clip(blur_m, MIN_BLUR_M, MAX_BLUR_M)
        height = np.zeros(np.broadcast_shapes(x_m.shape, y_m.shape, blur_m.shape))
        for term in self.terms:
            height += term.height_m(x_m, y_m, blur_m)
        return np.asarray(level * height)


# --------------------
# Random relief, made once as periodic tiles and interpolated in them.

SIDE = 256  # points along each side of a tile; a power of two
POINTS_PER_WAVE = 4  # of the shortest wave
# The periodic tile lies askew at the golden slope, so that a slide along x or y never meets the same stretch again.
TURN_RAD = math.atan((math.sqrt(5) - 1) / 2)
BLURS_M = np.geomspace(MIN_BLUR_M, MAX_BLUR_M, 10)  # tiles are made for these and interpolated between
# Points under one blur, from which on a separate tile is cheaper than mixing point by point.
MIN_POINTS_FOR_TILE = 20_000
TILE_POINTS = (SIDE + 1) ** 2


@dataclass(frozen=True)
class Seeded(Relief):
    """A relief of which something is drawn at random."""

    seed: int = param(0, 'Seed of what is random; equal seeds give equal surfaces.', low=0)


class RandomRelief(Seeded):
    """A kind of random relief; hashable, so that its tiles are made once."""

    @property
    def spacing_m(self) -> float:
        """Distance of the tile's points."""
        raise NotImplementedError

    def sharp(self) -> Array:
        """Return the height over one tile, (SIDE, SIDE) m, not blurred, going on periodically."""
        raise NotImplementedError

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions, (..., n)."""
        cosine, sine = math.cos(TURN_RAD) / self.spacing_m, math.sin(TURN_RAD) / self.spacing_m
        rows, columns = x_m * cosine - y_m * sine, x_m * sine + y_m * cosine
        level = np.minimum(np.interp(np.log(blur_m), np.log(BLURS_M), np.arange(len(BLURS_M))), len(BLURS_M) - 1.001)
        many = level.shape[-1] == 1 and rows.size >= MIN_POINTS_FOR_TILE
        if many and len(levels := np.unique(level)) * MIN_POINTS_FOR_TILE <= rows.size:
            height = _bilinear(_mixed(self, tuple(levels.tolist())), np.searchsorted(levels, level), rows, columns)
            return np.asarray(height, dtype=np.float64)
        low = level.astype(np.intp)
        both = _bilinear(_pairs(self), low, rows, columns)
        return np.asarray(both.real + (level - low) * (both.imag - both.real), dtype=np.float64)


def _bilinear(tiles: AnyArray, number: NDArray[np.intp], rows: Array, columns: Array) -> AnyArray:
    """Return tiles between their points; rows and columns go on periodically.

    Written in place, which takes two thirds of the time.
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


def _between(tiles: AnyArray, at: NDArray[np.intp], fraction: NDArray[np.float32]) -> AnyArray:
    """Return values between points and those after them."""
    value, after = tiles.take(at), tiles[1:].take(at)
    after -= value
    after *= fraction
    value += after
    return value


@lru_cache(maxsize=64)
def _mixed(random: RandomRelief, levels: tuple[float, ...]) -> AnyArray:
    """Return one tile for each of some levels of blur."""
    tiles = []
    for level in levels:
        low = int(level)
        fraction = level - low
        pair = _pairs(random)[low * TILE_POINTS : (low + 1) * TILE_POINTS].view(np.float32).reshape(-1, 2)
        tiles.append(pair @ np.array([1.0 - fraction, fraction], dtype=np.float32))
    return np.concatenate(tiles)


@lru_cache(maxsize=32)
def _pairs(random: RandomRelief) -> AnyArray:
    """Return the tiles of all levels of blur, each with the next blunter one as imaginary part: found at once.

    All are made at once, 4.8 MB a relief: what a emulator holds does not grow with what it has measured.
    """
    spectrum, wave_1_m = np.fft.rfft2(random.sharp()), waves_1_m(random.spacing_m)
    weak = [np.exp(-0.5 * (2 * np.pi * wave_1_m * blur_m) ** 2) for blur_m in BLURS_M]
    blurred = [np.fft.irfft2(spectrum * fraction, s=(SIDE, SIDE)) for fraction in weak]
    both = [sharp + 1j * blunt for sharp, blunt in itertools.pairwise(blurred)]
    # One after the other, each with its first row and column again at its end.
    flat = [np.pad(tile, ((0, 1), (0, 1)), mode='wrap').ravel() for tile in both]
    return np.asarray(np.concatenate(flat), dtype=np.complex64)


def waves_1_m(spacing_m: float) -> Array:
    """Return the wave number of each coefficient of a tile's spectrum, (SIDE, SIDE // 2 + 1) 1/m."""
    return np.hypot(np.fft.fftfreq(SIDE, spacing_m)[:, None], np.fft.rfftfreq(SIDE, spacing_m)[None, :])


# --------------------
# Grains glued to a sheet.

POINTS_PER_GRAIN = 4
SIZES = (0.5, 1.5)  # range of the grains' heights, of the mean


@dataclass(frozen=True)
class Sandpaper(RandomRelief):
    """Round grains at random places, of random height; where they overlap they add up.

    Sizes of FEPA grades: P60 269 µm, P80 201, P120 125, P240 58.5, P400 35 (ISO 6344).
    """

    grain_m: float = param(
        2e-4, 'Diameter of a grain; a larger grain gives lower frequencies.', unit='m', low=2e-5, high=0.01
    )
    grain_height_m: float = param(5e-5, 'Mean height of a grain above the sheet.', unit='m', low=0.0, high=0.005)
    cover: float = param(0.5, 'Fraction of the sheet that lies under grains.', low=0.02, high=2.0)

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
        distance = np.minimum(np.arange(SIDE), SIDE - np.arange(SIDE))
        dome = np.maximum(0.0, 1 - (distance[:, None] ** 2 + distance**2) / (POINTS_PER_GRAIN / 2) ** 2)
        height = self.grain_height_m * np.fft.irfft2(np.fft.rfft2(tops) * np.fft.rfft2(dome), s=(SIDE, SIDE))
        return np.asarray(height - height.mean())


# --------------------
# Random roughness on many scales.


@dataclass(frozen=True)
class SelfAffine(RandomRelief):
    """Random roughness: power ∝ k^(−2−2·hurst) between two wavelengths, the same in all directions.

    Along any line its power falls as 1/f^s with s = 1 + 2·hurst.
    """

    rms_m: float = param(1e-5, 'Standard deviation of the height.', unit='m', low=0.0, high=1e-3)
    hurst: float = param(0.8, 'Hurst exponent: 1 is smooth on small scales, 0 is jagged.', low=0.0, high=1.0)
    longest_m: float = param(6e-3, 'Longest wavelength of the relief.', unit='m', low=1e-4, high=0.1)
    shortest_m: float = param(4e-4, 'Shortest wavelength of the relief.', unit='m', low=1e-5, high=0.01)

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


# --------------------
# Cloth: yarns that go over and under each other.

# Plane waves of 6 to 18 mm that shift the yarns from their even places.
WAVES_1_M = 2 * np.pi * np.array([[90.0, 40.0], [-55.0, 130.0], [60.0, -75.0], [25.0, 50.0]])
PHASES = np.array([[0.7, 2.6, 4.4, 1.1], [5.9, 0.2, 3.3, 2.0]])

KNOT_M = 2.5e-4  # straight between such places the shift is wrong by 1 % at most


@dataclass(frozen=True)
class Weave(Seeded):
    """Two sets of yarns: those met when sliding along x have the spacing `pitch_x_m`.

    Each set is a sine across its yarns. Over and under is one wave along the diagonal in a twill, and a chequerboard
    in a plain weave (`repeat` 2). Each wave is blurred by a separate factor, which is exact. `irregular_m` shifts the
    yarns by slow waves, as in linen: its lines are broader the finer they are.
    """

    pitch_x_m: float = param(
        8e-4,
        'Distance of the yarns that a slide along x crosses; a larger pitch lowers the frequency.',
        unit='m',
        low=5e-5,
        high=0.05,
    )
    pitch_y_m: float = param(
        8e-4,
        'Distance of the yarns that a slide along y crosses; a larger pitch lowers the frequency.',
        unit='m',
        low=5e-5,
        high=0.05,
    )
    thickness_x_m: float = param(
        1e-4, 'Height of the yarns that a slide along x crosses.', unit='m', low=0.0, high=0.01
    )
    thickness_y_m: float = param(
        1e-4, 'Height of the yarns that a slide along y crosses.', unit='m', low=0.0, high=0.01
    )
    repeat: int = param(
        2, 'Number of yarns after which the weave repeats: 2 is plain, more is a twill.', low=2, high=12
    )
    irregular_m: float = param(
        0.0,
        'Standard deviation of the yarn positions; larger values broaden the spectral lines.',
        unit='m',
        low=0.0,
        high=0.005,
    )

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions, (..., n)."""
        x_m, y_m = self._even(x_m, y_m)
        across_x, across_y = 2 * np.pi / self.pitch_x_m * x_m, 2 * np.pi / self.pitch_y_m * y_m
        weak_x = np.exp(-0.5 * (2 * np.pi * blur_m / self.pitch_x_m) ** 2)
        weak_y = np.exp(-0.5 * (2 * np.pi * blur_m / self.pitch_y_m) ** 2)
        height = 0.25 * self.thickness_x_m * weak_x * np.cos(across_x)
        height += 0.25 * self.thickness_y_m * weak_y * np.cos(across_y)
        weak = (weak_x * weak_y) ** (1 / self.repeat**2)
        over = self._over(across_x, across_y)
        return np.asarray(height + 0.25 * (self.thickness_x_m + self.thickness_y_m) * weak * over)

    def _over(self, across_x: Array, across_y: Array) -> Array:
        """Return where which thread lies above, from -1 to 1."""
        if self.repeat == 2:
            return np.asarray(np.cos(across_x / 2) * np.cos(across_y / 2))
        return np.asarray(0.5 * np.cos((across_x + across_y) / self.repeat))

    def _even(self, x_m: Array, y_m: Array) -> tuple[Array, Array]:
        """Return where places would lie if the yarns were even."""
        if not self.irregular_m or not x_m.shape[-1]:
            return x_m, y_m
        turns = PHASES + np.random.default_rng(self.seed).uniform(0, 2 * np.pi, PHASES.shape)
        scale_m = self.irregular_m * math.sqrt(2 / len(WAVES_1_M))
        x_and_y = interpolated_field(lambda x, y: _shift(x, y, turns), x_m, y_m, KNOT_M)
        return x_m + scale_m * x_and_y.real, y_m + scale_m * x_and_y.imag


def _shift(x_m: Array, y_m: Array, turns: Array) -> AnyArray:
    """Return sums of plane waves, (..., n): those along x as the real part, those along y as the imaginary one."""
    shift = np.zeros(np.broadcast_shapes(x_m.shape, y_m.shape), dtype=np.complex128)
    for (kx, ky), turn_x, turn_y in zip(WAVES_1_M, *turns, strict=True):
        angle = kx * x_m + ky * y_m
        shift += np.cos(angle + turn_x) + 1j * np.cos(angle + turn_y)
    return shift


# --------------------
# Kinds of relief by name.

KINDS: Mapping[str, type] = {
    'grating': Grating,  # parallel ridges
    'grid': Grid,  # posts in rows and columns, or a net
    'circles': Circles,  # concentric rings
    'weave': Weave,  # cloth
    'self_affine': SelfAffine,  # random roughness on many scales
    'sandpaper': Sandpaper,  # grains of one size
}
