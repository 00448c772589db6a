# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from texture_drivers.biotac import LAYOUTS
from texture_simulation.path import Trajectory
from texture_simulation.scene import scene_from
from texture_simulation.sensor_models import BIOTAC_PATH_RATE_HZ as PATH_RATE_HZ
from texture_simulation.sensor_models import PA_PER_N, PDC_PA, BioTacModel

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


def slow(values: np.ndarray, channel: str) -> np.ndarray:
    return values[:, BIOTAC.slots.index(channel)].astype(float)


def test_a_resting_finger_on_a_flat_surface_senses_no_vibration() -> None:
    pac = model('flat').advance(slide(100))[50:, 1::2]
    assert np.ptp(pac) <= 1
    assert pac.mean() == pytest.approx(2030, abs=1)


def test_the_static_pressure_is_proportional_to_the_force() -> None:
    free, pressed = (slow(model('flat').advance(slide(2, force_n=force_n)), 'pdc')[-1] for force_n in (0.0, 5.0))
    assert pressed - free == pytest.approx(5.0 * PA_PER_N / PDC_PA, abs=1)


def test_load_squeezes_the_fluid_away_from_the_electrodes_under_it() -> None:
    free, pressed = (model('flat').advance(slide(1, force_n=force_n))[0].astype(float) for force_n in (0.0, 2.0))
    change = (pressed - free)[list(BIOTAC.slow_slots[3:])]
    assert change.min() < -300
    assert (change <= 0).all()
    assert (change == 0).any()  # far from the contact


def test_touching_cools_the_finger() -> None:
    values = model('flat').advance(slide(500))
    assert slow(values, 'tdc')[-1] < slow(values, 'tdc')[0]
    assert slow(values, 'tac')[10] < slow(values, 'tac')[-1]  # the flow of heat ebbs away


def test_cutting_the_path_into_blocks_changes_nothing() -> None:
    path = slide(40, speed_m_s=0.05)
    whole = model('ridges').advance(path)
    pieces, parts = model('ridges'), []
    for first in range(0, 40, 8):
        points = np.arange(first * len(BIOTAC.slots), (first + 8) * len(BIOTAC.slots))
        parts.append(pieces.advance(path.at(points)))
    assert (np.concatenate(parts) == whole).all()
