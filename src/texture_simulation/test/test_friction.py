# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Friction: the Stribeck curve, the tip that sticks and slips, its energy, and what a finger senses of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from texture_core.errors import InvalidParameter
from texture_simulation.friction import (
    CREEP_M_S,
    PASSIVE,
    SlidingDrag,
    SlidingFriction,
    StickSlip,
    Tip,
    TipDrag,
    coefficient,
    drag,
    pull_n,
    steady_force_n,
)
from texture_simulation.offline import simulate_slides
from texture_simulation.path import SimulatedSlide, Trajectory
from texture_simulation.scene import Scene, scene_from
from texture_simulation.sensor_models import SENSORS

STEP_S, RATE_HZ = 5e-5, 2000.0
USUAL = StickSlip()
HANGS, GLIDES = {'kind': 'stick_slip'}, {'kind': 'sliding_friction'}


def with_skin(**values: float) -> StickSlip:
    """Return a friction with other constants of skin and bristles, which are in capitals."""
    constants = {name: value for name, value in values.items() if name.isupper()}
    fields = {name: value for name, value in values.items() if not name.isupper()}
    return type('OtherSkin', (StickSlip,), constants)(**fields)


def steadily(friction: StickSlip, speed_m_s: float, force_n: float, duration_s: float, step_s: float = STEP_S):
    speed = np.full(round(duration_s / step_s), speed_m_s)
    tip = drag(friction, speed, np.full_like(speed, force_n), step_s)
    return tip, pull_n(friction, tip, speed)


def slow_drag(friction: StickSlip, speed_m_s: float, force_n: float) -> tuple[float, float]:
    """Return period and swing of a drag that is slow against the Stribeck speed and the swing of the tip.

    The tip lets go at static·force and swings about kinetic·force for half a period of the skin.
    """
    drop_n = (friction.static - friction.kinetic) * force_n
    natural_1_s = math.sqrt(friction.SKIN_N_M / friction.MASS_KG)
    damping = friction.SKIN_N_S_M / (2 * friction.MASS_KG * natural_1_s)
    root = math.sqrt(1 - damping**2)
    swing_n = drop_n * (1 + math.exp(-math.pi * damping / root))
    return swing_n / (friction.SKIN_N_M * speed_m_s) + math.pi / (natural_1_s * root), swing_n


def energy_j(friction: StickSlip, tip: Tip, force_n: np.ndarray) -> np.ndarray:
    """Return what is stored: movement of the tip, stretched skin, bent bristles."""
    bent = force_n * friction.BRISTLE_1_M * tip.bend_m**2
    return (friction.MASS_KG * tip.slip_m_s**2 + friction.SKIN_N_M * tip.stretch_m**2 + bent) / 2


def test_the_stribeck_curve_falls_from_static_to_kinetic() -> None:
    at_one = USUAL.kinetic + (USUAL.static - USUAL.kinetic) / math.e
    found = coefficient(USUAL, np.array([0.0, USUAL.stribeck_m_s, 1.0]))
    assert found == pytest.approx([USUAL.static, at_one, USUAL.kinetic])


def test_the_tip_moves_as_scipy_solves_the_equations_of_the_bristles() -> None:
    friction, speed, force = StickSlip(), 0.1, 1.0

    def slope(_: float, state: np.ndarray) -> list[float]:
        stretch, slip, bend = state
        fading = math.exp(-((slip / friction.stribeck_m_s) ** 2))
        curve = friction.kinetic + (friction.static - friction.kinetic) * fading
        bending = slip - friction.BRISTLE_1_M * abs(slip) * bend / curve
        rubbing = friction.BRISTLE_1_M * bend + friction.BRISTLE_S_M * fading * bending + friction.viscous_s_m * slip
        pull = friction.SKIN_N_M * stretch + friction.SKIN_N_S_M * (speed - slip)
        return [speed - slip, (pull - force * rubbing) / friction.MASS_KG, bending]

    times_s = np.arange(1, 61) * 1e-3
    solved = solve_ivp(
        slope, (0.0, 0.06), (0.0, 0.0, 0.0), 'LSODA', times_s, rtol=1e-7, atol=1e-7 * np.array([1e-4, 1e-2, 1e-6])
    )
    tip, _ = steadily(friction, speed, force, 0.06, 2e-6)
    at = np.arange(1, 61) * 500 - 1
    assert np.allclose(tip.stretch_m[at], solved.y[0], atol=0.01 * np.ptp(solved.y[0]))


@pytest.mark.parametrize('speed_m_s', [-0.3, 0.02, 0.08, 0.3])
def test_steady_sliding_meets_the_friction_of_the_stribeck_curve(speed_m_s: float) -> None:
    friction = with_skin(SKIN_N_S_M=20.0, viscous_s_m=0.3)  # damped so well that no speed vibrates
    _, pull = steadily(friction, speed_m_s, 2.0, 0.8)
    assert pull[-1] == pytest.approx(steady_force_n(friction, np.array(speed_m_s), 2.0), rel=1e-4)


