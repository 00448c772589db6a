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
    skin: float = param(
        0.0,
        'Sets the relative spread of the skin from finger to finger: a thicker one touches over a larger area, is '
        'softer and resonates lower.',
        low=0.0,
        high=0.5,
    )
    noise: float = param(
        0.0, 'Sets the relative spread of the strength of the noise from finger to finger.', low=0.0, high=1.0
    )

    def gain(self, path: Trajectory, finger: int) -> Array | float:
        """Return the factor of a finger, the same at all points."""
        return self.factors(finger)[0]

    def factors(self, finger: int) -> tuple[float, float, float]:
        """Return the factors of a finger: of its sensitivity, of the thickness of its skin, and of its noise.

        Parameters
        ----------
        finger
            Which individual of the sensor.
        """
        drawn = np.random.default_rng([SALT, finger]).standard_normal(3)
        gain, thicker, noisier = np.exp(np.array([self.relative, self.skin, self.noise]) * drawn)
        return float(gain), float(thicker), float(noisier)
