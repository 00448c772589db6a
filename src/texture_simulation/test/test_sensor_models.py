# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the simulated fingers of papers 3 and 5 must feel, whatever their gains."""

from __future__ import annotations

import math

import numpy as np
import pytest

from texture_drivers import pvdf as tables
from texture_drivers.biotac import LAYOUTS
from texture_simulation import sensor_models as daq
from texture_simulation import sensor_models as pvdf
from texture_simulation.effects import SALT
from texture_simulation.offline import simulate_slide_streams
from texture_simulation.path import SimulatedSlide, Trajectory, straight
from texture_simulation.scene import Contact, Scene, scene_from
from texture_simulation.sensor_models import BIOTAC_PATH_RATE_HZ as PATH_RATE_HZ
from texture_simulation.sensor_models import COLUMNS, ELECTRODE_PITCH_M, PA_PER_N, PDC_PA, BioTacModel, Tsf85Model
from texture_simulation.sensor_models import ELECTRODE_BASELINE as BASELINE

BIOTAC = LAYOUTS['biotac']
PITCH_M = 1e-3
SCENE = scene_from(
    'test', {'surfaces': {'flat': [], 'ridges': [{'kind': 'grating', 'pitch_m': PITCH_M, 'depth_m': 2e-5}]}}
)


def model(surface: str) -> BioTacModel:
    return BioTacModel(SCENE, SCENE.surface(surface), np.random.default_rng(0), layout=BIOTAC)


def slide(n_frames: int, speed_m_s: float = 0.0, force_n: float = 2.0) -> Trajectory:
    time_s = np.arange(n_frames * len(BIOTAC.slots)) / PATH_RATE_HZ
    return Trajectory(speed_m_s * time_s, np.zeros_like(time_s), np.full_like(time_s, force_n))


def slow(path: Trajectory, channel: str) -> np.ndarray:
    return model('flat').measure(path)['signal_static'][:, BIOTAC.slow_channels.index(channel)]


def test_the_static_pressure_is_proportional_to_the_force() -> None:
    free, pressed = (slow(slide(2, force_n=force_n), 'pdc')[-1] for force_n in (0.0, 5.0))
    assert pressed - free == pytest.approx(5.0 * PA_PER_N / PDC_PA, abs=1)


def test_load_squeezes_the_fluid_away_from_the_electrodes_under_it() -> None:
    free, pressed = (model('flat').measure(slide(1, force_n=force_n))['signal_static'][0] for force_n in (0.0, 2.0))
    change = (pressed - free)[3:]
    assert change.min() < -300
    assert (change <= 0).all()
    assert (change == 0).any()  # far from the contact


def test_touching_cools_the_finger() -> None:
    tdc, tac = (slow(slide(500), channel) for channel in ('tdc', 'tac'))
    assert tdc[-1] < tdc[0]
    assert tac[10] < tac[-1]  # the flow of heat ebbs away


SPEED_M_S = 0.05  # over ridges of 1 mm: 50 Hz


@pytest.fixture
def scene() -> Scene:
    ridges = [{'kind': 'grating', 'pitch_m': PITCH_M, 'depth_m': 5e-5}]
    flat = [{'kind': 'grating', 'pitch_m': PITCH_M, 'depth_m': 0.0}]
    return scene_from('test', {'surfaces': {'ridges': ridges, 'flat': flat}})


def slide_at(rate_hz: float, seconds: float, speed_m_s: float = SPEED_M_S, force_n: float = 1.0) -> Trajectory:
    x_m = np.arange(round(seconds * rate_hz)) / rate_hz * speed_m_s
    return Trajectory(x_m, np.zeros_like(x_m), np.full_like(x_m, force_n))


def test_films_forget_a_constant_force_and_gauges_do_not(scene: Scene) -> None:
    model = daq.DaqModel(scene, scene.surface('flat'), np.random.default_rng(0))
    counts = model.measure(slide_at(daq.DAQ_PATH_RATE_HZ, 4.0, speed_m_s=0.0))['signal']
    assert np.abs(counts[-1, :4]).max() <= 1
    assert np.abs(counts[-1, 4:]).min() >= 2.0 / daq.VOLT_PER_COUNT - 1  # at least 2 V/N, at 1 N


