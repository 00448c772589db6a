# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""After a fault the finger is lifted until nothing touches it, on every arm, before a motion begins."""

import math
from dataclasses import replace

import pytest

from texture_core.errors import DeviceError, MotionRefused
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.arm import ArmCommand, ArmState
from texture_exploration.lift_first import CalmDown, Detour, Rise
from texture_exploration.motions import MOTIONS
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import SettleForceStage
from texture_exploration.touch import TouchParams

TOUCH = TouchParams()
REQUEST = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.03)
DEADLINE_S = 60.0


@pytest.fixture
def lifting_first(monkeypatch):
    """Let linear slides lift first; return how an arm says whether its force sensor is zeroed."""
    plan, zeroed = MOTIONS['linear_slide'], [True]
    monkeypatch.setitem(
        MOTIONS,
        'linear_slide',
        lambda *planned: plan(*planned).lift_first(lambda: zeroed[0]),
    )
    return zeroed


def test_a_finger_that_presses_is_free_before_it_comes_down_again(table, lifting_first):
    table.arm.displace((0.0, 0.0, -0.0115))  # pressed by 1.5 mm: 3 N
    outcome = table.explore(REQUEST)
    assert outcome.success, outcome.message
    assert table.phases == [Phase.APPROACH, Phase.CONTACT, Phase.SLIDE, Phase.LIFT, Phase.DONE]
    heights = [z for state, (_, _, z) in zip(table.states, table.places, strict=True) if state.phase is Phase.APPROACH]
    assert heights[0] < 0.0
    assert max(heights) >= TOUCH.clearance_m - 0.001  # above the surface, which is at 0


def test_a_force_sensor_that_cannot_be_zeroed_aborts_in_the_air(table, lifting_first):
    lifting_first[0] = False
    outcome = table.explore(REQUEST)
    assert (outcome.success, outcome.slid) == (False, False)
    assert outcome.message == 'waited 5.0 s for the arm to zero its force sensor; the force is 0.00 N'
    assert table.arm.state().position[2] > 0.01
    assert table.arm.state().force_n == 0.0


def test_an_arm_that_needs_a_longer_rise_to_zero_its_force_sensor_gets_it(table, lifting_first, monkeypatch):
    """An arm may have seen less of the first lift than the explorer: standing still would never zero its sensor."""
    highest_m = 0.0
    state = table.arm.state

    def seen():
        nonlocal highest_m
        reading = state()
        highest_m = max(highest_m, reading.position[2])
        lifting_first[0] = highest_m > table.home[2] + 2.5 * TOUCH.clearance_m
        return reading

    lifting_first[0] = False
    monkeypatch.setattr(table.arm, 'state', seen)
    outcome = table.explore(REQUEST)
    assert outcome.success, outcome.message
    assert highest_m < table.home[2] + 5 * TOUCH.clearance_m


def test_a_state_from_before_the_zero_of_its_force_is_no_contact(table, lifting_first, monkeypatch):
    """An arm with a thread of its own may report its zero between a state and the check."""
    rested, state = 0, table.arm.state

    def seen():
        nonlocal rested
        reading, zeroed = state(), lifting_first[0]
        high = reading.position[2] > table.home[2] + 0.8 * TOUCH.clearance_m
        rested = rested + 1 if high and not any(reading.velocity) else 0
        lifting_first[0] = zeroed or rested > 40
        return reading if zeroed else replace(reading, force_n=reading.force_n - 3.0)

    lifting_first[0] = False
    monkeypatch.setattr(table.arm, 'state', seen)
    outcome = table.explore(REQUEST)
    assert outcome.success, outcome.message


