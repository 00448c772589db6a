"""The converter of the data acquisition finger on a pseudo-terminal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from texture_simulation.devices.sampler import Counts, EmulatedSampler, SampledStream

STREAM = SampledStream(kind=0x01, rate_hz=2500.0, columns=8, rows=10)  # 250 frames of 174 bytes a second


class EmulatedDaq(EmulatedSampler):
    """Eight channels at 2.5 kHz; see `EmulatedSampler`."""

    def __init__(
        self, link: Path, rng: np.random.Generator, start_us: int = 0, rate_hz: float = STREAM.rate_hz
    ) -> None:
        super().__init__(link, rng, {'daq': replace(STREAM, rate_hz=rate_hz)}, start_us)

    def sample(self, counts: Counts) -> None:
        """Take samples, (n_samples, 8)."""
        self.advance({'daq': counts})
