"""Contact of a soft round finger with a texture at 1 N; how it depends on the force is an effect."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.parameters import param


@dataclass(frozen=True)
class Contact:
    """A finger pressed on a plane with 1 N."""

    blur_m: float = param(
        1.2e-4,
        'Sets the standard deviation of the spatial low-pass of the skin; a larger value removes coarser texture.',
        unit='m',
        low=1e-5,
        high=1e-3,
    )
    stiffness_n_m: float = param(
        2000.0,
        'Sets the force per height of the texture; a larger value gives stronger signals.',
        unit='N/m',
        low=1.0,
        high=1e6,
    )
    tip_radius_m: float = param(
        7e-3,
        'Sets the radius of curvature of the fingertip; on a curved object a larger one changes the contact more.',
        unit='m',
        low=1e-3,
        high=0.1,
    )

    def on(self, radius_m: float) -> float:
        """Return how much smaller than on a plane the contact is on a convex object: a factor, at most 1.

        Two spheres touch as one of radius 1 / (1 / r + 1 / R) touches a plane, and size and stiffness of the contact
        are as the cube root of that.

        Parameters
        ----------
        radius_m
            Radius of curvature of the object, R; infinite for a plane.

        Source: Hertz 1882.
        """
        return 1.0 if math.isinf(radius_m) else (radius_m / (radius_m + self.tip_radius_m)) ** (1 / 3)
