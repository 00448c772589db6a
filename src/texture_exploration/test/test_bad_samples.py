# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Samples that no sensor can mean, and errors of the program itself: named, and the finger is lifted."""

import math
import re
from dataclasses import replace

import pytest

from texture_core.errors import ExplorationError
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.paths import PathFollower
from texture_exploration.safety import SafetyLimits

SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.02, force_n=1.0, distance_m=0.03)
LONGEST = 400  # characters of a message
BAD = {
    'force nan': ('force', {'force_n': (0.0, 0.0, math.nan)}, 'a force on'),
    'force infinite': ('force', {'force_n': (math.inf, 0.0, 0.0)}, 'a force on'),
    'force 1e308': ('force', {'force_n': (0.0, 0.0, 1e308)}, 'a force on'),
    'place nan': ('pose', {'position_m': (0.4, math.nan, 0.1)}, 'a pose on'),
    'place 1e308': ('pose', {'position_m': (1e308, 0.0, 0.1)}, 'a pose on'),
    'rotation nan': ('pose', {'rotation': (math.nan, 0.0, 0.0, 1.0)}, 'a pose on'),
    'rotation zero': ('pose', {'rotation': (0.0, 0.0, 0.0, 0.0)}, 'a pose on'),
}
PHASES = ('approach', 'contact', 'slide', 'lift')


def spoil(robot, kind, bad, samples):
    """Let the next samples of a kind be bad."""
    newest, left = getattr(robot, f'newest_{kind}'), [samples]

    def spoiled():
        left[0] -= 1
        sample = newest()
        return sample._replace(**bad) if left[0] >= 0 else sample

    setattr(robot, f'newest_{kind}', spoiled)


def explored(robot, kind, bad, phase, samples):
    """Explore with an arm whose samples are bad from the third state of a phase on."""
    spoilt = []

    def on_state(state):
        if not spoilt and [old.value for old in robot.phases[-3:]] == [phase] * 3:
            spoilt.append(phase)
            spoil(robot, kind, bad, samples)

    outcome = robot.explore(SLIDE, on_state)
    assert spoilt
    assert not any(robot.sent[-1][1])
    return outcome


@pytest.mark.parametrize('phase', PHASES)
@pytest.mark.parametrize('name', BAD)
def test_one_sample_that_cannot_be_meant_is_named_and_the_finger_lifted(make_robot, name, phase):
    robot, (kind, bad, sentence) = make_robot(), BAD[name]
    outcome = explored(robot, kind, bad, phase, 1)
    assert robot.pressed_n[-1] == 0.0
    assert outcome.lifted
    assert sentence in outcome.message and len(outcome.message) < LONGEST
    assert outcome.error is ExplorationError.ARM_FAULT


@pytest.mark.parametrize('name', ['force nan', 'force 1e308'])
def test_a_sensor_that_goes_on_to_give_no_number_does_not_keep_the_finger_pressed(make_robot, name):
    robot, (kind, bad, sentence) = make_robot(), BAD[name]
    outcome = explored(robot, kind, bad, 'slide', 10**9)
    assert robot.pressed_n[-1] == 0.0
    assert sentence in outcome.message and len(outcome.message) < LONGEST


def test_an_arm_whose_place_stays_unknown_is_stopped_and_named(make_robot):
    kind, bad, sentence = BAD['place nan']
    outcome = explored(make_robot(), kind, bad, 'slide', 10**9)
    assert sentence in outcome.message
    assert not outcome.lifted


@pytest.mark.parametrize('phase', [Phase.APPROACH, Phase.CONTACT, Phase.SLIDE, Phase.LIFT])
@pytest.mark.parametrize('field', ['force_n', 'position', 'along_n'])
@pytest.mark.parametrize('value', [math.nan, math.inf, 1e308])
def test_a_state_of_any_arm_that_is_no_number_is_named_and_the_finger_lifted(table, field, phase, value):
    state, bad = table.arm.state, []
    given = {'position': (0.0, 0.0, value), 'along_n': (0.0, value)}.get(field, value)

    def spoiled():
        reading = state()
        return replace(reading, **{field: given}) if bad and bad.pop() else reading

    table.arm.state = spoiled
    table.when[phase] = lambda: bad.extend([False, True])
    outcome = table.explore()
    assert not outcome.success
    assert 'the arm reports' in outcome.message and len(outcome.message) < LONGEST
    assert table.arm.true_force_n == 0.0
    assert table.phases[-2:] == [Phase.LIFT, Phase.ABORTED]


@pytest.mark.parametrize('phase', [Phase.APPROACH, Phase.CONTACT, Phase.SLIDE])
@pytest.mark.parametrize('where', ['_guard.relative', '_motion.step', '_force_watch.note', '_motion.abort'])
def test_an_error_of_the_program_commands_zero_lifts_the_finger_and_says_so(table, phase, where):
    def fail(*_args, **_named):
        raise IndexError('list index out of range')

    def spoil_it():
        owner, method = where.split('.')
        setattr(getattr(table.exploration, owner), method, fail)
        table.exploration.stop('enough') if method == 'abort' else None

    table.when[phase] = spoil_it
    outcome = table.explore()
    assert outcome.error is ExplorationError.INTERNAL
    assert re.search(r'internal error.*IndexError: list index out of range', outcome.message)
    assert outcome.lifted
    assert table.arm.true_force_n == 0.0
    assert table.phases[-1] is Phase.ABORTED


@pytest.mark.parametrize('phase', [Phase.CONTACT, Phase.SLIDE])
def test_a_command_that_the_arm_refuses_is_named_and_the_finger_is_lifted(table, monkeypatch, phase):
    table.when[phase] = lambda: monkeypatch.setattr(PathFollower, 'velocity', lambda *_: (math.nan, 0.0))
    outcome = table.explore()
    assert outcome.error is ExplorationError.ARM_FAULT
    assert 'the command was refused and the arm stopped: the speed along the surface is nan' in outcome.message
    assert outcome.lifted
    assert table.arm.true_force_n == 0.0


def test_an_error_in_the_thread_of_the_arm_commands_zero_is_named_and_the_finger_lifted(make_robot):
    robot, raised = make_robot(), []
    choose = robot.arm._loop.velocity

    def fail(*given):
        if robot.phases[-1:] == [Phase.SLIDE] and not raised:
            raised.append(robot.now_ns)
            raise IndexError('list index out of range')
        return choose(*given)

    robot.arm._loop.velocity = fail
    outcome = robot.explore(SLIDE)
    assert raised
    assert 'IndexError' in outcome.message
    assert robot.pressed_n[-1] == 0.0
    assert next(velocity for time_ns, velocity in robot.sent if time_ns >= raised[0]) == (0.0, 0.0, 0.0)


def test_an_error_that_stays_in_the_thread_of_the_arm_leaves_it_at_rest_and_named(make_robot):
    robot = make_robot()

    def fail(*_given):
        raise IndexError('list index out of range')

    outcome = robot.explore(
        SLIDE, lambda state: setattr(robot.arm._loop, 'velocity', fail) if state.phase is Phase.SLIDE else None
    )
    assert 'IndexError' in outcome.message and not outcome.lifted
    assert not any(robot.sent[-1][1])


def test_limits_that_are_broken_by_a_huge_force_are_told_in_few_characters(table):
    state = replace(table.arm.state(), force_n=1e308)
    assert len(SafetyLimits().force_violation(state)) < LONGEST
