"""A finger that does not move along the surface although it is commanded to."""

import math

import pytest

from texture_core.errors import MotionAborted
from texture_core.exploration import ExplorationRequest, Phase
from texture_exploration.arms.protocol import ArmState
from texture_exploration.motions.stall import StallWatch
from texture_exploration.motions.touch import TouchParams

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


@pytest.mark.parametrize(('share', 'stalls'), [(0.3, False), (0.2, True), (-1.0, True)])
def test_a_finger_counts_as_stalled_below_its_share_of_the_commanded_speed(share, stalls):
    assert (watched(lambda s: share * SPEED_M_S * s, 1.0) is not None) is stalls


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
