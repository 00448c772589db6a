"""The electronics' own noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Samples
from texture_core.parameters import param
from texture_simulation.effects.protocols import BatchShape, SignalFilter


@dataclass(frozen=True)
class Noise:
    """White noise on every sample: its density is 2·count²/rate, from 0 Hz to half the rate."""

    fast_count: float = param(
        25.0, 'Sets the standard deviation of the noise on the fast channels.', unit='count', low=0.0
    )
    slow_count: float = param(
        8.0, 'Sets the standard deviation of the noise on the slow channels.', unit='count', low=0.0
    )

    def start_signal(
        self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape, channels: int, *, slow: bool
    ) -> SignalFilter:
        """Return what adds the noise."""
        spread = self.slow_count if slow else self.fast_count

        def add(samples: Samples) -> Samples:
            # Single precision costs half as much, and its last bit lies far below a count.
            return samples + spread * rng.standard_normal(samples.shape, dtype=np.float32)

        return add
