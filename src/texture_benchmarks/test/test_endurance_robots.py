"""Endurance of the emulated robots without nodes: schedules, true contact and requirements."""

import json
import math
from dataclasses import replace
from itertools import islice

import pytest

from texture_benchmarks.endurance import robot_report
from texture_benchmarks.endurance.robot_faults import (
    AT_START,
    HAND,
    NO_FAULT,
    RAILS,
    RIGS,
    ROBOT_FAULTS,
    SIMULATED_ARM,
    UR,
    PlannedRobotFault,
    RobotSession,
    sessions,
)
from texture_benchmarks.endurance.robot_record import ExplorerExit, RobotExploration, RobotRecord
from texture_benchmarks.endurance.robot_requirements import check_robots
from texture_benchmarks.endurance.robot_rigs import RIG_CLASSES
from texture_benchmarks.endurance.true_contact import TrueContact, true_contact
from texture_core.finger_state import FingerState
from texture_core.parameters import parameters_of
from texture_exploration.arms.in_hand import InHandParams
from texture_exploration.arms.rails import RailsParams
from texture_exploration.arms.simulated import SimulatedArmParams
from texture_exploration.arms.ur_params import UrArmParams
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits
from texture_exploration.signal_watch import SignalWatchParams

ASKED_N = 3.0
KEPT = TrueContact(slide_s=2.0, observed_s=2.0, mean_force_n=3.0, max_force_n=3.2, longest_loss_s=0.0)
EXITS = (ExplorerExit(UR, 'SIGINT', 90.0, 0.5),)
ARM_PARAMS = {UR: UrArmParams, HAND: InHandParams, RAILS: RailsParams, SIMULATED_ARM: SimulatedArmParams}


def exploration(**changed):
    given = {
        'rig': UR, 'fault': NO_FAULT, 'detail': '', 'injected': True, 'attempt': 0, 'begin_s': 0.0, 'end_s': 4.0,
        'motion': 'linear_slide', 'force_n': ASKED_N, 'ending': 'success', 'message': 'the motion ended as asked',
        'contact': KEPT,
    }  # fmt: skip
    return RobotExploration(**{**given, **changed})


def aborted(**changed):
    return exploration(**{'ending': 'aborted', 'message': 'the arm reports a fault: protective stop', **changed})


def record(*explorations, exits=EXITS):
    return RobotRecord(0.0, 100.0, 7, 1, [exploration(), *explorations], list(exits), {UR: {}}, [8.0])


def failed(*explorations, **changed):
    """Return what does not hold."""
    return [item.asked for item in check_robots(record(*explorations, **changed)) if not item.holds]


def fingers(forces_n, rate_hz=100.0):
    """Return the datagrams of an emulator from time 0 on."""
    return [FingerState(round(1e9 * i / rate_hz), force_n=force) for i, force in enumerate(forces_n)]


def test_a_run_in_which_all_is_as_asked_passes():
    assert failed(aborted(fault='protective stop'), exploration(fault='protective stop', attempt=1)) == []


@pytest.mark.parametrize('force_n', [6.0, 3.0 * 1.31, 3.0 * 0.69, 0.0, math.nan])
def test_a_success_at_another_true_force_than_the_asked_one_fails(force_n):
    [asked] = failed(exploration(contact=replace(KEPT, mean_force_n=force_n)))
    assert 'true mean force' in asked


@pytest.mark.parametrize('force_n', [3.0 * 1.29, 3.0 * 0.71])
def test_a_success_within_30_percent_of_the_asked_force_passes(force_n):
    assert failed(exploration(contact=replace(KEPT, mean_force_n=force_n))) == []


def test_an_abort_at_another_true_force_is_no_violation():
    assert failed(aborted(contact=replace(KEPT, mean_force_n=6.0, longest_loss_s=1.0))) == []


def test_a_success_with_contact_lost_for_longer_than_the_parameter_fails():
    [asked] = failed(exploration(contact=replace(KEPT, longest_loss_s=0.13)))
    assert 'contact lost' in asked
    assert failed(exploration(contact=replace(KEPT, longest_loss_s=0.11))) == []
    assert failed(exploration(contact=replace(KEPT, longest_loss_s=0.13), lost_contact_s=0.2)) == []


def test_a_success_whose_true_force_nobody_saw_fails():
    [asked] = failed(exploration(contact=replace(KEPT, observed_s=1.0)))
    assert 'known' in asked


@pytest.mark.parametrize(
    'changed',
    [
        {'ending': 'hung', 'message': 'no result within the timeout of 45 s'},
        {'end_s': 61.0},
        {'ending': 'aborted', 'message': ''},
        {'ending': 'aborted', 'message': 'error'},
        {'ending': 'lost', 'message': 'the explorer process has ended', 'fault': 'slow acknowledgements'},
    ],
)
def test_an_exploration_that_hangs_vanishes_or_ends_without_a_sentence_fails(changed):
    assert any('ends as a success or' in asked for asked in failed(exploration(**changed)))


def test_an_exploration_may_be_lost_with_an_explorer_that_was_killed():
    assert failed(exploration(ending='lost', message='the explorer process has ended', fault='explorer killed')) == []


NAMED = {
    'fault': 'another program at connect',
    'ending': 'refused',
    'message': "the arm is not ready: another program is on the controller ('PLAYING x')",
}


