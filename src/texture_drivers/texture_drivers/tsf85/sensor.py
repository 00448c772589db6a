"""The TSF-85 fingertip as a sensor of the suite."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from texture_core.errors import DeviceError
from texture_core.signal import TactileSignal
from texture_drivers.clock import StreamClock
from texture_drivers.counting import SampleCounter
from texture_drivers.params import SensorParams
from texture_drivers.serial_port import SerialPort
from texture_drivers.tsf85 import tables
from texture_drivers.tsf85.protocol import Packet, PacketParser, start_command, stop_command

SILENCE_S = 0.5  # an open port may stay silent after an unclean end; stop and start wake the device
REVIVALS = 3  # so many times, as the vendor does, before the port is given up
IMAGE_HOLD_S = 0.25  # an image older than this is no measurement of now


class Set(NamedTuple):
    """One millisecond of one finger: the dynamic value, and the taxel image if a new one came with it."""

    stamp_ms: int | None
    dynamic: int
    image: tuple[int, ...] | None


class Tsf85:
    """Read one finger of a TSF-85: 'signal' at 1 kHz, 'signal_static' (28 taxels, 7 rows of 4) at a constant rate.

    The device's own stamps number the samples, so losses are known exactly; over an interruption the host's clock
    does. Taxel images come irregularly (or, from old firmware, repeated each millisecond): the newest one is published
    at each tick of `static_rate_hz`. See `texture_core.protocols.Sensor`.
    """

    def __init__(self, params: SensorParams, now_ns: Callable[[], int] = time.time_ns) -> None:
        self._params = params
        self._now_ns = now_ns
        self._port: SerialPort | None = None
        self._parser = PacketParser()
        self._splitter = SetSplitter(params.finger)
        self._counter = SampleCounter()
        self._clock = StreamClock(tables.RATE_HZ)
        self._cutter = BatchCutter(params, self._clock)
        self._waiting: list[Set] = []
        self._interrupted = False
        self._silent_reads = 0
        self._opened = self._revived = self._revivals = 0

    def open(self) -> None:
        """Open the device and start its stream; DeviceError if it cannot be reached."""
        self.close()
        port = SerialPort(self._params.device)
        port.write(start_command())
        self._port = port
        self._opened += 1
        self._silent_reads = self._revivals = 0
        self._interrupt()

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Wait for the length of one batch and return what arrived."""
        if self._port is None:
            raise DeviceError(f"device '{self._params.device}' is not open; open it before reading")
        time.sleep(self._params.batch_s)
        data = self._port.read()
        arrival_ns = self._now_ns()
        sets = self._splitter.sets(self._parser.feed(data))
        self._watch_silence(self._port, bool(sets))
        return self._place(sets, arrival_ns)

    def close(self) -> None:
        """Stop the stream and close the device."""
        if self._port is None:
            return
        with contextlib.suppress(DeviceError):  # if it is gone there is nothing to stop
            self._port.write(stop_command())
        self._port.close()
        self._port = None

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals: samples published, samples lost, bogus candidates and bytes refused, and what was done about it."""
        return {
            'samples': self._cutter.samples,
            'lost': self._cutter.lost,
            'bogus': self._parser.refused,
            'refused_bytes': self._parser.refused_bytes,
            'damaged_stamps': self._counter.damaged_stamps,
            'reopened': max(0, self._opened - 1),
            'revived': self._revived,
            'clock_steps': self._clock.steps,
        }

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        return {'signal': tables.RATE_HZ, 'signal_static': self._params.static_rate_hz}

    def _watch_silence(self, port: SerialPort, alive: bool) -> None:
        """Wake a device that is open but silent; DeviceError when that does not help."""
        self._silent_reads = 0 if alive else self._silent_reads + 1
        if alive:
            self._revivals = 0
        if self._silent_reads * self._params.batch_s < SILENCE_S:
            return
        if self._revivals == REVIVALS:
            raise DeviceError(
                f"device '{self._params.device}' is open but sends no data of finger {self._params.finger}; "
                'check the finger, or replug the sensor'
            )
        self._silent_reads = 0
        self._revivals += 1
        self._revived += 1
        port.write(stop_command())
        port.write(start_command())
        self._interrupt()

    def _interrupt(self) -> None:
        """Forget what belongs to the stream so far: another one begins."""
        self._interrupted = True
        self._waiting = []

    def _place(self, sets: list[Set], arrival_ns: int) -> Mapping[str, Sequence[TactileSignal]]:
        """Number the samples and return the batches they make."""
        if not sets:
            return {}
        if self._interrupted:
            self._resume(len(sets), arrival_ns)
        waiting = self._waiting + sets
        indices, anew = self._counter.place([item.stamp_ms for item in waiting])
        self._waiting = waiting[len(indices) :]
        if anew:
            self._interrupt()
        if not indices:
            return {}
        self._clock.observe(indices[-1], arrival_ns)
        return self._cutter.cut(indices, waiting[: len(indices)])

    def _resume(self, n_sets: int, arrival_ns: int) -> None:
        """Go on after an interruption at the index that the host's clock tells."""
        self._interrupted = False
        if self._clock.settled:
            self._counter.resume(round(self._clock.index_at(arrival_ns)) - (n_sets - 1))
        else:
            self._counter.resume(self._counter.next_index)
        self._clock.restart()


