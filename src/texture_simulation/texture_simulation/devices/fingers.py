# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fingers emulated at protocol level: encoders of their protocols and the devices that send them."""

from __future__ import annotations

import binascii
import contextlib
import os
import re
import struct
import tty
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import DeviceError
from texture_core.types import Array

# --------------------
# What a BioTac bridge puts on the wire, written from its protocol and not from the driver's code.
#
# Reply of a slot: the command's two bytes, then two bytes for each BioTac: seven and five bits of the value, each byte
# with a last bit that makes its number of ones odd. Frame: COBS(kind u8, version u8, sequence u16, time_us u32, rows
# u8, columns u8, body, CRC-16/CCITT-FALSE u16), then a zero; little endian, numbered kind by kind. Kind 'B' holds one
# reply to all slots, kind 'S' the serial numbers, separated by commas.

Values = NDArray[np.uint16]
Bytes = NDArray[np.uint8]

VERSION = 1
PAC, PDC, TAC, TDC, ELECTRODE_1 = 0, 1, 2, 3, 17  # indices of the sampling commands


def with_parity(upper: Bytes) -> Bytes:
    """Return bytes with bit 0 set so that the number of ones is odd."""
    ones = np.unpackbits(upper[..., None], axis=-1).sum(axis=-1)
    return upper | (1 - ones % 2).astype(np.uint8)


def commands(electrodes: int) -> Bytes:
    """Return the sampling command of each slot, (2 * electrodes + 6,): every second one is PAC."""
    slow = np.array([*range(ELECTRODE_1, ELECTRODE_1 + electrodes), PDC, TAC, TDC], dtype=np.uint8)
    indices = np.stack([slow, np.full_like(slow, PAC)], axis=1).ravel()
    return with_parity(np.uint8(0x80) | indices << np.uint8(1))


