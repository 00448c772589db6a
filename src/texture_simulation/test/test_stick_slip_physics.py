# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

from texture_core.errors import InvalidData, InvalidParameter
from texture_simulation.friction import (
    PASSIVE,
    StickSlip,
    Tip,
    coefficient,
    critical_speed_m_s,
    drag,
    energy_j,
    jacobian,
    nudged,
    pull_n,
    rate,
    slope_s_m,
    slow_drag,
    steady_force_n,
)

STEP_S = 5e-5
USUAL = StickSlip()


def steadily(friction: StickSlip, speed_m_s: float, force_n: float, duration_s: float, step_s: float = STEP_S):
    speed = np.full(round(duration_s / step_s), speed_m_s)
    tip = drag(friction, speed, np.full_like(speed, force_n), step_s)
    return tip, pull_n(friction, tip, speed)


def test_the_stribeck_curve_falls_from_static_to_kinetic() -> None:
    assert coefficient(USUAL, np.array(0.0)) == USUAL.static
    assert coefficient(USUAL, np.array(1.0)) == pytest.approx(USUAL.kinetic)
    at_one = USUAL.kinetic + (USUAL.static - USUAL.kinetic) / math.e
    assert coefficient(USUAL, np.array(USUAL.stribeck_m_s)) == pytest.approx(at_one)
    step = 1e-6
    by_difference = (coefficient(USUAL, np.array(0.03 + step)) - coefficient(USUAL, np.array(0.03 - step))) / (2 * step)
    assert slope_s_m(USUAL, np.array(0.03)) == pytest.approx(by_difference, rel=1e-6)


@pytest.mark.parametrize('speed_m_s', [-0.3, 0.02, 0.08, 0.3])
def test_steady_sliding_meets_the_friction_of_the_stribeck_curve(speed_m_s: float) -> None:
    friction = StickSlip(skin_n_s_m=20.0, viscous_s_m=0.3)  # damped so well that no speed vibrates
    _, pull = steadily(friction, speed_m_s, 2.0, 0.8)
    assert pull[-1] == pytest.approx(steady_force_n(friction, np.array(speed_m_s), 2.0), rel=1e-4)


def test_before_it_slides_a_tip_is_held_by_the_stiffness_of_the_bristles() -> None:
    friction, force_n, speed_m_s = StickSlip(bristle_1_m=2e4), 2.0, 1e-5
    tip, pull = steadily(friction, speed_m_s, force_n, 0.2)  # pulls with a few thousandths of the static friction
    assert pull[-1] / tip.bend_m[-1] == pytest.approx(
        force_n * friction.bristle_1_m, rel=4e-3
    )  # they creep and are damped
    moved_m = np.sum(tip.slip_m_s) * STEP_S
    assert tip.bend_m[-1] == pytest.approx(moved_m, rel=2e-3)