def test_a_program_of_somebody_else_must_be_named_and_left_alone():
    again = exploration(fault='another program at connect', attempt=1)
    assert failed(exploration(**NAMED), again) == []
    for changed in ({'taken_over': 'PLAYING rtde_control'}, {'message': 'the arm is not ready'}, {'ending': 'success'}):
        assert any('another program' in asked for asked in failed(exploration(**{**NAMED, **changed}), again))


def test_a_robot_that_never_explores_again_fails():
    tried = [aborted(fault='overload latched', attempt=attempt) for attempt in range(4)]
    [asked] = failed(*tried, exploration())
    assert 'succeeds within three attempts' in asked
    assert failed(*tried[:3], exploration(fault='overload latched', attempt=3), exploration()) == []


@pytest.mark.parametrize('changed', [{'powered': 'motors [1] have torque'}, {'exit_s': 21.0}])
def test_an_exit_that_leaves_torque_or_takes_too_long_fails(changed):
    [asked] = failed(exits=[replace(ExplorerExit(HAND, 'SIGKILL', 90.0, 0.5), **changed)])
    assert 'no motor has torque' in asked


def test_a_run_without_a_success_or_an_exit_proves_nothing():
    empty = RobotRecord(0.0, 1.0, 7, 0, [], [], {}, [])
    assert len([item for item in check_robots(empty) if not item.holds]) == 4


def test_the_true_force_is_the_mean_over_the_slide_alone():
    contact = true_contact(fingers([9.0] * 100 + [3.0] * 100 + [0.0] * 100), (1_000_000_000, 1_990_000_000), 0.75)
    assert contact.mean_force_n == pytest.approx(3.0)
    assert (contact.slide_s, contact.max_force_n, contact.longest_loss_s) == (pytest.approx(0.99), 9.0, 0.0)
    assert contact.observed_s == pytest.approx(0.99)


def test_the_longest_loss_of_several_counts():
    forces_n = [3.0] * 20 + [0.5] * 7 + [3.0] * 20 + [0.0] * 12 + [3.0] * 20 + [math.nan] * 3 + [3.0] * 20
    assert true_contact(fingers(forces_n), (0, 1_010_000_000), 0.75).longest_loss_s == pytest.approx(0.12)


def test_a_loss_up_to_the_end_of_the_slide_counts():
    assert true_contact(fingers([3.0] * 50 + [0.0] * 51), (0, 1_000_000_000), 0.75).longest_loss_s == pytest.approx(0.5)


def test_an_emulator_that_fell_silent_is_not_taken_for_one_that_goes_on_pressing():
    silent = [*fingers([3.0] * 51), FingerState(2_000_000_000, force_n=3.0)]
    contact = true_contact(silent, (0, 2_000_000_000), 0.75)
    assert contact.observed_s == pytest.approx(0.55)
    assert contact.slide_s == 2.0


def test_without_a_slide_only_the_highest_force_is_known():
    contact = true_contact(fingers([1.0, 2.0]), None, 0.75)
    assert math.isnan(contact.mean_force_n)
    assert contact.max_force_n == 2.0


def test_the_same_seed_gives_the_same_sessions_and_every_fault_comes():
    first, second = (list(islice(sessions(5), 300)) for _ in range(2))
    assert first == second
    for rig, faults in ROBOT_FAULTS.items():
        mine = [session for session in first if session.rig == rig]
        assert len(mine) == 300 // len(RIGS)
        drawn = {trial.fault.name for session in mine for trial in session.trials}
        assert drawn == set(faults)
        starts = {session.start_fault for session in mine} - {NO_FAULT}
        assert starts == {name for name, fault in faults.items() if fault.when == AT_START}


def test_a_fault_that_kills_the_explorer_is_the_last_of_its_session():
    for session in islice(sessions(1), 200):
        kills = [ROBOT_FAULTS[session.rig][trial.fault.name].kills for trial in session.trials]
        assert not any(kills[:-1])


@pytest.mark.parametrize('rig', RIGS)
def test_every_parameter_of_a_rig_is_one_of_the_explorer_and_every_fault_has_an_action(rig):
    starts = [name for name, fault in ROBOT_FAULTS[rig].items() if fault.when == AT_START]
    for start in (NO_FAULT, *starts):
        made = RIG_CLASSES[rig](RobotSession(rig, start, (), 'SIGINT'))
        known = (ARM_PARAMS[rig], TouchParams, SafetyLimits, SignalWatchParams)
        assert set(made.parameters) - {'arm'} <= {item.name for cls in known for item in parameters_of(cls)}
        assert {fault.action for fault in ROBOT_FAULTS[rig].values()} - set(made.actions) == set()


def test_the_report_holds_each_exploration_and_what_failed(tmp_path):
    wrong = exploration(contact=replace(KEPT, mean_force_n=6.0))
    page, figures, picture = robot_report.write_robots(record(aborted(fault='protective stop'), wrong), tmp_path)
    content = json.loads(figures.read_text())['numbers']
    assert len(content['explorations']) == 3
    assert [item['holds'] for item in content['requirements'] if 'true mean force' in item['asked']] == [False]
    assert '**no**' in page.read_text()
    assert picture.stat().st_size > 10_000


def test_a_planned_fault_has_the_strength_of_its_kind():
    for session in islice(sessions(2), 100):
        for trial in session.trials:
            kind = ROBOT_FAULTS[session.rig][trial.fault.name]
            assert kind.low <= trial.fault.strength <= kind.high
            assert isinstance(trial.fault, PlannedRobotFault)
