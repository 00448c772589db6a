# SPDX-License-Identifier: Apache-2.0
import os
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import DeviceError, UnknownName
from texture_core.types import FingerState, TactileSignal, lost_samples
from texture_drivers.sensor import SensorParams
from texture_drivers.tsf85 import Tsf85
from texture_simulation.devices.fingers import ByteFaults
from texture_simulation.emulator import Emulator, EmulatorParams

pytestmark = pytest.mark.realtime

DEADLINE_S = 15.0


class Arm:
    """Reports a finger that slides for ever along x, as emulated arms do."""

    def __init__(self, port: int, speed_m_s: float = 0.1, force_n: float = 2.0) -> None:
        self._port, self._speed_m_s, self._force_n = port, speed_m_s, force_n
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        start_ns = time.monotonic_ns()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            while not self._stop.wait(0.01):
                now_ns = time.monotonic_ns()
                x_m = self._speed_m_s * (now_ns - start_ns) / 1e9
                state = FingerState(now_ns, x_m=x_m, vx_m_s=self._speed_m_s, force_n=self._force_n)
                line.sendto(state.to_bytes(), ('127.0.0.1', self._port))

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()


@pytest.fixture
def emulator(tmp_path: Path) -> Iterator[Emulator]:
    params = EmulatorParams(surface='ridge_2mm_deep', sensor_link=str(tmp_path / 'tsf85'), finger_port=0)
    with Emulator(params) as made:
        yield made


@pytest.fixture
def sensor(emulator: Emulator, tmp_path: Path) -> Iterator[Tsf85]:
    made = Tsf85(SensorParams(device=str(tmp_path / 'tsf85')))
    made.open()
    yield made
    made.close()


@pytest.fixture
def arm(emulator: Emulator) -> Iterator[Arm]:
    made = Arm(emulator.finger_port)
    yield made
    made.stop()


def read(sensor: Tsf85, samples: int) -> list[TactileSignal]:
    batches: list[TactileSignal] = []
    deadline = time.monotonic() + DEADLINE_S
    while sum(len(batch.samples) for batch in batches) < samples:
        assert time.monotonic() < deadline
        batches += sensor.read().get('signal', [])
    return batches


def values(batches: list[TactileSignal]) -> np.ndarray:
    return np.concatenate([batch.samples for batch in batches])[:, 0]


def test_the_driver_senses_the_ridges_at_speed_over_pitch(sensor: Tsf85, arm: Arm) -> None:
    read(sensor, 500)
    batches = read(sensor, 2000)
    signal = values(batches)[:2000]
    spectrum = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(len(signal))))
    assert np.fft.rfftfreq(len(signal), 1e-3)[spectrum.argmax()] == pytest.approx(50.0, abs=1.0)
    assert lost_samples(batches) == 0
    assert sensor.counts['bogus'] == 0


def test_nothing_is_measured_while_no_arm_reports(sensor: Tsf85) -> None:
    assert values(read(sensor, 300)).std() < 50


def test_the_sample_can_be_swapped_while_the_finger_slides(emulator: Emulator, sensor: Tsf85, arm: Arm) -> None:
    rough = values(read(sensor, 1000))[-400:].std()
    emulator.set_surface('glass')
    read(sensor, 300)
    assert values(read(sensor, 400)).std() < 0.2 * rough
    with pytest.raises(UnknownName, match="did you mean 'glass'"):
        emulator.set_surface('glas')
    assert emulator.surface == 'glass'


def test_replugging_gives_another_device_behind_the_same_link(
    emulator: Emulator, sensor: Tsf85, tmp_path: Path
) -> None:
    before = read(sensor, 200)[-1]
    emulator.unplug()
    assert not os.path.lexists(tmp_path / 'tsf85')
    with pytest.raises(DeviceError):
        read(sensor, 1000)
    sensor.close()
    emulator.replug()
    sensor.open()
    after = read(sensor, 200)[0]
    assert after.first_sample - before.next_sample == sensor.counts['lost'] > 50
    gap_s = (after.stamp_ns - before.end_ns) / 1e9
    assert (after.first_sample - before.next_sample) / 1000 == pytest.approx(gap_s, abs=0.02)


def test_a_bad_line_costs_samples_and_every_one_is_counted(emulator: Emulator, sensor: Tsf85) -> None:
    read(sensor, 200)
    emulator.device.faults = ByteFaults(drop=1e-3)
    batches = read(sensor, 3000)
    emulator.device.faults = ByteFaults()
    batches += read(sensor, 200)
    share = lost_samples(batches) / (batches[-1].next_sample - batches[0].first_sample)
    # A packet has 47 bytes, so 1 − 0.999^47 = 4.6 % are hit; each may take its forerunner or successor along.
    assert 0.02 < share < 0.1
    assert sensor.counts['bogus'] > 0
    span_s = (batches[-1].stamp_ns - batches[0].stamp_ns) / 1e9
    assert (batches[-1].first_sample - batches[0].first_sample) / 1000 == pytest.approx(span_s, abs=0.01)


def test_a_device_that_is_silent_after_opening_is_woken(emulator: Emulator, tmp_path: Path) -> None:
    emulator.device.ignored_starts = 3  # the one of opening and two more
    sensor = Tsf85(SensorParams(device=str(tmp_path / 'tsf85')))
    sensor.open()
    read(sensor, 300)
    sensor.close()
    assert (sensor.counts['revived'], sensor.counts['reopened']) == (3, 0)


def test_the_second_finger_and_old_firmware_are_understood(tmp_path: Path) -> None:
    params = EmulatorParams(sensor_link=str(tmp_path / 'old'), finger_port=0, finger=1, long_stamps=False)
    sensor = Tsf85(SensorParams(device=params.sensor_link, finger=1))
    with Emulator(params):
        sensor.open()
        batches = read(sensor, 500)
        sensor.close()
    assert lost_samples(batches) == 0
    assert values(batches).std() > 5
