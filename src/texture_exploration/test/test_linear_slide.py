# SPDX-License-Identifier: Apache-2.0
import math
from itertools import pairwise

import pytest

from texture_core.errors import MotionRefused
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.motions import linear_slide
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import TouchParams


def slide_of(table):
    """Return the duration and the length of the slide."""
    (begin, start), (end, stop) = table.first(Phase.SLIDE), table.first(Phase.LIFT)
    return (end.stamp_ns - begin.stamp_ns) * 1e-9, math.dist(start[:2], stop[:2])


def test_the_phases_come_in_order(table):
    assert table.explore().success
    assert table.phases == [Phase.APPROACH, Phase.CONTACT, Phase.SLIDE, Phase.LIFT, Phase.DONE]


@pytest.mark.parametrize(('speed', 'distance'), [(0.02, 0.02), (0.05, 0.1), (0.1, 0.08)])
def test_the_slide_has_the_length_and_the_speed_that_were_asked(table, speed, distance):
    table.explore(ExplorationRequest('linear_slide', speed_m_s=speed, distance_m=distance))
    duration, length = slide_of(table)
    assert length == pytest.approx(distance, abs=0.001)
    assert length / duration == pytest.approx(speed, rel=0.02)


def test_while_sliding_speed_and_force_are_those_that_were_asked(table):
    table.explore(ExplorationRequest('linear_slide', speed_m_s=0.1, force_n=2.5))
    sliding = [state for state in table.states if state.phase is Phase.SLIDE]
    assert [state.speed_m_s for state in sliding] == pytest.approx([0.1] * len(sliding), rel=0.02)
    assert [state.force_n for state in sliding] == pytest.approx([2.5] * len(sliding), rel=0.1)


def test_the_finger_goes_where_it_was_pointed(table):
    table.explore(ExplorationRequest('linear_slide', direction_rad=math.pi / 2))
    x, y, _ = table.arm.state().position
    assert abs(x) < 1e-9
    assert y > 0.1
    assert table.first(Phase.SLIDE)[0].direction_rad == math.pi / 2


def test_what_a_slide_guarantees_it_keeps(table):
    table.explore()
    end_ns = table.first(Phase.LIFT)[0].stamp_ns
    sliding = [state for state in table.states if state.phase is Phase.SLIDE]
    guaranteed = [state.stamp_ns + int(state.steady_s * 1e9) for state in sliding]
    assert max(guaranteed) <= end_ns
    assert sliding[0].steady_s == pytest.approx(0.1)
    assert not any(state.steady_s for state in table.states if state.phase is not Phase.SLIDE)


def test_the_second_slide_begins_where_the_first_began(table):
    table.explore()
    first = table.first(Phase.SLIDE)[1]
    table.states, table.places = [], []
    assert table.explore().success
    assert math.dist(first, table.first(Phase.SLIDE)[1]) < 0.002


def test_speed_is_gained_smoothly_and_within_the_acceleration_limit(make_table):
    table = make_table(touch=TouchParams(acceleration_m_s2=0.5))
    table.explore(ExplorationRequest('linear_slide', speed_m_s=0.1))
    pushing = [state for state in table.states if state.phase is Phase.CONTACT and state.speed_m_s > 0]
    gained = [b.speed_m_s - a.speed_m_s for a, b in pairwise(pushing)]
    took = [(b.stamp_ns - a.stamp_ns) * 1e-9 for a, b in pairwise(pushing)]
    assert max(dv / dt for dv, dt in zip(gained, took, strict=True)) < 0.5 * 1.05
    assert gained[0] < 0.5 * max(gained)


def refusal(**numbers):
    request = ExplorationRequest('linear_slide', **numbers)
    with pytest.raises(MotionRefused) as refused:
        linear_slide(request, (0.0, 0.0, 0.01), TouchParams(), SafetyLimits())
    return str(refused.value)


def test_a_refusal_names_the_allowed_range():
    assert refusal(speed_m_s=2.0) == 'linear_slide: speed_m_s is 2; allowed is 0.002 to 0.25 m/s'
    assert refusal(force_n=-1.0) == 'linear_slide: force_n is -1; allowed is 0.1 to 6 N'


def test_a_default_that_is_refused_is_called_one():
    request, slow = ExplorationRequest('linear_slide'), SafetyLimits(max_speed_m_s=0.02)
    with pytest.raises(MotionRefused, match=r'speed_m_s is 0\.05 \(the default of the motion\); allowed is 0\.002 to'):
        linear_slide(request, (0.0, 0.0, 0.01), TouchParams(), slow)


def test_a_distance_beyond_both_limits_is_refused_with_the_smaller_one_at_once():
    assert 'distance_m is 2, which' in refusal(distance_m=2.0, speed_m_s=0.05)
    assert 'at most 0.192 m' in refusal(distance_m=2.0, speed_m_s=0.05)


def test_numbers_that_are_none_are_refused():
    assert 'distance_m is nan' in refusal(distance_m=math.nan)
    assert 'direction_rad is inf' in refusal(direction_rad=math.inf)


def test_a_slide_out_of_the_workspace_is_refused_with_the_longest_possible_one():
    # 0.2 m of room, less the ramp of 0.1 s and the steady 0.05 s at 0.05 m/s.
    assert 'at most 0.192 m' in refusal(speed_m_s=0.05, distance_m=0.195, force_n=1.0, direction_rad=math.pi)


def test_a_number_of_another_motion_is_refused():
    assert refusal(radius_m=0.02, turns=2.0) == 'linear_slide knows no radius_m and no turns; leave it at 0'
