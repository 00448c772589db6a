# SPDX-License-Identifier: Apache-2.0
import itertools
import math

import pytest

from texture_core.errors import MotionRefused
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.motions import CROSS_SLIDE_DEFAULTS as DEFAULTS
from texture_exploration.motions import cross_slide
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import TouchParams

CROSS = ExplorationRequest('cross_slide')
LEG_S = DEFAULTS['distance_m'] / DEFAULTS['speed_m_s']


def sliding(table):
    return [(s, p) for s, p in zip(table.states, table.places, strict=True) if s.phase is Phase.SLIDE]


def guaranteed(table, direction_rad):
    """Return for how long a direction was guaranteed, s, and the states that did so."""
    states = [
        s for s, _ in sliding(table) if s.steady_s > 0 and math.isclose(s.direction_rad, direction_rad, abs_tol=1e-6)
    ]
    return (states[-1].stamp_ns - states[0].stamp_ns) * 1e-9 + states[-1].steady_s, states


@pytest.mark.parametrize('heading', [0.0, 0.5 * math.pi])
def test_each_leg_is_guaranteed_for_its_whole_length(table, heading):
    assert table.explore(ExplorationRequest('cross_slide', direction_rad=heading)).success
    for direction in (heading, math.remainder(heading + 0.5 * math.pi, 2 * math.pi)):
        lasted_s, states = guaranteed(table, direction)
        assert lasted_s == pytest.approx(LEG_S, abs=0.05)
        assert max(b.stamp_ns - a.stamp_ns for a, b in itertools.pairwise(states)) < 50_000_000


def test_nothing_is_guaranteed_between_the_legs(table):
    table.explore(CROSS)
    between = [s for s, _ in sliding(table) if 0.01 < s.direction_rad < 0.5 * math.pi - 0.01]
    assert len(between) >= 3
    assert all(state.steady_s == 0 for state in between)
    spans = [(s.stamp_ns, s.stamp_ns + s.steady_s * 1e9) for s, _ in sliding(table) if s.steady_s > 0]
    assert not any(begin <= state.stamp_ns < end for state in between for begin, end in spans)


def test_the_second_leg_is_straight_and_at_right_angles_to_the_first(table):
    table.explore(CROSS)
    first = [p for s, p in sliding(table) if s.steady_s > 0 and s.direction_rad == 0.0]
    second = [p for s, p in sliding(table) if s.steady_s > 0 and s.direction_rad > 1.0]
    assert max(abs(y - table.home[1]) for _, y, _ in first) < 2e-4
    assert max(x for x, _, _ in second) - min(x for x, _, _ in second) < 2e-4
    assert second[-1][1] - second[0][1] == pytest.approx(DEFAULTS['distance_m'], abs=0.003)


def test_the_corner_exceeds_no_acceleration_and_keeps_the_speed(table):
    table.explore(ExplorationRequest('cross_slide', speed_m_s=0.1, distance_m=0.05))
    states = [s for s, _ in sliding(table)]
    velocities = [(s.stamp_ns, s.speed_m_s, s.direction_rad) for s in states]
    assert min(speed for _, speed, _ in velocities) > 0.09
    vectors = [(t, v * math.cos(a), v * math.sin(a)) for t, v, a in velocities]
    steps = [math.hypot(b[1] - a[1], b[2] - a[2]) / ((b[0] - a[0]) * 1e-9) for a, b in itertools.pairwise(vectors)]
    assert max(steps) < 1.2 * TouchParams().acceleration_m_s2


@pytest.mark.parametrize('heading', [0.0, 0.5, math.pi])
def test_legs_that_leave_the_workspace_are_refused_with_the_longest_that_do_not(heading):
    home = (0.1, 0.1, 0.01)
    request = ExplorationRequest('cross_slide', distance_m=0.4, direction_rad=heading)
    with pytest.raises(MotionRefused, match='the length of each of two legs') as refused:
        cross_slide(request, home, TouchParams(), SafetyLimits())
    allowed = float(str(refused.value).split()[-2])
    assert 0.0 < allowed < 0.3
    fitting = ExplorationRequest('cross_slide', distance_m=allowed, direction_rad=heading)
    cross_slide(fitting, home, TouchParams(), SafetyLimits())


def test_the_longest_legs_stay_within_the_workspace(make_table):
    table = make_table(limits=SafetyLimits(x_high_m=0.06, y_high_m=0.06))
    with pytest.raises(MotionRefused) as refused:
        cross_slide(ExplorationRequest('cross_slide', distance_m=0.2), table.home, TouchParams(), table.limits)
    allowed = float(str(refused.value).split()[-2])
    assert table.explore(ExplorationRequest('cross_slide', distance_m=allowed)).success


@pytest.mark.parametrize('direction', [0.0, 0.5 * math.pi], ids=['first leg', 'second leg'])
def test_a_stop_on_either_leg_lifts_and_aborts(table, direction):
    def stop_on(state):
        if state.phase is Phase.SLIDE and state.steady_s > 0 and abs(state.direction_rad - direction) < 0.01:
            table.exploration.stop('enough')

    keep = table.on_state
    table.on_state = lambda state: (keep(state), stop_on(state))
    outcome = table.explore(CROSS)
    assert not outcome.success and outcome.message == 'enough'
    assert table.phases[-2:] == [Phase.LIFT, Phase.ABORTED]
    assert table.arm.state().force_n == 0
