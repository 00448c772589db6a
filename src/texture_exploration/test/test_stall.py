# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A finger that does not move along the surface as commanded, and slides that are not what was asked for."""

import math

import numpy as np
import pytest

from texture_core.errors import MotionAborted
from texture_core.types import ExplorationRequest, Phase, TactileSignal
from texture_exploration.arms.arm import ArmState
from texture_exploration.arms.simulated import SimulatedArmParams
from texture_exploration.touch import TouchParams
from texture_exploration.watches import SlideWatch, StallWatch
from texture_features.windows import CutWindow, WindowParams, cut_recording

SPEED_M_S = 0.02
STEP_S = 0.01


def watched(place, seconds):
    """Return after how long the finger counts as stalled, None if it does not; `place` is x over time."""
    watch = StallWatch(TouchParams())
    for number in range(round(seconds / STEP_S)):
        now_s = number * STEP_S
        arm = ArmState(round(now_s * 1e9), (place(now_s), 0.0, 0.0), (0.0, 0.0, 0.0), 1.0)
        try:
            watch.update(arm, (SPEED_M_S, 0.0))
        except MotionAborted:
            return now_s
    return None


def test_a_finger_that_stands_still_counts_as_stalled_once_three_quarters_of_the_time_hold_no_way():
    assert watched(lambda s: SPEED_M_S * min(s, 1.0), 3.0) == pytest.approx(
        1.0 + 0.75 * TouchParams().stall_s, abs=0.02
    )


