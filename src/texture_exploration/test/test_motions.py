# SPDX-License-Identifier: Apache-2.0
"""What every motion of the catalogue keeps to."""

import math
from itertools import pairwise

import pytest

from texture_core.types import ExplorationRequest, Phase
from texture_exploration.motions import MOTIONS

ORDER = [Phase.APPROACH, Phase.CONTACT, Phase.SLIDE, Phase.LIFT, Phase.DONE]


@pytest.mark.parametrize('name', MOTIONS)
def test_a_motion_with_all_defaults_slides_and_ends_lifted(table, name):
    assert table.explore(ExplorationRequest(name)).success
    assert table.phases == ORDER
    assert table.arm.state().force_n == 0


@pytest.mark.parametrize('name', MOTIONS)
def test_the_finger_keeps_its_speed_and_its_direction_is_where_it_goes(table, name):
    table.explore(ExplorationRequest(name))
    slide = [(s, p) for s, p in zip(table.states, table.places, strict=True) if s.phase is Phase.SLIDE]
    steps = [(a, b, (b[0].stamp_ns - a[0].stamp_ns) * 1e-9) for a, b in pairwise(slide)]
    guaranteed = [step for step in steps if step[2] <= step[0][0].steady_s]
    assert len(guaranteed) > 0.7 * len(steps)
    for (state, place), (_, next_place), seconds in guaranteed:
        way = math.dist(place[:2], next_place[:2])
        assert way / seconds == pytest.approx(state.speed_m_s, rel=0.02)
        heading = math.atan2(next_place[1] - place[1], next_place[0] - place[0])
        assert abs(math.remainder(heading - state.direction_rad, 2 * math.pi)) < 0.1


@pytest.mark.parametrize('name', MOTIONS)
def test_a_motion_that_is_aborted_in_the_approach_only_lifts(table, name):
    table.when[Phase.APPROACH] = lambda: table.exploration.stop('no')
    assert not table.explore(ExplorationRequest(name)).success
    assert [phase for phase in table.phases if phase is not Phase.LIFT] == [Phase.APPROACH, Phase.ABORTED]
    assert table.arm.state().position[2] >= table.home[2] - 0.001
