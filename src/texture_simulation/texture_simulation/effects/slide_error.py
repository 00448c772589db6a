"""A robot is not quite as fast and does not press quite as hard as it should."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param

MIN_SHARE = 0.05  # of what was wanted


@dataclass(frozen=True)
class SlideError:
    """Speed and force deviate from slide to slide (offline recordings; a simulated arm has errors of its own)."""

    speed: float = param(
        0.01, 'Sets the relative standard deviation of the speed from slide to slide.', low=0.0, high=0.5
    )
    force: float = param(
        0.04, 'Sets the relative standard deviation of the force from slide to slide.', low=0.0, high=0.5
    )

    def slide(self, speed_m_s: Array, force_n: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return speed and force as they become, of the same shape."""
        return (
            speed_m_s * np.maximum(MIN_SHARE, 1 + self.speed * rng.standard_normal(speed_m_s.shape)),
            force_n * np.maximum(MIN_SHARE, 1 + self.force * rng.standard_normal(force_n.shape)),
        )
