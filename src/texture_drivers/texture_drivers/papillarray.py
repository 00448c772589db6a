# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Contactile PapillArray: protocol and sensor."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from struct import Struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.errors import DeviceError, InvalidParameter
from texture_core.types import TactileSignal
from texture_drivers.sensor import SensorParams, load_settings
from texture_drivers.serial_line import Decoder, SerialSensor
from texture_drivers.timing import PPM, SLOW_CLOCK, PacketNumbering, StreamClock

# --------------------
# Numbers of the PapillArray's protocol and streams.
#
# Source: langxin11/contactile-papillarray-ros2, the description of the controller's protocol 2.0 (PTS, 2025). All
# numbers are little endian; offsets count from the byte after the start mark.

START = b'\x55\x66\x77\x88'
END = b'\xaa\xbb\xcc\xdd'
CHECKSUM_BYTES = 2  # the sum of all bytes between the start mark and itself, modulo 65536
MAX_PACKET_BYTES = 8192

# Types of blocks, as the index at the beginning of a packet names them.
HUB, PILLARS, WHOLE = 1, 3, 4  # the hub's counter and clock; each pillar; the whole array. 5 to 7 are slip
HUB_BYTES = 12  # counter u32, time u64 in µs
VALUES_TYPE = 2  # before the six values of a pillar, and of a whole array
TYPE_BYTES, COUNT_BYTES = 2, 2
VALUES_BYTES = 6 * 4

SENSORS = 2  # that a hub can carry
COMMANDS_OF_RATE = {100: b'f100\n', 250: b'f250\n', 500: b'f500\n', 1000: b'f1000\n'}
BIAS_COMMAND = b'z\n'  # takes 2 s, in which nothing may touch the pillars
BIAS_S = 2.0

SIGNAL, WRENCH = 'signal', 'signal_wrench'
PILLARS_SENSOR, WHOLE_SENSOR = 'papillarray/pillars', 'papillarray/whole'
PILLAR_QUANTITIES = {'fx': 'N', 'fy': 'N', 'fz': 'N', 'dx': 'mm', 'dy': 'mm', 'dz': 'mm'}
WHOLE_QUANTITIES = {'fx': 'N', 'fy': 'N', 'fz': 'N', 'tx': 'N mm', 'ty': 'N mm', 'tz': 'N mm'}


def pillar_channels(pillars: int) -> tuple[str, ...]:
    """Return the names of the pillars' channels: 'p0_fx' to 'p0_dz', 'p1_fx' and so on."""
    return tuple(f'p{number}_{quantity}' for number in range(pillars) for quantity in PILLAR_QUANTITIES)


# --------------------
# The PapillArray's protocol: bytes to packets, packets to measurements. Knows no port and no clock.

U16 = Struct('<H')
Values = NDArray[np.float32]
Bytes = NDArray[np.uint8]


