# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A sensor on its emulated device, whose samples encode index, channel and finger, so that every fault is detected."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from texture_core.errors import DeviceError
from texture_core.types import NANOSECONDS, AnyArray, Sensor, TactileSignal
from texture_drivers.catalogue import SENSORS
from texture_drivers.sensor import SensorParams
from texture_simulation.devices.fingers import (
    EmulatedAnySkin,
    EmulatedBioTac,
    EmulatedDaq,
    EmulatedDevice,
    EmulatedPvdf,
    EmulatedTsf85,
)

DAQ = '{channels: [' + ', '.join(f'{{name: c{i}, unit: count}}' for i in range(8)) + ']}'
Feed = Callable[[Any, int, int], None]
MakeDevice = Callable[[Path, np.random.Generator], EmulatedDevice]


class Line(NamedTuple):
    """What comes on the line of a device, and what its driver reports; nothing has a default."""

    silent: str  # from the report of a device that opens and sends nothing
    wrong: str  # from that of one with other firmware
    numbered: bool  # packets have a number or a time
    checked: bool  # frames have a checksum
    restarts: bool  # after a brown-out the device sends again without a command
    fault_rate: float  # of each kind of byte fault; more on a slow device: as many in the time of the test


@dataclass(frozen=True)
class RigCase:
    """A device, how it is fed, and how what arrives is to be read.

    Channel c of sample i of `topic` holds i, c and a constant, modulo `modulus`; see `counting`.
    """

    device: MakeDevice
    topic: str  # The fast one
    # ticks_per_s, samples_per_tick: how often the device is fed, and how many samples that makes
    ticks_per_s: float
    samples_per_tick: int
    feed: Feed  # Called with the device, the first tick and the number of ticks
    # Unit of each topic that must come: one for all of its channels, or one for each
    units: Mapping[str, str | tuple[str, ...]]
    modulus: int
    line: Line | None  # None if the sensor differs from a listed one by a table alone
    config: str = ''  # Settings of the sensor, so that it publishes whole counts (gain 1)
    resting: str = ''  # Topic that the device is not fed with, if there is one

    @property
    def finger(self) -> int:
        """Finger that `topic` is of: 1 for 'finger1/signal', 0 without a prefix."""
        return int(self.topic.removeprefix('finger').split('/')[0]) if '/' in self.topic else 0

    @property
    def rate_hz(self) -> float:
        """Samples a second on `topic`."""
        return self.ticks_per_s * self.samples_per_tick


