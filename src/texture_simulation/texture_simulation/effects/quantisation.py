"""A converter of fewer bits than its numbers have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Samples
from texture_core.parameters import param
from texture_simulation.effects.protocols import BatchShape, SignalFilter


@dataclass(frozen=True)
class Quantisation:
    """Samples come in steps of several counts; steps of one count are always there."""

    step_count: float = param(16.0, 'Sets the quantisation step; a larger step is coarser.', unit='count', low=1.0)

    def start_signal(
        self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape, channels: int, *, slow: bool
    ) -> SignalFilter:
        """Return what rounds the samples."""
        return self._round

    def _round(self, samples: Samples) -> Samples:
        return self.step_count * np.rint(samples / self.step_count)
