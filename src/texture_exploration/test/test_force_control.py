# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The force loop alone."""

import math

import numpy as np
import pytest

from texture_core.types import ExplorationRequest
from texture_exploration.arms.simulated import SimulatedArmParams
from texture_exploration.force_control import (
    ContactState,
    ForceController,
    ForceLoop,
    ForceLoopParams,
    LagEstimate,
    SlopeObserver,
    StiffnessEstimate,
    fitted_lag_s,
    spectral_radius,
)
from texture_exploration.stages import TouchParams

PERIOD_S = 0.004


@pytest.mark.parametrize('lag_s', [0.0, 0.004, 0.02, 0.1])
@pytest.mark.parametrize('speed_m_s', [-0.0005, -0.02, 0.05])
def test_the_lag_of_an_arm_is_measured_from_its_first_movement(speed_m_s, lag_s):
    rng, estimate = np.random.default_rng(2), LagEstimate()
    for time_s in np.arange(100) * PERIOD_S:
        height_m = 0.01 + speed_m_s * max(0.0, time_s - lag_s) + 1e-6 * rng.standard_normal()
        estimate.update(height_m, speed_m_s, PERIOD_S)
    assert estimate.value_s == pytest.approx(lag_s, abs=0.003)


def test_a_lag_is_not_measured_on_an_arm_that_was_still_moving():
    estimate = LagEstimate()
    for asked_m_s in [0.0] * 50 + [-0.02] * 20 + [0.0] * 5 + [-0.01] * 100:
        estimate.update(0.0, asked_m_s, PERIOD_S)  # it does not follow at all
    assert math.isnan(estimate.value_s)


@pytest.mark.parametrize('stiffness', [100.0, 1e3, 1e4, 1e5])
@pytest.mark.parametrize('delay', [0.0, 0.005, 0.02])
def test_the_chosen_gain_is_stable_with_twice_the_stiffness_or_twice_the_delay(stiffness, delay):
    gain = ForceLoopParams(loop_delay_s=delay).default_gain(stiffness, PERIOD_S)
    for params, estimated_n_m in [
        (ForceLoopParams(loop_delay_s=delay), 2 * stiffness),
        (ForceLoopParams(loop_delay_s=2 * delay), stiffness),
    ]:
        assert spectral_radius(params.loop(estimated_n_m, PERIOD_S, gain)) < 1.0


def test_the_stiffness_is_measured_from_the_rise_of_the_force():
    estimate = StiffnessEstimate()
    for depth in np.linspace(0.0, 4e-4, 8):
        estimate.update(0.003 - depth, 1500.0 * depth)
    assert estimate.value_n_m == pytest.approx(1500.0)


def test_a_limited_speed_does_not_wind_up():
    controller = ForceController(0.01, integral_s=0.1, max_speed_m_s=0.02)
    for _ in range(1000):
        assert controller.update(10.0, PERIOD_S) == -0.02
    assert controller.update(-0.1, PERIOD_S) > 0.0


def test_the_observer_sees_a_slope_at_once_when_the_speed_changes():
    observer, travelled = SlopeObserver(ahead_s=0.01), 0.0
    for step in range(200):
        speed = 0.05 * step / 200
        travelled += speed * PERIOD_S
        rise = observer.update(travelled, 0.1 * travelled, speed, noise_m=1e-6)
    assert rise == pytest.approx(0.1 * speed, rel=0.02)


def test_the_observer_sees_where_a_bend_leads():
    observer, ahead_m = SlopeObserver(ahead_s=0.01), 0.05 * 0.01
    for travelled in np.arange(40) * 2e-4:
        rise = observer.update(travelled, 5.0 * travelled**2, 0.05, noise_m=1e-9)
    assert rise == pytest.approx(0.05 * 2 * 5.0 * (travelled + ahead_m), rel=0.01)


def test_a_finger_at_rest_is_pressed_on_no_faster_than_the_stiffest_base_allows():
    params = ForceLoopParams(loop_delay_s=0.008, max_stiffness_n_m=20000.0)
    loop, height_m, force_n = ForceLoop(params, PERIOD_S), 0.0, 0.05
    for period in range(100):
        contact = ContactState(round(period * PERIOD_S * 1e9), height_m, 0.0, force_n)
        loop.observe(contact)
        speed_m_s = loop.velocity_m_s(1.0, contact, 0.0, PERIOD_S)
        height_m, force_n = height_m + speed_m_s * PERIOD_S, force_n - 200.0 * speed_m_s * PERIOD_S
        # 1 N on 20 kN/m within 8 ms and two periods of 4 ms.
        assert speed_m_s >= -1.0 / 20000.0 / 0.016 - 1e-12


