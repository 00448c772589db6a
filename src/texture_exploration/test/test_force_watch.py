# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A force sensor that freezes, drifts or has the wrong sign: it is noticed soon, and the finger is lifted."""

from dataclasses import replace

import pytest
from table_arm import Shape, TableArm, TableArmParams

from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.arm import ArmCommand, ArmState
from texture_exploration.guards import ForceWatch
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams

REQUEST = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.06)
ARM = TableArmParams(force_mode=False, start_height_m=0.002, max_stiffness_n_m=20000.0)
TILT = 0.005  # a steeper slope is no success with one gain for the stiffest contact


def explore(make_table, arm, happens, phase, *, request=REQUEST, tilt_rad=0.0):
    """Explore while something happens in a phase; return the table, the outcome, and when it was."""
    touch = TouchParams(approach_stiffness_n_m=arm.max_stiffness_n_m)
    table = make_table(arm, touch, shape=Shape(tilt_rad=tilt_rad))
    happened = []
    table.when[phase] = lambda: (happened.append(table.now_ns), happens(table.arm))
    return table, table.explore(request), happened[0]


def lifted_ns(table):
    """Return when the finger began to be lifted, or the end if it had not come down yet."""
    return next(state.stamp_ns for state in table.states if state.phase in (Phase.LIFT, Phase.ABORTED))


@pytest.mark.parametrize('tilt_rad', [0.0, TILT, -TILT])
@pytest.mark.parametrize('stiffness', [200.0, 2000.0, 20000.0])
@pytest.mark.parametrize('phase', [Phase.APPROACH, Phase.CONTACT, Phase.SLIDE])
def test_a_frozen_force_is_noticed_within_100_ms_and_the_finger_is_lifted(make_table, phase, stiffness, tilt_rad):
    arm = replace(ARM, stiffness_n_m=stiffness, max_stiffness_n_m=stiffness)
    freeze = TableArm.freeze_force
    table, outcome, frozen_ns = explore(make_table, arm, freeze, phase, tilt_rad=tilt_rad)
    assert not outcome.success
    assert outcome.message.startswith('the measured force is frozen: it has been')
    assert (lifted_ns(table) - frozen_ns) * 1e-9 <= 0.1
    assert table.largest_n < 6.0
    assert table.arm.true_force_n == 0.0


@pytest.mark.parametrize('noise_n', [0.0, 0.001])
@pytest.mark.parametrize('stiffness', [200.0, 2000.0, 20000.0])
def test_a_force_that_freezes_far_from_the_wanted_one_is_noticed_without_noise_too(make_table, stiffness, noise_n):
    arm = replace(ARM, stiffness_n_m=stiffness, max_stiffness_n_m=stiffness, force_noise_n=noise_n)
    table, outcome, frozen_ns = explore(make_table, arm, TableArm.freeze_force, Phase.CONTACT)
    assert outcome.message.startswith('the measured force is frozen')
    assert (lifted_ns(table) - frozen_ns) * 1e-9 <= 0.25  # it stands at first, which proves nothing without noise
    assert table.largest_n < 6.0


@pytest.mark.parametrize('force_mode', [True, False])
@pytest.mark.parametrize('tilt_rad', [0.0, TILT, -TILT])
@pytest.mark.parametrize('stiffness', [200.0, 2000.0, 20000.0])
def test_an_arm_without_noise_whose_force_stays_the_same_is_believed(make_table, force_mode, tilt_rad, stiffness):
    arm = replace(ARM, stiffness_n_m=stiffness, max_stiffness_n_m=stiffness, force_mode=force_mode, force_noise_n=0.0)
    table = make_table(arm, TouchParams(approach_stiffness_n_m=20000.0), shape=Shape(tilt_rad=tilt_rad))
    outcome = table.explore(REQUEST)
    assert outcome.success, outcome.message


@pytest.mark.parametrize('force_mode', [True, False])
@pytest.mark.parametrize('rate_n_s', [-0.5, 0.5, 2.0])
def test_a_force_that_drifts_over_the_slide_is_no_success(make_table, rate_n_s, force_mode):
    arm = replace(ARM, force_mode=force_mode)
    table, outcome, _ = explore(
        make_table, arm, lambda arm: arm.drift_force(rate_n_s), Phase.SLIDE, request=replace(REQUEST, distance_m=0.1)
    )
    assert not outcome.success
    assert outcome.message.startswith(
        ('the force in free air was', 'the contact with the surface was lost', 'the mean force of the slide was')
    )
    assert table.largest_n < 3.0