class SetSplitter:
    """Turn packets into the sets of one finger: a dynamic item is a new set, an image joins the next one."""

    def __init__(self, finger: int) -> None:
        self._finger = finger
        self._image: tuple[int, ...] | None = None

    def sets(self, packets: Sequence[Packet]) -> list[Set]:
        """Return the sets in a row of packets."""
        found: list[Set] = []
        for packet in packets:
            stamp, dynamic = self._numbers(packet)
            for value in dynamic:
                found.append(Set(stamp, value, self._image))
                self._image = None
        return found

    def _numbers(self, packet: Packet) -> tuple[int | None, list[int]]:
        """Return the stamp and the dynamic values of a packet; its image is kept for the next set."""
        stamp, dynamic = None, []
        for kind, finger, values in packet.items:
            if kind == tables.TIMESTAMP:
                stamp = values[0] if stamp is None or finger == self._finger else stamp
            elif finger != self._finger:
                continue
            elif kind == tables.DYNAMIC:
                dynamic.append(values[0])
            elif kind == tables.STATIC:
                self._image = values
        return stamp, dynamic


class BatchCutter:
    """Make batches of numbered sets: a new batch wherever the index jumps, and taxel images at a constant rate."""

    def __init__(self, params: SensorParams, clock: StreamClock) -> None:
        self.samples = 0
        self.lost = 0
        self._params = params
        self._clock = clock
        self._next_index: int | None = None  # none published yet
        self._image: tuple[int, ...] | None = None
        self._image_index = 0
        self._tick = 0
        self._sets_per_tick = tables.RATE_HZ / params.static_rate_hz

    def cut(self, indices: Sequence[int], sets: Sequence[Set]) -> Mapping[str, Sequence[TactileSignal]]:
        """Return the batches by topic; nothing while the clock is not settled."""
        if not self._clock.settled:
            return {}
        dynamic, static = [], []
        numbered = zip(indices, sets, strict=True)
        for _, run in groupby(enumerate(numbered), key=lambda item: item[1][0] - item[0]):
            members = [numbered_set for _, numbered_set in run]
            first = members[0][0]
            if first != self._next_index:
                self._jump(first)
            self._next_index = first + len(members)
            self.samples += len(members)
            dynamic.append(self._dynamic(first, [item.dynamic for _, item in members]))
            static.extend(self._images(members))
        return {'signal': dynamic, 'signal_static': static}

    def _jump(self, first: int) -> None:
        self.lost += 0 if self._next_index is None else first - self._next_index
        self._tick = math.ceil(first / self._sets_per_tick)

    def _images(self, members: Sequence[tuple[int, Set]]) -> list[TactileSignal]:
        images = []
        for index, item in members:
            if item.image is not None:
                self._image, self._image_index = item.image, index
            while self._tick * self._sets_per_tick <= index:
                if self._image is not None and index - self._image_index <= IMAGE_HOLD_S * tables.RATE_HZ:
                    images.append(self._static(self._tick, self._image))
                self._tick += 1
        return images

    def _dynamic(self, first: int, values: Sequence[int]) -> TactileSignal:
        return TactileSignal(
            stamp_ns=self._clock.time_ns(first),
            sensor=tables.DYNAMIC_SENSOR,
            channels=tables.DYNAMIC_CHANNELS,
            unit=tables.UNIT,
            sampling_rate_hz=tables.RATE_HZ,
            first_sample=first,
            samples=np.array(values, dtype=np.float32)[:, None],
            frame_id=self._params.frame_id,
        )

    def _static(self, tick: int, image: Sequence[int]) -> TactileSignal:
        return TactileSignal(
            stamp_ns=self._clock.time_ns(tick * self._sets_per_tick),
            sensor=tables.STATIC_SENSOR,
            channels=tables.STATIC_CHANNELS,
            unit=tables.UNIT,
            sampling_rate_hz=self._params.static_rate_hz,
            first_sample=tick,
            samples=np.array([image], dtype=np.float32),
            frame_id=self._params.frame_id,
        )
