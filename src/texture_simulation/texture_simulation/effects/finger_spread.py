"""No two fingers of a kind are equally sensitive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.trajectory import Trajectory

SALT = 41  # so that the gain of a finger is drawn apart from its other traits


@dataclass(frozen=True)
class FingerSpread:
    """Each individual of the sensor senses textures by a factor of its own more or less strongly."""

    relative: float = param(
        0.1, 'Sets the relative spread of the sensitivity from finger to finger.', low=0.0, high=0.5
    )

    def gain(self, path: Trajectory, finger: int) -> Array | float:
        """Return the factor of a finger, the same at all points."""
        return float(np.exp(self.relative * np.random.default_rng([SALT, finger]).standard_normal()))
