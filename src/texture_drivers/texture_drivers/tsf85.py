# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Robotiq TSF-85 fingertip: protocol, sample frames, settings, messages of the vendor, the sensor."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import groupby
from struct import Struct
from typing import NamedTuple

import numpy as np

from texture_core.config import param
from texture_core.errors import DeviceError, InvalidParameter
from texture_core.types import TactileSignal
from texture_drivers import serial_line
from texture_drivers.health import Limits
from texture_drivers.sensor import SensorParams, load_settings
from texture_drivers.serial_line import SerialSensor
from texture_drivers.timing import BLOCKS_LATE, PPM, SLOW_CLOCK, ArrivalNumbering, SampleCounter

# --------------------
# Numbers of the TSF-85's protocol and streams.
#
# Sources: robotiq/tactile_sensors @8cb0219 (`sdk_cpp/RobotiqTactileSensor.cpp`, `sensor_quickstart/protocol.py`) and
# robotiq/ros @18335fa (`robotiq_tsf/src/PollData.cpp`). Both agree.

START_BYTE = 0x9A
HEADER_BYTES = 4  # start, checksum (sent as 0, never checked), command, payload length

READ_SENSORS = 0x61
AUTOSEND = 0x58
AUTOSEND_ASYNC = 0x59  # firmware >= 1.1.7
# Their payload is the period in ms; 0 ends the stream.
START_COMMAND, STOP_COMMAND = (bytes([START_BYTE, 0, AUTOSEND, 1, period_ms]) for period_ms in (1, 0))
DATA_COMMANDS = frozenset({READ_SENSORS, AUTOSEND, AUTOSEND_ASYNC})

# An item byte: type in the high nibble, finger in bits 3..2, index (0 in practice) in bits 1..0.
TYPE_MASK, FINGER_MASK, FINGER_SHIFT, INDEX_MASK = 0xF0, 0x0C, 2, 0x03
FINGERS = 2
STATIC, DYNAMIC, ACCELEROMETER, GYROSCOPE, MAGNETOMETER, TEMPERATURE, TIMESTAMP = range(0x10, 0x80, 0x10)
ITEMS: Mapping[int, Struct] = {
    DYNAMIC: Struct('>h'),
    ACCELEROMETER: Struct('>3h'),
    GYROSCOPE: Struct('>3h'),
    MAGNETOMETER: Struct('>3h'),
    TEMPERATURE: Struct('>h'),
}
# Firmware up to 1.0.6 sends 16 bits, from 1.1.7 on 64 bits; the packet does not show which. The short one is tried
# first: it never fits a long stamp, whose third byte, taken as the next item, is below 0x10 and no type (for 200 days
# of microseconds). The vendor's sources called the long one milliseconds (robotiq/ros @2347d23) and since call it
# microseconds (@73cb1b5); so the stamps themselves decide.
TIMESTAMPS = (Struct('>H'), Struct('>Q'))

RATE_HZ = 1000.0  # of the dynamic channel; the device stamps each sample with its milliseconds, or microseconds
DYNAMIC_SENSOR, STATIC_SENSOR, MOTION_SENSOR = 'tsf85/dynamic', 'tsf85/static', 'tsf85/imu'
DYNAMIC_CHANNELS = ('dynamic',)
UNIT = 'count'
LIMITS = {'signal': (-(2**15), 2**15 - 1), 'signal_static': (0, 2**16 - 1)}  # what the counts can be, by topic


@dataclass(frozen=True)
class Tsf85Layout:
    """The taxels of one kind of fingertip, row by row."""

    rows: int
    columns: int
    static_rate_hz: float

    @cached_property
    def static_channels(self) -> tuple[str, ...]:
        """Name of each taxel."""
        return tuple(f'taxel_{row}_{column}' for row in range(self.rows) for column in range(self.columns))

    @cached_property
    def items(self) -> Mapping[int, Struct]:
        """What follows each item byte, but for the stamp's."""
        return {STATIC: Struct(f'>{self.rows * self.columns}H'), **ITEMS}


LAYOUTS: Mapping[str, Tsf85Layout] = {
    'tsf85': Tsf85Layout(7, 4, 60.0),  # 60 Hz: Robotiq README 2026; 59 Hz in paper 2, about 25 Hz with some firmware
    # The prototype of Roberge et al. ("3x4 taxels per phalanges ... about 25 Hz"). No public driver shows its packets:
    # those of the TSF-85 are taken, with 12 taxels.
    'tsf85_3x4': Tsf85Layout(3, 4, 25.0),
}
TSF85 = LAYOUTS['tsf85']

