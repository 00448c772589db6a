"""The board of an AnySkin on a pseudo-terminal, written from its protocol and not from the driver's code.

Frame: of each magnetometer four float32, little endian: temperature (°C), x, y, z (µT); then CR LF.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from texture_core.arrays import Array
from texture_simulation.devices.device import EmulatedDevice
from texture_simulation.devices.faults import FrameFaults

RATE_HZ = 100.0
MAGNETOMETERS = 5
TEMPERATURE_C = 31.25


class EmulatedAnySkin(EmulatedDevice):
    """An emulated board: `sample` it at its pace; it sends from the moment it is plugged in. See `EmulatedDevice`."""

    def sample(self, field_ut: Array) -> None:
        """Measure and send.

        Parameters
        ----------
        field_ut : (n_frames, 15)
            Field along x, y, z of each magnetometer.
        """
        frames = encode(field_ut[:, 3:] if self.wrong_firmware else field_ut)  # a board with fewer magnetometers
        if self.frame_faults != FrameFaults():
            frames = (self.frame_faults.apply(frame, self._rng) for frame in frames)
        self._send(b''.join(frames))

    def skip(self, frames: int) -> None:
        """Let time pass without sending: the board does not number its frames."""


def encode(field_ut: Array, temperature_c: float = TEMPERATURE_C) -> Iterator[bytes]:
    """Yield the frames of consecutive measurements.

    Parameters
    ----------
    field_ut : (n_frames, 3 · n_magnetometers)
        Field along x, y, z of each magnetometer.
    temperature_c
        Temperature that all magnetometers report.
    """
    values = np.full((len(field_ut), field_ut.shape[1] // 3, 4), temperature_c, dtype='<f4')
    values[..., 1:] = field_ut.reshape(*values.shape[:2], 3)
    for row in values:
        yield row.tobytes() + b'\r\n'
