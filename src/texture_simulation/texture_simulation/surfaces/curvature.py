"""The shape of an object below its relief: how it is curved where a finger slides."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.parameters import param


@dataclass(frozen=True)
class Curved:
    """An object that is a ball, or curved like one, where the finger slides."""

    radius_m: float = param(
        0.035,
        'Sets the radius of curvature of the object; a smaller one makes the contact smaller and softer.',
        unit='m',
        low=0.002,
        high=10.0,
    )


FLAT = Curved(math.inf)
