# SPDX-License-Identifier: Apache-2.0
"""The other sensors on the emulator: scene, model, device, line and driver together."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from texture_core.types import NANOSECONDS, FingerState
from texture_drivers.daq import daq
from texture_drivers.pvdf import Pvdf
from texture_drivers.sensor import SensorParams
from texture_simulation.emulator import LIVE_SENSORS, Emulator, EmulatorParams
from texture_simulation.path import straight
from texture_simulation.scene import load_scene

pytestmark = pytest.mark.realtime

DEADLINE_S = 30.0
SPEED_M_S, FORCE_N = 0.1, 2.0  # over ridges of 2 mm: 50 Hz


@pytest.fixture
def emulator(tmp_path: Path) -> Iterator[Emulator]:
    params = EmulatorParams(
        surface='ridge_2mm_deep',
        sensor_link=str(tmp_path / 'tsf85'),
        daq_link=str(tmp_path / 'daq'),
        pvdf_link=str(tmp_path / 'pvdf'),
        finger_port=0,
    )
    with Emulator(params) as made:
        yield made


@pytest.fixture
def arm(emulator: Emulator) -> Iterator[None]:
    """An arm whose finger slides for ever along x."""
    stop = threading.Event()

    def run() -> None:
        start_ns = time.monotonic_ns()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            while not stop.wait(0.01):
                now_ns = time.monotonic_ns()
                x_m = SPEED_M_S * (now_ns - start_ns) / 1e9
                state = FingerState(now_ns, x_m=x_m, vx_m_s=SPEED_M_S, force_n=FORCE_N)
                line.sendto(state.to_bytes(), ('127.0.0.1', emulator.finger_port))

    thread = threading.Thread(target=run)
    thread.start()
    yield
    stop.set()
    thread.join()


def read(sensor: Any, seconds: float) -> dict[str, np.ndarray]:
    """Return what comes in so many seconds, by topic, (n_samples, n_channels)."""
    batches: dict[str, list[Any]] = {}
    deadline_s = time.monotonic() + DEADLINE_S
    wanted = round(seconds * sensor.expected_rates_hz['signal'])
    sensor.open()
    while sum(len(batch.samples) for batch in batches.get('signal', [])) < wanted:
        assert time.monotonic() < deadline_s
        for topic, found in sensor.read().items():
            batches.setdefault(topic, []).extend(found)
    sensor.close()
    return {topic: np.concatenate([batch.samples for batch in found]) for topic, found in batches.items()}


def peak_hz(samples: np.ndarray, rate_hz: float) -> float:
    spectrum = np.abs(np.fft.rfft((samples - samples.mean()) * np.hanning(len(samples))))
    return float(np.fft.rfftfreq(len(samples), 1 / rate_hz)[spectrum.argmax()])


def test_the_daq_finger_senses_the_ridges_at_speed_over_pitch(emulator: Emulator, arm: None, tmp_path: Path) -> None:
    samples = read(daq(SensorParams(device=str(tmp_path / 'daq'))), 3.0)['signal'][2500:]
    assert peak_hz(samples[:, 0], 2500.0) == pytest.approx(50.0, abs=1.0)


def test_the_pvdf_finger_senses_ridges_and_force(emulator: Emulator, arm: None, tmp_path: Path) -> None:
    found = read(Pvdf(SensorParams(device=str(tmp_path / 'pvdf'))), 3.0)
    assert peak_hz(found['signal'][4096:, 0], 4096.0) == pytest.approx(50.0, abs=1.0)
    assert found['signal_static'][64:].mean() == pytest.approx(FORCE_N, rel=0.05)


def test_after_a_stall_of_the_machine_time_has_gone_on(tmp_path: Path) -> None:
    scene = load_scene('twelve_textures')
    live = LIVE_SENSORS['daq'](scene, scene.surface('glass'), tmp_path / 'daq', np.random.default_rng(0))
    live.advance(0)
    live.advance(10 * NANOSECONDS)
    assert live.device._frames['daq'] == 2500  # the driver sees a gap of 9.75 s, and then 0.25 s of samples


def test_a_stalled_biotac_leaves_frames_out(tmp_path: Path) -> None:
    scene = load_scene('twelve_textures')
    live = LIVE_SENSORS['biotac'](scene, scene.surface('glass'), tmp_path / 'biotac', np.random.default_rng(0))
    live.advance(0)
    live.advance(10 * NANOSECONDS)
    assert (live.done, live.skipped) == (1000, 975)


def test_two_fingers_of_a_board_sense_other_places_of_one_surface_and_its_third_place_nothing(tmp_path: Path) -> None:
    scene = load_scene('twelve_textures')
    surface, rng = scene.surface('ridge_2mm_deep'), np.random.default_rng(0)
    live = LIVE_SENSORS['biotac_hand'](scene, surface, tmp_path / 'biotac', rng)
    slide = straight((0.0, 0.0, FORCE_N), (0.1, 0.0, FORCE_N), 4400)
    counts = live.model.advance(slide).astype(float)  # type: ignore[attr-defined]
    assert counts.shape == (100, 44, 3)
    assert (counts[..., 2] == 0).all()
    pac = counts[50:, 1::2].reshape(-1, 3)  # every second slot
    rough = pac.std(axis=0)
    assert rough[0] == pytest.approx(rough[1], rel=0.3)
    assert np.abs(pac[:, 0] - pac[:, 1]).max() > rough[0]
    live.model.touch.surface = scene.surface('glass')
    smooth = live.model.advance(slide).astype(float)[50:, 1::2].reshape(-1, 3).std(axis=0)  # type: ignore[attr-defined]
    assert (smooth[:2] < 0.3 * rough[:2]).all()