def test_what_lies_deeper_senses_fine_ridges_less(scene: Scene) -> None:
    model = daq.DaqModel(scene, scene.surface('ridges'), np.random.default_rng(0))
    counts = model.measure(slide_at(daq.DAQ_PATH_RATE_HZ, 2.0))['signal'][2500:]
    measured = counts.std(axis=0) / np.abs(model.volt_per_n)
    assert measured[[0, 1, 4, 5]].min() > measured[[2, 3, 6, 7]].max()


def test_the_daq_finger_passes_500_hz_at_half_power_and_little_above(scene: Scene) -> None:
    def measured(frequency_hz: float) -> float:
        model = daq.DaqModel(scene, scene.surface('ridges'), np.random.default_rng(0))
        path = slide_at(daq.DAQ_PATH_RATE_HZ, 1.0, frequency_hz * PITCH_M)
        return float(model.measure(path)['signal'][1250:, 4].std())

    assert measured(500.0) / measured(100.0) == pytest.approx(np.sqrt(0.5), rel=0.02)
    assert measured(1100.0) / measured(100.0) < 0.05


def test_the_film_answers_a_touch_with_a_charge_that_leaks_away(scene: Scene) -> None:
    model = pvdf.PvdfModel(scene, scene.surface('flat'), np.random.default_rng(0))
    charge_pc = model.streams(slide_at(pvdf.PVDF_PATH_RATE_HZ, 2.0, speed_m_s=0.0, force_n=1.5))['signal'][:, 0]
    at = round(0.106 * tables.FILM_RATE_HZ)  # R·C: 100 MΩ and 1.06 nF
    assert charge_pc.max() == pytest.approx(1.5 * 21.0, rel=0.1)  # the low-pass overshoots a little
    assert charge_pc[at] == pytest.approx(1.5 * 21.0 * np.exp(-1), rel=0.02)
    assert abs(charge_pc[-1]) < 0.01


def test_the_force_sensor_reports_the_force_in_newtons_at_64_hz(scene: Scene) -> None:
    model = pvdf.PvdfModel(scene, scene.surface('flat'), np.random.default_rng(0))
    force_n = model.streams(slide_at(pvdf.PVDF_PATH_RATE_HZ, 2.0, speed_m_s=0.0, force_n=1.5))['signal_static']
    assert len(force_n) == 128
    assert force_n[-1, 0] == pytest.approx(1.5, abs=0.01)


def recorded(scene: Scene, speed_m_s: float, surface: str = 'sine', seed: int = 0, force_n: float = 2.0):
    sliding = SimulatedSlide(speed_m_s, force_n, 2.0)
    return simulate_slide_streams(scene, surface, 1, sliding, np.random.default_rng(seed))['signal'][0, :, 0]


def test_too_strong_a_vibration_is_clipped_as_by_the_converter() -> None:
    scene = scene_from('t', {'surfaces': {'deep': [{'kind': 'grating', 'pitch_m': 2e-3, 'depth_m': 5e-3}]}})
    signal = recorded(scene, 0.2, 'deep')
    assert (signal.min(), signal.max()) == (-32768, 32767)


def test_the_image_rises_where_and_as_hard_as_the_finger_presses() -> None:
    scene = scene_from('t', {'surfaces': {'flat': []}})
    model = Tsf85Model(scene, scene.surface('flat'), np.random.default_rng(0))
    still = np.zeros(200)
    free, pressed = (
        model.measure(Trajectory(still, still, still + force))['signal_static'][-1] for force in (0.0, 2.0)
    )
    rise = (pressed - free).reshape(7, 4)
    assert rise.sum() == pytest.approx(6000, abs=20)
    assert rise[3, 1] >= rise.max() - 1
    assert rise[0, 0] == 0


