# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A sensor on the emulator: scene, model, device, line and driver together."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import UnknownName
from texture_core.types import NANOSECONDS, FingerSender, FingerState, TactileSignal, lost_samples
from texture_drivers.sensor import SensorParams
from texture_drivers.tsf85 import Tsf85
from texture_simulation.emulator import LIVE_SENSORS, Emulator, EmulatorParams
from texture_simulation.path import straight
from texture_simulation.scene import load_scene

pytestmark = pytest.mark.realtime

DEADLINE_S = 15.0


class Arm:
    """Reports a finger that slides without end along x, as emulated arms do."""

    def __init__(self, emulator: FingerSender, speed_m_s: float = 0.1, force_n: float = 2.0) -> None:
        self._emulator, self._speed_m_s, self._force_n = emulator, speed_m_s, force_n
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        start_ns = time.monotonic_ns()
        while not self._stop.wait(0.01):
            now_ns = time.monotonic_ns()
            x_m = self._speed_m_s * (now_ns - start_ns) / 1e9
            self._emulator.send(FingerState(now_ns, x_m=x_m, vx_m_s=self._speed_m_s, force_n=self._force_n))

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()
        self._emulator.close()


def emulated(folder: Path) -> Emulator:
    links = {'finger_pipe': str(folder / 'finger'), 'sensor_link': str(folder / 'tsf85')}
    return Emulator(EmulatorParams(surface='ridge_2mm_deep', sensor='tsf85', **links))


@pytest.fixture
def emulator(tmp_path: Path) -> Iterator[Emulator]:
    with emulated(tmp_path) as made:
        yield made


@pytest.fixture
def sensor(emulator: Emulator, tmp_path: Path) -> Iterator[Tsf85]:
    made = Tsf85(SensorParams(device=str(tmp_path / 'tsf85')))
    made.open()
    yield made
    made.close()


@pytest.fixture
def arm(emulator: Emulator, tmp_path: Path) -> Iterator[Arm]:
    made = Arm(FingerSender(str(tmp_path / 'finger')))
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


def peak_hz(samples: np.ndarray, rate_hz: float) -> float:
    spectrum = np.abs(np.fft.rfft((samples - samples.mean()) * np.hanning(len(samples))))
    return float(np.fft.rfftfreq(len(samples), 1 / rate_hz)[spectrum.argmax()])


def test_the_driver_senses_the_ridges_at_speed_over_pitch(emulator: Emulator, sensor: Tsf85, arm: Arm) -> None:
    read(sensor, 500)
    batches = read(sensor, 2000)
    assert peak_hz(values(batches)[:2000], 1000.0) == pytest.approx(50.0, abs=1.0)
    assert lost_samples(batches) <= emulator.counts['skipped samples']  # none, unless the machine stalls
    assert sensor.counts['bogus'] == 0


def test_the_sample_can_be_swapped_while_the_finger_slides(emulator: Emulator, sensor: Tsf85, arm: Arm) -> None:
    rough = values(read(sensor, 1000))[-400:].std()
    emulator.set_surface('glass')
    read(sensor, 300)
    assert values(read(sensor, 400)).std() < 0.2 * rough
    with pytest.raises(UnknownName, match="did you mean 'glass'"):
        emulator.set_surface('glas')
    assert emulator.surface == 'glass'


def test_a_device_that_is_silent_after_opening_is_woken(emulator: Emulator, tmp_path: Path) -> None:
    emulator.device.ignored_starts = 3  # the one of opening and two more
    sensor = Tsf85(SensorParams(device=str(tmp_path / 'tsf85')))
    sensor.open()
    read(sensor, 300)
    sensor.close()
    assert (sensor.counts['revived'], sensor.counts['reopened']) == (3, 0)


FORCE_N = 2.0


def test_after_a_stall_of_the_machine_time_has_gone_on(tmp_path: Path) -> None:
    scene = load_scene('twelve_textures')
    live = LIVE_SENSORS['daq'](scene, scene.surface('glass'), tmp_path / 'daq', np.random.default_rng(0))
    live.advance(0)
    live.advance(10 * NANOSECONDS)
    assert live.device._frames['signal'] == 2500  # the driver sees a gap of 9.75 s, and then 0.25 s of samples


def test_the_fingers_of_a_board_sense_other_places_of_one_surface(tmp_path: Path) -> None:
    scene = load_scene('twelve_textures')
    surface, rng = scene.surface('ridge_2mm_deep'), np.random.default_rng(0)
    live = LIVE_SENSORS['biotac_hand'](scene, surface, tmp_path / 'biotac', rng)
    slide = straight((0.0, 0.0, FORCE_N), (0.1, 0.0, FORCE_N), 4400)

    def measured() -> np.ndarray:
        return np.stack([finger.measure(slide)['signal'][1100:, 0] for finger in live.fingers], axis=-1)

    pac = measured()
    rough = pac.std(axis=0)
    np.testing.assert_allclose(rough, rough.mean(), rtol=0.3)
    assert all(np.abs(pac[:, 0] - pac[:, other]).max() > rough[0] for other in (1, 2))
    live.surface = scene.surface('glass')
    assert (measured().std(axis=0) < 0.3 * rough).all()