def counting(first: int, samples: int, modulus: int, channels: int, fingers: int) -> AnyArray:
    """Return samples, (samples, channels, fingers): a channel holds 1 more than the one before, a finger a quarter."""
    numbers = np.arange(first, first + samples)[:, None, None] + np.arange(channels)[:, None]
    return (numbers + np.arange(fingers) * modulus // 4) % modulus


def feed_tsf85(taxels: int, fingers: int) -> Feed:
    """Return what feeds a TSF-85 with images of so many taxels."""

    def feed(device: Any, first: int, ticks: int) -> None:
        image = counting(first, 1, 1000, taxels, fingers)
        device.measure({'signal': counting(first, ticks, 1000, 1, fingers), 'signal_static': image})

    return feed


def feed_biotac(slots: int, fingers: int) -> Feed:
    """Return what feeds a board with frames of this many slots."""

    def feed(device: Any, first: int, ticks: int) -> None:
        pac = counting(first * slots // 2, ticks * slots // 2, 4096, 1, fingers)
        device.measure({'signal': pac, 'signal_static': counting(first, ticks, 4096, slots // 2, fingers)})

    return feed


def feed_signal(channels: int) -> Feed:
    """Return what feeds a device that has one stream of this many channels."""
    return lambda device, first, ticks: device.measure({'signal': counting(first, ticks, 30_000, channels, 1)})


def feed_pvdf(device: Any, first: int, ticks: int) -> None:
    """Feed the film, and the force with every 64th tick."""
    film = counting(first, ticks, 30_000 * 64, 1, 1)
    device.measure({'signal': film % 30_000, 'signal_static': film[film[:, 0, 0] % 64 == 0] // 64})


def tsf85(line: Line | None, prefix: str = '', taxels: int = 28, fingers: int = 1) -> RigCase:
    """Return how a TSF-85 is fed."""
    imu = ('m/s²',) * 3 + ('rad/s',) * 3
    units: dict[str, str | tuple[str, ...]] = {
        f'{prefix}signal': 'count',
        f'{prefix}signal_static': 'count',
        f'{prefix}signal_imu': imu,
    }
    feed = feed_tsf85(taxels, fingers)
    return RigCase(
        EmulatedTsf85, f'{prefix}signal', 1000.0, 1, feed, units, 1000, line, resting=f'{prefix}signal_imu'
    )  # fmt: skip


def biotac(
    line: Line | None, device: MakeDevice = EmulatedBioTac, prefix: str = '', slots: int = 44, fingers: int = 1
) -> RigCase:
    """Return how a BioTac is fed."""
    units: dict[str, str | tuple[str, ...]] = {f'{prefix}signal': 'count', f'{prefix}signal_static': 'count'}
    return RigCase(device, f'{prefix}signal', 4400 / slots, slots // 2, feed_biotac(slots, fingers), units, 4096, line)


VERSION_99 = 'sends frames of version 99, and 1 is known'
FRAMES = Line('sends nothing;', VERSION_99, numbered=True, checked=True, restarts=True, fault_rate=4e-4)
CASES: Mapping[str, RigCase] = {
    'tsf85': tsf85(
        Line('sends nothing, started', 'no known packet', numbered=True, checked=False, restarts=False, fault_rate=4e-4)
    ),
    'tsf85_pair': tsf85(None, 'finger1/', fingers=2),
    'tsf85_3x4': tsf85(None, taxels=12),
    'biotac': biotac(FRAMES._replace(silent='sends no complete frames')),
    'biotac_sp': biotac(None, slots=54),
    'biotac_hand': biotac(None, partial(EmulatedBioTac, serials=('BT-0', 'BT-1', 'BT-2')), 'finger2/', fingers=3),
    'daq': RigCase(EmulatedDaq, 'signal', 2500.0, 1, feed_signal(8), {'signal': 'count'}, 30_000, FRAMES, DAQ),
    'pvdf': RigCase(
        EmulatedPvdf, 'signal', 4096.0, 1, feed_pvdf, {'signal': 'pC', 'signal_static': 'N'}, 30_000, FRAMES,
        config='{film_gain_pc: 1.0, force_gain_n: 1.0}',
    ),
    'anyskin': RigCase(
        EmulatedAnySkin, 'signal', 250.0, 1, feed_signal(15), {'signal': 'µT'}, 30_000,
        Line('sends nothing;', 'no valid frame', numbered=False, checked=False, restarts=True, fault_rate=2e-3),
        config='{rate_hz: 250.0}',
    ),
}  # fmt: skip

DEADLINE_S = 30.0
STEP_S = 0.003
MOSTLY = 0.9  # more than byte faults leave
MAX_AT_ONCE_S = 0.04  # after a stall of the machine the line's buffer must not run over


class Rig:
    """A device, its driver, and the time that passes for the device; usable as a context manager."""

    def __init__(self, name: str, link: Path, pace: float = 1.0, case: RigCase | None = None) -> None:
        self.case = case or CASES[name]
        self.link = link
        self.device = self.case.device(link, np.random.default_rng(0))
        self.device.plug()
        self.start_ns = time.time_ns()
        self._name = name
        self._pace = pace
        self.sensor: Sensor = self.another()
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='rig', daemon=True)
        self._thread.start()

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def another(self) -> Sensor:
        """Return another driver for the same device."""
        return SENSORS[self._name](SensorParams(device=str(self.link), config=self.case.config), time.time_ns)

    def close(self) -> None:
        """Close the sensor and unplug the device."""
        self.sensor.close()
        self._stop.set()
        self._thread.join()
        self.device.unplug()

    def _run(self) -> None:
        done, most = 0, max(1, round(MAX_AT_ONCE_S * self.case.ticks_per_s))
        while not self._stop.wait(STEP_S):
            due = int((time.time_ns() - self.start_ns) / NANOSECONDS * self.case.ticks_per_s * self._pace)
            ticks = min(due - done, most)
            if ticks > 0:
                with self._lock:
                    self.case.feed(self.device, done, ticks)
                done += ticks

    def set(self, **switches: Any) -> None:
        """Throw switches of the device."""
        with self._lock:
            for name, value in switches.items():
                setattr(self.device, name, value)

    def run_locked(self, action: Callable[[], None]) -> None:
        """Do something to the device between two of its steps."""
        with self._lock:
            action()

    def read_s(self, seconds: float) -> dict[str, list[TactileSignal]]:
        """Return, by topic, what comes until this many seconds of samples have; a lost device is opened again."""
        topics: dict[str, list[TactileSignal]] = {}
        deadline_s = time.monotonic() + DEADLINE_S
        while sum(len(batch.samples) for batch in topics.get(self.case.topic, [])) < seconds * self.case.rate_hz:
            if time.monotonic() > deadline_s:
                raise TimeoutError(f'{self._name}: the samples did not come')
            for topic, batches in self._read().items():
                topics.setdefault(topic, []).extend(batches)
        return topics

    def signal_s(self, seconds: float) -> list[TactileSignal]:
        """Return the batches of the first topic alone."""
        return self.read_s(seconds)[self.case.topic]

    def _read(self) -> Mapping[str, Sequence[TactileSignal]]:
        try:
            return self.sensor.read()
        except DeviceError:
            self.sensor.close()
        with contextlib.suppress(DeviceError):
            self.sensor.open()
        return {}

    def fault(self) -> str:
        """Return the sentence with which reading ends."""
        deadline_s = time.monotonic() + DEADLINE_S
        try:
            while time.monotonic() < deadline_s:
                self.sensor.read()
        except DeviceError as error:
            return str(error)
        raise TimeoutError(f'{self._name}: no error came')

    def offsets(self, batches: Sequence[TactileSignal]) -> AnyArray:
        """Return each finite value without its index and channel, (n,): constant if each is in its place."""
        values = np.concatenate([batch.samples for batch in batches])
        indices = np.concatenate([np.arange(batch.first_sample, batch.next_sample) for batch in batches])
        channels = np.arange(values.shape[1])
        offsets: AnyArray = (values - indices[:, None] - channels) % self.case.modulus
        finite: AnyArray = offsets[np.isfinite(values)]
        assert np.mean(finite == finite.round()) > MOSTLY, (
            f"'{self._name}' publishes {values[0, 0]}, which is no count; give RigCase.config a setting for gain 1"
        )
        return finite

    def in_order(self, batch: TactileSignal) -> bool:
        """Return whether each channel holds 1 more than the one before; also of topics other than the fast one."""
        steps = np.diff(batch.samples, axis=1) % self.case.modulus
        return bool((steps == 1).all())

    def lateness_s(self, batch: TactileSignal) -> float:
        """Return by how much a stamp is later than its sample was taken."""
        samples = (batch.stamp_ns - self.start_ns) / NANOSECONDS * self.case.rate_hz
        turn = self.case.modulus
        late = samples + self.case.finger * turn // 4 - float(batch.samples[0, 0])
        return ((late + turn / 2) % turn - turn / 2) / self.case.rate_hz
