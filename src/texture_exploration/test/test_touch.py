# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How fast the finger may come down."""

from dataclasses import replace

import pytest
from table_arm import TableArmParams

from texture_core.errors import MotionRefused
from texture_core.types import ExplorationRequest
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