USB_IDS = ((0x16D0, 0x14CC), (0x04B4, 0xF232))  # the present one; an older one, Cypress' default


# --------------------
# The TSF-85's protocol: bytes to packets, commands to bytes. Independent of port and clock.


class Item(NamedTuple):
    """One measurement in a packet: its type, its finger and its numbers."""

    kind: int
    finger: int
    values: tuple[int, ...]


class Packet(NamedTuple):
    """What the device sent at once."""

    command: int
    items: tuple[Item, ...]


class Tsf85Parser:
    """Turn a byte stream into packets, whatever is lost or added in transmission.

    The protocol has no checksum, so a packet is accepted only if everything about it fits: a data command, known item
    types, index bits 0, a finger that exists, no item twice (a flipped type or finger would make a sample that never
    was), items that end exactly with the payload, and a start byte after it as far as one has come. A flipped value
    byte inside such a packet cannot be seen.
    """

    def __init__(self, layout: Tsf85Layout = TSF85) -> None:
        self.refused = 0  # start bytes that led to no packet
        self.refused_bytes = 0
        self._items = layout.items
        self._buffer = b''

    def feed(self, data: bytes) -> list[Packet]:
        """Return the packets completed by `data`; what is refused is counted. Keeps fewer than 260 bytes."""
        buffer = self._buffer + data
        packets: list[Packet] = []
        position = 0
        while True:
            start = buffer.find(START_BYTE, position)
            if start < 0:
                self.refused_bytes += len(buffer) - position
                position = len(buffer)
                break
            self.refused_bytes += start - position
            position = start
            if not _is_decidable(buffer, start):
                break
            packet = _packet_at(buffer, start, self._items)
            if packet is None:
                self.refused += 1
                self.refused_bytes += 1
                position += 1
            else:
                packets.append(packet)
                position = _end(buffer, start)
        self._buffer = buffer[position:]
        return packets


def _end(buffer: bytes, start: int) -> int:
    return start + HEADER_BYTES + buffer[start + 3]


def _is_decidable(buffer: bytes, start: int) -> bool:
    """Return whether the packet has come completely, or enough of it to be refused."""
    if len(buffer) < start + HEADER_BYTES:
        return False
    end = _end(buffer, start)
    if buffer[start + 2] not in DATA_COMMANDS or end < len(buffer):
        return True
    # A packet that lost a byte borrows the next start byte as its last: wait for what follows.
    return end == len(buffer) and buffer[end - 1] != START_BYTE


def _packet_at(buffer: bytes, start: int, layouts: Mapping[int, Struct]) -> Packet | None:
    command, end = buffer[start + 2], _end(buffer, start)
    if command not in DATA_COMMANDS or (end < len(buffer) and buffer[end] != START_BYTE):
        return None
    payload = buffer[start + HEADER_BYTES : end]
    for timestamp in TIMESTAMPS:
        items = _parse_items(payload, timestamp, layouts)
        if items:
            return Packet(command, items)
    return None


def _parse_items(payload: bytes, timestamp: Struct, layouts: Mapping[int, Struct]) -> tuple[Item, ...] | None:
    """Return the items of a payload, or None if they do not fit it exactly."""
    items = []
    item_bytes: set[int] = set()
    position = 0
    while position < len(payload):
        item_byte = payload[position]
        kind, finger = item_byte & TYPE_MASK, (item_byte & FINGER_MASK) >> FINGER_SHIFT
        layout = timestamp if kind == TIMESTAMP else layouts.get(kind)
        if layout is None or item_byte & INDEX_MASK or finger >= FINGERS or item_byte in item_bytes:
            return None
        if position + 1 + layout.size > len(payload):
            return None
        item_bytes.add(item_byte)
        items.append(Item(kind, finger, layout.unpack_from(payload, position + 1)))
        position += 1 + layout.size
    return tuple(items)


# --------------------
# Sample frames of one finger, one a millisecond, from packets that may hold any of its measurements.

MOTION_KINDS = (ACCELEROMETER, GYROSCOPE)  # of the inertial sensors, three numbers each; few devices send a field
MOTION_CHANNELS = tuple(f'{quantity}_{axis}' for quantity in ('acceleration', 'rotation') for axis in 'xyz')
MOTION_UNITS = ('m/s²',) * 3 + ('rad/s',) * 3
# Counts of 1 g and of 1 degree a second, of the vendor's viewer: 2 g and 250 degrees a second are full scale.
MOTION_GAINS = np.repeat([9.80665 / 16384.0, math.radians(1.0) / 131.072], 3)
MOTION_HOLD = 10  # sets; firmware that sends what is new may be a set late with it, not more
UNKNOWN = (float('nan'),) * 3