def test_before_it_slides_a_tip_is_held_by_the_stiffness_of_the_bristles() -> None:
    friction, force_n = with_skin(BRISTLE_1_M=2e4), 2.0
    tip, pull = steadily(friction, 1e-5, force_n, 0.2)  # pulls with a few thousandths of the static friction
    assert pull[-1] / tip.bend_m[-1] == pytest.approx(force_n * friction.BRISTLE_1_M, rel=4e-3)
    assert tip.bend_m[-1] == pytest.approx(np.sum(tip.slip_m_s) * STEP_S, rel=2e-3)


def test_a_slowly_dragged_tip_sticks_and_slips_with_the_period_of_the_formula() -> None:
    friction = with_skin(stribeck_m_s=0.003, SKIN_N_S_M=0.05, BRISTLE_1_M=1e6)
    _, pull = steadily(friction, 0.004, 1.0, 1.2, 2e-5)
    releases = np.flatnonzero((pull[1:-1] > pull[:-2]) & (pull[1:-1] >= pull[2:]) & (pull[1:-1] > 0.8)) * 2e-5
    periods = np.diff(releases[np.diff(releases, prepend=-1.0) > 0.01])
    period_s, swing_n = slow_drag(friction, 0.004, 1.0)
    assert len(periods) >= 3
    assert periods == pytest.approx(period_s, rel=0.04)
    assert np.ptp(pull[len(pull) // 2 :]) == pytest.approx(swing_n, rel=0.04)


def drives(n: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return speeds and forces that are awkward, by name."""
    time, press, noisy = np.arange(n) * 2.5e-4, np.full(n, 2.0), np.random.default_rng(0)
    return {
        'standstill': (np.zeros(n), press),
        'no force': (np.full(n, 0.1), np.zeros(n)),
        'reversal': (0.1 * np.sign(np.sin(2 * np.pi * 3 * time)), press),
        'lift-off and contact again': (np.full(n, 0.1), np.maximum(0.0, 2.0 * np.sin(2 * np.pi * 4 * time))),
        'stop and go': (0.05 * (np.sin(2 * np.pi * 2 * time) > 0), press),
        'force that jumps to zero': (np.full(n, 0.05), np.where(time % 0.2 < 0.1, 3.0, 0.0)),
        'anything': (noisy.normal(0.0, 0.3, n), np.maximum(0.0, noisy.normal(1.0, 2.0, n))),
        'pumping': (np.zeros(n), 2.0 + 1.9 * np.sin(2 * np.pi * 220 * time)),
    }


@pytest.mark.parametrize('name', list(drives(1)))
@pytest.mark.parametrize(
    'friction', [USUAL, with_skin(BRISTLE_1_M=1e7), with_skin(BRISTLE_S_M=80.0), StickSlip(viscous_s_m=1.0)]
)
def test_whatever_happens_no_energy_comes_from_nowhere(name: str, friction: StickSlip) -> None:
    speed, force = drives(4000)[name]
    # Up to damping over stiffness of the skin the integrator provably never adds energy.
    assert friction.SKIN_N_S_M / friction.SKIN_N_M >= 2.5e-4
    tip = drag(friction, speed, force, 2.5e-4)
    assert np.isfinite(pull_n(friction, tip, speed)).all()
    assert np.abs(tip.bend_m).max() <= 1.2 * friction.static / friction.BRISTLE_1_M or name == 'anything'
    stretch = np.concatenate([[0.0], tip.stretch_m])[:-1]
    put_in = (friction.SKIN_N_M * stretch + friction.SKIN_N_S_M * (speed - tip.slip_m_s)) * speed * 2.5e-4
    stored = energy_j(friction, tip, force)
    lost = np.concatenate([[0.0], stored])[:-1] + put_in - stored
    assert lost.min() > -1e-12


def test_a_tip_left_alone_comes_to_rest_and_stays() -> None:
    tip = drag(USUAL, np.zeros(4000), np.ones(4000), 2.5e-4, start=Tip(5e-4, 0.3, 0.0), force_before_n=1.0)
    assert np.abs(tip.slip_m_s[-10:]).max() < 1e-9
    assert (np.diff(energy_j(USUAL, tip, np.ones(4000))) <= 1e-15).all()


def test_friction_that_makes_no_sense_is_refused() -> None:
    most = PASSIVE * USUAL.kinetic / USUAL.stribeck_m_s
    with_skin(BRISTLE_S_M=0.99 * most)
    with pytest.raises(InvalidParameter, match='never put in; raise kinetic'):
        with_skin(BRISTLE_S_M=1.01 * most)
    with pytest.raises(InvalidParameter, match='2 kinds of friction; name one of'):
        table(HANGS, GLIDES)
    for kind in (HANGS, GLIDES):
        with pytest.raises(InvalidParameter, match='below the kinetic one'):
            table({**kind, 'static': 0.3, 'kinetic': 0.4})


# -- along a path, and through a whole sensor


def along_x(x_m: np.ndarray, force_n: float = 2.0) -> Trajectory:
    return Trajectory(x_m, np.zeros_like(x_m), np.full_like(x_m, force_n))


def glided_n(speed_m_s: np.ndarray, force_n: float = 1.0, **values: float) -> np.ndarray:
    path = along_x(np.cumsum(speed_m_s) / RATE_HZ, force_n)
    friction = SlidingFriction(**values)
    return SlidingDrag(friction, RATE_HZ).advance(path) / friction.FORCE_COUPLING


def table(*terms: dict, sensor: str = 'tsf85') -> Scene:
    return scene_from('test', {'sensor': sensor, 'surfaces': {'sheet': list(terms)}})


def slides(scene: Scene, count: int, *how: float, seed: int = 0) -> np.ndarray:
    return simulate_slides(scene, 'sheet', count, SimulatedSlide(*how), np.random.default_rng(seed))


def test_a_path_in_blocks_senses_like_the_whole() -> None:
    path = along_x(0.05 / RATE_HZ * np.arange(600))
    whole = TipDrag(USUAL, RATE_HZ).advance(path)
    follower = TipDrag(USUAL, RATE_HZ)
    parts = [follower.advance(path.at(slice(first, first + 7))) for first in range(0, 600, 7)]
    assert np.allclose(np.concatenate(parts), whole, atol=1e-12)
    assert not len(follower.advance(along_x(np.zeros(0))))


def test_back_the_way_it_came_the_skin_is_pulled_the_other_way_even_after_a_rest() -> None:
    friction, there = with_skin(SKIN_N_S_M=20.0), 0.1 / RATE_HZ * np.arange(800)
    path = along_x(np.concatenate([there, np.full(200, there[-1]), there[::-1]]))
    measured = TipDrag(friction, RATE_HZ).advance(path) / friction.FORCE_COUPLING
    assert measured[[700, -50]] == pytest.approx([2.0 * 0.5, -2.0 * 0.5], rel=0.05)


@pytest.mark.parametrize('sensor', SENSORS)
def test_every_sensor_senses_a_skin_that_hangs_and_lets_go(sensor: str) -> None:
    smooth, hangs = (slides(table(*terms, sensor=sensor), 3, 0.05, 1.5, 0.3) for terms in ([], [HANGS]))
    assert np.isfinite(hangs).all()
    assert (smooth.std(axis=1) < 0.01 * hangs.std(axis=1)).all()


def test_the_skin_lets_go_as_often_as_the_formula_of_slow_drag_predicts() -> None:
    scene = table(HANGS)
    measured = slides(scene, 1, 0.01, 1.5, 4.0)[0, :, 0]
    jumps = np.flatnonzero(np.abs(measured) > 0.5 * np.abs(measured).max()) / 1000
    times_s = jumps[np.diff(jumps, prepend=-1.0) > 0.02]
    assert np.diff(times_s).mean() == pytest.approx(slow_drag(scene.surface('sheet').friction, 0.01, 1.5)[0], rel=0.1)


def test_slides_cut_out_of_longer_ones_begin_anywhere_in_the_cycle_and_a_seed_is_one_of_them() -> None:
    first, again = (slides(table(HANGS), 3, 0.02, 1.5, 0.3, seed=1)[..., 0] for _ in range(2))
    assert np.array_equal(first, again)
    assert np.abs(np.corrcoef(first)[np.triu_indices(3, 1)]).max() < 0.9


def test_gliding_pulls_as_the_stribeck_curve_predicts_and_builds_up_without_a_jump() -> None:
    values = {'static': 0.9, 'kinetic': 0.5, 'stribeck_m_s': 0.05, 'viscous_s_m': 0.1}
    for speed_m_s in (0.01, 0.05, 0.2):
        expected = 0.5 + 0.4 * np.exp(-((speed_m_s / 0.05) ** 2)) + 0.1 * speed_m_s
        assert glided_n(np.full(50, speed_m_s), 2.0, **values) == pytest.approx(2.0 * expected, rel=0.01)
    pull = glided_n(np.concatenate([np.zeros(10), np.linspace(0, 0.05, 500), np.linspace(0.05, -0.05, 1000), [0.0]]))
    assert not pull[:10].any()
    assert pull[-1] == pytest.approx(0.0)
    assert np.abs(np.diff(pull)[:-2]).max() < 2 * 0.05 / 500 / CREEP_M_S