def encode_replies(values: Values, absent: Sequence[int] = ()) -> Bytes:
    """Return the replies to whole frames."""
    n_frames, n_slots, n_fingers = values.shape
    replies = np.zeros((n_frames, n_slots, 2 + 2 * n_fingers), dtype=np.uint8)
    replies[:, :, 0] = commands(n_slots // 2 - 3)
    replies[:, :, 2::2] = with_parity((values >> 5 << 1).astype(np.uint8))
    replies[:, :, 3::2] = with_parity(((values & 31) << 3).astype(np.uint8))
    for finger in absent:
        replies[:, :, 2 + 2 * finger : 4 + 2 * finger] = 0
    return replies.reshape(n_frames, n_slots * (2 + 2 * n_fingers))


def framed(kind: int, version: int, sequence: int, time_us: int, *, shape: tuple[int, ...], body: bytes) -> bytes:
    """Return a frame of a serial line designed in this project; its number wraps at 16 bits, its time at 32.

    `shape` is rows and columns of what it holds.
    """
    content = struct.pack('<BBHIBB', kind, version, sequence % 2**16, time_us % 2**32, *shape) + body
    content += struct.pack('<H', binascii.crc_hqx(content, 0xFFFF))
    # In COBS: no zero byte, a length before every run.
    blocks = []
    for run in content.split(b'\x00'):
        full, rest = run[: len(run) // 254 * 254], run[len(run) // 254 * 254 :]
        blocks += [b'\xff' + full[i : i + 254] for i in range(0, len(full), 254)]
        blocks.append(bytes([len(rest) + 1]) + rest)
    return b''.join(blocks) + b'\x00'


# --------------------
# Faults in transmission: of bytes, and of whole frames.


class ByteFaults(NamedTuple):
    """How likely each byte is to suffer: lost, a random one inserted before it, one bit changed."""

    drop: float = 0.0
    insert: float = 0.0
    flip: float = 0.0

    def apply(self, data: bytes, rng: np.random.Generator) -> bytes:
        """Return what arrives of `data`."""
        if not (self.drop or self.insert or self.flip):
            return data
        values = np.frombuffer(data, dtype=np.uint8).copy()
        flipped = rng.random(len(values)) < self.flip
        values[flipped] ^= np.uint8(1) << rng.integers(0, 8, flipped.sum(), dtype=np.uint8)
        values = values[rng.random(len(values)) >= self.drop]
        places = np.flatnonzero(rng.random(len(values)) < self.insert)
        return np.insert(values, places, rng.integers(0, 256, len(places), dtype=np.uint8)).tobytes()


class FrameFaults(NamedTuple):
    """How likely each frame is to be numbered and not sent, and to be sent twice."""

    skip: float = 0.0
    duplicate: float = 0.0

    def apply(self, frame: bytes, rng: np.random.Generator) -> bytes:
        """Return what is sent of a frame."""
        if rng.random() < self.skip:
            return b''
        return frame * 2 if rng.random() < self.duplicate else frame


# --------------------
# A serial device made of a pseudo-terminal, behind a symbolic link, that can be unplugged.


class PtyPort:
    """The device's end of a pseudo-terminal; `link` leads to the other end, whatever its name is this time.

    Writing never waits: what does not fit the kernel's buffer (about 14 kB) is dropped and counted, as a device does
    when nobody reads it.
    """

    def __init__(self, link: Path) -> None:
        self.link = link
        self.dropped_bytes = 0
        self._ends: tuple[int, int] | None = None

    @property
    def plugged(self) -> bool:
        """Whether the device is there."""
        return self._ends is not None

    def plug(self) -> None:
        """Make the device appear under a new name, and lead the link there."""
        if self._ends is not None:
            return
        device_end, host_end = os.openpty()
        tty.setraw(host_end)
        os.set_blocking(device_end, False)
        self._ends = (device_end, host_end)  # the host end stays open here, or reading fails while no driver is there
        try:
            _point_link(self.link, os.ttyname(host_end))
        except OSError as error:
            self.unplug()
            raise DeviceError(
                f"the link '{self.link}' to the emulated device cannot be made: {error}; choose a path in a folder "
                'that you may write to, where there is no other file'
            ) from error

    def unplug(self) -> None:
        """Remove the device and its link; readers that have it open get an error."""
        if self._ends is None:
            return
        name = os.ttyname(self._ends[1])
        for end in self._ends:
            os.close(end)
        self._ends = None
        with contextlib.suppress(OSError):
            if self.link.readlink() == Path(name):
                self.link.unlink()

    def read(self) -> bytes:
        """Return what the host has sent."""
        if self._ends is None:
            return b''
        try:
            return os.read(self._ends[0], 4096)
        except BlockingIOError:
            return b''

    def write(self, data: bytes) -> None:
        """Send what fits."""
        if self._ends is None or not data:
            return
        try:
            sent = os.write(self._ends[0], data)
        except BlockingIOError:
            sent = 0
        self.dropped_bytes += len(data) - sent


def _point_link(link: Path, target: str) -> None:
    """Make or change a symbolic link at once, so that it is never missing; a file that is no link is left alone."""
    link.parent.mkdir(parents=True, exist_ok=True)
    if link.exists() and not link.is_symlink():
        raise FileExistsError(f'there is a file that is no link at {link}')
    passing = link.with_name(f'{link.name}.{os.getpid()}')
    passing.symlink_to(target)
    passing.replace(link)


# --------------------
# What all emulated sensor devices have in common: they can be plugged, and the same can go wrong with them.


# What fingers have measured since the last time, by topic, (n_samples, n_channels, n_fingers).
Measured = Mapping[str, NDArray[Any]]


class EmulatedDevice:
    """An emulated device on a pseudo-terminal.

    It has no clock: each kind is given the samples, and a caller of another pace than nominal makes it a
    device whose clock drifts.
    """

    def __init__(self, link: Path, rng: np.random.Generator) -> None:
        self.faults = ByteFaults()  # bytes lost, added, changed
        self.frame_faults = FrameFaults()  # frames left out or sent twice
        self.silent = False  # open but silent
        self.stalled = False  # keeps what it samples, and sends it all at once when it resumes
        self.wrong_firmware = False  # sends unknown data
        self._port = PtyPort(link)
        self._rng = rng
        self._held_back = b''

    @property
    def plugged(self) -> bool:
        """Whether the device is there."""
        return self._port.plugged

    @property
    def streaming(self) -> bool:
        """Whether it sends."""
        return self.plugged and not self.silent

    @property
    def dropped_bytes(self) -> int:
        """How many bytes were not read."""
        return self._port.dropped_bytes

    def plug(self) -> None:
        """Appear, under a new name, with clock and numbers at the beginning."""
        self._port.plug()
        self.reset()

    def unplug(self) -> None:
        """Vanish."""
        self._port.unplug()

    def reset(self) -> None:
        """Begin clock and numbers again, as after a brown-out."""
        self._held_back = b''

    def measure(self, measured: Measured) -> None:
        """Send what the fingers have measured."""
        raise NotImplementedError

    def skip(self, steps: int) -> None:
        """Let time pass without sending."""
        raise NotImplementedError

    def _disturbed(self, frames: Iterable[bytes]) -> bytes:
        """Return frames as they go out, some of them left out or sent twice."""
        if self.frame_faults == FrameFaults():
            return b''.join(frames)
        return b''.join(self.frame_faults.apply(frame, self._rng) for frame in frames)

    def _send(self, data: bytes) -> None:
        if self.streaming:
            self._held_back += data
        if not self.stalled:
            self._port.write(self.faults.apply(self._held_back, self._rng))
            self._held_back = b''


# --------------------
# The board of an AnySkin on a pseudo-terminal, written from its protocol and not from the driver's code.
#
# Frame: of each magnetometer four float32, little endian: temperature (°C), x, y, z (µT); then CR LF.

RATE_HZ = 100.0
MAGNETOMETERS = 5
TEMPERATURE_C = 31.25


class EmulatedAnySkin(EmulatedDevice):
    """An emulated board: it sends from the moment it is plugged in. See `EmulatedDevice`."""

    def measure(self, measured: Measured) -> None:
        """Send the field, (n_samples, 15, 1) µT."""
        field_ut = measured['signal'][:, :, 0]
        # With the wrong firmware it is a board with fewer magnetometers.
        self._send(self._disturbed(encode(field_ut[:, 3:] if self.wrong_firmware else field_ut)))

    def skip(self, steps: int) -> None:
        """Let time pass without sending: the board does not number its frames."""


def encode(field_ut: Array, temperature_c: float = TEMPERATURE_C) -> Iterator[bytes]:
    """Yield the frames of consecutive measurements."""
    values = np.full((len(field_ut), field_ut.shape[1] // 3, 4), temperature_c, dtype='<f4')
    values[..., 1:] = field_ut.reshape(*values.shape[:2], 3)
    for row in values:
        yield row.tobytes() + b'\r\n'


# --------------------
# A bridge with a board of BioTacs on a pseudo-terminal: streams what it is given.

SLOT_US = 1e6 / 4400
FRAMES_PER_SERIALS = 100
WRONG_VERSION = 99


class EmulatedBioTac(EmulatedDevice):
    """An emulated bridge; see `EmulatedDevice`."""

    def __init__(
        self, link: Path, rng: np.random.Generator, serials: Sequence[str] = ('BT-2P-02.2.0-B-11-E-00-04',)
    ) -> None:
        super().__init__(link, rng)
        self.board_flip = 0.0  # probability that a bit of a byte changes before the check sum of the bridge is made
        self._serials = serials
        self._absent = [place for place, serial in enumerate(serials) if not serial]
        self._frames = 0

    def reset(self) -> None:
        """Begin the sequence numbers and the clock again, as after a brown-out."""
        super().reset()
        self._frames = 0

    def skip(self, steps: int) -> None:
        """Let time pass without sending: frames are lost."""
        self._frames += steps

    def measure(self, measured: Measured) -> None:
        """Send frames: PAC of every second slot, (n_frames * n_pac, 1, n_places), and TDC, TAC, PDC, the electrodes."""
        slow = measured['signal_static']
        n_frames, n_slow, n_places = slow.shape
        values = np.empty((n_frames, 2 * n_slow, n_places), dtype=np.uint16)
        values[:, ::2] = np.concatenate([slow[:, 3:], slow[:, 2::-1]], axis=1)
        values[:, 1::2] = measured['signal'].reshape(n_frames, n_slow, n_places)
        replies = self._disturb(encode_replies(values, self._absent))
        self._send(b''.join(self._sent(frame, reply.tobytes()) for frame, reply in zip(values, replies, strict=True)))

    def _sent(self, values: Values, reply: bytes) -> bytes:
        """Return the bytes that one frame becomes."""
        time_us = round(self._frames * len(values) * SLOT_US)
        version = WRONG_VERSION if self.wrong_firmware else VERSION
        data = framed(ord('B'), version, self._frames, time_us, shape=values.shape, body=reply)
        serials_sent, turn = divmod(self._frames, FRAMES_PER_SERIALS)
        self._frames += 1
        sent = self.frame_faults.apply(data, self._rng)
        serials, shape = ','.join(self._serials).encode('ascii'), (1, len(self._serials))
        return sent if turn else framed(ord('S'), VERSION, serials_sent, time_us, shape=shape, body=serials) + sent

    def _disturb(self, replies: Bytes) -> Bytes:
        """Return replies with flipped bits."""
        hit = self._rng.random(replies.shape) < self.board_flip
        bits = np.uint8(1) << self._rng.integers(0, 8, replies.shape, dtype=np.uint8)
        return np.where(hit, replies ^ bits, replies)


# --------------------
# A microcontroller that streams samples over a pseudo-terminal, written from its protocol, not from the driver's
# code.
#
# Frame: COBS(kind u8, version u8, sequence u16, time_us u32, rows u8, columns u8, rows × columns int16,
# CRC-16/CCITT-FALSE u16), then a zero; little endian, numbered kind by kind, timed at the first row.

Counts = NDArray[np.int16]
MICROSECONDS = 1_000_000


class SampledStream(NamedTuple):
    """One kind of frames that the device sends."""

    kind: int
    rate_hz: float
    columns: int
    rows: int  # in a frame


class EmulatedSampler(EmulatedDevice):
    """An emulated device that sends one kind of frames for each topic; see `EmulatedDevice`."""

    STREAMS: ClassVar[Mapping[str, SampledStream]]  # by topic, the fastest first

    def __init__(self, link: Path, rng: np.random.Generator) -> None:
        super().__init__(link, rng)
        self.reset()

    def reset(self) -> None:
        """Begin numbers and clock again, as after a brown-out."""
        super().reset()
        self._frames = dict.fromkeys(self.STREAMS, 0)
        self._waiting: dict[str, Counts] = {
            name: np.empty((0, stream.columns), dtype=np.int16) for name, stream in self.STREAMS.items()
        }

    def skip(self, steps: int) -> None:
        """Let time pass, in samples of the first stream, without sending: whole frames are lost."""
        first = next(iter(self.STREAMS.values()))
        for name, stream in self.STREAMS.items():
            self._frames[name] += round(steps / first.rate_hz * stream.rate_hz / stream.rows)

    def measure(self, measured: Measured) -> None:
        """Send what fills a frame."""
        data = b''
        for name, counts in measured.items():
            self._waiting[name] = np.concatenate([self._waiting[name], counts[:, :, 0].astype(np.int16)])
            rows = self.STREAMS[name].rows
            while len(self._waiting[name]) >= rows:
                data += self._sent(name, self._waiting[name][:rows])
                self._waiting[name] = self._waiting[name][rows:]
        self._send(data)

    def _sent(self, name: str, counts: Counts) -> bytes:
        """Return the bytes that one frame becomes."""
        stream, number = self.STREAMS[name], self._frames[name]
        self._frames[name] += 1
        time_us = round(number * stream.rows * MICROSECONDS / stream.rate_hz)
        version, body = WRONG_VERSION if self.wrong_firmware else VERSION, counts.astype('<i2').tobytes()
        data = framed(stream.kind, version, number, time_us, shape=counts.shape, body=body)
        return self.frame_faults.apply(data, self._rng)


class EmulatedDaq(EmulatedSampler):
    """The converter of the data acquisition finger: eight channels, 250 frames of 174 bytes a second."""

    STREAMS: ClassVar = {'signal': SampledStream(kind=0x01, rate_hz=2500.0, columns=8, rows=10)}


class EmulatedPvdf(EmulatedSampler):
    """The microcontroller of the PVDF finger: 128 frames of 78 bytes of the film, 64 of 16 bytes of the force."""

    STREAMS: ClassVar = {
        'signal': SampledStream(kind=0x10, rate_hz=4096.0, columns=1, rows=32),
        'signal_static': SampledStream(kind=0x11, rate_hz=64.0, columns=1, rows=1),
    }


# --------------------
# What a TSF-85 puts on the wire, written from its protocol and not from the driver's code.
#
# Packets: `9A 00 58 length payload`; payload items big-endian, item byte = type | finger << 2. As firmware from 1.1.7
# on it stamps with 64 bits and sends an image when there is a new one.

Image = NDArray[np.uint16]

TAXELS = 28
FINGERS = 2
RESTING_ACCELERATION = b'\x00\x00\x00\x00\x40\x00'  # 1 g along z at 16384 counts/g
RESTING_ROTATION = bytes(6)
STAMP, STAMP_AT = np.dtype('>u8'), slice(5, 13)  # ms


class Tsf85Encoder:
    """Make the packets of consecutive milliseconds; a finger that does not sense and the inertial sensors rest."""

    def __init__(self) -> None:
        self.plug((True,) * FINGERS)

    def plug(self, plugged: Sequence[bool]) -> None:
        """Send items of the fingers that are plugged in alone, one flag a finger."""
        self._plugged = tuple(plugged)
        self._template = np.frombuffer(self._resting_packet(), dtype=np.uint8)

    def _resting_packet(self) -> bytes:
        items = b'\x70' + bytes(STAMP.itemsize)
        for finger in self._present:
            head = finger << 2
            items += bytes([0x20 | head, 0, 0])
            items += bytes([0x30 | head]) + RESTING_ACCELERATION + bytes([0x40 | head]) + RESTING_ROTATION
        return bytes([0x9A, 0x00, 0x58, len(items)]) + items

    def packets(self, first_ms: int, dynamic: Counts, image: Image, image_is_new: bool) -> Iterator[bytes]:
        """Yield the packets of some milliseconds, of (n, n_fingers) values and an (n_taxels, n_fingers) image."""
        rows = np.tile(self._template, (len(dynamic), 1))
        stamps = (first_ms + np.arange(len(dynamic))).astype(STAMP)
        rows[:, STAMP_AT] = stamps[:, None].view(np.uint8)
        for finger, counts in self._by_finger(dynamic.T):
            at = STAMP_AT.stop + self._present.index(finger) * 17 + 1
            rows[:, at : at + 2] = counts.astype('>i2')[:, None].view(np.uint8)
        images = [
            bytes([0x9A, 0x00, 0x58, 1 + 2 * len(taxels), 0x10 | finger << 2]) + taxels.astype('>u2').tobytes()
            for finger, taxels in self._by_finger(image.T)
        ]
        for number, row in enumerate(rows):
            if image_is_new and number == 0:
                yield from images
            yield row.tobytes()

    def _by_finger(self, values: NDArray[Any]) -> Iterator[tuple[int, NDArray[Any]]]:
        """Yield finger and values, (n,), of each that senses and is plugged in."""
        yield from ((finger, row) for finger, row in enumerate(values) if self._plugged[finger])

    @property
    def _present(self) -> list[int]:
        return [finger for finger, plugged in enumerate(self._plugged) if plugged]


# --------------------
# A TSF-85 on a pseudo-terminal: listens to commands, streams what it is given.

AUTOSEND = re.compile(rb'\x9a.\x58\x01(.)', re.DOTALL)  # the last byte is the period in ms; 0 stops
TSF85_KEPT_BYTES = 4  # of an incomplete command
UNKNOWN_ITEM = b'\x80'  # no type that any firmware known sends


class EmulatedTsf85(EmulatedDevice):
    """An emulated hub; see `EmulatedDevice`."""

    def __init__(self, link: Path, rng: np.random.Generator) -> None:
        super().__init__(link, rng)
        self.started = False
        self.ignored_starts = 0  # number of next start commands that are ignored, as after an unclean end
        self._encoder = Tsf85Encoder()
        self._received = b''
        self._clock_ms = 0
        self._image: Image = np.zeros((TAXELS, 1), dtype=np.uint16)
        self._image_is_new = False

    @property
    def streaming(self) -> bool:
        """Whether it sends."""
        return super().streaming and self.started

    def reset(self) -> None:
        """Begin the clock again, silent until started, as after a brown-out."""
        super().reset()
        self._clock_ms = 0
        self.started = False

    def plug_fingers(self, plugged: Sequence[bool]) -> None:
        """Pull the plugs of fingers, or plug them in again, one flag a finger; the hub stays on its line."""
        self._encoder.plug(plugged)

    def measure(self, measured: Measured) -> None:
        """Let as many milliseconds pass as there are dynamic values, and send them and the newest image if started."""
        dynamic, images = measured['signal'][:, 0].astype(np.int16), measured['signal_static'].astype(np.uint16)
        self._execute(self._port.read())
        if len(images):
            self._image, self._image_is_new = images[-1], True
        data = b''
        if self.streaming:
            data, self._image_is_new = self._sent(dynamic), False
        self._send(data)
        self.skip(len(dynamic))

    def skip(self, steps: int) -> None:
        """Let milliseconds pass of which nothing is sent."""
        self._clock_ms += steps

    def _sent(self, dynamic: Counts) -> bytes:
        packets = self._encoder.packets(self._clock_ms, dynamic, self._image, self._image_is_new)
        if self.wrong_firmware:
            packets = (UNKNOWN_ITEM.join([packet[:4], packet[4:]]) for packet in packets)
        return self._disturbed(packets)

    def _execute(self, data: bytes) -> None:
        received = self._received + data
        for command in AUTOSEND.finditer(received):
            is_start = command.group(1) != b'\x00'
            self.started = is_start and not self.ignored_starts
            self.ignored_starts -= is_start and self.ignored_starts > 0
        self._received = received[-TSF85_KEPT_BYTES:] if data else self._received
