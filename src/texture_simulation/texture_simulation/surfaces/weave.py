"""Cloth: yarns that go over and under each other."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.parameters import param
from texture_simulation.slow_field import interpolated_field

# Plane waves of 6 to 18 mm that shift the yarns from their even places.
WAVES_1_M = 2 * np.pi * np.array([[90.0, 40.0], [-55.0, 130.0], [60.0, -75.0], [25.0, 50.0]])
PHASES = np.array([[0.7, 2.6, 4.4, 1.1], [5.9, 0.2, 3.3, 2.0]])

KNOT_M = 2.5e-4  # straight between such places the shift is wrong by 1 % at most


@dataclass(frozen=True)
class Weave:
    """Two sets of yarns: those met when sliding along x stand `pitch_x_m` apart.

    Each set is a sine across its yarns. Over and under is one wave along the diagonal in a twill, and a chequerboard
    in a plain weave (`repeat` 2). Each wave is blurred by its own factor, which is exact. `irregular_m` shifts the
    yarns by slow waves, as in linen: its lines are broader the finer they are.
    """

    pitch_x_m: float = param(
        8e-4,
        'Sets the distance of the yarns that a slide along x crosses; a larger pitch lowers the frequency.',
        unit='m',
        low=5e-5,
        high=0.05,
    )
    pitch_y_m: float = param(
        8e-4,
        'Sets the distance of the yarns that a slide along y crosses; a larger pitch lowers the frequency.',
        unit='m',
        low=5e-5,
        high=0.05,
    )
    thickness_x_m: float = param(
        1e-4,
        'Sets how far the yarns crossed along x stand out; a larger value gives a stronger signal.',
        unit='m',
        low=0.0,
        high=0.01,
    )
    thickness_y_m: float = param(
        1e-4,
        'Sets how far the yarns crossed along y stand out; a larger value gives a stronger signal.',
        unit='m',
        low=0.0,
        high=0.01,
    )
    repeat: int = param(
        2, 'Sets the number of yarns after which the weave repeats: 2 is plain, more is a twill.', low=2, high=12
    )
    irregular_m: float = param(
        0.0,
        'Sets the standard deviation of the yarn positions; a larger value broadens the spectral lines.',
        unit='m',
        low=0.0,
        high=0.005,
    )
    seed: int = param(0, 'Sets the seed of the yarn positions.', low=0)

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
        if not self.irregular_m:
            return x_m, y_m
        if not x_m.shape[-1]:
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
