# SPDX-License-Identifier: Apache-2.0
import itertools
import math

import numpy as np
import pytest

from texture_core.errors import MotionRefused
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.simulated import SimulatedArmParams
from texture_exploration.motions import in_hand_random, in_hand_sliding, random_strokes
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import TouchParams

RUB = ExplorationRequest('in_hand_sliding')


def sliding(table):
    return [(s, p) for s, p in zip(table.states, table.places, strict=True) if s.phase is Phase.SLIDE]


def test_two_seconds_of_sliding_stay_within_the_stroke(table):
    assert table.explore(RUB).success
    states = [state for state, _ in sliding(table)]
    assert (states[-1].stamp_ns - states[0].stamp_ns) * 1e-9 == pytest.approx(2.0, abs=0.05)
    along = [place[0] for place in table.places]
    assert min(along) == pytest.approx(0.0, abs=0.0005)
    assert max(along) == pytest.approx(0.02, abs=0.0005)


def test_nothing_is_guaranteed_for_a_turn(table):
    table.explore(RUB)
    guaranteed = [(s.stamp_ns, s.stamp_ns + s.steady_s * 1e9) for s, _ in sliding(table)]
    slow = [s.stamp_ns for s, _ in sliding(table) if abs(s.speed_m_s - 0.02) > 0.0005]
    assert len(slow) >= 5
    assert not any(begin <= stamp < end for stamp in slow for begin, end in guaranteed if end > begin)


def guaranteed_speeds(table, request):
    """Explore, and return the true speeds at all times for which a steady one was guaranteed, m/s."""
    speeds, pace = [], table.pace

    def watched():
        pace()
        speeds.append((table.now_ns, math.hypot(*table.arm.state().velocity[:2])))

    table.pace = watched
    assert table.explore(request).success
    guaranteed = [(s.stamp_ns, s.stamp_ns + s.steady_s * 1e9) for s, _ in sliding(table)]
    return [speed for stamp, speed in speeds if any(begin <= stamp < end for begin, end in guaranteed)]


@pytest.mark.parametrize('lag_s', [0.008, 0.02, 0.05])
def test_after_a_turn_a_late_arm_is_steady_only_when_it_has_turned(make_table, lag_s):
    table = make_table(SimulatedArmParams(force_mode=False, loop_delay_s=lag_s, start_height_m=0.002))
    speeds = guaranteed_speeds(table, RUB)
    assert len(speeds) > 100
    begun_within = abs(speeds[0] / 0.02 - 1)
    assert begun_within <= table.touch.speed_tolerance
    assert max(abs(speed / 0.02 - 1) for speed in speeds[1:]) <= 0.02


def test_the_direction_alternates(table):
    table.explore(RUB)
    directions = [round(abs(state.direction_rad), 3) for state, _ in sliding(table)]
    assert set(directions) == {0.0, 3.142}


def test_no_turn_exceeds_the_acceleration(table):
    table.explore(ExplorationRequest('in_hand_sliding', speed_m_s=0.1, distance_m=0.08))
    velocities = [(s.stamp_ns, p) for s, p in sliding(table)]
    speeds = [(b[1][0] - a[1][0]) / ((b[0] - a[0]) * 1e-9) for a, b in itertools.pairwise(velocities)]
    assert max(abs(b - a) / 0.02 for a, b in itertools.pairwise(speeds)) < 1.1


def test_a_stroke_too_short_to_turn_is_refused():
    request = ExplorationRequest('in_hand_sliding', speed_m_s=0.1, distance_m=0.01)
    with pytest.raises(MotionRefused, match=r'the length of a stroke, is 0\.01; allowed is 0\.0'):
        in_hand_sliding(request, (0.0, 0.0, 0.01), TouchParams(), SafetyLimits())


def turning_places(table):
    """Return where the finger turned, as seen from the start, m."""
    along = [place[0] for _, place in sliding(table)]
    return [b for a, b, c in zip(along, along[1:], along[2:], strict=False) if (b - a) * (c - b) < 0]


def test_random_strokes_stay_within_the_stroke_and_are_at_least_half_as_long():
    for seed in range(20):
        end_of = random_strokes(0.02, np.random.default_rng(seed))
        places = [0.0]
        for number in range(20):
            places.append(end_of(number % 2 == 0, places[-1]))
        assert min(places) >= 0.0 and max(places) <= 0.02
        lengths = [abs(b - a) for a, b in itertools.pairwise(places)]
        assert min(lengths) >= 0.01 - 1e-12
        assert np.ptp(lengths) > 0.001


def test_a_finger_rubs_at_random_places_and_turns_elsewhere_each_time(table):
    assert table.explore(ExplorationRequest('in_hand_random', duration_s=10.0)).success
    along = [place[0] for place in table.places]
    assert min(along) > -0.0005 and max(along) < 0.0205
    places = turning_places(table)
    assert len({round(place, 4) for place in places}) > 4  # without chance it turns at two; chance may repeat one


def test_a_random_stroke_may_be_half_as_long_so_the_shortest_that_turns_is_twice_that():
    request = ExplorationRequest('in_hand_random', speed_m_s=0.05, distance_m=0.02)
    in_hand_sliding(
        ExplorationRequest('in_hand_sliding', speed_m_s=0.05, distance_m=0.02),
        (0.0, 0.0, 0.01),
        TouchParams(),
        SafetyLimits(),
    )
    with pytest.raises(MotionRefused, match=r'in_hand_random: distance_m, the length of a stroke, is 0\.02; allowed'):
        in_hand_random(request, (0.0, 0.0, 0.01), TouchParams(), SafetyLimits())
