"""Endurance of the emulated robots, shortened: the launched explorer, real processes, two faults."""

import importlib.util
import os

import pytest

pytestmark = [pytest.mark.benchmark, pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from texture_benchmarks.endurance.robot_faults import HAND, RAILS, UR, PlannedRobotFault, RobotSession, RobotTrial  # noqa: E402
from texture_benchmarks.endurance.robot_requirements import check_robots  # noqa: E402
from texture_benchmarks.endurance.robot_run import RobotPlan, endure_robots  # noqa: E402
from texture_core.exploration import ExplorationRequest  # noqa: E402

SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.04, force_n=3.0, distance_m=0.05)
RUB = ExplorationRequest('in_hand_sliding', speed_m_s=0.02, force_n=1.0, distance_m=0.02, duration_s=2.0)
DEADLINE_S = 60.0


def needs(module):
    return pytest.mark.skipif(importlib.util.find_spec(module) is None, reason=f'{module} is not installed')


def run(rig, start_fault, trials, tmp_path, exit_by='SIGINT'):
    session = RobotSession(rig, start_fault, trials, exit_by)
    log = tmp_path / 'explorers.log'
    kept = []
    record = endure_robots(RobotPlan(DEADLINE_S), log, lambda _: None, [session], kept.append)
    assert [len(item.explorations) for item in kept] == [len(record.explorations)]
    told = log.read_text() + '\n'.join(item.message for item in record.explorations)
    assert [item.asked for item in check_robots(record) if not item.holds] == [], told
    return record


@needs('rtde_control')
def test_another_program_is_named_then_a_lost_surface_aborts_and_the_same_request_succeeds(tmp_path):
    trials = [
        RobotTrial(SLIDE, PlannedRobotFault('another program at connect')),
        RobotTrial(SLIDE, PlannedRobotFault('surface lost', 0.012, 0.2)),
    ]
    record = run(UR, 'another program at connect', trials, tmp_path)
    named, _, lost, _ = record.explorations
    assert 'another program is on the controller' in named.message
    assert (lost.ending, 'contact with the surface was lost' in lost.message) == ('aborted', True)
    assert lost.contact.longest_loss_s > 0.05


@needs('dynamixel_sdk')
def test_an_exception_in_the_bus_thread_is_named_and_no_motor_keeps_its_torque(tmp_path):
    trials = [RobotTrial(RUB, PlannedRobotFault('exception in the bus thread', 0.0, 0.3))]
    record = run(HAND, 'none', trials, tmp_path, 'SIGKILL')
    assert 'InjectedError' in record.explorations[0].message
    assert record.explorations[-1].ending == 'success'
    assert record.exits[0].powered == ''


@needs('serial')
def test_rails_whose_cable_is_pulled_out_are_named_and_the_same_request_succeeds(tmp_path):
    trials = [RobotTrial(SLIDE, PlannedRobotFault('cable pulled out', 0.3, 0.3))]
    record = run(RAILS, 'none', trials, tmp_path)
    named, again = record.explorations
    assert ('cannot be reached' in named.message, again.ending) == (True, 'success')
    assert record.exits[0].powered == ''