class PapillArrayParser:
    """Turn a byte stream into the contents of packets, whatever is lost or added on the way.

    The checksum is a sum: a byte 0 more or less does not change it. So a packet is believed only if the one before it,
    valid or not believed for that alone, was as long.
    """

    def __init__(self) -> None:
        self.packets = 0
        self.refused = 0  # start marks that led to no packet
        self.refused_bytes = 0
        self.restart()

    def restart(self) -> None:
        """Forget what has begun, as after opening the port."""
        self._length = -1  # of the last packet with a right checksum; -1 before the first one
        self._buffer = b''

    def feed(self, data: bytes) -> list[bytes]:
        """Return what stands between start mark and checksum of each packet completed by `data`."""
        self._buffer += data
        packets = []
        while self._skip_to_start():
            end = self._end()
            if end is None:
                break
            if not end:
                self._refuse(len(START))
                continue
            content = self._buffer[len(START) : end - CHECKSUM_BYTES]
            self._buffer = self._buffer[end + len(END) :]
            if len(content) == self._length:
                packets.append(content)
            else:
                self.refused += self._length >= 0
                self.refused_bytes += end + len(END)
            self._length = len(content)
        self.packets += len(packets)
        return packets

    def _skip_to_start(self) -> bool:
        """Drop what comes before a start mark; return whether there is one."""
        start = self._buffer.find(START)
        passed = start if start >= 0 else max(0, len(self._buffer) - len(START) + 1)
        self.refused_bytes += passed
        self._buffer = self._buffer[passed:]
        return start >= 0

    def _refuse(self, length: int) -> None:
        self.refused += 1
        self.refused_bytes += length
        self._buffer = self._buffer[length:]

    def _end(self) -> int | None:
        """Return where the end mark of the packet in front stands; 0 if it is damaged, None if more must come."""
        buffer, first = self._buffer, len(START) + CHECKSUM_BYTES
        following = buffer.find(START, len(START))
        limit = min(following if following >= 0 else len(buffer), MAX_PACKET_BYTES)
        end = buffer.find(END, first, limit)
        while end >= 0:
            checksum_at = end - CHECKSUM_BYTES
            if sum(buffer[len(START) : checksum_at]) % 2**16 == U16.unpack_from(buffer, checksum_at)[0]:
                return end
            end = buffer.find(END, end + 1, limit)
        return 0 if following >= 0 or len(buffer) >= MAX_PACKET_BYTES else None


class Measurements(NamedTuple):
    """What packets of one layout hold."""

    counters: NDArray[np.int64]
    times_us: NDArray[np.int64]
    pillars: Sequence[Values]
    wholes: Sequence[Values]


class PacketLayout(NamedTuple):
    """Where the measurements stand in a packet."""

    hub: int
    pillars: tuple[tuple[int, ...], ...]
    wholes: tuple[int, ...]

    def decode(self, packets: Sequence[bytes]) -> Measurements:
        """Return the measurements of packets that have this layout, and all the same length."""
        rows: Bytes = np.frombuffer(b''.join(packets), dtype=np.uint8).reshape(len(packets), -1)
        counters = np.ascontiguousarray(rows[:, self.hub : self.hub + 4]).view('<u4')[:, 0]
        times_us = np.ascontiguousarray(rows[:, self.hub + 4 : self.hub + HUB_BYTES]).view('<u8')[:, 0]
        return Measurements(
            counters.astype(np.int64),
            times_us.astype(np.int64),
            [_floats(rows, offsets) for offsets in self.pillars],
            [_floats(rows, (offset,)) for offset in self.wholes],
        )


def _floats(rows: Bytes, offsets: Sequence[int]) -> Values:
    """Return the six values at each offset, (n_packets, 6 · n_offsets)."""
    columns = (np.array(offsets)[:, None] + np.arange(VALUES_BYTES)).ravel()
    return np.ascontiguousarray(rows[:, columns]).view('<f4').astype(np.float32)


def layout_of(packet: bytes) -> PacketLayout | None:
    """Return the layout of a packet's content, or None if its blocks do not fit it.

    The index ends where the first block begins. The counts in a block tell its length: it must end where the next one
    begins, or with the packet; only the blocks of slip, whose content is not known here, may be of any length.
    """
    blocks = _index(packet)
    if blocks is None or not {HUB, PILLARS} <= set(blocks):
        return None
    size = packet[0]
    hub = blocks[HUB]
    pillars = _pillars(packet, blocks[PILLARS], size)
    wholes = _wholes(packet, blocks[WHOLE], size) if WHOLE in blocks else ((), None)
    if pillars is None or wholes is None:
        return None
    ends = {HUB: hub + HUB_BYTES, PILLARS: pillars[1], WHOLE: wholes[1]}
    following = dict(zip(blocks, [*list(blocks.values())[1:], len(packet)], strict=True))
    if any(ends.get(kind, end) != end for kind, end in following.items()):
        return None
    return PacketLayout(hub, pillars[0], wholes[0])


