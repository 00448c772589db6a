"""A surface: heights over a plane, blurred by the contact of a soft finger.

A surface is a sum of terms. Each kind of term is a frozen dataclass with a method that gives its height at places
(x, y), blurred by a Gaussian of standard deviation `blur_m`: detail finer than the contact is averaged out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from texture_core.arrays import Array
from texture_simulation.surfaces.curvature import FLAT, Curved

MIN_BLUR_M, MAX_BLUR_M = 5e-5, 2e-3


class Term(Protocol):
    """A kind of relief."""

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at (..., n); `blur_m` is (..., n), or (..., 1) where it stays the same.

        Parameters
        ----------
        x_m : (..., n)
            Positions along x.
        y_m : (..., n)
            Positions along y.
        blur_m : (..., n) or (..., 1)
            Standard deviation of the contact that averages.

        Returns
        -------
        (..., n)
            m, of zero mean.
        """


@dataclass(frozen=True)
class Surface:
    """A named sum of terms, the friction on it (`frictions.py`; without one, the skin glides), and its curvature."""

    name: str
    terms: tuple[Term, ...]
    friction: Any = None
    shape: Curved = FLAT

    def height_m(self, x_m: Array, y_m: Array, blur_m: Array) -> Array:
        """Return the blurred height at positions."""
        blur_m = np.clip(blur_m, MIN_BLUR_M, MAX_BLUR_M)
        height = np.zeros(np.broadcast_shapes(x_m.shape, y_m.shape, blur_m.shape))
        for term in self.terms:
            height += term.height_m(x_m, y_m, blur_m)
        return height
