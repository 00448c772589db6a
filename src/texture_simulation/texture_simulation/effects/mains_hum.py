"""What cables pick up from the mains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Samples
from texture_core.parameters import param
from texture_simulation.effects.protocols import BatchShape, SignalFilter

THIRD = 0.3  # of the fundamental; rectifiers draw odd harmonics


@dataclass(frozen=True)
class MainsHum:
    """A sine of the mains' frequency, and its third harmonic, on all channels alike."""

    rms_count: float = param(
        20.0, 'Sets the root mean square of the fundamental; a larger value gives more hum.', unit='count', low=0.0
    )
    mains_hz: float = param(50.0, 'Sets the frequency of the mains, 50 or 60 Hz.', unit='Hz', low=40.0, high=70.0)

    def start_signal(
        self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape, channels: int, *, slow: bool
    ) -> SignalFilter:
        """Return what adds the hum; its phase is another in each slide."""
        phase = rng.uniform(0, 2 * np.pi, (*batch_shape, 1))
        turn, done = 2 * np.pi * self.mains_hz / rate_hz, 0

        def add(samples: Samples) -> Samples:
            nonlocal done
            angle = phase + turn * (done + np.arange(samples.shape[-2]))
            done += samples.shape[-2]
            hum = np.sqrt(2) * self.rms_count * (np.sin(angle) + THIRD * np.sin(3 * angle))
            return np.asarray(samples + hum[..., None])

        return add