RELIEF = {'kind': 'self_affine', 'rms_m': 2e-5, 'hurst': 0.5, 'longest_m': 4e-3, 'shortest_m': 4e-4, 'seed': 1}
SMOOTH = {'kind': 'self_affine', 'rms_m': 1e-9, 'hurst': 0.5, 'longest_m': 4e-3, 'shortest_m': 4e-4, 'seed': 1}


def object_of(*terms, effects=None):
    return scene_from('mine', {'sensor': 'biotac', 'surfaces': {'object': list(terms)}, 'effects': effects or {}})


def measured(scene, finger=0, seed=0):
    sliding = SimulatedSlide(0.05, 1.0, 1.0)
    return simulate_slide_streams(scene, 'object', 4, sliding, np.random.default_rng(seed), finger=finger)


def test_two_equal_spheres_touch_as_one_of_half_the_radius() -> None:
    contact = Contact(tip_radius_m=7e-3)
    assert contact.on(7e-3) == pytest.approx(0.5 ** (1 / 3))
    assert contact.on(math.inf) == 1.0
    assert contact.on(0.1) > contact.on(0.01)


def test_a_curved_object_is_sensed_more_softly_than_a_flat_one_of_the_same_relief() -> None:
    flat, ball = (
        measured(object_of(RELIEF, *more))['signal'].std() for more in ((), [{'kind': 'curved', 'radius_m': 7e-3}])
    )
    assert 0.5 < ball / flat < 1.0


def test_the_load_wanders_over_the_fingertip_by_the_share_of_its_radius_in_both() -> None:
    scene = object_of(SMOOTH, {'kind': 'curved', 'radius_m': 0.035})
    model = BioTacModel(
        scene, scene.surface('object'), np.random.default_rng(0), layout=LAYOUTS['biotac'], finger=0, settled=True
    )
    model.touch._tilt_rad = np.zeros((2, 1))
    way_m = 0.012
    electrodes = model.streams(straight((0.0, 0.0, 1.0), (way_m, 0.0, 1.0), 4400))['signal_static'][:, 3:]
    load = 1.0 / electrodes - 1.0 / model._baseline[:, 0]  # as a squeezed electrode reads B / (1 + load / B)
    x_m = (np.arange(19) % COLUMNS - (COLUMNS - 1) / 2) * ELECTRODE_PITCH_M
    weight = load * model._baseline[:, 0] ** 2
    centre_m = (weight * x_m).sum(axis=1) / weight.sum(axis=1)
    expected_m = 7e-3 * way_m / (7e-3 + 0.035)  # 2 mm, of which coarse electrodes see most
    assert centre_m[-1] - centre_m[0] == pytest.approx(expected_m, rel=0.4)
    assert BASELINE[0] < electrodes.max() < BASELINE[1]


def test_a_finger_has_an_individual_sensitivity_skin_and_noise() -> None:
    spread = {'relative': 0.0, 'skin': 0.2, 'noise': 0.5}
    scene = object_of(RELIEF, effects={'finger_spread': spread, 'noise': {'fast_count': 1.0}})
    drawn = np.random.default_rng([SALT, 3]).standard_normal(3)
    individual = scene.of_finger(3)
    assert individual.contact.blur_m == pytest.approx(scene.contact.blur_m * np.exp(0.2 * drawn[1]))
    assert individual.contact.stiffness_n_m == pytest.approx(scene.contact.stiffness_n_m * np.exp(-0.2 * drawn[1]))
    assert individual.effects['noise'].fast_count == pytest.approx(np.exp(0.5 * drawn[2]))
    assert individual.surfaces is scene.surfaces


def test_two_fingers_measure_one_object_differently_where_the_scene_defines_it() -> None:
    alike = [measured(object_of(RELIEF), finger)['signal'].std() for finger in (1, 2)]
    assert alike[0] == pytest.approx(alike[1], rel=1e-9)
    spread = object_of(RELIEF, effects={'finger_spread': {'relative': 0.2, 'skin': 0.2}})
    unlike = [measured(spread, finger)['signal'].std() for finger in (1, 2)]
    assert abs(math.log(unlike[0] / unlike[1])) > 0.03
