"""What a soft round finger feels of a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.path import Path
from texture_simulation.surfaces import Surface


@dataclass(frozen=True)
class Contact:
    """A sphere pressed on a plane (Hertz): contact size and stiffness both grow with the cube root of the force."""

    blur_m: float = param(1.2e-4, 'Length over which the skin averages at 1 N.', unit='m', low=1e-5, high=1e-3)
    stiffness_n_m: float = param(2000.0, 'Force per height felt at 1 N.', unit='N/m', low=1.0, high=1e6)

    def blur_at_m(self, force_n: Array) -> Array:
        """Return the blur at forces, (n,)."""
        return self.blur_m * np.cbrt(force_n)

    def force_variation_n(self, surface: Surface, path: Path, blur_m: Array) -> Array:
        """Return by how much the shape of the surface changes the force on the skin, (n,); 0 in the air.

        Parameters
        ----------
        path
            Places, and the force that the arm applies there; n points.
        blur_m : (n,)
            Over what length the feeling part of the finger averages.
        """
        return self.stiffness_n_m * np.cbrt(path.force_n) * surface.height_m(path.x_m, path.y_m, blur_m)