@pytest.mark.parametrize('rate_n_s', [0.3, 1.0])
def test_a_force_that_drifts_up_in_free_air_is_not_taken_for_a_slide(make_table, rate_n_s):
    _, outcome, _ = explore(make_table, ARM, lambda arm: arm.drift_force(rate_n_s), Phase.APPROACH)
    assert not outcome.success


def test_a_small_drift_is_allowed(make_table):
    _, outcome, _ = explore(make_table, ARM, lambda arm: arm.drift_force(0.05), Phase.SLIDE)
    assert outcome.success, outcome.message


def test_a_force_of_the_wrong_sign_is_limited_too():
    state = ArmState(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), -10.1)
    assert SafetyLimits().force_violation(state).endswith('its sign is wrong')


def test_a_pause_of_the_arm_is_no_frozen_reading():
    watch = ForceWatch(SafetyLimits(), True, 1.0)
    state = ArmState(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.5)
    assert not any(watch.frozen(state, ArmCommand()) for _ in range(100))
    assert watch.frozen(replace(state, time_ns=400_000_000), ArmCommand()) == ''  # one state after a pause


@pytest.mark.parametrize(('late_s', 'is_frozen'), [(0.03, False), (0.2, True)])
def test_a_force_that_the_arm_held_may_stay_the_same_until_the_lift_takes_effect(late_s, is_frozen):
    """A hand in current control reports exactly the force that it holds; one count of its encoder moves the height."""
    watch = ForceWatch(SafetyLimits(), False, 1.0)
    for step in range(50):
        free = ArmState(step * 10_000_000, (0.0, 0.0, 0.01), (0.0, 0.0, 0.0), 0.0)
        watch.note(Phase.APPROACH, free, ArmCommand(normal_m_s=-0.01))
    said = []
    for step in range(130):
        lifted_s = max(0.0, 0.01 * (step - 100))
        height_m = -0.0005 + (0.00007 if step > 50 else 0.0) + 0.05 * lifted_s
        force_n = 1.0 if lifted_s <= late_s else 0.0
        command = ArmCommand(force_n=1.0) if step < 100 else ArmCommand(normal_m_s=0.05)
        said.append(watch.frozen(ArmState(step * 10_000_000, (0.0, 0.0, height_m), (0.0, 0.0, 0.0), force_n), command))
    assert not any(said[:105])
    assert any(said[105:110]) is is_frozen  # within 100 ms of the lift


@pytest.mark.parametrize(
    ('lift', 'drifted'),
    [
        ([(0.0, 1.0)] * 6 + [(0.004, 0.0)], False),  # a busy machine saw one state of the lift
        ([(0.0, 1.0)] * 6 + [(0.004, 0.8), (0.008, 0.8)], True),
        ([(0.0, 1.0)] * 6, False),  # and here none
        ([], False),
    ],
)
def test_only_what_was_measured_above_the_surface_counts_as_free_air(lift, drifted):
    watch = ForceWatch(SafetyLimits(), True, wanted_n=1.0)
    for step in range(40):
        watch.note(Phase.APPROACH, ArmState(step * 10_000_000, (0.0, 0.0, 0.01), (0.0, 0.0, 0.0), 0.0), ArmCommand())
    for height_m, force_n in lift:
        watch.note(Phase.LIFT, ArmState(10**9, (0.0, 0.0, height_m), (0.0, 0.0, 0.0), force_n), ArmCommand())
    assert bool(watch.drifted()) is drifted


@pytest.mark.parametrize('moves_at_s', [0.0, 0.3])
def test_what_was_measured_while_the_sensor_may_be_zeroed_is_no_free_air(moves_at_s):
    """An arm zeroes for 0.1 s from its first state, or from its last one at rest: here -3 N become 0 N."""
    watch = ForceWatch(SafetyLimits(), True, wanted_n=1.0)
    zeroed_s = moves_at_s + 0.08
    for step in range(round(100 * zeroed_s) + 6):
        at_s = 0.01 * step
        free = ArmState(step * 10_000_000, (0.0, 0.0, 0.01), (0.0, 0.0, 0.0), -3.0 if at_s < zeroed_s else 0.0)
        watch.note(Phase.APPROACH, free, ArmCommand() if at_s < moves_at_s else ArmCommand(normal_m_s=-0.01))
    for height_m in (0.0, 0.004, 0.008):
        watch.note(Phase.LIFT, ArmState(10**9, (0.0, 0.0, height_m), (0.0, 0.0, 0.0), 3.0), ArmCommand())
    assert 'was 0.00 N before the slide and 3.00 N after it' in watch.drifted()