def _index(packet: bytes) -> Mapping[int, int] | None:
    """Return the offset of each type of block, in their order; None if there is no valid index."""
    if not packet or packet[0] not in (1, 2, 4):
        return None
    size, at, first = packet[0], 1, len(packet)
    blocks: dict[int, int] = {}
    while at < first:
        if at + TYPE_BYTES + size > len(packet):
            return None
        kind = U16.unpack_from(packet, at)[0]
        offset = int.from_bytes(packet[at + TYPE_BYTES : at + TYPE_BYTES + size], 'little')
        at += TYPE_BYTES + size
        if kind in blocks or offset > len(packet) or offset < max(blocks.values(), default=at):
            return None
        blocks[kind] = offset
        first = next(iter(blocks.values()))
    return blocks if at == first else None


def _counted(packet: bytes, at: int, size: int) -> tuple[int, int] | None:
    """Return a count and where what follows its table of offsets begins; None beyond the end."""
    if at + COUNT_BYTES > len(packet):
        return None
    count = U16.unpack_from(packet, at)[0]
    return count, at + COUNT_BYTES + count * size


def _values(packet: bytes, at: int, count: int) -> tuple[tuple[int, ...], int] | None:
    """Return the offsets of the six values of each of `count` items, and where they end; None if they do not fit."""
    item_bytes = TYPE_BYTES + VALUES_BYTES
    starts = [at + number * item_bytes for number in range(min(count, MAX_PACKET_BYTES))]
    end = at + count * item_bytes
    if end > len(packet) or any(U16.unpack_from(packet, start)[0] != VALUES_TYPE for start in starts):
        return None
    return tuple(start + TYPE_BYTES for start in starts), end


def _pillars(packet: bytes, at: int, size: int) -> tuple[tuple[tuple[int, ...], ...], int] | None:
    """Return the offsets of each pillar of each array, and where the block ends; None if it does not fit."""
    arrays = _counted(packet, at, size)
    if arrays is None or not 1 <= arrays[0] <= SENSORS:
        return None
    found, at = [], arrays[1]
    for _ in range(arrays[0]):
        counted = _counted(packet, at, size)
        values = _values(packet, counted[1], counted[0]) if counted else None
        if values is None:
            return None
        found.append(values[0])
        at = values[1]
    return tuple(found), at


def _wholes(packet: bytes, at: int, size: int) -> tuple[tuple[int, ...], int] | None:
    """Return the offset of the values of each whole array, and where the block ends; None if it does not fit."""
    counted = _counted(packet, at, size)
    return _values(packet, counted[1], counted[0]) if counted else None


# --------------------
# The PapillArray as a sensor of the suite: its pillars on 'signal', the whole array on 'signal_wrench'.

MICROSECONDS_PER_S = 1e6
LONGEST_STEP_US = 10_000_000  # a clock that leaps further, or back, is another one
Topics = dict[str, list[TactileSignal]]


@dataclass(frozen=True)
class PapillArraySettings:
    """Parameters of the PapillArray hub."""

    rate_hz: int = param(
        500,
        'Rate that is asked of the hub: 100, 250, 500 or 1000; a higher rate holds finer texture and costs '
        'more computing time.',
        unit='Hz',
        low=100,
        high=1000,
    )
    wrench: bool = param(True, "Publishes force and torque of the whole array on the topic 'signal_wrench'.")

    def __post_init__(self) -> None:
        if self.rate_hz not in COMMANDS_OF_RATE:
            raise InvalidParameter(
                f"setting 'rate_hz' is {self.rate_hz}; the hub can do {', '.join(map(str, COMMANDS_OF_RATE))} Hz"
            )


