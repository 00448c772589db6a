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
from texture_simulation.devices.faults import ByteFaults, FrameFaults
from texture_simulation.devices.pty_port import PtyPort

Counts = NDArray[np.int16]
VERSION = 1
WRONG_VERSION = 99
MICROSECONDS = 1_000_000


@dataclass(frozen=True)
class Sampled:
    """One kind of frames that the device sends."""

    kind: int
    rate_hz: float
    columns: int
    rows: int  # in a frame


class EmulatedSampler:
    """An emulated device without a clock of its own: `advance` it by what has been sampled.

    Its time is its own: called at another pace than nominal it is a device whose clock drifts.

    Parameters
    ----------
    link
        Symbolic link that leads to the device; this is the path for the driver.
    rng
        Randomness of the faults.
    streams
        What it samples, by a name of our own.
    start_us
        Its clock when plugged in.
    """

    def __init__(self, link: Path, rng: np.random.Generator, streams: Mapping[str, Sampled], start_us: int = 0) -> None:
        self.faults = ByteFaults()
        self.frame_faults = FrameFaults()
        self.mute = False  # open but silent
        self.stalled = False  # keeps what it samples, and sends it all at once when it goes on
        self.wrong_firmware = False
        self._port = PtyPort(link)
        self._rng = rng
        self._start_us = start_us
        self._streams = streams
        self.reset()

    @property
    def plugged(self) -> bool:
        """Whether the device is there."""
        return self._port.plugged

    @property
    def streaming(self) -> bool:
        """Whether it sends."""
        return self.plugged and not self.mute

    @property
    def dropped_bytes(self) -> int:
        """How many bytes nobody took."""
        return self._port.dropped_bytes

    def plug(self) -> None:
        """Appear, under a new name, with numbers and clock at the beginning."""
        self._port.plug()
        self.reset()

    def unplug(self) -> None:
        """Vanish."""
        self._port.unplug()

    def reset(self) -> None:
        """Begin numbers and clock anew, as after a brown-out."""
        self._frames = dict.fromkeys(self._streams, 0)
        self._waiting: dict[str, Counts] = {
            name: np.empty((0, stream.columns), dtype=np.int16) for name, stream in self._streams.items()
        }
        self._kept = b''

    def pass_by(self, duration_s: float) -> None:
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
        for name, counts in samples.items():
            self._waiting[name] = np.concatenate([self._waiting[name], counts])
            rows = self._streams[name].rows
            while len(self._waiting[name]) >= rows:
                self._kept += self._sent(name, self._waiting[name][:rows])
                self._waiting[name] = self._waiting[name][rows:]
        if self.stalled:
            return
        if self.streaming:
            self._port.write(self.faults.apply(self._kept, self._rng))
        self._kept = b''

    def _sent(self, name: str, counts: Counts) -> bytes:
        """Return the bytes that one frame becomes."""
        stream, number = self._streams[name], self._frames[name]
        self._frames[name] += 1
        time_us = self._start_us + round(number * stream.rows * MICROSECONDS / stream.rate_hz)
        data = encode(stream, number, time_us, counts, WRONG_VERSION if self.wrong_firmware else VERSION)
        return self.frame_faults.apply(data, self._rng)


def encode(stream: Sampled, number: int, time_us: int, counts: Counts, version: int = VERSION) -> bytes:
    """Return a frame on the wire; number and time wrap."""
    rows, columns = counts.shape
    content = struct.pack('<BBHIBB', stream.kind, version, number % 2**16, time_us % 2**32, rows, columns)
    content += counts.astype('<i2').tobytes()
    return stuff(content + struct.pack('<H', binascii.crc_hqx(content, 0xFFFF))) + b'\x00'
