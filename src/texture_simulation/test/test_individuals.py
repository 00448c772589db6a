# SPDX-License-Identifier: Apache-2.0
"""Fingers that are no copies of each other, and objects that are not flat."""

import math

import numpy as np
import pytest

from texture_drivers.biotac import LAYOUTS
from texture_simulation.effects import SALT
from texture_simulation.offline import simulate_slide_streams
from texture_simulation.path import SimulatedSlide, straight
from texture_simulation.scene import Contact, scene_from
from texture_simulation.sensor_models import COLUMNS, ELECTRODE_PITCH_M, BioTacModel
from texture_simulation.sensor_models import ELECTRODE_BASELINE as BASELINE

RELIEF = {'kind': 'self_affine', 'rms_m': 2e-5, 'hurst': 0.5, 'longest_m': 4e-3, 'shortest_m': 4e-4, 'seed': 1}
SMOOTH = {'kind': 'self_affine', 'rms_m': 1e-9, 'hurst': 0.5, 'longest_m': 4e-3, 'shortest_m': 4e-4, 'seed': 1}


def scene_of(*terms, effects=None):
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
        measured(scene_of(RELIEF, *more))['signal'].std() for more in ((), [{'kind': 'curved', 'radius_m': 7e-3}])
    )
    assert 0.5 < ball / flat < 1.0


def test_the_load_wanders_over_the_fingertip_by_the_share_of_its_radius_in_both() -> None:
    scene = scene_of(SMOOTH, {'kind': 'curved', 'radius_m': 0.035})
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


def test_a_finger_has_a_sensitivity_a_skin_and_a_noise_of_its_own() -> None:
    spread = {'relative': 0.0, 'skin': 0.2, 'noise': 0.5}
    scene = scene_of(RELIEF, effects={'finger_spread': spread, 'noise': {'fast_count': 1.0}, 'skin': {}})
    drawn = np.random.default_rng([SALT, 3]).standard_normal(3)
    own = scene.of_finger(3)
    assert own.contact.blur_m == pytest.approx(scene.contact.blur_m * np.exp(0.2 * drawn[1]))
    assert own.contact.stiffness_n_m == pytest.approx(scene.contact.stiffness_n_m * np.exp(-0.2 * drawn[1]))
    assert own.effects['skin'].resonance_hz == pytest.approx(200.0 * np.exp(-0.2 * drawn[1]))
    assert own.effects['noise'].fast_count == pytest.approx(np.exp(0.5 * drawn[2]))
    assert own.surfaces is scene.surfaces


def test_two_fingers_measure_one_object_differently_where_they_are_told_to() -> None:
    alike = [measured(scene_of(RELIEF), finger)['signal'].std() for finger in (1, 2)]
    assert alike[0] == pytest.approx(alike[1], rel=1e-9)
    spread = scene_of(RELIEF, effects={'finger_spread': {'relative': 0.2, 'skin': 0.2}})
    unlike = [measured(spread, finger)['signal'].std() for finger in (1, 2)]
    assert abs(math.log(unlike[0] / unlike[1])) > 0.03
