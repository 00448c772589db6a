# SPDX-License-Identifier: Apache-2.0
"""Friction that a surface asks for, as a finger feels it through the whole chain."""

from __future__ import annotations

import numpy as np
import pytest

from texture_core.errors import InvalidParameter
from texture_simulation.friction import CREEP_M_S, SlidingDrag, SlidingFriction, slow_drag
from texture_simulation.offline import simulate_slides
from texture_simulation.path import SimulatedSlide, Trajectory
from texture_simulation.scene import Scene, scene_from
from texture_simulation.sensor_models import SENSORS

RATE_HZ = 2000.0
HANGS = {'kind': 'stick_slip'}
GLIDES = {'kind': 'sliding_friction'}


def table(*terms: dict, sensor: str = 'tsf85') -> Scene:
    return scene_from('test', {'sensor': sensor, 'surfaces': {'sheet': list(terms)}})


def dragged_n(speed_m_s: np.ndarray, force_n: float = 1.0, **values: float) -> np.ndarray:
    x_m = np.cumsum(speed_m_s) / RATE_HZ
    path = Trajectory(x_m, 0 * x_m, np.full_like(x_m, force_n))
    return SlidingDrag(SlidingFriction(force_coupling=1.0, **values), RATE_HZ).advance(path)


@pytest.mark.parametrize('sensor', SENSORS)
def test_every_sensor_senses_a_skin_that_hangs_and_lets_go(sensor: str) -> None:
    measured = [
        simulate_slides(
            table(*terms, sensor=sensor), 'sheet', 3, SimulatedSlide(0.05, 1.5, 0.3), np.random.default_rng(0)
        )
        for terms in ([], [HANGS])
    ]
    assert np.isfinite(measured[1]).all()
    assert (measured[0].std(axis=1) < 0.01 * measured[1].std(axis=1)).all()


def test_the_skin_lets_go_as_often_as_the_formula_of_slow_drag_says() -> None:
    scene = table(HANGS)
    friction = scene.surface('sheet').friction
    speed_m_s, force_n, duration_s = 0.01, 1.5, 4.0
    measured = simulate_slides(
        scene, 'sheet', 1, SimulatedSlide(speed_m_s, force_n, duration_s), np.random.default_rng(0)
    )[0, :, 0]
    jumps = np.flatnonzero(np.abs(measured) > 0.5 * np.abs(measured).max()) / 1000
    times_s = jumps[np.diff(jumps, prepend=-1.0) > 0.02]
    assert np.diff(times_s).mean() == pytest.approx(slow_drag(friction, speed_m_s, force_n).period_s, rel=0.1)


def test_slides_cut_out_of_longer_ones_begin_anywhere_in_the_cycle_and_a_seed_is_one_of_them() -> None:
    def measured(seed: int) -> np.ndarray:
        return simulate_slides(table(HANGS), 'sheet', 3, SimulatedSlide(0.02, 1.5, 0.3), np.random.default_rng(seed))[
            ..., 0
        ]

    assert np.array_equal(measured(1), measured(1))
    assert np.abs(np.corrcoef(measured(1))[np.triu_indices(3, 1)]).max() < 0.9


def test_steady_sliding_pulls_as_the_stribeck_curve_says() -> None:
    values = {'static': 0.9, 'kinetic': 0.5, 'stribeck_m_s': 0.05, 'viscous_s_m': 0.1}
    for speed_m_s in (0.01, 0.05, 0.2):
        expected = 0.5 + 0.4 * np.exp(-((speed_m_s / 0.05) ** 2)) + 0.1 * speed_m_s
        found = dragged_n(np.full(50, speed_m_s), 2.0, **values)
        assert found == pytest.approx(2.0 * expected, rel=0.01)


def test_sliding_friction_builds_up_and_ebbs_away_without_a_jump() -> None:
    speed_m_s = np.concatenate([np.zeros(10), np.linspace(0, 0.05, 500), np.linspace(0.05, -0.05, 1000), np.zeros(10)])
    pull = dragged_n(speed_m_s)
    assert np.isfinite(pull).all()
    assert not pull[:10].any()
    assert pull[-9:] == pytest.approx(0.0)
    assert np.abs(np.diff(pull[:1500])).max() < 2 * 0.05 / 500 / CREEP_M_S


def test_two_frictions_on_one_surface_are_refused() -> None:
    with pytest.raises(InvalidParameter, match='2 kinds of friction; name one of'):
        table(HANGS, GLIDES)


def test_friction_that_is_lower_at_rest_than_sliding_is_refused() -> None:
    with pytest.raises(InvalidParameter, match='below the kinetic one'):
        table({**GLIDES, 'static': 0.1, 'kinetic': 0.5})