class SampleFrame(NamedTuple):
    """One millisecond of one finger: the dynamic value, the taxel image if one came with it, the inertial values."""

    stamp: int | None
    dynamic: int
    image: tuple[int, ...] | None = None
    motion: tuple[float, ...] = ()


class SampleFrameSplitter:
    """Turn packets into the sample frames of one finger: a dynamic item starts a frame and takes what came before."""

    def __init__(self, finger: int) -> None:
        self._finger = finger
        self._image: tuple[int, ...] | None = None
        self._motion: dict[int, tuple[float, ...]] = dict.fromkeys(MOTION_KINDS, UNKNOWN)
        self._ages = dict.fromkeys(MOTION_KINDS, 0)

    def frames(self, packets: Sequence[Packet]) -> list[SampleFrame]:
        """Return the sets in a row of packets."""
        found: list[SampleFrame] = []
        for packet in packets:
            stamp, dynamic = self._numbers(packet)
            for value in dynamic:
                found.append(SampleFrame(stamp, value, self._image, self._newest_motion()))
                self._image = None
        return found

    def _numbers(self, packet: Packet) -> tuple[int | None, list[int]]:
        """Return the stamp and the dynamic values of a packet; the rest is kept for the next set."""
        stamp, dynamic = None, []
        for kind, finger, values in packet.items:
            if kind == TIMESTAMP:
                stamp = values[0] if stamp is None or finger == self._finger else stamp
            elif finger != self._finger:
                continue
            elif kind == DYNAMIC:
                dynamic.append(values[0])
            elif kind == STATIC:
                self._image = values
            elif kind in self._motion:
                self._motion[kind], self._ages[kind] = values, 0
        return stamp, dynamic

    def _newest_motion(self) -> tuple[float, ...]:
        """Return the newest inertial values, NaN for those that have not come for long."""
        values: tuple[float, ...] = ()
        for kind, newest in self._motion.items():
            values += newest if self._ages[kind] < MOTION_HOLD else UNKNOWN
            self._ages[kind] += 1
        return values


# --------------------
# One finger of a TSF-85: its sample frames become numbered, timed batches of signals.

IMAGE_HOLD_S = 0.25  # an image older than this is no measurement of now
SHORTEST_LOSS_S = 0.01  # what is late by less is no loss, where the firmware sends no stamps
SIGNAL, BATCH_STATIC, IMU = 'signal', 'signal_static', 'signal_imu'


