# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A finger that does not move along the surface as commanded, and slides that are not what was asked for."""

import math
from dataclasses import replace

import pytest

from texture_core.errors import MotionAborted
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.arm import ArmState
from texture_exploration.arms.tool_state import ForceSample, PoseSample, RosControllersParams, ToolState
from texture_exploration.touch import TouchParams
from texture_exploration.watches import SlideWatch, StallWatch

SPEED_M_S = 0.02
STEP_S = 0.01
REST = (0.0, 0.0, 0.0)


STALL_S = TouchParams().stall_s
# Where the finger is over the time, and when it counts as stalled; None: never.
WAYS = {
    'stops after 1 s': (lambda s: SPEED_M_S * min(s, 1.0), 1.0 + 0.75 * STALL_S),
    'at 0.3 of the speed': (lambda s: 0.3 * SPEED_M_S * s, None),
    'at 0.2 of the speed': (lambda s: 0.2 * SPEED_M_S * s, STALL_S),
    'backwards': (lambda s: -SPEED_M_S * s, STALL_S),
    'trembles': (lambda s: 0.0002 * (round(s / STEP_S) % 2), STALL_S),
    'unknown': (lambda s: math.nan, STALL_S),
}


@pytest.mark.parametrize('name', WAYS)
def test_a_finger_counts_as_stalled_once_it_made_less_than_a_fraction_of_the_commanded_way(name):
    place, expected_s = WAYS[name]
    watch, stalled_s = StallWatch(TouchParams()), None
    for number in range(300):
        now_s = number * STEP_S
        try:
            watch.update(ArmState(round(now_s * 1e9), (place(now_s), 0.0, 0.0), REST, 1.0), (SPEED_M_S, 0.0))
        except MotionAborted:
            stalled_s = stalled_s or now_s
    assert stalled_s == (expected_s and pytest.approx(expected_s, abs=0.02))


@pytest.mark.parametrize('ahead_s', [0.05, -0.05])
def test_stamps_that_jump_by_50_ms_in_a_slide_are_no_speed(ahead_s):
    watch = SlideWatch(SPEED_M_S, 1.0, TouchParams())
    for number in range(100):
        now_s = number * STEP_S
        stamp_s = 1.0 + now_s + ahead_s * (now_s > 0.5)
        watch.update(ArmState(round(stamp_s * 1e9), (SPEED_M_S * now_s, 0.0, 0.0), REST, 1.0), True)
    assert watch.flaw() == ''


def test_a_force_that_comes_later_than_the_place_is_no_speed():
    watch, tool = SlideWatch(SPEED_M_S, 1.0, TouchParams()), ToolState(RosControllersParams())
    for number in range(100):
        now_ns, place_m = round((1.0 + number * STEP_S) * 1e9), SPEED_M_S * number * STEP_S
        tool.take_pose(now_ns, PoseSample(now_ns, 'base', (place_m, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))
        age_ns = 30_000_000 * (number % 10 == 9)
        if number % 10 not in (4, 5, 6, 7, 8):
            sample = ForceSample(now_ns - age_ns, 'base', (0.0, 0.0, 1.0 + 1e-6 * number), age_ns)
            tool.take_force(now_ns, sample, moving=True)
        watch.update(replace(tool.state(''), force_n=1.0), True)
    assert watch.flaw() == ''


def test_a_pause_of_this_machine_in_which_the_command_ran_out_is_no_stall():
    """The finger stood still for 0.8 s of a second without a step, and goes on."""
    watch = StallWatch(TouchParams())
    places = [0.02 * s for s in (0.0, 0.1, 0.3)]
    for time_s, place_m in zip((0.0, 0.1, 1.1), places, strict=True):
        watch.update(ArmState(round(time_s * 1e9), (place_m, 0.0, 0.0), REST, 1.0), (SPEED_M_S, 0.0))


def test_a_stall_in_mid_slide_aborts_and_lifts(table):
    table.when[Phase.SLIDE] = table.arm.jam
    outcome = table.explore(ExplorationRequest('linear_slide', speed_m_s=0.02, force_n=1.0, distance_m=0.04))
    assert (outcome.success, outcome.slid) == (False, True)
    assert outcome.message.startswith('the finger stalled: in 250 ms it moved by')
    assert table.phases[-2:] == [Phase.LIFT, Phase.ABORTED]
    lifted, jammed = (table.first(phase)[0].stamp_ns for phase in (Phase.LIFT, Phase.SLIDE))
    assert (lifted - jammed) * 1e-9 < 0.5


def slid(seconds=1.0, force_n=lambda s: 1.0, speed=lambda s: 1.0):
    """Return which states of a slide at 20 mm/s and 1 N count as steady, and what is said at its end."""
    watch, x_m, steady = SlideWatch(SPEED_M_S, 1.0, TouchParams()), 0.0, []
    for number in range(round(seconds / STEP_S)):
        now_s = number * STEP_S
        x_m += speed(now_s) * SPEED_M_S * STEP_S
        velocity = (speed(now_s) * SPEED_M_S, 0.0, 0.0)
        state = ArmState(round(now_s * 1e9), (x_m, 0.0, 0.0), velocity, force_n(now_s))
        steady.append(watch.update(state, constant=True))
    return steady, watch.flaw()


def test_a_slide_as_asked_is_steady_and_without_flaw():
    steady, flaw = slid(force_n=lambda s: 1.0 + 0.2 * math.sin(50 * s))
    assert all(steady)
    assert flaw == ''


def test_three_times_the_speed_is_not_steady_and_named_with_what_was_asked():
    steady, flaw = slid(speed=lambda s: 3.0)
    assert not any(steady[5:])
    assert 'the mean speed of the slide was 0.0600 m/s, more than 20% off the 0.02 m/s requested' in flaw
    assert 'the speed of the slide reached 0.06 m/s, and 0.03 m/s are allowed with 0.02 m/s requested' in flaw


def test_half_the_speed_is_no_success():
    assert slid(speed=lambda s: 0.5)[1].startswith('the mean speed of the slide was 0.0100 m/s')


def test_a_short_peak_of_the_force_is_not_steady_and_named_although_the_mean_is_right():
    steady, flaw = slid(force_n=lambda s: 1.86 if 0.5 <= s < 0.56 else 1.0)
    assert [number for number, good in enumerate(steady) if not good] == [51, 52, 53, 54, 55, 56]
    assert flaw == (
        "the force of the slide reached 1.86 N, and 1.5 N are allowed with 1 N requested ('peak_force_fraction')"
    )


def test_one_wrong_reading_of_the_force_is_none():
    assert slid(force_n=lambda s: 5.0 if abs(s - 0.5) < 0.004 else 1.0)[1] == ''


def test_turns_are_no_part_of_the_speed_that_was_asked_for():
    watch, x_m = SlideWatch(SPEED_M_S, 1.0, TouchParams()), 0.0
    for number in range(200):
        turning = number % 50 >= 40
        x_m += (0.0 if turning else SPEED_M_S) * STEP_S
        watch.update(ArmState(round(number * STEP_S * 1e9), (x_m, 0.0, 0.0), REST, 1.0), not turning)
    assert watch.flaw() == ''
