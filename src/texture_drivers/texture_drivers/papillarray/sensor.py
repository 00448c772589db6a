"""The PapillArray as a sensor of the suite: its pillars on 'signal', the whole array on 'wrench'."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import DeviceError, InvalidParameter
from texture_core.parameters import param
from texture_core.signal import TactileSignal
from texture_drivers.channel_watch import Limits
from texture_drivers.clock import PPM, SLOW_CLOCK, StreamClock
from texture_drivers.packet_numbering import PacketNumbering
from texture_drivers.papillarray import tables
from texture_drivers.papillarray.protocol import Measurements, PacketLayout, PapillArrayParser, Values, layout_of
from texture_drivers.params import SensorParams
from texture_drivers.serial_sensor import SerialSensor
from texture_drivers.settings import load_settings

MICROSECONDS_PER_S = 1e6
LONGEST_STEP_US = 10_000_000  # a clock that leaps further, or back, is another one
Topics = dict[str, list[TactileSignal]]


@dataclass(frozen=True)
class PapillArraySettings:
    """Parameters of the PapillArray hub."""

    rate_hz: int = param(
        500,
        'Sets the rate that is asked of the hub: 100, 250, 500 or 1000; a higher rate holds finer texture and costs '
        'more computing time.',
        unit='Hz',
        low=100,
        high=1000,
    )
    wrench: bool = param(True, "Publishes force and torque of the whole array on the topic 'wrench'.")

    def __post_init__(self) -> None:
        if self.rate_hz not in tables.COMMANDS_OF_RATE:
            raise InvalidParameter(
                f"setting 'rate_hz' is {self.rate_hz}; the hub can do {', '.join(map(str, tables.COMMANDS_OF_RATE))} Hz"
            )


@dataclass(frozen=True)
class ArrayTopics:
    """Names of what one array publishes."""

    prefix: str

    @cached_property
    def signal(self) -> str:
        """Topic of the pillars."""
        return f'{self.prefix}{tables.SIGNAL}'

    @cached_property
    def wrench(self) -> str:
        """Topic of the whole array."""
        return f'{self.prefix}{tables.WRENCH}'


class PapillArrayDecoder:
    """Decode the packets of a hub; see `texture_drivers.serial_sensor.Decoder`.

    The hub's counter numbers the samples and its clock times them; over an interruption the host's clock tells what is
    missing.

    Parameters
    ----------
    settings
        Of the hub.
    arrays
        Which arrays are published, and the prefix of the topics of each.
    device
        Path, for the error sentences.
    frame_id
        For the headers.
    """

    def __init__(
        self, settings: PapillArraySettings, arrays: Mapping[int, str], device: str, frame_id: str = ''
    ) -> None:
        self._settings = settings
        self._topics = {array: ArrayTopics(prefix) for array, prefix in arrays.items()}
        self._device = device
        self._frame_id = frame_id
        self._rate_hz = float(settings.rate_hz)
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
        topics = [(topics.signal, topics.wrench) for topics in self._topics.values()]
        named = [name for names in topics for name in (names if self._settings.wrench else names[:1])]
        return dict.fromkeys(named, self._rate_hz)

    @property
    def limits(self) -> Limits:
        """None is published."""
        return {}

    def restart(self) -> None:
        """Go on after an interruption, with the index that the host's clock will tell."""
        self._parser.restart()
        self._interrupt()

    def feed(self, data: bytes, arrival_ns: int) -> Mapping[str, Sequence[TactileSignal]]:
        """Return the batches in `data`; none in the first 0.1 s of a stream.

        Raises
        ------
        DeviceError
            If the hub does not carry an array that is published.
        """
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
        for array, names in self._topics.items():
            pillars = found.pillars[array][rows]
            topics.setdefault(names.signal, []).append(self._pillars(stamp_ns, index, pillars))
            if self._settings.wrench and array < len(found.wholes):
                whole = self._whole(stamp_ns, index, found.wholes[array][rows])
                topics.setdefault(names.wrench, []).append(whole)

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
            elif self._last and not self._follows(first):
                self._restarts += 1
                self._interrupt()
            self._last = int(found.counters[rows[-1]]), int(found.times_us[rows[-1]])
            yield rows

    def _follows(self, packet: tuple[int, int]) -> bool:
        """Return whether counter and time of a packet go on from those of the last one."""
        counter, time_us = self._last or packet
        return packet[0] > counter and 0 < packet[1] - time_us <= LONGEST_STEP_US

    def _interrupt(self) -> None:
        self._numbering.interrupt()
        self._clock.restart()
        self._last = None

    def _pillars(self, stamp_ns: int, index: int, values: Values) -> TactileSignal:
        count = values.shape[1] // len(tables.PILLAR_QUANTITIES)
        return TactileSignal(
            stamp_ns=stamp_ns,
            sensor=tables.PILLARS_SENSOR,
            channels=tables.pillar_channels(count),
            units=tuple(tables.PILLAR_QUANTITIES.values()) * count,
            sampling_rate_hz=self._rate_hz,
            first_sample=index,
            samples=values,
            frame_id=self._frame_id,
        )

    def _whole(self, stamp_ns: int, index: int, values: Values) -> TactileSignal:
        return TactileSignal(
            stamp_ns=stamp_ns,
            sensor=tables.WHOLE_SENSOR,
            channels=tuple(tables.WHOLE_QUANTITIES),
            units=tuple(tables.WHOLE_QUANTITIES.values()),
            sampling_rate_hz=self._rate_hz,
            first_sample=index,
            samples=values,
            frame_id=self._frame_id,
        )


class PapillArray(SerialSensor):
    """Read one array of a hub, or both. See `texture_core.protocols.Sensor`.

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
        if not arrays and params.finger >= tables.SENSORS:
            raise InvalidParameter(f"parameter 'finger' is {params.finger}; a hub has the places 0 and 1")
        settings = load_settings(PapillArraySettings, params.config)
        prefixes = {array: f'finger{array}/' for array in arrays} or {params.finger: ''}
        decoder = PapillArrayDecoder(settings, prefixes, params.device, params.frame_id)
        self._rate_command = tables.COMMANDS_OF_RATE[settings.rate_hz]
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
        self.send(tables.BIAS_COMMAND)
        return tables.BIAS_S
