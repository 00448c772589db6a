"""The drivers on emulated devices: what they deliver must be what was sampled, at the time it was sampled."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from texture_core.errors import DeviceError
from texture_core.signal import TactileSignal, lost_samples
from texture_drivers.daq.sensor import daq
from texture_drivers.params import SensorParams
from texture_drivers.pvdf.sensor import Pvdf
from texture_simulation.devices.daq import EmulatedDaq
from texture_simulation.devices.faults import ByteFaults, FrameFaults
from texture_simulation.devices.pvdf import EmulatedPvdf

SECOND = 1_000_000_000
DEADLINE_S = 30.0
MOST_AT_ONCE = 100  # samples: after a stall of the machine the line's buffer must not run over
COUNTING = '{channels: [' + ', '.join(f'{{name: c{i}, unit: count}}' for i in range(8)) + ']}'


class Rig:
    """An emulated DAQ whose time passes: its first channel counts samples modulo 30 000, the last one backwards."""

    def __init__(self, link: Path, start_us: int = 0, pace: float = 1.0) -> None:
        self.device = EmulatedDaq(link, np.random.default_rng(0), start_us)
        self.device.plug()
        self.lock = threading.Lock()
        self.start_ns = time.time_ns()
        self._pace = pace
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.device.unplug()

    def _run(self) -> None:
        done = 0
        while not self._stop.wait(0.003):
            due = int((time.time_ns() - self.start_ns) / SECOND * 2500 * self._pace)
            due = min(due, done + MOST_AT_ONCE)
            number = np.arange(done, due) % 30_000
            done = due
            with self.lock:
                self.device.feel(np.outer(number, [1, 0, 0, 0, 0, 0, 0, -1]).astype(np.int16))


@pytest.fixture
def make_rig(tmp_path: Path) -> Iterator[Callable[..., Rig]]:
    rigs: list[Rig] = []

    def make(**options: Any) -> Rig:
        rigs.append(Rig(tmp_path / 'daq', **options))
        return rigs[-1]

    yield make
    for rig in rigs:
        rig.close()


@pytest.fixture
def sensor(tmp_path: Path) -> Iterator[Any]:
    made = daq(SensorParams(device=str(tmp_path / 'daq'), config=COUNTING))
    yield made
    made.close()


def collect(sensor: Any, samples: int, topic: str = 'signal') -> list[TactileSignal]:
    """Read until so many samples have come, opening the device again whenever it is gone."""
    batches: list[TactileSignal] = []
    deadline_s = time.monotonic() + DEADLINE_S
    while sum(len(batch.samples) for batch in batches) < samples:
        assert time.monotonic() < deadline_s, 'the samples did not come'
        batches += read_or_open(sensor).get(topic, [])
    return batches


def read_or_open(sensor: Any) -> Mapping[str, Sequence[TactileSignal]]:
    try:
        return sensor.read()
    except DeviceError:
        sensor.close()
    with contextlib.suppress(DeviceError):
        sensor.open()
    return {}


def offsets(batches: list[TactileSignal]) -> np.ndarray:
    """Return what each sample holds less what its index asks for: constant if every one is in its place."""
    values = np.concatenate([batch.samples[:, 0] for batch in batches])
    indices = np.concatenate([np.arange(batch.first_sample, batch.next_sample) for batch in batches])
    return (values - indices) % 30_000


def test_nothing_is_lost_and_everything_is_in_its_place(make_rig, sensor):
    make_rig()
    sensor.open()
    batches = collect(sensor, 2500)
    assert len(set(offsets(batches))) == 1
    assert lost_samples(batches) == sensor.counts['lost'] == sensor.counts['bogus'] == 0
    np.testing.assert_array_equal(batches[-1].samples[:, 7], -batches[-1].samples[:, 0])


def test_stamps_are_the_times_of_sampling(make_rig, sensor):
    rig = make_rig()
    sensor.open()
    last = collect(sensor, 2500)[-1]
    taken_ns = rig.start_ns + round(last.samples[0, 0] / 2500 * SECOND)
    assert abs(last.stamp_ns - taken_ns) < 20e6  # this machine may be busy


def test_sequence_and_clock_wrap_without_a_trace(make_rig, sensor):
    rig = make_rig(start_us=2**32 - 1_000_000)
    rig.device._frames['daq'] = 65_536 - 200
    sensor.open()
    batches = collect(sensor, 2500)
    assert len(set(offsets(batches))) == 1
    assert sensor.counts['lost'] == sensor.counts['device restarts'] == 0


@pytest.mark.parametrize(
    'faults', [ByteFaults(drop=1e-3), ByteFaults(flip=1e-3), ByteFaults(insert=1e-3)], ids=['drop', 'flip', 'insert']
)
def test_damaged_bytes_cost_frames_and_never_give_a_false_sample(make_rig, sensor, faults):
    rig = make_rig()
    sensor.open()
    collect(sensor, 100)
    with rig.lock:
        rig.device.faults = faults
    batches = collect(sensor, 2500)
    assert len(set(offsets(batches))) == 1
    assert lost_samples(batches) > 0
    assert lost_samples(batches) % 10 == 0
    assert sensor.counts['bogus'] > 0


def test_frames_that_never_come_and_frames_that_come_twice_are_counted(make_rig, sensor):
    rig = make_rig()
    sensor.open()
    collect(sensor, 100)
    with rig.lock:
        rig.device.frame_faults = FrameFaults(skip=0.05, duplicate=0.05)
    batches = collect(sensor, 2500)
    assert len(set(offsets(batches))) == 1
    assert lost_samples(batches) > 0
    assert sensor.counts['repeated frames'] > 0
    assert sensor.counts['bogus'] == sensor.counts['left out by the device'] == 0


def test_a_stall_of_the_device_loses_nothing_and_moves_no_stamp(make_rig, sensor):
    rig = make_rig()
    sensor.open()
    batches = collect(sensor, 2500)
    with rig.lock:
        rig.device.stalled = True
    deadline_s = time.monotonic() + 0.2  # 9 kB fit the kernel's buffer
    while time.monotonic() < deadline_s:
        batches += sensor.read().get('signal', [])
    with rig.lock:
        rig.device.stalled = False
    batches += collect(sensor, 2500)
    assert lost_samples(batches) == 0
    steps_ns = np.diff([batch.stamp_ns for batch in batches])
    lengths_ns = np.array([len(batch.samples) for batch in batches[:-1]]) / 2500 * SECOND
    np.testing.assert_allclose(steps_ns, lengths_ns, rtol=0.03)


def test_replugging_and_a_brown_out_are_survived_and_the_gap_is_told(make_rig, sensor):
    rig = make_rig()
    sensor.open()
    batches = collect(sensor, 1000)
    with rig.lock:
        rig.device.unplug()
    time.sleep(0.3)
    with rig.lock:
        rig.device.plug()
    batches += collect(sensor, 1000)
    with rig.lock:
        rig.device.reset()
    batches += collect(sensor, 1000)
    counts = sensor.counts
    assert (counts['reopened'], counts['device restarts']) == (1, 1)
    assert lost_samples(batches) == counts['lost'] >= 0.3 * 2500
    # Index and stamp tell the same gap.
    first, last = batches[0], batches[-1]
    elapsed = (last.stamp_ns - first.stamp_ns) / SECOND * 2500
    assert last.first_sample - first.first_sample == pytest.approx(elapsed, abs=0.05 * 2500)


def test_a_silent_device_and_a_babbling_one_are_told_apart(make_rig, sensor):
    rig = make_rig()
    rig.device.mute = True
    sensor.open()
    with pytest.raises(DeviceError, match='sends nothing'):
        collect_once(sensor)
    with rig.lock:
        rig.device.mute, rig.device.faults = False, ByteFaults(flip=0.2)
    sensor.open()
    with pytest.raises(DeviceError, match=r'no valid frame.*baud'):
        collect_once(sensor)


def collect_once(sensor: Any) -> None:
    deadline_s = time.monotonic() + DEADLINE_S
    while time.monotonic() < deadline_s:
        sensor.read()


def test_a_device_whose_clock_drifts_is_followed(make_rig, sensor):
    make_rig(pace=1.004)
    sensor.open()
    collect(sensor, 8000)
    assert sensor._line.clock.drift == pytest.approx(-4e-3, abs=1e-3)


def test_settings_that_name_other_channels_are_refused_in_one_sentence(make_rig, tmp_path):
    make_rig()
    wrong = daq(SensorParams(device=str(tmp_path / 'daq'), config='{channels: [{name: a}, {name: b}]}'))
    wrong.open()
    with pytest.raises(DeviceError, match='sends 8 channels, and 2 are named'):
        collect_once(wrong)
    wrong.close()


@pytest.fixture
def pvdf_rig(tmp_path: Path) -> Iterator[Path]:
    device = EmulatedPvdf(tmp_path / 'pvdf', np.random.default_rng(0))
    device.plug()
    stop = threading.Event()

    def run() -> None:
        start_s, film, force = time.monotonic(), 0, 0
        while not stop.wait(0.005):
            due_s = time.monotonic() - start_s
            films, forces = np.arange(film, int(4096 * due_s)), np.arange(force, int(64 * due_s))
            film, force = film + len(films), force + len(forces)
            device.feel(
                (1000 * np.sin(2 * np.pi * 50 / 4096 * films)).astype(np.int16), (forces % 3000).astype(np.int16)
            )

    thread = threading.Thread(target=run)
    thread.start()
    yield tmp_path / 'pvdf'
    stop.set()
    thread.join()
    device.unplug()


def test_film_and_force_come_as_two_streams_in_their_units(pvdf_rig):
    sensor = Pvdf(SensorParams(device=str(pvdf_rig), frame_id='tip'))
    sensor.open()
    film, force = [], []
    deadline_s = time.monotonic() + DEADLINE_S
    while len(force) < 64:
        assert time.monotonic() < deadline_s
        batches = sensor.read()
        film += batches.get('signal', [])
        force += batches.get('signal_static', [])
    sensor.close()
    assert lost_samples(film) == lost_samples(force) == 0
    assert (film[0].sensor, film[0].unit, film[0].sampling_rate_hz) == ('pvdf/film', 'pC', 4096.0)
    assert (force[0].sensor, force[0].unit, force[0].sampling_rate_hz) == ('pvdf/force', 'N', 64.0)
    charge = np.concatenate([batch.samples for batch in film])
    assert charge.max() == pytest.approx(2.0, rel=0.01)  # 1000 counts of 0.002 pC
    assert np.diff(np.concatenate([batch.samples for batch in force]), axis=0) == pytest.approx(0.005, abs=1e-6)


def test_the_force_on_the_film_is_restored_if_wanted(pvdf_rig):
    sensor = Pvdf(SensorParams(device=str(pvdf_rig), config='{restore_from_hz: 0.5}'))
    sensor.open()
    batches = collect(sensor, 8192)
    sensor.close()
    assert batches[-1].unit == 'N'
    late = np.concatenate([batch.samples for batch in batches])[4096:]
    assert np.ptp(late) / 2 == pytest.approx(2.0 / 21.0, rel=0.05)  # far above the corner nothing leaks
