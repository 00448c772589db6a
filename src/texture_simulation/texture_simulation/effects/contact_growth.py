"""A sphere pressed on a plane (Hertz): size and stiffness of the contact grow with the cube root of the force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param


def _power(force_n: Array, exponent: float) -> Array:
    """Return force ** exponent; 0 N gives 0."""
    grown: Array = np.maximum(force_n, 0.0) ** exponent
    return grown


@dataclass(frozen=True)
class PatchGrowth:
    """The contact, over which the skin averages, grows with the force."""

    exponent: float = param(
        1 / 3,
        'Sets the exponent with which the contact radius grows with the force; 0 keeps it constant.',
        low=0.0,
        high=1.0,
    )

    def blur_growth(self, force_n: Array) -> Array | float:
        """Return how much larger the contact is than at 1 N."""
        return _power(force_n, self.exponent)

    def gain_growth(self, force_n: Array) -> Array | float:
        """Return 1."""
        return 1.0


@dataclass(frozen=True)
class ForceGain:
    """The contact is the stiffer, the harder it is pressed: the same height changes the force more."""

    exponent: float = param(
        1 / 3,
        'Sets the exponent with which the contact stiffness grows with the force; 0 keeps it constant.',
        low=0.0,
        high=1.0,
    )

    def blur_growth(self, force_n: Array) -> Array | float:
        """Return 1."""
        return 1.0

    def gain_growth(self, force_n: Array) -> Array | float:
        """Return how much stronger a texture is measured than at 1 N."""
        return _power(force_n, self.exponent)