CHANGING = {
    'swings': (lambda reading: 2.0 * (reading.time_ns // 50_000_000 % 2), 'the force changed by 2.00 N'),
    'falls slowly': (
        lambda reading: -120.0 * reading.position[2],
        'the force changed while the finger rose by 0.05',
    ),
}


@pytest.mark.parametrize('change', CHANGING)
def test_a_force_that_never_stops_changing_aborts_after_the_travel_of_an_approach(
    table, lifting_first, monkeypatch, change
):
    state, (force_n, message) = table.arm.state, CHANGING[change]

    def changing():
        reading = state()
        return replace(reading, force_n=force_n(reading))

    monkeypatch.setattr(table.arm, 'state', changing)
    outcome = table.explore(REQUEST)
    assert message in outcome.message
    assert not outcome.lifted
    assert table.arm.state().position[2] < table.home[2] + 0.052


def lifts_first(explorer):
    """Explore; return whether the finger rose above the height at which explorations begin."""
    table = explorer.table
    table.states.clear()
    table.places.clear()
    exploration = explorer.begin('one', REQUEST)
    assert exploration.ended.wait(DEADLINE_S)
    assert exploration.outcome.success, exploration.outcome.message
    heights = [z for state, (_, _, z) in zip(table.states, table.places, strict=True) if state.phase is Phase.APPROACH]
    return max(heights) > 0.002 + 0.8 * TOUCH.clearance_m


def test_the_first_exploration_lifts_first_and_so_does_one_after_a_fault_or_an_abort(explorer):
    assert [lifts_first(explorer), lifts_first(explorer)] == [True, False]
    explorer.arm.fail('protective stop')
    explorer.recover()
    assert [lifts_first(explorer), lifts_first(explorer)] == [True, False]
    explorer.table.gate.clear()
    exploration = explorer.begin('two', REQUEST)
    explorer.stop('enough')
    explorer.table.gate.set()
    assert exploration.ended.wait(DEADLINE_S)
    assert lifts_first(explorer)


def rested(force_n_at):
    """Return the command of an arm that stands still for 1 s and has not said that its sensor is zeroed."""
    stage = CalmDown(lambda: False, 1.0, TOUCH, SafetyLimits())
    for tick in range(101):
        state = ArmState(tick * 10_000_000, (0.0, 0.0, 0.01), (0.0, 0.0, 0.0), force_n_at(0.01 * tick))
        if not tick:
            stage.begin(state.time_ns, state)
        command = stage.step(state.time_ns, state)
    return command


@pytest.mark.parametrize('offset_n', [0.0, 1.5], ids=['no offset', 'an offset'])
def test_a_contact_that_grows_while_the_finger_stands_still_forbids_the_next_rise(offset_n):
    with pytest.raises(Detour, match=r'the finger met something .*, [0-3]\.\d\d N'):
        rested(lambda seconds: offset_n + min(3.0, 6.0 * seconds))


def test_a_sensor_that_is_zeroed_before_the_arm_says_so_is_no_contact():
    """A controller may acknowledge its zeroing 0.4 s late: the offset of 1.5 N is gone by then."""
    assert rested(lambda seconds: 1.5 if seconds < 0.1 else 0.0).normal_m_s > 0.0


@pytest.mark.parametrize('bad', [{'force_n': math.nan}, {'force_n': 1e308}, {'position': (0.0, 0.0, math.nan)}])
def test_a_lift_on_request_ends_at_the_first_number_that_cannot_be_meant(explorer, monkeypatch, bad):
    arm, states = explorer.arm, []
    state, (_, _, start_m) = arm.state, arm.state().position

    def spoiled():
        states.append(state())
        return replace(states[-1], **bad) if len(states) > 20 else states[-1]

    monkeypatch.setattr(arm, 'state', spoiled)
    with pytest.raises((DeviceError, MotionRefused), match=r'the arm reports a (force|place)'):
        explorer.lift()
    monkeypatch.undo()
    assert arm.state().position[2] < start_m + 0.001
    assert not explorer.lifted


@pytest.mark.parametrize('bad', [{'force_n': math.nan}, {'along_n': (0.0, math.inf)}, {'velocity': (math.nan,) * 3}])
def test_an_arm_whose_numbers_cannot_be_meant_gets_no_request(explorer, monkeypatch, bad):
    state = explorer.arm.state
    monkeypatch.setattr(explorer.arm, 'state', lambda: replace(state(), **bad))
    assert 'the arm reports a' in explorer.fault()


def test_from_a_zero_that_is_no_number_nothing_rises():
    stage = Rise(1.0, TOUCH, SafetyLimits(), zero_n=(math.nan, 0.0, 0.0))
    with pytest.raises(Detour, match='the force changed by more than'):
        for tick in range(20):
            state = ArmState(tick * 10_000_000, (0.0, 0.0, 0.01), (0.0, 0.0, 0.0), 0.0)
            if not tick:
                stage.begin(state.time_ns, state)
            stage.step(state.time_ns, state)


def test_a_state_that_stays_old_is_no_rest():
    """The arm may move while a busy machine gets no new state of it: a probe would be taken for a wrong frame."""
    stage, old = Rise(1.0, TOUCH, SafetyLimits()), ArmState(0, (0.0, 0.0, 0.01), (0.0, 0.0, 0.0), 0.0)
    stage.begin(0, old)
    assert {stage.step(tick * 10_000_000, old) for tick in range(13)} == {ArmCommand()}
    moved = replace(old, time_ns=130_000_000, position=(0.008, 0.0, 0.01))
    assert stage.step(130_000_000, moved) == ArmCommand()
    rested = [stage.step(ns, replace(moved, time_ns=ns)) for ns in range(140_000_000, 210_000_000, 10_000_000)]
    assert rested[-1].normal_m_s > 0.0


def test_a_force_that_stays_old_has_not_settled():
    stage, old = SettleForceStage(1.0, TOUCH, SafetyLimits()), ArmState(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0)
    stage.begin(0, old)
    assert None not in [stage.step(tick * 10_000_000, old) for tick in range(13)]
    assert stage.step(130_000_000, replace(old, time_ns=130_000_000)) is None
