# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import re
from collections import deque
from dataclasses import replace

import pytest
from table_arm import Shape, TableArmParams

from texture_core.errors import ExplorationError
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.guards import SignalWatch
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams

MOVING = (Phase.APPROACH, Phase.CONTACT, Phase.SLIDE, Phase.LIFT)


@pytest.mark.parametrize('phase', MOVING)
def test_a_stop_in_any_phase_lifts_the_finger_and_says_aborted(table, phase):
    table.when[phase] = lambda: table.exploration.stop('stopped on request')
    outcome = table.explore()
    assert (outcome.error, outcome.message) == (ExplorationError.STOPPED, 'stopped on request')
    assert table.phases[-2:] == [Phase.LIFT, Phase.ABORTED]
    assert table.arm.state().force_n == 0
    assert table.arm.state().position[2] == pytest.approx(table.home[2], abs=0.001)
    if phase is Phase.SLIDE:  # it leaves along the normal: 0.05 m/s until the third state
        assert table.arm.state().position[0] - table.first(Phase.SLIDE)[1][0] < 0.004


def test_a_lift_that_fails_after_a_stop_is_reported_with_the_stop(table, monkeypatch):
    monkeypatch.setattr(TouchParams, 'lift_speed_m_s', 0.001)
    monkeypatch.setattr(SafetyLimits, 'lift_timeout_s', 0.5)
    table.when[Phase.SLIDE] = lambda: table.exploration.stop('stopped on request')
    outcome = table.explore()
    assert not outcome.success
    assert outcome.message.startswith(
        'stopped on request; the finger was not lifted: waited 0.5 s for the finger to be lifted'
    )
    assert table.phases[-2:] == [Phase.LIFT, Phase.ABORTED]


def test_an_exploration_that_takes_longer_than_its_timeout_is_aborted_and_lifts(table):
    outcome = table.explore(ExplorationRequest('linear_slide', speed_m_s=0.01, timeout_s=2.0))
    assert outcome.error is ExplorationError.TIMEOUT
    assert outcome.message == 'the exploration took longer than its timeout of 2 s'
    assert table.phases[-2:] == [Phase.LIFT, Phase.ABORTED]
    assert table.arm.state().force_n == 0


def test_an_arm_that_hangs_in_the_lift_after_a_stop_is_reported_with_the_stop(table):
    table.when[Phase.SLIDE] = lambda: table.exploration.stop('stopped on request')
    table.when[Phase.LIFT] = table.arm.freeze
    outcome = table.explore()
    assert re.match(
        r'stopped on request; .*has not answered for 1[34]\d ms; the finger was not lifted', outcome.message
    )


def test_without_a_surface_the_approach_gives_up(make_table):
    table = make_table(TableArmParams(stiffness_n_m=0.0), TouchParams(approach_travel_m=0.02))
    outcome = table.explore()
    assert outcome.error is ExplorationError.NO_SURFACE
    assert outcome.message.startswith('no surface within 0.02 m')
    assert table.phases == [Phase.APPROACH, Phase.LIFT, Phase.ABORTED]
    assert not outcome.slid


def test_a_finger_that_leaves_the_workspace_is_lifted(make_table):
    table = make_table(limits=SafetyLimits(z_low_m=-0.0004))
    outcome = table.explore()  # 1 N needs 0.5 mm of depth
    assert outcome.error is ExplorationError.WORKSPACE
    assert outcome.message.startswith('the finger left the workspace: z is -0.000')
    assert table.arm.state().force_n == 0


@pytest.mark.parametrize('phase', MOVING)
def test_an_arm_that_hangs_aborts_within_the_allowed_age(table, phase):
    table.when[phase] = table.arm.freeze
    outcome = table.explore()
    hung_ns = table.arm.state().time_ns
    assert re.search(r'has not answered for 1[34]\d ms; the finger was not lifted', outcome.message)
    assert (table.states[-1].stamp_ns - hung_ns) * 1e-9 == pytest.approx(0.13, abs=0.011)
    assert table.phases[-1] is Phase.ABORTED


def test_a_machine_that_slept_does_not_take_the_arm_for_dead(table):
    table.when[Phase.SLIDE] = table.sleep
    assert table.explore().success
    assert table.exploration.gaps == 1


