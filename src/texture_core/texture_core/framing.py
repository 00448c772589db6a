# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Frames on a serial line: checked, numbered and timed, for devices of this project.

    COBS( kind u8 | version u8 | sequence u16 | time_us u32 | rows u8 | columns u8 | body | crc u16 ) 00

All numbers are little endian. COBS (consistent overhead byte stuffing) leaves no zero byte within a frame: whatever is
lost or added on the way, the frame after the next zero is whole again. The checksum is CRC-16/CCITT-FALSE, also called
IBM-3740 (polynomial 1021, start FFFF, of "123456789": 29B1), over everything before it. The sequence counts the frames
of one kind, so losses are counted per stream. The time is that of the first row by the device's clock; it wraps.

Source: Cheshire & Baker 1999, "Consistent Overhead Byte Stuffing".
"""

from __future__ import annotations

from binascii import crc_hqx
from struct import Struct
from typing import NamedTuple

HEADER = Struct('<BBHIBB')
CRC = Struct('<H')
CRC_START = 0xFFFF
DELIMITER = b'\x00'
LONGEST_RUN = 254  # COBS
SEQUENCE_BITS = 16
TIME_BITS = 32
MAX_FRAME_BYTES = 4096


class Frame(NamedTuple):
    """One frame that passed the check; `rows` and `columns` depend on its kind."""

    kind: int
    version: int
    sequence: int
    time_us: int
    rows: int
    columns: int
    body: bytes
    lost: int = 0  # frames of this kind missing just before it


class FrameDecoder:
    """Decode frames from a byte stream with lost, added or damaged bytes."""

    def __init__(self) -> None:
        self.frames = 0
        self.bad_frames = 0  # too short or long, wrongly stuffed, or of a wrong checksum
        self.lost = 0  # frames whose number never came
        self.repeated = 0  # came twice; the second is left out
        self.restart()

    def restart(self) -> None:
        """Drop the unfinished frame and the expected numbers: the line was opened again. The totals are kept."""
        self._unfinished = b''
        self._synchronised = False
        self._last: dict[int, int] = {}

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames completed by `data`; never raises."""
        *segments, unfinished = (self._unfinished + data).split(DELIMITER)
        # One byte more than allowed is enough to refuse the frame when its end comes.
        self._unfinished = unfinished[: MAX_FRAME_BYTES + 1]
        frames = [frame for segment in segments if (frame := self._decode(segment)) is not None]
        self.frames += len(frames)
        return frames

    def _decode(self, segment: bytes) -> Frame | None:
        """Return the frame in the bytes between two zeros, unless it is damaged or a repetition."""
        synchronised, self._synchronised = self._synchronised, True
        frame = unpack(segment) if len(segment) <= MAX_FRAME_BYTES else None
        if frame is not None:
            return self._check_sequence(frame)
        # Reading may begin in the middle of a frame, and a sender may add zeros at any time: both are no fault.
        self.bad_frames += bool(segment) and synchronised
        return None

    def _check_sequence(self, frame: Frame) -> Frame | None:
        range_ = 1 << SEQUENCE_BITS
        step = (frame.sequence - self._last.get(frame.kind, frame.sequence - 1)) % range_
        self._last[frame.kind] = frame.sequence
        if step == 0:
            self.repeated += 1
            return None
        if step >= range_ // 2:  # numbers went back: the device restarted, as a line never changes the order
            return frame
        self.lost += step - 1
        return frame._replace(lost=step - 1) if step > 1 else frame


def cobs_encode(data: bytes) -> bytes:
    """Return bytes without a zero: each run between zeros, or of 254 bytes, after its length plus one."""
    stuffed = bytearray()
    for run in data.split(DELIMITER):
        for at in range(0, len(run) + 1, LONGEST_RUN):
            piece = run[at : at + LONGEST_RUN]
            stuffed.append(len(piece) + 1)
            stuffed += piece
    return bytes(stuffed)


def cobs_decode(stuffed: bytes) -> bytes:
    """Return the bytes encoded by `cobs_encode`; ValueError if the encoding is invalid."""
    data = bytearray()
    at = 0
    while at < len(stuffed):
        end = at + stuffed[at]
        piece = stuffed[at + 1 : end]
        if end == at or end > len(stuffed) or DELIMITER in piece:
            raise ValueError(f'byte {at} of {len(stuffed)} is not the length of a run')
        data += piece
        if len(piece) < LONGEST_RUN and end < len(stuffed):
            data += DELIMITER
        at = end
    return bytes(data)


def unpack(segment: bytes) -> Frame | None:
    """Return the frame in the bytes between two zeros, or None if it is damaged."""
    try:
        raw = cobs_decode(segment)
    except ValueError:
        return None
    if len(raw) < HEADER.size + CRC.size:
        return None
    checked = raw[: -CRC.size]
    if CRC.unpack(raw[-CRC.size :]) != (crc_hqx(checked, CRC_START),):
        return None
    kind, version, sequence, time_us, rows, columns = HEADER.unpack_from(checked)
    return Frame(kind, version, sequence, time_us, rows, columns, checked[HEADER.size :])


def pack(frame: Frame) -> bytes:
    """Return the bytes of a frame on the line, the zero after it included; sequence and time are cut to their bits."""
    sequence, time_us = frame.sequence % (1 << SEQUENCE_BITS), frame.time_us % (1 << TIME_BITS)
    header = HEADER.pack(frame.kind, frame.version, sequence, time_us, frame.rows, frame.columns)
    checked = header + frame.body
    return cobs_encode(checked + CRC.pack(crc_hqx(checked, CRC_START))) + DELIMITER


class CounterUnwrapper:
    """Unwrap a counter of few bits."""

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