def test_a_slowly_dragged_tip_sticks_and_slips_with_the_period_of_the_formula() -> None:
    friction = StickSlip(stribeck_m_s=0.003, skin_n_s_m=0.05, bristle_1_m=1e6)
    speed_m_s, force_n = 0.004, 1.0
    _, pull = steadily(friction, speed_m_s, force_n, 1.2, 2e-5)
    releases = np.flatnonzero((pull[1:-1] > pull[:-2]) & (pull[1:-1] >= pull[2:]) & (pull[1:-1] > 0.8)) * 2e-5
    periods = np.diff(releases[np.diff(releases, prepend=-1.0) > 0.01])
    expected = slow_drag(friction, speed_m_s, force_n)
    undamped_s = 2 * (friction.static - friction.kinetic) * force_n / (friction.skin_n_m * speed_m_s)
    assert expected.period_s == pytest.approx(undamped_s, rel=0.1)
    assert len(periods) >= 3
    assert periods == pytest.approx(expected.period_s, rel=0.04)
    assert np.ptp(pull[len(pull) // 2 :]) == pytest.approx(expected.swing_n, rel=0.04)


def test_steady_sliding_is_stable_from_the_critical_speed_on() -> None:
    critical = critical_speed_m_s(USUAL, 1.0)
    assert USUAL.skin_n_s_m + 1.0 * slope_s_m(USUAL, np.array(critical)) == pytest.approx(0.0, abs=1e-6)
    swings = []
    for share in (0.96, 1.04):
        speed = np.full(30_000, share * critical)
        tip = drag(
            USUAL, speed, np.ones(30_000), STEP_S, start=nudged(USUAL, share * critical, 1.0), force_before_n=1.0
        )
        swings.append(np.ptp(pull_n(USUAL, tip, speed)[-2000:]))
    assert swings[0] > 0.3
    assert swings[1] < 1e-9


def test_a_well_damped_or_constant_friction_is_stable_at_all_speeds() -> None:
    assert critical_speed_m_s(StickSlip(skin_n_s_m=50.0), 1.0) == 0.0
    assert critical_speed_m_s(StickSlip(static=0.5, kinetic=0.5), 1.0) == 0.0


@pytest.mark.parametrize('slip_m_s', [0.0, 0.02, 0.3])
def test_the_linearised_movement_is_the_derivative_of_the_rate(slip_m_s: float) -> None:
    curve = float(coefficient(USUAL, np.array(slip_m_s)))
    bend_m = curve / USUAL.bristle_1_m if slip_m_s else 0.0
    steady = np.array([1e-3, slip_m_s, bend_m])
    columns = []
    for i, small in enumerate((1e-7, 1e-8, 1e-10)):
        ahead, behind = (Tip(*(steady + sign * small * np.eye(3)[i])) for sign in (1, -1))
        difference = np.subtract(rate(USUAL, ahead, 0.1, 2.0), rate(USUAL, behind, 0.1, 2.0))
        columns.append(difference / (2 * small))
    exact = jacobian(USUAL, slip_m_s, 2.0)
    assert np.allclose(np.transpose(columns), exact, rtol=1e-3, atol=1e-6 * np.abs(exact).max())


def drives(n: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return speeds and forces that are awkward, by name."""
    time = np.arange(n) * 2.5e-4
    press = np.full(n, 2.0)
    lifting = np.maximum(0.0, 2.0 * np.sin(2 * np.pi * 4 * time))
    noisy = np.random.default_rng(0)
    return {
        'standstill': (np.zeros(n), press),
        'no force': (np.full(n, 0.1), np.zeros(n)),
        'reversal': (0.1 * np.sign(np.sin(2 * np.pi * 3 * time)), press),
        'lift-off and contact again': (np.full(n, 0.1), lifting),
        'stop and go': (0.05 * (np.sin(2 * np.pi * 2 * time) > 0), press),
        'force that jumps to zero': (np.full(n, 0.05), np.where(time % 0.2 < 0.1, 3.0, 0.0)),
        'anything': (noisy.normal(0.0, 0.3, n), np.maximum(0.0, noisy.normal(1.0, 2.0, n))),
        'pumping': (np.zeros(n), 2.0 + 1.9 * np.sin(2 * np.pi * 220 * time)),
    }


@pytest.mark.parametrize('name', list(drives(1)))
@pytest.mark.parametrize(
    'friction', [USUAL, StickSlip(bristle_1_m=1e7), StickSlip(bristle_s_m=80.0), StickSlip(viscous_s_m=1.0)]
)
def test_whatever_happens_no_energy_comes_from_nowhere(name: str, friction: StickSlip) -> None:
    speed, force = drives(4000)[name]
    assert friction.passive_step_s >= 2.5e-4
    tip = drag(friction, speed, force, 2.5e-4)
    pull = pull_n(friction, tip, speed)
    assert np.isfinite(pull).all()
    kept_m = np.abs(tip.bend_m).max()
    assert kept_m <= 1.2 * friction.static / friction.bristle_1_m or name == 'anything'
    stretch = np.concatenate([[0.0], tip.stretch_m])[:-1]
    put_in = (friction.skin_n_m * stretch + friction.skin_n_s_m * (speed - tip.slip_m_s)) * speed * 2.5e-4
    stored = energy_j(friction, tip, force)
    lost = np.concatenate([[0.0], stored])[:-1] + put_in - stored
    assert lost.min() > -1e-12


def test_a_tip_left_alone_comes_to_rest_and_stays() -> None:
    start = Tip(5e-4, 0.3, 0.0)
    tip = drag(USUAL, np.zeros(4000), np.full(4000, 1.0), 2.5e-4, start=start, force_before_n=1.0)
    assert np.abs(tip.slip_m_s[-10:]).max() < 1e-9
    stored = energy_j(USUAL, tip, 1.0)
    assert (np.diff(stored) <= 1e-15).all()


def test_friction_that_would_give_out_work_is_refused() -> None:
    most = PASSIVE * USUAL.kinetic / USUAL.stribeck_m_s
    StickSlip(bristle_s_m=0.99 * most)
    with pytest.raises(InvalidParameter, match='never put in; lower it'):
        StickSlip(bristle_s_m=1.01 * most)
    with pytest.raises(InvalidParameter, match='at least as much'):
        StickSlip(static=0.3, kinetic=0.4)


@pytest.mark.parametrize(
    ('speed', 'force', 'sentence'),
    [
        (np.zeros(3), np.zeros(4), 'one of each'),
        (np.array([0.0, np.nan]), np.zeros(2), 'not finite'),
        (np.zeros(2), np.array([1.0, -0.1]), '0 or more'),
    ],
)
def test_what_no_finger_does_is_refused(speed: np.ndarray, force: np.ndarray, sentence: str) -> None:
    with pytest.raises(InvalidData, match=sentence):
        drag(USUAL, speed, force, 2.5e-4)