class FingerStream:
    """Number the sample frames of one finger by the device's stamps, time them by the host's clock, cut batches.

    Where the firmware sends no stamps, the host's clock also shows what was lost, half a second later. A new batch
    begins wherever the index jumps; the newest taxel image is published at each tick of a constant rate.
    """

    def __init__(self, layout: Tsf85Layout = TSF85, *, imu: bool = True, frame_id: str = '') -> None:
        self.samples = self.lost = 0
        self.counter = SampleCounter(ticks=0)
        self._numbering = ArrivalNumbering(RATE_HZ, block_s=SHORTEST_LOSS_S / BLOCKS_LATE)
        self.clock = self._numbering.clock
        self._imu = imu
        self._static_rate_hz = layout.static_rate_hz
        signal, taxels = partial(TactileSignal, frame_id=frame_id), layout.static_channels
        self._dynamic = partial(
            signal, sensor=DYNAMIC_SENSOR, channels=DYNAMIC_CHANNELS, units=(UNIT,), sampling_rate_hz=RATE_HZ
        )
        self._motion = partial(
            signal, sensor=MOTION_SENSOR, channels=MOTION_CHANNELS, units=MOTION_UNITS, sampling_rate_hz=RATE_HZ
        )
        self._static = partial(
            signal, sensor=STATIC_SENSOR, channels=taxels, units=(UNIT,) * len(taxels),
            sampling_rate_hz=layout.static_rate_hz,
        )  # fmt: skip
        self._waiting: list[SampleFrame] = []
        self._next_index: int | None = None  # none published yet
        self._image: tuple[int, ...] | None = None
        self._image_index = 0
        self._tick = 0
        self._frames_per_tick = RATE_HZ / layout.static_rate_hz

    @property
    def rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        rates = {SIGNAL: RATE_HZ, BATCH_STATIC: self._static_rate_hz}
        return {**rates, IMU: RATE_HZ} if self._imu else rates

    def interrupt(self) -> None:
        """Reset the state for a new stream."""
        self._numbering.interrupt()
        self.counter.interrupt()
        self._waiting = []

    def place(self, frames: Sequence[SampleFrame], arrival_ns: int) -> Mapping[str, list[TactileSignal]]:
        """Return the batches, by topic, that the sets make which have just arrived; none while no time is known."""
        if not frames:
            return {}
        waiting = [*self._waiting, *frames]
        indices, restarted = self.counter.place([item.stamp for item in waiting])
        placed, self._waiting = waiting[: len(indices)], waiting[len(indices) :]
        skipped = 0
        if indices:
            counted = any(item.stamp is not None for item in placed)
            skipped = self._numbering.missing(indices[-1], arrival_ns, counted=counted)
            self.counter.skip(skipped)
        if restarted:
            self.interrupt()
        return self._cut([index + skipped for index in indices], placed) if indices and self.clock.settled else {}

    def _cut(self, indices: Sequence[int], frames: Sequence[SampleFrame]) -> Mapping[str, list[TactileSignal]]:
        batches: dict[str, list[TactileSignal]] = {SIGNAL: [], BATCH_STATIC: [], IMU: []}
        # Runs without a gap: there index and place differ by the same number.
        numbered = enumerate(zip(indices, frames, strict=True))
        for _, run in groupby(numbered, key=lambda item: item[1][0] - item[0]):
            members_at = [numbered_frame for _, numbered_frame in run]
            first, members = members_at[0][0], [item for _, item in members_at]
            if first != self._next_index:
                self.lost += 0 if self._next_index is None else first - self._next_index
                self._tick = math.ceil(first / self._frames_per_tick)
            self._next_index = first + len(members)
            self.samples += len(members)
            stamp_ns = self.clock.time_ns(first)
            dynamic = np.array([item.dynamic for item in members], dtype=np.float32)[:, None]
            batches[SIGNAL].append(self._dynamic(stamp_ns=stamp_ns, first_sample=first, samples=dynamic))
            batches[BATCH_STATIC].extend(self._images(first, members))
            motion = np.array([item.motion for item in members])
            if self._imu and not np.isnan(motion).all():  # the device has sent some of it
                motion = (motion * MOTION_GAINS).astype(np.float32)
                batches[IMU].append(self._motion(stamp_ns=stamp_ns, first_sample=first, samples=motion))
        return batches

    def _images(self, first: int, members: Sequence[SampleFrame]) -> Iterator[TactileSignal]:
        for index, item in enumerate(members, first):
            if item.image is not None:
                self._image, self._image_index = item.image, index
            while self._tick * self._frames_per_tick <= index:
                if self._image is not None and index - self._image_index <= IMAGE_HOLD_S * RATE_HZ:
                    stamp_ns = self.clock.time_ns(self._tick * self._frames_per_tick)
                    image = np.array([self._image], dtype=np.float32)
                    yield self._static(stamp_ns=stamp_ns, first_sample=self._tick, samples=image)
                self._tick += 1


# --------------------
# The TSF-85 fingertip as a sensor of the suite.


@dataclass(frozen=True)
class Tsf85Settings:
    """What is published of a TSF-85 in addition to its tactile signals."""

    imu: bool = param(True, "Publishes acceleration and angular rate on the topic 'signal_imu'.")


SILENCE_S = 0.5  # an open port may stay silent after an unclean end; stop and start wake the device
REVIVALS = 3  # restarts, as the vendor does, before the port is closed
REVIVAL_PAUSE_S = 0.05  # between stop and start


