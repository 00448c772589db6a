# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What takes and gives back the arm behind ROS controllers: processes that end, the guard, the controller manager."""

import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from std_srvs.srv import Trigger
from texture_msgs import msg, srv

from texture_core.errors import DeviceError
from texture_core.ros import STATE_QOS, to_msg
from texture_core.ros_testing import LocalGraph, NodeProcess, killed_on_error
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.ros_controllers import RosControllersArm, RosControllersParams
from texture_exploration.ros import controllers as controller_topics

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

PATIENT = RosControllersParams(connect_timeout_s=30.0, accept_no_timeout=True)
HELD = {'start_height_m': 0.003, 'command_timeout_s': 0.0}  # as a controller that holds the last velocity for ever
DEADLINE_S = 60.0
MANAGED = {
    'arm': 'managed_arm:ManagedArm',
    'controller_manager': 'controller_manager',
    'activate_controllers': 'twist',
    'deactivate_controllers': 'joints',
    'max_stiffness_n_m': 2000.0,  # that of the contact: it comes down faster
    'max_impact_n': 1.0,
    'watch_signal': False,
    'state_timeout_s': 2.0,
    'deadman_s': 1.0,
}
MOVING = """
import time
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.ros_controllers import RosControllersArm, RosControllersParams

arm = RosControllersArm(RosControllersParams(connect_timeout_s=30.0, deadman_s=1.0, accept_no_timeout=True))
arm.connect()
print('moving', flush=True)
while True:
    arm.command(ArmCommand(tangential_m_s=(0.01, 0.0)))
    time.sleep(0.01)
"""


@pytest.fixture
def graph():
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup it is ignored, and a node would inherit that
    with LocalGraph(82, deadline_s=DEADLINE_S) as graph:
        yield graph
    signal.signal(signal.SIGHUP, before)


def end_by(number):
    def end(_graph, explorer):
        explorer.process.send_signal(number)
        assert explorer.wait(DEADLINE_S) == 0

    return end


def end_by_deactivation(graph, _explorer):
    client = graph.peer.create_client(ChangeState, 'explorer/change_state')
    graph.until(client.service_is_ready)
    request = ChangeState.Request()
    request.transition.id = Transition.TRANSITION_DEACTIVATE
    answer = client.call_async(request)
    graph.until(answer.done)
    assert answer.result().success


@pytest.mark.parametrize(
    'end',
    [end_by(signal.SIGINT), end_by(signal.SIGHUP), end_by(signal.SIGQUIT), end_by_deactivation],
    ids=['Ctrl-C', 'hang-up', 'quit', 'deactivation'],
)
def test_controllers_are_handed_back_with_the_finger_lifted_and_at_rest(graph, monkeypatch, tmp_path, end):
    log = tmp_path / 'switches'
    monkeypatch.setenv('MANAGED_LOG', str(log))
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join([str(Path(__file__).parent), os.environ.get('PYTHONPATH', '')]))
    states = graph.listen(msg.ExplorationState, 'exploration', STATE_QOS)
    with NodeProcess('texture_exploration', 'explorer', MANAGED) as explorer:
        client = graph.peer.create_client(srv.Explore, 'explore')
        graph.until(client.service_is_ready)
        request = ExplorationRequest('linear_slide', speed_m_s=0.01, force_n=1.0, distance_m=0.1)
        client.call_async(srv.Explore.Request(request=to_msg(request)))
        graph.until(lambda: any(state.phase == Phase.SLIDE.code for state in states))
        end(graph, explorer)
        taken, given_back = map(json.loads, log.read_text().splitlines())
    assert (taken['activated'], taken['deactivated']) == (['twist'], ['joints'])
    assert (given_back['activated'], given_back['deactivated']) == (['joints'], ['twist'])
    assert given_back['at_rest']
    assert given_back['height_m'] > 0.0  # in the slide it was pressed into the surface


@pytest.mark.parametrize('transition', [Transition(id=Transition.TRANSITION_CONFIGURE), Transition(id=99)])
def test_an_invalid_lifecycle_request_is_refused_and_the_explorer_lives(graph, transition):
    with NodeProcess('texture_exploration', 'explorer', {'watch_signal': False}) as explorer:
        client = graph.peer.create_client(ChangeState, 'explorer/change_state')
        graph.until(client.service_is_ready)
        answers = [client.call_async(ChangeState.Request(transition=transition)) for _ in range(2)]
        graph.until(lambda: explorer.process.poll() is not None or all(answer.done() for answer in answers))
        assert explorer.process.poll() is None, explorer.output
        assert not any(answer.result().success for answer in answers)
        assert 'Traceback' not in explorer.output