def test_a_new_gain_goes_on_at_the_speed_that_the_integral_part_has():
    controller = ForceController(3e-4, integral_s=0.5)
    for _ in range(500):
        controller.update(0.8, PERIOD_S)
    before_m_s = controller.update(0.0, PERIOD_S)
    controller.gain_m_s_n = 3e-2
    assert controller.update(0.0, PERIOD_S) == pytest.approx(before_m_s)


@pytest.mark.parametrize('seed', range(20))
def test_a_noisy_force_does_not_choose_the_stiffness(seed):
    """A slow rise to 0.3 N with 20 mN of noise."""
    rng, estimate = np.random.default_rng(seed), StiffnessEstimate(touching_n=0.12)
    for depth in np.linspace(0.0, 1.5e-3, 200):
        estimate.update(0.003 - depth, 200.0 * depth + 0.02 * rng.standard_normal())
    assert estimate.value_n_m == pytest.approx(200.0, rel=0.15)


@pytest.mark.parametrize('seed', range(20))
def test_noise_is_no_slope_when_a_late_arm_sets_off(seed):
    """Commanded to 30 mm/s, it has gone a few micrometres: 1 um of noise is no wall and no abyss."""
    rng, observer = np.random.default_rng(seed), SlopeObserver(ahead_s=0.06)
    heights = 1e-6 * rng.standard_normal(8)
    rises = [observer.update(1e-6 * step, height, 0.03, noise_m=1e-6, doubt=0.1) for step, height in enumerate(heights)]
    assert max(map(abs, rises)) < 3e-4  # in 60 ms 18 um, 0.36 N at 20 kN/m


# Declared and true stiffness in N/m, undeclared lag in ms, noise in mN, force that counts as touching in N.
HARD_LOOPS = [
    (20000.0, 20000.0, 50, 20, 0.03),
    (20000.0, 5000.0, 50, 20, 0.03),
    (20000.0, 20000.0, 50, 10, 0.06),
    (20000.0, 600.0, 50, 20, 0.12),
    (20000.0, 200.0, 20, 20, 0.12),
    (5000.0, 2000.0, 50, 20, 0.03),
    (5000.0, 200.0, 50, 20, 0.12),
]


@pytest.mark.parametrize('loop', HARD_LOOPS)
def test_a_late_arm_with_a_noisy_force_overshoots_by_a_fifth_at_most(make_table, loop):
    declared, true, lag_ms, noise_mn, touching_n = loop
    arm = SimulatedArmParams(
        force_mode=False,
        start_height_m=0.002,
        max_stiffness_n_m=declared,
        stiffness_n_m=true,
        undeclared_lag_s=1e-3 * lag_ms,
        force_noise_n=1e-3 * noise_mn,
        touching_n=touching_n,
    )
    table, forces = make_table(arm, TouchParams(approach_stiffness_n_m=declared)), []
    go_on = table.pace

    def pace():
        go_on()
        forces.append(table.arm.true_force_n)

    table.pace = pace
    table.explore(ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.01))
    assert 0.9 < max(forces) < 1.2


@pytest.mark.parametrize('lag_s', [0.0, 0.03, 0.1])
def test_the_lag_of_a_force_behind_its_height_is_that_of_a_spring_that_stops(lag_s):
    """Down at 1 mm/s until 0.2 s, on 2 kN/m with 10 mN of noise."""
    times_s = np.arange(0.0, 0.4, PERIOD_S)
    heights_m = np.maximum(-0.0002, -0.001 * times_s)
    forces_n = -2000.0 * np.interp(times_s - lag_s, times_s, heights_m)
    forces_n += 0.01 * np.random.default_rng(1).standard_normal(len(times_s))
    late = times_s > 0.1
    found_s = fitted_lag_s(np.stack([times_s, heights_m], axis=1), np.stack([times_s, forces_n], axis=1)[late], 0.01)
    assert found_s == pytest.approx(lag_s, abs=0.008)
