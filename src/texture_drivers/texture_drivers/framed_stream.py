"""A stream of a framed protocol, as a sensor declares it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import DeviceError, InvalidParameter
from texture_core.framing import Frame

VERSION = 1
SAMPLE = np.dtype('<i2')


@dataclass(frozen=True, eq=False)
class FramedStream:
    """What one kind of frames holds, and under what name and in what units it is published.

    Parameters
    ----------
    gains, offsets : (n_channels,)
        Sample in its unit = gain · count + offset.
    """

    topic: str
    kind: int
    sensor: str
    rate_hz: float
    channels: tuple[str, ...]
    units: tuple[str, ...]
    gains: Array
    offsets: Array

    def __post_init__(self) -> None:
        if not len(self.channels) == len(self.units) == len(self.gains) == len(self.offsets) > 0:
            raise InvalidParameter(
                f"'{self.sensor}' has {len(self.channels)} channels, {len(self.units)} units, {len(self.gains)} gains "
                f'and {len(self.offsets)} offsets; give one of each for every channel'
            )

    @property
    def limits(self) -> tuple[Array, Array]:
        """Lowest and highest sample of each channel, (n_channels,) each."""
        counts = np.iinfo(SAMPLE)
        ends = np.array([self.gains * end + self.offsets for end in (counts.min, counts.max)], dtype=np.float32)
        return ends.min(axis=0), ends.max(axis=0)

    def check(self, frame: Frame) -> None:
        """Raise DeviceError if a frame is of another version or another number of channels.

        Raises
        ------
        DeviceError
            If it is.
        """
        if frame.version != VERSION:
            raise DeviceError(
                f"'{self.sensor}' sends frames of version {frame.version}, and {VERSION} is known; update the device "
                'or this driver'
            )
        if frame.columns != len(self.channels):
            raise DeviceError(
                f"'{self.sensor}' sends {frame.columns} channels, and {len(self.channels)} are named "
                f'{list(self.channels)}; correct the channels in the settings'
            )