@pytest.mark.parametrize('silent', ['arm', 'sensor'])
def test_steps_that_are_late_again_and_again_hide_neither_an_arm_that_hangs_nor_a_silent_sensor(table, silent):
    def be_late():  # every eighth step is late by 60 ms, as on a busy machine
        if len(table.pressed) % 8 == 7:
            table.asleep_ns = 60_000_000

    table.at_each_step = be_late
    if silent == 'arm':
        table.when[Phase.SLIDE] = table.arm.freeze
    else:
        table.signal_fault = SignalWatch(0.5, lambda: table.now_ns).signal_fault
    assert {'arm': 'has not answered for', 'sensor': "no samples on 'signal'"}[silent] in table.explore().message


def test_a_slide_that_was_over_before_it_was_seen_is_no_success(table):
    table.late_ns = 100_000_000
    outcome = table.explore(ExplorationRequest('linear_slide', speed_m_s=0.1, distance_m=0.005))
    assert (outcome.error, outcome.slid) == (ExplorationError.NO_SAMPLES, False)
    assert outcome.message.startswith('the slide was shorter than the delay of the arm')
    assert table.phases[-2:] == [Phase.LIFT, Phase.ABORTED]


def test_a_force_sensor_that_hangs_aborts_with_a_code_of_its_own(table):
    table.when[Phase.SLIDE] = table.arm.freeze_force
    assert table.explore().error is ExplorationError.FORCE_SENSOR


def test_an_arm_that_is_lost_aborts(table):
    table.when[Phase.SLIDE] = table.arm.close
    outcome = table.explore()
    assert outcome.error is ExplorationError.ARM_FAULT
    assert outcome.message.startswith('the simulated arm is not connected')
    assert table.phases[-1] is Phase.ABORTED


def test_a_slide_can_end_early_with_success_but_not_before_the_guaranteed_time(table):
    table.when[Phase.SLIDE] = lambda: table.exploration.finish('the texture is decided')
    outcome = table.explore()
    assert (outcome.success, outcome.message) == (True, 'the texture is decided')
    begin, end = table.first(Phase.SLIDE)[0], table.first(Phase.LIFT)[0]
    assert begin.stamp_ns + begin.steady_s * 1e9 <= end.stamp_ns
    assert (end.stamp_ns - begin.stamp_ns) * 1e-9 < 0.15


def test_a_force_that_never_settles_aborts_with_what_was_waited_for(table, monkeypatch):
    monkeypatch.setattr(SafetyLimits, 'contact_timeout_s', 0.5)
    monkeypatch.setattr(TableArmParams, 'admittance_m_s_n', 1e-4)
    outcome = table.explore(ExplorationRequest('linear_slide', force_n=3.0))
    assert outcome.error is ExplorationError.MOTION_FAILED
    assert outcome.message.startswith('waited 0.5 s for the force to settle at 3 N; the force is')


def test_states_come_fifty_times_a_second_and_carry_who_and_what(table):
    table.explore(ExplorationRequest('linear_slide', surface='cork'))
    sliding = [state for state in table.states if state.phase is Phase.SLIDE]
    assert len(sliding) == pytest.approx(50 * 2.0, abs=2)
    assert {(state.exploration_id, state.motion, state.surface) for state in table.states} == {
        ('one', 'linear_slide', 'cork')
    }
    assert [sliding[0].progress, sliding[-1].progress] == pytest.approx([0.0, 1.0], abs=0.02)


@pytest.mark.parametrize('phase', MOVING)
def test_a_sensor_that_falls_silent_lifts_the_finger_within_150_ms(table, phase):
    watch = SignalWatch(0.12, lambda: table.now_ns)
    table.signal_fault, hear = watch.signal_fault, watch.on_samples
    fell_silent = []

    table.at_each_step = lambda: fell_silent or hear()
    table.when[phase] = lambda: fell_silent.append(table.now_ns)
    outcome = table.explore()
    assert re.fullmatch(r"no samples on 'signal' for 1[23]\d ms; check the sensor; its node logs why", outcome.message)
    assert table.arm.state().force_n == 0
    if phase is not Phase.LIFT:
        lifted_ns = next(s.stamp_ns for s in table.states if s.phase is Phase.LIFT)
        assert (lifted_ns - fell_silent[0]) * 1e-9 == pytest.approx(0.12, abs=0.02)