class Tsf85(SerialSensor):
    """Read a TSF-85: 'signal' at 1 kHz, 'signal_static' (7 rows of 4 taxels) at a constant rate, 'signal_imu' at 1 kHz.

    The device's stamps number the samples, so losses are known exactly; over an interruption the host's clock
    does. Taxel images come irregularly (or, from old firmware, repeated each millisecond): the newest one is published
    at each tick of the static rate. See `texture_core.types.Sensor`.

    Parameters
    ----------
    params
        `device` is a path or 'auto', `finger` 0 or 1, `config` means `Tsf85Settings`.
    now_ns
        The host's clock.
    layout
        Kind of fingertip.
    fingers
        Several fingers instead of `params.finger`; topics are then 'finger0/signal' and so on.

    Raises
    ------
    InvalidParameter
        If there is no such finger, or the settings are wrong.
    """

    def __init__(
        self,
        params: SensorParams,
        now_ns: Callable[[], int] = time.time_ns,
        *,
        layout: Tsf85Layout = TSF85,
        fingers: Sequence[int] = (),
    ) -> None:
        if not fingers and params.finger >= FINGERS:
            raise InvalidParameter(f"parameter 'finger' is {params.finger}; a TSF-85 has the fingers 0 and 1")
        super().__init__(params, now_ns, start_command=START_COMMAND, stop_command=STOP_COMMAND)
        imu = load_settings(Tsf85Settings, params.config).imu
        self._prefixes = {finger: f'finger{finger}/' for finger in fingers} or {params.finger: ''}
        self._parser = Tsf85Parser(layout)
        self._splitters = {finger: SampleFrameSplitter(finger) for finger in self._prefixes}
        self._fingers = {finger: FingerStream(layout, imu=imu, frame_id=params.frame_id) for finger in self._prefixes}
        self._last_packet: Packet | None = None
        self._frames = self._repeated = 0
        self._serial = ''
        self._revived = self._revivals = 0

    def open(self) -> None:
        """Open the device and start its stream; DeviceError if it cannot be reached."""
        self.close()
        self._path = serial_line.resolve(self._params.device, USB_IDS, 'TSF-85')
        super().open()
        self._serial = serial_line.serial_number(self._path)
        self._revivals = 0

    @property
    def valid_frames(self) -> int:
        """Sample frames of the fingers that are published."""
        return self._frames

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals: samples published, samples lost, bogus candidates and bytes refused, and what was done about it."""
        fingers = self._fingers.values()
        return {
            'samples': sum(finger.samples for finger in fingers),
            'lost': sum(finger.lost for finger in fingers),
            'bogus': self._parser.refused,
            'refused_bytes': self._parser.refused_bytes,
            'repeated': self._repeated,
            'damaged_stamps': sum(finger.counter.damaged_stamps for finger in fingers),
            'clock_steps': sum(finger.clock.steps for finger in fingers),
            'revived': self._revived,
            **super().counts,
        }

    @property
    def details(self) -> Mapping[str, str | float]:
        """Serial number of the USB device if it has one, and how much its clock is slow."""
        serial = {'serial number': self._serial} if self._serial else {}
        return {**serial, SLOW_CLOCK: PPM * next(iter(self._fingers.values())).clock.drift}

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        return {
            f'{prefix}{topic}': rate
            for number, prefix in self._prefixes.items()
            for topic, rate in self._fingers[number].rates_hz.items()
        }

    @property
    def limits(self) -> Limits:
        """Ends of the int16 and of the uint16 by topic."""
        return {f'{prefix}{topic}': ends for prefix in self._prefixes.values() for topic, ends in LIMITS.items()}

    def restart(self) -> None:
        """Resume after an interruption, with the index according to the host's clock."""
        for finger in self._fingers.values():
            finger.interrupt()

    def feed(self, data: bytes, arrival_ns: int) -> Mapping[str, Sequence[TactileSignal]]:
        """Return the batches in `data`; none in the first 0.1 s of a stream."""
        packets = self._without_duplicates(self._parser.feed(data))
        topics: dict[str, Sequence[TactileSignal]] = {}
        for number, finger in self._fingers.items():
            frames = self._splitters[number].frames(packets)
            self._frames += len(frames)
            placed = finger.place(frames, arrival_ns)
            topics |= {f'{self._prefixes[number]}{topic}': batches for topic, batches in placed.items()}
        return topics

    def _without_duplicates(self, packets: Sequence[Packet]) -> list[Packet]:
        """Leave out what came twice: the same to the last bit, stamp and all."""
        unique = []
        for packet in packets:
            if packet == self._last_packet and any(item.kind == TIMESTAMP for item in packet.items):
                self._repeated += 1
            else:
                unique.append(packet)
            self._last_packet = packet
        return unique

    def _act_on_silence(self) -> None:
        """Wake a device that is open but silent; DeviceError when that does not help."""
        if not self._silent_s:
            self._revivals = 0
        if self._silent_s < SILENCE_S:
            return
        if self._revivals == REVIVALS:
            raise DeviceError(self._silence_sentence())
        self._silent_s = 0.0
        self._revivals += 1
        self._revived += 1
        self.send(self._stop_command)
        time.sleep(REVIVAL_PAUSE_S)
        self.send(self._start_command)
        self.restart()

    def _silence_sentence(self) -> str:
        if self._babbles:
            fingers = ' or '.join(str(finger) for finger in self._prefixes)
            return (
                f"device '{self._params.device}' sends bytes, but no known packet of finger "
                f'{fingers}; check the finger, that it is a TSF-85, and its firmware (1.0.6 to 1.1.8 are known)'
            )
        return f"device '{self._params.device}' is open and sends nothing, started {1 + REVIVALS} times; replug it"