class PapillArrayDecoder(Decoder):
    """Decode the packets of a hub; see `texture_drivers.serial_line.Decoder`.

    The hub's counter numbers the samples and its clock times them; over an interruption the host's clock tells what is
    missing.
    """

    def __init__(
        self, settings: PapillArraySettings, arrays: Mapping[int, str], device: str, frame_id: str = ''
    ) -> None:
        self._settings = settings
        self._topics = {array: (f'{prefix}{SIGNAL}', f'{prefix}{WRENCH}') for array, prefix in arrays.items()}
        self._device = device
        self._rate_hz = float(settings.rate_hz)
        self._signal = partial(TactileSignal, sampling_rate_hz=self._rate_hz, frame_id=frame_id)
        self._parser = PapillArrayParser()
        self._layout: tuple[int, PacketLayout] | None = None  # length of the packets, and their layout
        self._clock = StreamClock(MICROSECONDS_PER_S)
        self._numbering = PacketNumbering(self._rate_hz)
        self._last: tuple[int, int] | None = None  # counter and time of the last packet
        self._samples = self._malformed = self._repeated = self._restarts = 0

    @property
    def valid_frames(self) -> int:
        """Packets that passed the checks."""
        return self._parser.packets - self._malformed

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals: samples published and lost, packets refused, sent twice, and new beginnings."""
        return {
            'samples': self._samples,
            'lost': self._numbering.lost,
            'bogus': self._parser.refused + self._malformed,
            'refused_bytes': self._parser.refused_bytes,
            'repeated frames': self._repeated,
            'device restarts': self._restarts,
            'clock_steps': self._clock.steps,
        }

    @property
    def details(self) -> Mapping[str, float]:
        """How much the hub's clock is slow."""
        return {SLOW_CLOCK: PPM * self._clock.drift}

    @property
    def rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        named = [name for names in self._topics.values() for name in (names if self._settings.wrench else names[:1])]
        return dict.fromkeys(named, self._rate_hz)

    def restart(self) -> None:
        """Go on after an interruption, with the index that the host's clock will tell."""
        self._parser.restart()
        self._interrupt()

    def feed(self, data: bytes, arrival_ns: int) -> Mapping[str, Sequence[TactileSignal]]:
        """Return the batches in `data`; none in the first 0.1 s of a stream."""
        topics: Topics = {}
        for layout, packets in self._by_layout(self._parser.feed(data)):
            self._check_arrays(len(layout.pillars))
            self._place(layout.decode(packets), arrival_ns, topics)
        return topics

    def _by_layout(self, packets: Sequence[bytes]) -> Iterator[tuple[PacketLayout, list[bytes]]]:
        """Yield runs of packets of one length with their layout."""
        run: list[bytes] = []
        for packet in packets:
            if self._layout is None or len(packet) != self._layout[0]:
                if run and self._layout:
                    yield self._layout[1], run
                run = []
                layout = layout_of(packet)
                self._layout = (len(packet), layout) if layout else None
            if self._layout is None:
                self._malformed += 1
            else:
                run.append(packet)
        if run and self._layout:
            yield self._layout[1], run

    def _check_arrays(self, arrays: int) -> None:
        missing = [array for array in self._topics if array >= arrays]
        if missing:
            raise DeviceError(
                f"array {missing[0]} is asked for, and the hub at '{self._device}' carries {arrays}; set the parameter "
                'finger to one of them, or check its plug'
            )

    def _place(self, found: Measurements, arrival_ns: int, topics: Topics) -> None:
        """Make batches of packets that have just arrived: a new one wherever packets are missing."""
        for rows in self._runs(found):
            counter, time_us = int(found.counters[rows[0]]), int(found.times_us[rows[0]])
            self._clock.observe(int(found.times_us[rows[-1]]), arrival_ns)
            if not self._clock.settled:
                continue
            stamp_ns = self._clock.time_ns(time_us)
            index = self._numbering.place(counter, len(rows), stamp_ns)
            self._samples += len(rows)
            self._add_batches(found, rows, stamp_ns, index, topics)

    def _add_batches(
        self, found: Measurements, rows: NDArray[np.intp], stamp_ns: int, index: int, topics: Topics
    ) -> None:
        """Add the batch of each array that a run of packets makes."""
        signal_of = partial(self._signal, stamp_ns=stamp_ns, first_sample=index)
        units = tuple(PILLAR_QUANTITIES.values())
        for array, (signal, wrench) in self._topics.items():
            pillars = found.pillars[array][rows]
            count = pillars.shape[1] // len(PILLAR_QUANTITIES)
            batch = signal_of(
                sensor=PILLARS_SENSOR, channels=pillar_channels(count), units=units * count, samples=pillars
            )
            topics.setdefault(signal, []).append(batch)
            if self._settings.wrench and array < len(found.wholes):
                whole = found.wholes[array][rows]
                channels, whole_units = tuple(WHOLE_QUANTITIES), tuple(WHOLE_QUANTITIES.values())
                batch = signal_of(sensor=WHOLE_SENSOR, channels=channels, units=whole_units, samples=whole)
                topics.setdefault(wrench, []).append(batch)

    def _runs(self, found: Measurements) -> Iterator[NDArray[np.intp]]:
        """Yield the rows of packets that follow each other, without those sent twice."""
        steps = np.diff(found.counters)
        for rows in np.split(np.arange(len(found.counters)), np.flatnonzero(steps != 1) + 1):
            first = int(found.counters[rows[0]]), int(found.times_us[rows[0]])
            if self._last == first:
                self._repeated += 1
                rows = rows[1:]  # noqa: PLW2901
                if not len(rows):
                    continue
            elif self._last and not (first[0] > self._last[0] and 0 < first[1] - self._last[1] <= LONGEST_STEP_US):
                self._restarts += 1
                self._interrupt()
            self._last = int(found.counters[rows[-1]]), int(found.times_us[rows[-1]])
            yield rows

    def _interrupt(self) -> None:
        self._numbering.interrupt()
        self._clock.restart()
        self._last = None


