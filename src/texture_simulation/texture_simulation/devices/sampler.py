"""A microcontroller that streams samples over a pseudo-terminal, written from its protocol, not from the driver's code.

Frame: COBS(kind u8, version u8, sequence u16, time_us u32, rows u8, columns u8, rows × columns int16,
CRC-16/CCITT-FALSE u16), then a zero; little endian, numbered kind by kind, timed at the first row.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from texture_simulation.devices.biotac_encoder import stuff
from texture_simulation.devices.device import EmulatedDevice

Counts = NDArray[np.int16]
VERSION = 1
WRONG_VERSION = 99
MICROSECONDS = 1_000_000


@dataclass(frozen=True)
class SampledStream:
    """One kind of frames that the device sends."""

    kind: int
    rate_hz: float
    columns: int
    rows: int  # in a frame


class EmulatedSampler(EmulatedDevice):
    """An emulated device: `advance` it by what has been sampled.

    Parameters
    ----------
    link, rng
        See `EmulatedDevice`.
    streams
        What it samples, by a name of our own.
    start_us
        Its clock when plugged in.
    """

    def __init__(
        self, link: Path, rng: np.random.Generator, streams: Mapping[str, SampledStream], start_us: int = 0
    ) -> None:
        super().__init__(link, rng)
        self._start_us = start_us
        self._streams = streams
        self.reset()

    def reset(self) -> None:
        """Begin numbers and clock again, as after a brown-out."""
        super().reset()
        self._frames = dict.fromkeys(self._streams, 0)
        self._waiting: dict[str, Counts] = {
            name: np.empty((0, stream.columns), dtype=np.int16) for name, stream in self._streams.items()
        }

    def skip(self, duration_s: float) -> None:
        """Let time pass without sending: whole frames are lost."""
        for name, stream in self._streams.items():
            self._frames[name] += round(duration_s * stream.rate_hz / stream.rows)

    def advance(self, samples: Mapping[str, Counts]) -> None:
        """Sample, and send what fills a frame.

        Parameters
        ----------
        samples
            Counts of each stream, (n_samples, n_columns).
        """
        data = b''
        for name, counts in samples.items():
            self._waiting[name] = np.concatenate([self._waiting[name], counts])
            rows = self._streams[name].rows
            while len(self._waiting[name]) >= rows:
                data += self._sent(name, self._waiting[name][:rows])
                self._waiting[name] = self._waiting[name][rows:]
        self._send(data)

    def _sent(self, name: str, counts: Counts) -> bytes:
        """Return the bytes that one frame becomes."""
        stream, number = self._streams[name], self._frames[name]
        self._frames[name] += 1
        time_us = self._start_us + round(number * stream.rows * MICROSECONDS / stream.rate_hz)
        data = encode(stream, number, time_us, counts, WRONG_VERSION if self.wrong_firmware else VERSION)
        return self.frame_faults.apply(data, self._rng)


def encode(stream: SampledStream, number: int, time_us: int, counts: Counts, version: int = VERSION) -> bytes:
    """Return a frame on the wire; number and time wrap.

    Parameters
    ----------
    stream
        Kind of the frame.
    number
        Running number of the frame; wraps at 16 bits.
    time_us
        Device's time of its first row; wraps at 32 bits.
    counts : (n_rows, n_columns)
        Samples of the frame.
    version
        Version of the protocol.

    Returns
    -------
    bytes
        The whole frame.
    """
    rows, columns = counts.shape
    content = struct.pack('<BBHIBB', stream.kind, version, number % 2**16, time_us % 2**32, rows, columns)
    content += counts.astype('<i2').tobytes()
    return stuff(content + struct.pack('<H', binascii.crc_hqx(content, 0xFFFF))) + b'\x00'