@pytest.mark.parametrize('ahead_s', [0.05, -0.05])
def test_stamps_that_jump_by_50_ms_in_a_slide_are_no_speed(ahead_s):
    watch = SlideWatch(SPEED_M_S, 1.0, TouchParams())
    for number in range(100):
        now_s = number * STEP_S
        stamp_s = 1.0 + now_s + ahead_s * (now_s > 0.5)
        watch.update(ArmState(round(stamp_s * 1e9), (SPEED_M_S * now_s, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0), True)
    assert watch.flaw() == ''


@pytest.mark.parametrize(('fraction', 'stalls'), [(0.3, False), (0.2, True), (-1.0, True)])
def test_a_finger_counts_as_stalled_below_its_fraction_of_the_commanded_speed(fraction, stalls):
    assert (watched(lambda s: fraction * SPEED_M_S * s, 1.0) is not None) is stalls


def test_noise_of_the_position_is_no_way():
    assert watched(lambda s: 0.0002 * (round(s / STEP_S) % 2), 1.0) == pytest.approx(0.25, abs=0.02)


def test_an_arm_whose_place_is_no_number_counts_as_stalled():
    assert watched(lambda s: math.nan, 1.0) is not None


def test_a_pause_of_this_machine_in_which_the_command_ran_out_is_no_stall():
    """The finger stood still for 0.8 s of a second without a step, and goes on."""
    watch = StallWatch(TouchParams())
    places = [0.02 * s for s in (0.0, 0.1, 0.3)]
    for time_s, place_m in zip((0.0, 0.1, 1.1), places, strict=True):
        watch.update(ArmState(round(time_s * 1e9), (place_m, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0), (SPEED_M_S, 0.0))


def test_a_stall_in_mid_slide_aborts_and_lifts(table):
    table.when[Phase.SLIDE] = table.arm.jam
    outcome = table.explore(ExplorationRequest('linear_slide', speed_m_s=0.02, force_n=1.0, distance_m=0.04))
    assert (outcome.success, outcome.slid) == (False, True)
    assert outcome.message.startswith('the finger stalled: in 250 ms it moved by')
    assert table.phases[-2:] == [Phase.LIFT, Phase.ABORTED]
    lifted, jammed = (table.first(phase)[0].stamp_ns for phase in (Phase.LIFT, Phase.SLIDE))
    assert (lifted - jammed) * 1e-9 < 0.5


def slid(seconds=1.0, force_n=lambda s: 1.0, speed=lambda s: 1.0, tangential_n=lambda s: math.nan, **given):
    """Return which states of a slide at 20 mm/s and 1 N count as steady, and what is said at its end."""
    watch, x_m, steady = SlideWatch(SPEED_M_S, 1.0, TouchParams(**given)), 0.0, []
    for number in range(round(seconds / STEP_S)):
        now_s = number * STEP_S
        x_m += speed(now_s) * SPEED_M_S * STEP_S
        velocity = (speed(now_s) * SPEED_M_S, 0.0, 0.0)
        state = ArmState(
            round(now_s * 1e9), (x_m, 0.0, 0.0), velocity, force_n(now_s), tangential_force_n=tangential_n(now_s)
        )
        steady.append(watch.update(state, constant=True))
    return steady, watch.flaw()


def test_a_slide_as_asked_is_steady_and_without_flaw():
    steady, flaw = slid(force_n=lambda s: 1.0 + 0.2 * math.sin(50 * s), tangential_n=lambda s: 1.5)
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


def test_a_force_along_the_surface_beyond_friction_is_no_success():
    assert 'the mean force along the surface was 2.50 N, and 2.00 N' in slid(tangential_n=lambda s: -2.5)[1]
    steady, flaw = slid(tangential_n=lambda s: 3.5 if s >= 0.9 else 0.5)
    assert not steady[-1]
    assert flaw.startswith('the force along the surface of the slide reached 3.5 N, and 3 N are allowed')


def test_turns_are_no_part_of_the_speed_that_was_asked_for():
    watch, x_m = SlideWatch(SPEED_M_S, 1.0, TouchParams()), 0.0
    for number in range(200):
        turning = number % 50 >= 40
        x_m += (0.0 if turning else SPEED_M_S) * STEP_S
        watch.update(ArmState(round(number * STEP_S * 1e9), (x_m, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0), not turning)
    assert watch.flaw() == ''


@pytest.mark.parametrize('peak_n', [1.86, 3.0])
def test_a_force_that_departs_in_the_slide_is_no_success_and_no_window_is_cut_from_it(table, peak_n, monkeypatch):
    monkeypatch.setattr(SimulatedArmParams, 'admittance_m_s_n', 7e-4)  # it gives way slowly
    table.when[Phase.SLIDE] = lambda: setattr(table, 'pressed_ns', table.now_ns)
    table.pressed_ns, go_on = None, table.pace

    def pace():
        go_on()
        pressed_s = (table.now_ns - table.pressed_ns) * 1e-9 if table.pressed_ns else 0.0
        wanted_n = peak_n + 0.01 * math.sin(1e3 * pressed_s)  # a frozen force would be named instead
        table.arm.push(wanted_n - table.arm.true_force_n + table.arm._push_n if 0.5 < pressed_s < 0.65 else 0.0)

    table.pace = pace
    outcome = table.explore(ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.1))
    assert (outcome.success, outcome.slid) == (False, True)
    assert "1 N requested ('peak_force_fraction')" in outcome.message
    sliding = [state for state in table.states if state.phase is Phase.SLIDE]
    pressed = [state for state in sliding if state.force_n > 1.5]
    assert len(pressed) > 5
    assert not any(state.steady_s for state in pressed[2:])
    begin_ns, end_ns = sliding[0].stamp_ns, sliding[-1].stamp_ns
    rows = np.array([[0.0]] * round((end_ns - begin_ns) * 1e-6), dtype=np.float32)
    batches = [
        TactileSignal(begin_ns + round(first * 1e6), 's', ('force',), (), 1000.0, first, rows[first : first + 5])
        for first in range(0, len(rows), 5)
    ]
    windows = [
        piece
        for piece in cut_recording({'signal': batches}, table.states, WindowParams(length_s=0.1, hop_s=0.02))
        if isinstance(piece, CutWindow)
    ]
    assert len(windows) > 20
    spans = [(window.start_ns, window.start_ns + 100_000_000) for window in windows]
    assert not any(begin <= state.stamp_ns < end for begin, end in spans for state in pressed[2:])
