"""A batch of consecutive samples of one sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import InvalidData

NANOSECONDS = 1_000_000_000
TARED = ' (tared)'  # ends the name of a sensor whose level without load has been subtracted
MIN_HZ = 1e-3  # a sample in a quarter of an hour: below, stamps leave what 64 bits hold
MAX_HZ = 1e6  # seconds of samples are kept: a rate from nowhere would take all memory


@dataclass(frozen=True, eq=False)
class TactileSignal:
    """A batch of consecutive samples, as a driver delivers it and a message carries it.

    Parameters
    ----------
    stamp_ns
        Time of the first sample, ns since the epoch of the clock in use.
    sensor, channels
        Name of the sensor part, and of each column.
    units
        Unit of each channel, such as 'count' or 'Pa'; () if they are unknown.
    sampling_rate_hz
        Nominal rate, above 0 and at most 1 MHz.
    first_sample
        Running index of the first sample since the stream began; a jump between batches is a loss.
    samples : (n_samples, n_channels) float32
        NaN for a sample known to be bad.
    frame_id
        Frame of the fingertip.

    Raises
    ------
    InvalidData
        If the shape, the rate or the index makes no sense.
    """

    stamp_ns: int
    sensor: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    sampling_rate_hz: float
    first_sample: int
    samples: NDArray[np.float32]
    frame_id: str = ''

    def __post_init__(self) -> None:
        if self.samples.ndim != 2 or self.samples.shape[1] != len(self.channels):
            raise InvalidData(
                f"signal of '{self.sensor}' has samples of shape {self.samples.shape}; "
                f'(n_samples, {len(self.channels)}) is needed for its channels {list(self.channels)}'
            )
        if self.units and len(self.units) != len(self.channels):
            raise InvalidData(
                f"signal of '{self.sensor}' has {len(self.units)} units for {len(self.channels)} channels; "
                'give one for each, or none'
            )
        if not MIN_HZ <= self.sampling_rate_hz <= MAX_HZ:
            raise InvalidData(
                f"signal of '{self.sensor}' has a sampling rate of {self.sampling_rate_hz} Hz; "
                f'give one from {MIN_HZ:g} to {MAX_HZ:g}'
            )
        if self.first_sample < 0:
            raise InvalidData(f"signal of '{self.sensor}' starts at sample {self.first_sample}; 0 is the first")

    @property
    def common_unit(self) -> str:
        """The unit that all channels share; '' if they differ or are unknown."""
        return self.units[0] if len(set(self.units)) == 1 else ''

    @property
    def next_sample(self) -> int:
        """Running index of the sample after this batch."""
        return self.first_sample + len(self.samples)

    @property
    def end_ns(self) -> int:
        """Time of the sample after this batch, ns."""
        return self.stamp_ns + round(len(self.samples) / self.sampling_rate_hz * NANOSECONDS)


def lost_samples(batches: Sequence[TactileSignal]) -> int:
    """Return how many samples are missing between consecutive batches of one stream."""
    return sum(max(0, after.first_sample - before.next_sample) for before, after in pairwise(batches))