def test_a_machine_that_slept_does_not_take_the_sensor_for_silent(table):
    watch = SignalWatch(0.12, lambda: table.now_ns)

    def signal_fault(listening):
        message = watch.signal_fault(listening)
        watch.on_samples()
        return message

    table.signal_fault = signal_fault
    table.when[Phase.SLIDE] = table.sleep
    assert table.explore().success


# What happens in the slide, how soon it is detected (a step of the exploration), and the expected sentence.
FORCE, FAULT = ExplorationError.FORCE_LIMIT, ExplorationError.ARM_FAULT
HAPPENINGS = {
    'a force above the limit': (lambda table: table.arm.push(20.0), 0.02, FORCE, 'is above the limit of 10 N'),
    'a shove out of the workspace': (
        lambda table: table.arm.displace((0.3, 0.0, 0.0)), 0.02, ExplorationError.WORKSPACE, 'left the workspace: x is',
    ),
    'an arm in a protective stop': (
        lambda table: table.arm.fail('protective stop'), 0.02, FAULT, 'the arm reports a fault: protective stop',
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', HAPPENINGS)
def test_whatever_ends_a_slide_ends_it_within_100_ms_and_the_next_exploration_works(name, table, record_property):
    happens, soon_s, error, expected = HAPPENINGS[name]
    happened, moved = [], []

    def now():
        happened.append(table.now_ns)
        happens(table)

    table.at_each_step = lambda: moved.append((table.now_ns, any(table.arm.state().velocity[:2])))
    table.when[Phase.SLIDE] = now
    outcome = table.explore()
    assert (outcome.success, outcome.error) == (False, error)
    assert re.search(expected, outcome.message)
    detected_ns = next(s.stamp_ns for s in table.states if s.phase in (Phase.LIFT, Phase.ABORTED))
    record_property('detected_s', (detected_ns - happened[0]) * 1e-9)
    assert (detected_ns - happened[0]) * 1e-9 <= soon_s
    assert all(time_ns <= detected_ns + 100_000_000 for time_ns, slides in moved if slides)
    assert table.phases[-1] is Phase.ABORTED
    if name != 'a shove out of the workspace':
        table.arm.connect()  # as the explorer does, once the arm is in trouble
    assert table.explore().success


@pytest.mark.parametrize('speed_m_s', [0.05, 0.1])
def test_a_wall_in_the_path_ends_the_slide_and_the_finger_goes_back_before_it_is_lifted(make_table, speed_m_s):
    table = make_table(shape=Shape(wall_m=0.02))
    held = []
    table.at_each_step = lambda: held.append(table.arm.state().force_size_n)
    outcome = table.explore(ExplorationRequest('linear_slide', speed_m_s=speed_m_s, force_n=1.0, distance_m=0.06))
    print(f'{max(held):.1f} N: {outcome}')
    assert (outcome.success, outcome.lifted) == (False, True)
    assert 'along the surface' in outcome.message
    assert max(held) < 10.0 + 20000.0 * 0.035 * speed_m_s
    assert sum(force_n > 10.0 for force_n in held) <= 10  # steps of 10 ms
    assert held[-1] < 0.01


def test_a_force_that_comes_late_at_a_wall_is_not_taken_for_something_above_the_finger(make_table):
    """The force of the wall still grows in the readings while the finger is on its way back and up already."""
    table = make_table(TableArmParams(force_mode=False), shape=Shape(wall_m=0.02))
    state, late = table.arm.state, deque(maxlen=5)

    def state_with_late_force():
        arm = state()
        late.append(arm)
        return replace(arm, force_n=late[0].force_n, along_n=late[0].along_n)

    table.arm.state = state_with_late_force
    outcome = table.explore(ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.06))
    assert (outcome.success, outcome.lifted) == (False, True)
    assert 'along the surface' in outcome.message
    assert 'not lifted' not in outcome.message
