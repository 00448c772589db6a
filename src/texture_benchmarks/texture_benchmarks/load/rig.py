"""A sensor on its emulated device, whose samples encode their own index, so that every fault is detected."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.load.rig_cases import CASES, RigCase
from texture_core.arrays import AnyArray
from texture_core.errors import DeviceError
from texture_core.protocols import Sensor
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_drivers.catalogue import SENSORS
from texture_drivers.params import SensorParams
from texture_simulation.devices.catalogue import DEVICES
from texture_simulation.devices.daq import EmulatedDaq
from texture_simulation.devices.device import EmulatedDevice

DEADLINE_S = 30.0
STEP_S = 0.003
MAX_TICKS_PER_S = 5000.0  # beyond this rate as many
MAX_AT_ONCE_S = 0.04  # after a stall of the machine the line's buffer must not run over


def fast_daq(link: Path, factor: float) -> Rig:
    """Return a DAQ finger of another rate."""
    case = CASES['daq']
    rate_hz = factor * case.ticks_per_s
    fast = replace(case, ticks_per_s=rate_hz, config=case.config.replace('{', f'{{rate_hz: {rate_hz}, ', 1))
    device = EmulatedDaq(link, np.random.default_rng(0), rate_hz=rate_hz)
    return Rig('daq', link, case=fast, device=device)


class Rig:
    """A device, its driver, and the time that passes for the device; usable as a context manager.

    Parameters
    ----------
    name
        Of the sensor.
    link
        Path for the device.
    pace
        How much faster than the host's the device's clock goes.
    case, device
        Another way to feed and another device than those of the tables.
    """

    def __init__(
        self,
        name: str,
        link: Path,
        pace: float = 1.0,
        case: RigCase | None = None,
        device: EmulatedDevice | None = None,
    ) -> None:
        self.case = case or CASES[name]
        self.link = link
        self.device = device or DEVICES[name](link, np.random.default_rng(0))
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
        done, most = 0, max(1, round(MAX_AT_ONCE_S * min(self.case.ticks_per_s, MAX_TICKS_PER_S)))
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
        """Return, by topic, what comes until so many seconds of samples have; a device that is gone is opened again.

        Raises
        ------
        TimeoutError
            If they do not come in time.
        """
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
        """Return the sentence with which reading ends.

        Raises
        ------
        TimeoutError
            If reading goes on.
        """
        deadline_s = time.monotonic() + DEADLINE_S
        try:
            while time.monotonic() < deadline_s:
                self.sensor.read()
        except DeviceError as error:
            return str(error)
        raise TimeoutError(f'{self._name}: no error came')

    def offsets(self, batches: Sequence[TactileSignal]) -> AnyArray:
        """Return what each finite sample holds less what its index asks for: constant if each is in its place.

        Parameters
        ----------
        batches
            Batches of one topic.

        Returns
        -------
        (n,)
            In counts.
        """
        values = np.concatenate([batch.samples[:, 0] for batch in batches])
        indices = np.concatenate([np.arange(batch.first_sample, batch.next_sample) for batch in batches])
        offsets: AnyArray = (values - self.case.slope * indices) % self.case.modulus
        finite: AnyArray = offsets[np.isfinite(values)]
        return finite

    def lateness_s(self, batch: TactileSignal) -> float:
        """Return by how much a stamp is later than its sample was taken."""
        samples = (batch.stamp_ns - self.start_ns) / NANOSECONDS * self.case.rate_hz
        turn = self.case.modulus / self.case.slope
        late = samples - float(batch.samples[0, 0]) / self.case.slope
        return ((late + turn / 2) % turn - turn / 2) / self.case.rate_hz