def test_a_guard_commands_zero_force_as_well_once_nobody_speaks_for_the_arm(graph):
    wrenches = graph.listen(WrenchStamped, 'target')
    guard = controller_topics.TwistGuard(0.05, '/twist', 'base', '/target', 'base')
    try:
        graph.until(lambda: guard.beat(moving=True) or graph.peer.count_publishers('target'))
        graph.until(lambda: wrenches)
    finally:
        guard.dismiss()
    force = wrenches[0].wrench.force
    assert (wrenches[0].header.frame_id, force.x, force.y, force.z) == ('base', 0.0, 0.0, 0.0)


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGSTOP])
def test_when_the_process_that_commands_is_killed_or_stopped_its_guard_brings_the_arm_to_rest(
    graph, number, record_property
):
    """Stopped as by a debugger or a frozen cgroup: nothing ends, so that no pipe is closed."""
    places = graph.listen(PoseStamped, 'tcp_pose_broadcaster/pose')

    def x_m():
        return places[-1].pose.position.x

    with NodeProcess('texture_simulation', 'twist_controller', HELD):
        graph.until(lambda: places)
        command = [sys.executable, '-c', MOVING]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process, killed_on_error(process):
            graph.until(lambda: x_m() > places[0].pose.position.x + 0.002)
            process.send_signal(number)
            end_m = x_m()
            graph.until(lambda: len(places) > 100 and x_m() == pytest.approx(places[-100].pose.position.x, abs=1e-9))
            process.kill()
    record_property('gone_m', x_m() - end_m)
    assert x_m() - end_m < 0.005  # without a guard it never comes to rest


CLAIMING = """
import time

import rclpy
from geometry_msgs.msg import TwistStamped
from texture_exploration.ros.controllers import claim

rclpy.init()
node = rclpy.create_node('other')
file = claim(node)
publisher = node.create_publisher(TwistStamped, 'twist', 1)
time.sleep(600)
"""


@pytest.mark.parametrize('known', [True, False], ids=['of ours', 'of somebody else'])
def test_a_publisher_of_a_killed_process_is_passed_over_if_that_process_was_ours(graph, tmp_path, known):
    """ROS shows it for 20 s more; one whose file is elsewhere may be alive."""
    environment = {**os.environ, **({} if known else {'TMPDIR': str(tmp_path)})}

    def found():
        return graph.peer.get_publishers_info_by_topic('twist')

    with subprocess.Popen([sys.executable, '-c', CLAIMING], env=environment) as process, killed_on_error(process):
        graph.until(found)
        assert not controller_topics.has_ended(found()[0])
        process.kill()
    assert controller_topics.has_ended(found()[0]) is known


@pytest.mark.parametrize(('offered', 'started_by'), [(True, controller_topics.SCOPE), (False, ())])
def test_the_guard_has_a_control_group_of_its_own_where_systemd_offers_one(tmp_path, monkeypatch, offered, started_by):
    """A stand-in for systemd-run: most containers have none."""
    stand_in = tmp_path / 'systemd-run'
    stand_in.write_text(f'#!/bin/sh\nexit {int(not offered)}\n')
    stand_in.chmod(0o755)
    monkeypatch.setenv('PATH', str(tmp_path))
    controller_topics.scope.cache_clear()
    try:
        assert controller_topics.scope() == started_by
    finally:
        controller_topics.scope.cache_clear()


def test_a_controller_that_declares_no_timeout_is_refused_unless_that_is_accepted(graph):
    with pytest.raises(DeviceError, match=r"'controller_timeout_s'.*'accept_no_timeout: true'"):
        RosControllersArm(RosControllersParams()).connect()


def test_a_hand_over_without_the_messages_of_the_controller_manager_is_refused(graph, monkeypatch):
    def missing(name):
        raise ImportError(name)

    topics = controller_topics.RosTopics(replace(PATIENT, controller_manager='controller_manager'))
    try:
        with monkeypatch.context() as patch, pytest.raises(DeviceError, match='which needs controller_manager_msgs'):
            patch.setattr(controller_topics.importlib, 'import_module', missing)
            topics.switch_controllers(('twist_controller',), ())
    finally:
        topics.close()


def test_the_controller_manager_is_asked_over_ros_and_one_that_is_not_there_is_waited_for_in_vain(graph):
    """The service stands in for SwitchController, whose messages the wheels of ROS lack."""
    asked = []

    def answer(request, response):
        asked.append(request)
        response.success, response.message = False, 'a stand-in'
        return response

    graph.peer.create_service(Trigger, 'manager/switch_controller', answer)
    topics = controller_topics.RosTopics(replace(PATIENT, connect_timeout_s=DEADLINE_S))
    silent = controller_topics.RosTopics(replace(PATIENT, connect_timeout_s=0.2, twist_topic='another/twist'))
    try:
        with ThreadPoolExecutor() as pool:
            answered = pool.submit(topics._ask, Trigger, 'manager/switch_controller', Trigger.Request())
            graph.until(answered.done)
        assert answered.result().message == 'a stand-in'
        assert len(asked) == 1
        assert silent._ask(Trigger, 'no_manager/switch_controller', Trigger.Request()) is None
    finally:
        topics.close()
        silent.close()
