"""The microcontroller of the PVDF finger on a pseudo-terminal."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from texture_simulation.devices.sampler import Counts, EmulatedSampler, SampledStream

FILM = SampledStream(kind=0x10, rate_hz=4096.0, columns=1, rows=32)  # 128 frames of 78 bytes a second
FORCE = SampledStream(kind=0x11, rate_hz=64.0, columns=1, rows=1)  # 64 frames of 16 bytes a second


class EmulatedPvdf(EmulatedSampler):
    """Film at 4096 Hz and force at 64 Hz; see `EmulatedSampler`."""

    def __init__(self, link: Path, rng: np.random.Generator, start_us: int = 0) -> None:
        super().__init__(link, rng, {'film': FILM, 'force': FORCE}, start_us)

    def sample(self, film: Counts, force: Counts) -> None:
        """Take samples, (n_film,) and (n_force,)."""
        self.advance({'film': film[:, None], 'force': force[:, None]})
