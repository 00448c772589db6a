"""A bad contact in a cable."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Samples
from texture_core.parameters import param
from texture_simulation.effects.protocols import BatchShape, SignalFilter


@dataclass(frozen=True)
class Dropouts:
    """Now and then all channels stand still for a moment: the converter repeats its last sample.

    Samples that are missing altogether are a fault of the line: see `devices/faults.py`.
    """

    per_s: float = param(
        0.5, 'Sets how often a dropout occurs; a higher rate gives more dropouts.', unit='1/s', low=0.0, high=100.0
    )
    length_s: float = param(
        0.02, 'Sets how long a dropout lasts; the last good sample is repeated during it.', unit='s', low=1e-3, high=1.0
    )

    def start_signal(
        self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape, channels: int, *, slow: bool
    ) -> SignalFilter:
        """Return what holds the samples."""
        length = max(1, round(self.length_s * rate_hz))
        held = np.zeros((*batch_shape, 1, channels))  # the last good sample
        left = np.zeros(batch_shape, dtype=np.intp)  # samples that are still to be held

        def hold(samples: Samples) -> Samples:
            nonlocal held, left
            count = samples.shape[-2]
            if not count:
                return samples
            number = np.arange(count)
            begins = rng.random((*batch_shape, count)) < self.per_s / rate_hz
            last = np.maximum.accumulate(np.where(begins, number, left[..., None] - length - 1), axis=-1)
            bad = number - last < length
            source = np.maximum.accumulate(np.where(bad, -1, number), axis=-1)
            joined = np.concatenate([held, samples], axis=-2)
            result: Samples = np.take_along_axis(joined, source[..., None] + 1, axis=-2)
            held, left = result[..., -1:, :], np.maximum(last[..., -1] + length - count, 0)
            return result

        return hold
