"""What warms up wanders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Samples
from texture_core.parameters import param
from texture_simulation.effects.protocols import BatchShape, SignalFilter


@dataclass(frozen=True)
class Drift:
    """Each channel wanders at random (a Wiener process)."""

    count_per_sqrt_s: float = param(
        20.0,
        'Sets the standard deviation of the random walk after one second; a larger value drifts faster.',
        unit='count',
        low=0.0,
    )

    def start_signal(
        self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape, channels: int, *, slow: bool
    ) -> SignalFilter:
        """Return what adds the drift."""
        at = np.zeros((*batch_shape, 1, channels))
        step = self.count_per_sqrt_s / np.sqrt(rate_hz)

        def add(samples: Samples) -> Samples:
            nonlocal at
            if not samples.shape[-2]:
                return samples
            wandered = at + np.cumsum(step * rng.standard_normal(samples.shape), axis=-2)
            at = wandered[..., -1:, :]
            return np.asarray(samples + wandered)

        return add
