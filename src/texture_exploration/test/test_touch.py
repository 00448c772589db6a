# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How fast the finger may come down, and what it may meet."""

from dataclasses import replace

import pytest
from table_arm import TableArmParams

from texture_core.errors import MotionAborted, MotionRefused
from texture_core.types import ExplorationRequest
from texture_exploration.arms.arm import ArmState
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import ApproachStage, GoHomeStage
from texture_exploration.touch import REACTION_S, TouchParams

TOUCH = TouchParams(approach_speed_m_s=0.1, approach_stiffness_n_m=2000.0)


@pytest.mark.parametrize('force_n', [0.5, 1.4, 6.0])
@pytest.mark.parametrize('watchdog_s', [0.1, 0.15, 0.9])
def test_until_the_watchdog_stops_the_arm_the_force_stays_below_its_fraction_of_the_wanted_one(force_n, watchdog_s):
    speed_m_s = TOUCH.approach_m_s(force_n, watchdog_s)
    assert 2000.0 * speed_m_s * (watchdog_s + REACTION_S) == pytest.approx(1.5 * force_n)


def test_an_arm_that_stops_at_once_and_a_small_force_are_approached_as_the_reaction_allows():
    assert TOUCH.approach_m_s(1.0) == pytest.approx(0.8 / (2000.0 * 0.03))
    assert TOUCH.approach_m_s(0.1, 0.1) == TOUCH.approach_m_s(0.1)


@pytest.mark.parametrize(
    ('stiffness_n_m', 'message'),
    [(2e4, 'no surface within 0.004 m'), (2e5, 'as the arm continues for 900 ms without a command')],
)
def test_an_approach_that_a_watchdog_slows_down_may_take_longer_and_one_too_slow_says_why(
    make_table, stiffness_n_m, message
):
    """At 20 kN/m an arm that is deaf for 0.9 s comes down at 0.08 instead of 1.3 mm/s."""
    table = make_table(touch=TouchParams(approach_stiffness_n_m=stiffness_n_m, approach_travel_m=0.004))
    state = table.arm.state
    table.arm.state = lambda: replace(state(), watchdog_s=0.9)
    outcome = table.explore(ExplorationRequest('linear_slide', speed_m_s=0.01, force_n=1.0, distance_m=0.02))
    assert message in outcome.message
    assert (table.states[-1].stamp_ns - table.states[0].stamp_ns) * 1e-9 > 40.0


@pytest.mark.parametrize(('delay_s', 'allowed'), [(0.0, '0.125'), (0.02, '0.0514'), (0.05, '0.0273'), (0.1, '0.0153')])
def test_a_slide_too_fast_for_a_wall_as_declared_is_refused_before_anything_moves(make_table, delay_s, allowed):
    """Force limit and 3.5 times as much more: stiffness × speed × (delay + 14 ms)."""
    arm = TableArmParams(force_mode=False, loop_delay_s=delay_s, max_stiffness_n_m=20000.0, max_impact_n=1.0)
    table = make_table(arm, TouchParams(approach_stiffness_n_m=20000.0))
    with pytest.raises(
        MotionRefused, match=rf'a wall of 20000 N/m .* 45 N, .* allowed is at most {allowed} m/s'
    ) as error:
        table.explore(ExplorationRequest('linear_slide', speed_m_s=0.13))
    assert error.value.field == 'speed_m_s'
    assert table.states == []


def end(stage, *forces_n):
    """Return how a stage ends at states with these forces on a finger 10 mm above the surface; '' if it does not."""
    stage.begin(1, ArmState(1, (0.0, 0.0, 0.01), (0.0, 0.0, 0.0), 0.0))
    try:
        for number, (x_n, y_n, z_n) in enumerate(forces_n):
            arm = ArmState(2 + number, (0.0, 0.0, 0.01), (0.0, 0.0, 0.0), z_n, along_n=(x_n, y_n))
            if stage.step(arm.time_ns, arm) is None:
                return 'contact'
    except MotionAborted as error:
        return str(error)
    return ''


@pytest.mark.parametrize(
    ('force_n', 'sentence'),
    [
        ((0.0, 0.0, 0.19), ''),
        ((0.0, 0.0, 0.21), 'contact'),
        ((1.9, 0.0, 1.0), 'contact'),  # of a finger that slides down a slope
        ((2.1, 0.0, 1.0), 'met something from the side'),
        ((0.0, 0.0, -0.21), 'its sign is wrong'),
    ],
)
def test_what_the_finger_comes_down_on_pushes_it_up_within_friction(force_n, sentence):
    stage = ApproachStage(1.0, TouchParams(contact_force_n=0.2), SafetyLimits(friction_limit=2.0))
    assert (sentence in end(stage, force_n)) if sentence else end(stage, force_n) == ''


@pytest.mark.parametrize(('force_n', 'met'), [(0.69, False), (0.71, True)])
def test_on_the_way_to_the_start_a_change_by_the_force_of_contact_aborts(force_n, met):
    stage = GoHomeStage((0.05, 0.0, 0.01), TouchParams(contact_force_n=0.2), SafetyLimits())
    assert ('met something on the way' in end(stage, (0.0, 0.0, 0.5), (0.0, 0.0, force_n))) is met
