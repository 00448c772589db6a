"""The driver on an emulated bridge: what it delivers must be what was sampled, at the time it was sampled."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import DeviceError
from texture_core.signal import TactileSignal, lost_samples
from texture_drivers.biotac.sensor import BioTac
from texture_drivers.biotac.tables import LAYOUTS
from texture_drivers.params import SensorParams
from texture_simulation.devices.biotac import BoardFaults, EmulatedBioTac
from texture_simulation.devices.faults import ByteFaults, FrameFaults

FRAME_S = 0.01
DEADLINE_S = 30.0


class Rig:
    """An emulated board whose time passes: slot i of frame n holds (44 n + i) mod 4096 in every finger."""

    def __init__(self, link: Path, serials: tuple[str, ...] = ('BT-0',), pace: float = 1.0) -> None:
        self.device = EmulatedBioTac(link, np.random.default_rng(0), serials)
        self.device.plug()
        self.lock = threading.Lock()
        self.start_ns = time.time_ns()
        self._fingers = len(serials)
        self._pace = pace
        self._frames = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.device.unplug()

    def _run(self) -> None:
        while not self._stop.wait(0.002):
            due = int((time.time_ns() - self.start_ns) / 1e9 / FRAME_S * self._pace) - self._frames
            if due > 0:
                slots = np.arange(self._frames * 44, (self._frames + due) * 44) % 4096
                values = np.repeat(slots[:, None], self._fingers, axis=1).astype(np.uint16)
                self._frames += due
                with self.lock:
                    self.device.advance(values.reshape(due, 44, self._fingers))


@pytest.fixture
def make_rig(tmp_path: Path) -> Iterator[Callable[..., Rig]]:
    rigs: list[Rig] = []

    def make(**options: object) -> Rig:
        rigs.append(Rig(tmp_path / 'biotac', **options))
        return rigs[-1]

    yield make
    for rig in rigs:
        rig.close()


@pytest.fixture
def make_sensor(tmp_path: Path) -> Iterator[Callable[..., BioTac]]:
    sensors: list[BioTac] = []

    def make(finger: int = 0, **options: object) -> BioTac:
        sensors.append(BioTac(SensorParams(device=str(tmp_path / 'biotac'), finger=finger), **options))
        sensors[-1].open()
        return sensors[-1]

    yield make
    for sensor in sensors:
        sensor.close()


def collect(sensor: BioTac, samples: int, topic: str = 'signal') -> list[TactileSignal]:
    """Read until so many samples have come, opening the device again whenever it is gone."""
    batches: list[TactileSignal] = []
    deadline_s = time.monotonic() + DEADLINE_S
    while sum(len(batch.samples) for batch in batches) < samples:
        assert time.monotonic() < deadline_s, 'the samples did not come'
        try:
            batches += sensor.read().get(topic, [])
        except DeviceError:
            sensor.close()
            time.sleep(0.01)
            try:
                sensor.open()
            except DeviceError:
                continue
    return batches


def offsets(batches: list[TactileSignal]) -> np.ndarray:
    """Return, for every finite sample, its value less the one that its index asks for: constant if nothing is bogus."""
    values = np.concatenate([batch.samples[:, 0] for batch in batches])
    indices = np.concatenate([np.arange(batch.first_sample, batch.next_sample) for batch in batches])
    return (values - 2 * indices)[np.isfinite(values)] % 4096


def test_what_was_sampled_is_delivered_with_its_time(
    make_rig: Callable[..., Rig], make_sensor: Callable[..., BioTac]
) -> None:
    rig, sensor = make_rig(), make_sensor()
    batches = collect(sensor, 3000)
    assert len(set(offsets(batches))) == 1
    assert lost_samples(batches) == sensor.counts['lost'] == sensor.counts['bogus'] == 0
    last = batches[-1]
    frame = int(last.samples[0, 0]) // 44  # of 93 until the values repeat
    since_s = (last.stamp_ns - rig.start_ns) / 1e9
    whole_turns = round((since_s / FRAME_S - frame) / (4096 / 44))
    true_s = (round((frame * 44 + 4096 * whole_turns) / 44) + 1 / 44) * FRAME_S
    assert since_s == pytest.approx(true_s, abs=0.02)
    assert sensor.details['serial of finger 0'] == 'BT-0'


def test_stamps_follow_the_pace_of_the_device(make_rig: Callable[..., Rig], make_sensor: Callable[..., BioTac]) -> None:
    make_rig(pace=1.002)
    batches = collect(make_sensor(), 8_800)
    stamps_s = np.array([batch.stamp_ns for batch in batches]) / 1e9
    indices = np.array([batch.first_sample for batch in batches])
    assert (np.diff(stamps_s) > 0).all()
    late = indices > indices[-1] - 4400
    assert np.polyfit(indices[late], stamps_s[late], 1)[0] * 2200 * 1.002 == pytest.approx(1, abs=1.5e-3)


@pytest.mark.parametrize(
    'faults', [ByteFaults(drop=1e-4), ByteFaults(insert=1e-4), ByteFaults(flip=3e-4), ByteFaults(1e-4, 1e-4, 1e-4)]
)
def test_bytes_lost_added_or_changed_never_become_samples(
    make_rig: Callable[..., Rig], make_sensor: Callable[..., BioTac], faults: ByteFaults
) -> None:
    rig, sensor = make_rig(), make_sensor()
    collect(sensor, 22)
    with rig.lock:
        rig.device.faults = faults
    batches = collect(sensor, 4000)
    assert len(set(offsets(batches))) == 1
    assert sensor.counts['bogus'] > 0
    assert lost_samples(batches) > 0


def test_words_damaged_on_the_board_are_nan_and_no_neighbour_moves(
    make_rig: Callable[..., Rig], make_sensor: Callable[..., BioTac]
) -> None:
    rig, sensor = make_rig(serials=('BT-0', 'BT-1', '')), make_sensor(finger=1)
    with rig.lock:
        rig.device.board_faults = BoardFaults(flip=0.01)
    batches = collect(sensor, 3000)
    values = np.concatenate([batch.samples[:, 0] for batch in batches])
    assert 0.005 < np.isnan(values).mean() < 0.05  # two bytes a word
    assert len(set(offsets(batches))) == 1
    assert lost_samples(batches) == 0
    assert sensor.counts['damaged_words'] > 0


def test_frames_left_out_or_sent_twice_are_counted(
    make_rig: Callable[..., Rig], make_sensor: Callable[..., BioTac]
) -> None:
    rig, sensor = make_rig(), make_sensor()
    collect(sensor, 22)
    with rig.lock:
        rig.device.frame_faults = FrameFaults(skip=0.1, duplicate=0.1)
    batches = collect(sensor, 4000)
    assert len(set(offsets(batches))) == 1
    assert lost_samples(batches) > 0
    assert sensor.counts['repeated'] > 0


def test_a_stalled_line_delays_and_loses_nothing(
    make_rig: Callable[..., Rig], make_sensor: Callable[..., BioTac]
) -> None:
    rig, sensor = make_rig(), make_sensor()
    batches = collect(sensor, 2200)
    with rig.lock:
        rig.device.stalled = True
    for _ in range(10):
        batches += sensor.read()['signal']
    with rig.lock:
        rig.device.stalled = False
    batches += collect(sensor, 2200)
    assert lost_samples(batches) == 0
    assert len(set(offsets(batches))) == 1
    stamps = np.array([batch.stamp_ns - batch.first_sample / 2200 * 1e9 for batch in batches])
    assert np.ptp(stamps) < 20e6  # the delay is not in the times


def test_replugging_goes_on_at_the_index_of_the_time(
    make_rig: Callable[..., Rig], make_sensor: Callable[..., BioTac]
) -> None:
    rig, sensor = make_rig(), make_sensor()
    before = collect(sensor, 1100)
    with rig.lock:
        rig.device.unplug()
    unplugged_s = time.monotonic()
    with pytest.raises(DeviceError):
        while time.monotonic() < unplugged_s + DEADLINE_S:
            sensor.read()
    sensor.close()
    with rig.lock:
        rig.device.plug()
    after = collect(sensor, 1100)
    assert sensor.counts['reopened'] >= 1
    lost = lost_samples([before[-1], after[0]])
    assert lost == sensor.counts['lost'] > 0
    elapsed_s = (after[-1].stamp_ns - before[0].stamp_ns) / 1e9
    assert (after[-1].first_sample - before[0].first_sample) / 2200 == pytest.approx(elapsed_s, abs=0.03)
    assert len(set(offsets(before))) == len(set(offsets(after))) == 1


def test_a_reset_of_the_device_is_an_interruption(
    make_rig: Callable[..., Rig], make_sensor: Callable[..., BioTac]
) -> None:
    rig, sensor = make_rig(), make_sensor()
    before = collect(sensor, 2200)
    with rig.lock:
        rig.device.reset()
    after = collect(sensor, 1100)
    assert sensor.counts['restarts'] == 1
    assert len(set(offsets(after[1:]))) == 1
    elapsed_s = (after[-1].stamp_ns - before[0].stamp_ns) / 1e9
    assert (after[-1].first_sample - before[0].first_sample) / 2200 == pytest.approx(elapsed_s, abs=0.03)


def test_a_mute_bridge_is_an_error_with_advice(
    make_rig: Callable[..., Rig], make_sensor: Callable[..., BioTac]
) -> None:
    rig = make_rig()
    rig.device.mute = True
    sensor = make_sensor()
    deadline_s = time.monotonic() + DEADLINE_S
    with pytest.raises(DeviceError, match='sends no whole frames'):
        while time.monotonic() < deadline_s:
            sensor.read()


def test_the_wrong_kind_of_biotac_is_told(make_rig: Callable[..., Rig], make_sensor: Callable[..., BioTac]) -> None:
    make_rig()
    with pytest.raises(DeviceError, match='44 slots'):
        collect_one = make_sensor(layout=LAYOUTS['biotac_sp'])
        deadline_s = time.monotonic() + DEADLINE_S
        while time.monotonic() < deadline_s:
            collect_one.read()


def test_all_fingers_of_a_board_have_topics_of_their_own(
    make_rig: Callable[..., Rig], make_sensor: Callable[..., BioTac]
) -> None:
    make_rig(serials=('BT-0', 'BT-1', ''))
    sensor = make_sensor(fingers=(0, 1, 2))
    assert len(collect(sensor, 220, 'finger1/signal')) > 0
    topics = sensor.read()
    assert topics['finger2/signal'] == []
    assert set(topics) == {f'finger{n}/{topic}' for n in range(3) for topic in ('signal', 'signal_static')}
