"""What disturbs a measurement; each is off unless the scene names it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param


@dataclass(frozen=True)
class Effects:
    """Strengths of the effects, 0 is off."""

    noise_count: float = param(0.0, 'Standard deviation of the electronics of the fast channel.', unit='count', low=0.0)
    static_noise_count: float = param(0.0, 'Standard deviation of the electronics of a taxel.', unit='count', low=0.0)
    unevenness: float = param(0.0, 'Relative variation of the texture over some centimetres of a sample.', low=0.0)
    speed_error: float = param(0.0, 'Relative deviation of the speed from slide to slide.', low=0.0, high=0.3)
    force_error: float = param(0.0, 'Relative deviation of the force from slide to slide.', low=0.0, high=0.3)


# Plane waves of 16 to 45 mm in four directions, with phases of no meaning.
UNEVEN_WAVES_1_M = 2 * np.pi * np.array([[38.0, 11.0], [-17.0, 57.0], [29.0, -33.0], [9.0, 20.0]])
UNEVEN_PHASES = np.array([0.3, 1.9, 4.1, 5.2])


def uneven_gain(x_m: Array, y_m: Array, unevenness: float) -> Array:
    """Return the gain of the texture at places, (n,): mean 1, standard deviation `unevenness`."""
    if not unevenness:
        return np.ones_like(x_m)
    phases = UNEVEN_WAVES_1_M[:, :1] * x_m + UNEVEN_WAVES_1_M[:, 1:] * y_m + UNEVEN_PHASES[:, None]
    gain: Array = 1 + unevenness * np.sqrt(2 / len(phases)) * np.cos(phases).sum(axis=0)
    return np.maximum(gain, 0.0)
