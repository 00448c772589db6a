"""The motor shakes the finger."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.effects.protocols import BatchShape, ForceFilter
from texture_simulation.trajectory import Trajectory


@dataclass(frozen=True)
class MotorVibration:
    """A ripple of the force with each step of the motor: its frequency is speed · steps; none in the air or at rest."""

    rms_n: float = param(
        2e-3,
        'Sets the root mean square of the force ripple; a larger value vibrates more.',
        unit='N',
        low=0.0,
        high=1.0,
    )
    steps_1_m: float = param(
        1000.0,
        'Sets the motor steps per metre of travel; the ripple has speed times this frequency.',
        unit='1/m',
        low=1.0,
        high=1e5,
    )

    def start_force(self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape) -> ForceFilter:
        """Return what adds the ripple."""
        travelled_m = rng.uniform(0, 1 / self.steps_1_m, (*batch_shape, 1))
        last: tuple[Array, Array] | None = None

        def add(path: Trajectory, variation_n: Array) -> Array:
            nonlocal travelled_m, last
            if not len(path):
                return variation_n
            x_m, y_m = last or (path.x_m[..., :1], path.y_m[..., :1])
            last = path.x_m[..., -1:], path.y_m[..., -1:]
            travelled_m = travelled_m[..., -1:] + np.cumsum(
                np.hypot(np.diff(path.x_m, prepend=x_m), np.diff(path.y_m, prepend=y_m)), axis=-1
            )
            ripple = np.sqrt(2) * self.rms_n * np.sin(2 * np.pi * self.steps_1_m * travelled_m) * (path.force_n > 0)
            # All elements of a finger with several shake alike: they have an axis more than the path.
            shaken: Array = variation_n + (ripple if variation_n.ndim == ripple.ndim else ripple[..., None, :])
            return shaken

        return add
