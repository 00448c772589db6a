"""Frames of a serial line: COBS, a check sum, a sequence number and the device's time. For devices of our own design.

On the wire a frame is COBS(header | body | CRC) and a zero byte; all numbers are little endian:

    kind u8 | version u8 | sequence u16 | time_us u32 | rows u8 | columns u8 | body | crc16

The CRC is CRC-16/CCITT-FALSE (polynomial 1021, start FFFF; of "123456789": 29B1) of all before it. `sequence` counts
the frames of a device, `time_us` is the device's clock at the first sample; both wrap. COBS (Cheshire & Baker 1999)
leaves no zero byte within a frame, so a reader is in step again after the next one, whatever happened.
"""

from __future__ import annotations

from binascii import crc_hqx
from struct import Struct
from typing import NamedTuple

HEADER = Struct('<BBHIBB')
CRC = Struct('<H')
CRC_START = 0xFFFF
DELIMITER = b'\x00'
FULL_BLOCK = 255
MAX_FRAME_BYTES = 4096


class Frame(NamedTuple):
    """One frame that passed the check; what `rows` and `columns` count is up to its kind."""

    kind: int
    version: int
    sequence: int
    time_us: int
    rows: int
    columns: int
    body: bytes


class Deframer:
    """Turn a byte stream into frames, whatever is lost or added on the way.

    Parameters
    ----------
    max_frame_bytes
        Longest frame on the wire; a longer run without a zero byte is refused. Bounds the memory kept.
    """

    def __init__(self, max_frame_bytes: int = MAX_FRAME_BYTES) -> None:
        self.frames = 0
        self.bad_frames = 0
        self._max_bytes = max_frame_bytes
        self._rest = b''
        self._in_step = False

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames completed by `data`; what is refused is counted in `bad_frames`."""
        *chunks, rest = (self._rest + data).split(DELIMITER)
        # One byte more than allowed is enough to refuse the frame when its end comes.
        self._rest = rest[: self._max_bytes + 1]
        frames = []
        for chunk in filter(None, chunks):
            frame = _unpack(chunk) if len(chunk) <= self._max_bytes else None
            if frame is not None:
                frames.append(frame)
            elif self._in_step:
                self.bad_frames += 1
            # The first piece of a stream is seldom a whole frame: that is no fault.
            self._in_step = True
        self.frames += len(frames)
        return frames

    def restart(self) -> None:
        """Forget the piece kept: another stream begins."""
        self._rest = b''
        self._in_step = False


def _unpack(chunk: bytes) -> Frame | None:
    """Return the frame in what stood between two zero bytes, or None if it is not one."""
    content = _unstuff(chunk)
    if content is None or len(content) < HEADER.size + CRC.size:
        return None
    checked, (crc,) = content[: -CRC.size], CRC.unpack(content[-CRC.size :])
    if crc_hqx(checked, CRC_START) != crc:
        return None
    kind, version, sequence, time_us, rows, columns = HEADER.unpack_from(checked)
    return Frame(kind, version, sequence, time_us, rows, columns, checked[HEADER.size :])


def _unstuff(chunk: bytes) -> bytes | None:
    """Undo COBS: a block is its length and the bytes up to the next zero; a full one is followed by none."""
    runs = []
    position = 0
    while position < len(chunk):
        length = chunk[position]
        run = chunk[position + 1 : position + length]
        if len(run) < length - 1:
            return None
        runs.append(run)
        position += length
        if length < FULL_BLOCK and position < len(chunk):
            runs.append(DELIMITER)
    return b''.join(runs)


class WrappingCounter:
    """Follow a counter of few bits beyond its wrapping.

    Parameters
    ----------
    bits
        Width of the device's counter; it may move by less than half of its range between two readings.
    """

    def __init__(self, bits: int) -> None:
        self._range = 1 << bits
        self.value: int | None = None

    def step(self, reading: int) -> int:
        """Return how far the counter went since the last reading, 0 at the first, negative if back."""
        if self.value is None:
            return 0
        half = self._range // 2
        return (reading - self.value + half) % self._range - half

    def advance(self, reading: int) -> int:
        """Take the reading and return the counter's value without wrapping."""
        self.value = reading if self.value is None else self.value + self.step(reading)
        return self.value
