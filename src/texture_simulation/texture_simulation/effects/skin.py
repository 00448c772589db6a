"""The skin as a mass on a spring and a damper."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.effects.protocols import BatchShape, ForceFilter
from texture_simulation.filters import Filter
from texture_simulation.trajectory import Trajectory


@dataclass(frozen=True)
class Skin:
    """The force reaches the sensor through m·x'' + d·x' + k·x = F, so that it resonates and then falls off.

    Turned into a filter by the bilinear transform, warped so that the resonance stays where it is: unconditionally
    stable, and exact at the resonance.
    """

    resonance_hz: float = param(
        200.0, 'Sets the resonance frequency of the skin, √(k/m) / 2π.', unit='Hz', low=1.0, high=400.0
    )
    damping: float = param(
        0.3,
        'Sets the damping ratio d / (2·√(k·m)); 1 is critical damping, a larger value is slower.',
        low=0.01,
        high=10.0,
    )

    def start_force(self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape) -> ForceFilter:
        """Return what filters the variation."""
        skin = Filter(self.sections(rate_hz))

        def through(path: Trajectory, variation_n: Array) -> Array:
            return skin(variation_n)

        return through

    def sections(self, rate_hz: float) -> Array:
        """Return the filter, (1, 6).

        Parameters
        ----------
        rate_hz
            Sampling rate.

        Returns
        -------
        (1, 6)
            Second-order section as scipy.signal.sosfilt takes it.
        """
        k = math.tan(math.pi * self.resonance_hz / rate_hz)
        scale = 1 + 2 * self.damping * k + k * k
        ahead = [k * k / scale, 2 * k * k / scale, k * k / scale]
        return np.array([[*ahead, 1.0, 2 * (k * k - 1) / scale, (1 - 2 * self.damping * k + k * k) / scale]])
