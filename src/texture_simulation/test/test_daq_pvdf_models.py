# SPDX-License-Identifier: Apache-2.0
"""What the simulated fingers of papers 3 and 5 must feel, whatever their gains."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from texture_drivers import pvdf as tables
from texture_simulation import sensor_models as daq
from texture_simulation import sensor_models as pvdf
from texture_simulation.path import Trajectory
from texture_simulation.scene import Scene, scene_from

PITCH_M = 1e-3
SPEED_M_S = 0.05  # over ridges of 1 mm: 50 Hz


@pytest.fixture
def scene() -> Scene:
    ridges = [{'kind': 'grating', 'pitch_m': PITCH_M, 'depth_m': 5e-5}]
    flat = [{'kind': 'grating', 'pitch_m': PITCH_M, 'depth_m': 0.0}]
    return scene_from('test', {'surfaces': {'ridges': ridges, 'flat': flat}})


def slide(rate_hz: float, seconds: float, speed_m_s: float = SPEED_M_S, force_n: float = 1.0) -> Trajectory:
    x_m = np.arange(round(seconds * rate_hz)) / rate_hz * speed_m_s
    return Trajectory(x_m, np.zeros_like(x_m), np.full_like(x_m, force_n))


def peak_hz(samples: np.ndarray, rate_hz: float) -> float:
    spectrum = np.abs(np.fft.rfft((samples - samples.mean()) * np.hanning(len(samples))))
    return float(np.fft.rfftfreq(len(samples), 1 / rate_hz)[spectrum.argmax()])


def test_every_element_of_the_daq_finger_senses_ridges_at_speed_over_pitch(scene: Scene) -> None:
    model = daq.DaqModel(scene, scene.surface('ridges'), np.random.default_rng(0))
    counts = model.advance(slide(daq.DAQ_PATH_RATE_HZ, 4.0))[5000:]
    assert [peak_hz(counts[:, i], 2500.0) for i in range(8)] == pytest.approx([50.0] * 8, abs=0.5)


def test_films_forget_a_constant_force_and_gauges_do_not(scene: Scene) -> None:
    model = daq.DaqModel(scene, scene.surface('flat'), np.random.default_rng(0))
    counts = model.advance(slide(daq.DAQ_PATH_RATE_HZ, 4.0, speed_m_s=0.0))
    assert np.abs(counts[-1, :4]).max() <= 1
    assert np.abs(counts[-1, 4:]).min() >= 2.0 / daq.VOLT_PER_COUNT - 1  # at least 2 V/N, at 1 N


def test_what_lies_deeper_senses_fine_ridges_less(scene: Scene) -> None:
    model = daq.DaqModel(scene, scene.surface('ridges'), np.random.default_rng(0))
    counts = model.advance(slide(daq.DAQ_PATH_RATE_HZ, 2.0))[2500:]
    measured = counts.std(axis=0) / np.abs(model.volt_per_n)
    assert measured[[0, 1, 4, 5]].min() > measured[[2, 3, 6, 7]].max()


def test_the_daq_finger_passes_500_hz_at_half_power_and_little_above(scene: Scene) -> None:
    def measured(frequency_hz: float) -> float:
        model = daq.DaqModel(scene, scene.surface('ridges'), np.random.default_rng(0))
        return float(model.advance(slide(daq.DAQ_PATH_RATE_HZ, 1.0, frequency_hz * PITCH_M))[1250:, 4].std())

    assert measured(500.0) / measured(100.0) == pytest.approx(np.sqrt(0.5), rel=0.02)
    assert measured(1100.0) / measured(100.0) < 0.05


def test_the_film_answers_a_touch_with_a_charge_that_leaks_away(scene: Scene) -> None:
    model = pvdf.PvdfModel(scene, scene.surface('flat'), np.random.default_rng(0))
    film, _ = model.advance(slide(pvdf.PVDF_PATH_RATE_HZ, 2.0, speed_m_s=0.0, force_n=1.5))
    charge_pc = film * tables.FILM_PC_PER_COUNT
    time_constant_s = tables.RESISTANCE_OHM * tables.CAPACITANCE_F
    at = round(time_constant_s * tables.FILM_RATE_HZ)
    assert charge_pc.max() == pytest.approx(1.5 * 21.0, rel=0.1)  # the low-pass overshoots a little
    assert charge_pc[at] == pytest.approx(1.5 * 21.0 * np.exp(-1), rel=0.02)
    assert abs(charge_pc[-1]) < 0.01


def test_the_force_sensor_reports_the_force_in_newtons_at_64_hz(scene: Scene) -> None:
    model = pvdf.PvdfModel(scene, scene.surface('flat'), np.random.default_rng(0))
    _, force = model.advance(slide(pvdf.PVDF_PATH_RATE_HZ, 2.0, speed_m_s=0.0, force_n=1.5))
    assert len(force) == 128
    assert force[-1] * tables.FORCE_N_PER_COUNT == pytest.approx(1.5, abs=0.01)


@pytest.mark.parametrize('parts', [2, 7])
def test_blocks_give_the_same_as_the_whole(scene: Scene, parts: int) -> None:
    path = slide(pvdf.PVDF_PATH_RATE_HZ, 0.5)
    cuts = np.linspace(0, len(path) // 2, parts + 1).astype(int) * 2
    pieces = [path.at(np.arange(a, b)) for a, b in itertools.pairwise(cuts)]
    for kind in (pvdf.PvdfModel, daq.DaqModel):
        whole = kind(scene, scene.surface('ridges'), np.random.default_rng(0)).advance(path)
        model = kind(scene, scene.surface('ridges'), np.random.default_rng(0))
        found = [model.advance(piece) for piece in pieces]
        if isinstance(whole, tuple):
            for i, values in enumerate(whole):
                np.testing.assert_array_equal(np.concatenate([piece[i] for piece in found]), values)
        else:
            np.testing.assert_array_equal(np.concatenate(found), whole)