class PapillArray(SerialSensor):
    """Read one array of a hub, or both. See `texture_core.types.Sensor`.

    Parameters
    ----------
    params
        `finger` is the place of the array, 0 or 1; `config` means `PapillArraySettings`.
    now_ns
        The host's clock.
    arrays
        Several arrays instead of `params.finger`; topics are then 'finger0/signal' and so on.

    Raises
    ------
    InvalidParameter
        If there is no such place, or the settings are wrong.
    """

    def __init__(
        self, params: SensorParams, now_ns: Callable[[], int] = time.time_ns, *, arrays: Sequence[int] = ()
    ) -> None:
        if not arrays and params.finger >= SENSORS:
            raise InvalidParameter(f"parameter 'finger' is {params.finger}; a hub has the places 0 and 1")
        settings = load_settings(PapillArraySettings, params.config)
        prefixes = {array: f'finger{array}/' for array in arrays} or {params.finger: ''}
        decoder = PapillArrayDecoder(settings, prefixes, params.device, params.frame_id)
        self._rate_command = COMMANDS_OF_RATE[settings.rate_hz]
        super().__init__(params, now_ns, decoder, start_command=self._rate_command)

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Return what arrived within the length of one batch; see `SerialSensor.read`.

        A hub that has begun again, as after a brown-out, is back at its own rate: it is asked for that of the settings.

        Raises
        ------
        DeviceError
            If the port is not open or is gone, or no valid packet has come for 1 s.
        """
        restarts = self.counts['device restarts']
        batches = super().read()
        if self.counts['device restarts'] > restarts:
            self.send(self._rate_command)
        return batches

    def set_bias(self) -> float:
        """Make the hub take the present state of its pillars for none; return the seconds that this takes.

        Raises
        ------
        DeviceError
            If the port is not open or is gone.
        """
        self.send(BIAS_COMMAND)
        return BIAS_S
