"""The skin as a mass on a spring and a damper."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.effects.stages import Scans, ThroughForce
from texture_simulation.filters import Filter
from texture_simulation.path import Path


@dataclass(frozen=True)
class Skin:
    """The force reaches the sensor through m·x'' + d·x' + k·x = F, so that it resonates and then falls off.

    Turned into a filter by the bilinear transform, warped so that the resonance stays where it is: unconditionally
    stable, and exact at the resonance.
    """

    resonance_hz: float = param(200.0, '√(k/m) / 2π.', unit='Hz', low=1.0, high=400.0)
    damping: float = param(0.3, 'd / (2·√(k·m)); 1 is critical.', low=0.01, high=10.0)

    def start_force(self, rng: np.random.Generator, rate_hz: float, scans: Scans) -> ThroughForce:
        """Return what filters the variation."""
        skin = Filter(self.sections(rate_hz))

        def through(path: Path, variation_n: Array) -> Array:
            return skin(variation_n)

        return through

    def sections(self, rate_hz: float) -> Array:
        """Return the filter, (1, 6)."""
        k = math.tan(math.pi * self.resonance_hz / rate_hz)
        scale = 1 + 2 * self.damping * k + k * k
        ahead = [k * k / scale, 2 * k * k / scale, k * k / scale]
        return np.array([[*ahead, 1.0, 2 * (k * k - 1) / scale, (1 - 2 * self.damping * k + k * k) / scale]])
