# SPDX-License-Identifier: Apache-2.0
"""The arm behind an emulated controller that is a process of its own, seen only through its topics."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from texture_msgs import msg, srv

from texture_core.errors import DeviceError, MotionRefused
from texture_core.ros import STATE_QOS, to_msg
from texture_core.ros_testing import LocalGraph, NodeProcess, killed_on_error
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.ros_controllers import RosControllersArm, RosControllersParams
from texture_exploration.explorer import Explorer
from texture_exploration.ros import controllers as controller_topics
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import TouchParams

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

# Patient with a busy machine where that is not what is tried.
PATIENT = RosControllersParams(connect_timeout_s=30.0, deadman_s=1.0, max_impact_n=0.5, accept_no_timeout=True)
TOUCH = TouchParams(peak_speed_fraction=3.4)  # it makes up for up to 0.1 s: seen over 30 ms, up to 4.3 times as fast
LIMITS = SafetyLimits(state_timeout_s=2.0, approach_timeout_s=60.0)
SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.05)
HELD = {'start_height_m': 0.003, 'command_timeout_s': 0.0}  # as a controller that holds the last velocity for ever
DEADLINE_S = 60.0
MANAGED = {
    'arm': 'managed_arm:ManagedArm',
    'controller_manager': 'controller_manager',
    'activate_controllers': 'twist',
    'deactivate_controllers': 'joints',
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
    with LocalGraph(94, deadline_s=DEADLINE_S) as graph:
        yield graph
    signal.signal(signal.SIGHUP, before)


@pytest.fixture
def make_explorer():
    """Return explorers; one that a failed test leaves behind would command the arm of the next."""
    with ExitStack() as closing:

        def make(params=PATIENT):
            explorer = Explorer(RosControllersArm(params), TOUCH, LIMITS, lambda state: None)
            closing.callback(explorer.close)
            return explorer

        yield make


def explored(explorer, on_slide=None):
    """Return the exploration, after doing something in its slide, and when that was, ns."""
    exploration, done_ns = explorer.begin('one', SLIDE), 0
    while not exploration.ended.wait(0.002):
        if on_slide and not done_ns and exploration.state.phase is Phase.SLIDE:
            done_ns = time.monotonic_ns()
            on_slide()
    return exploration, done_ns


def test_a_controller_that_dies_in_the_slide_is_named_and_the_next_request_connects_again(
    graph, make_explorer, record_property
):
    explorer = make_explorer()
    with NodeProcess('texture_simulation', 'twist_controller', HELD) as controller:
        explorer.connect()
        exploration, since_ns = explored(explorer, lambda: controller.process.send_signal(signal.SIGKILL))
    assert since_ns, exploration.outcome
    assert not exploration.outcome.success
    # It shows by what comes first: no pose, no listener, or no motion.
    assert re.search('no pose has come|nobody listens|the controller on .* is not active', exploration.outcome.message)
    record_property('detected_s', (exploration.state.stamp_ns - since_ns) * 1e-9)
    with NodeProcess('texture_simulation', 'twist_controller', HELD):
        # Until its lease ends, the dead controller counts as a listener: on a busy machine the first commands may be
        # sent before the new one hears them, and the exploration is aborted by name.
        again = []
        while not (again and again[-1].success) and len(again) < 3:
            again.append(explored(explorer)[0].outcome)
    explorer.close()
    assert again[-1].success, again


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


def test_a_guard_that_is_killed_ends_the_slide_with_the_finger_lifted(graph, make_explorer):
    explorer = make_explorer()
    with NodeProcess('texture_simulation', 'twist_controller', HELD):
        explorer.connect()
        exploration, since_ns = explored(explorer, lambda: os.kill(guard_of(explorer), signal.SIGKILL))
        assert since_ns, exploration.outcome
        assert 'guard' in exploration.outcome.message
        assert exploration.outcome.lifted
        assert explored(explorer)[0].outcome.success  # the next request starts another
        explorer.close()


def guard_of(explorer):
    return explorer.arm._topics._guard.pid


def test_another_commander_ends_the_slide_with_the_finger_lifted_and_then_keeps_the_arm_from_being_taken(
    graph, make_explorer
):
    explorer = make_explorer(replace(PATIENT, connect_timeout_s=10.0))
    with NodeProcess('texture_simulation', 'twist_controller', HELD):
        explorer.connect()
        others = []
        exploration, since_ns = explored(
            explorer, lambda: others.append(graph.peer.create_publisher(TwistStamped, 'twist_controller/twist', 1))
        )
        assert since_ns, exploration.outcome
        assert exploration.outcome.lifted
        assert "'/peer' commands" in exploration.outcome.message
        with pytest.raises(MotionRefused, match="'/peer' commands"):
            explorer.begin('two', SLIDE)
        graph.peer.destroy_publisher(others[0])
        assert explored(explorer)[0].outcome.success
        explorer.close()


def test_a_second_explorer_is_refused_and_does_not_disturb_the_first(graph, make_explorer):
    first = make_explorer()
    second = RosControllersArm(replace(PATIENT, connect_timeout_s=2.0))
    with NodeProcess('texture_simulation', 'twist_controller', HELD), ThreadPoolExecutor() as pool:
        first.connect()
        refused = []
        exploration, _ = explored(first, lambda: refused.append(pool.submit(second.connect)))
        with pytest.raises(DeviceError, match='commands'):
            refused[0].result()
        assert exploration.outcome.success, exploration.outcome.message
        first.close()


def test_a_controller_that_declares_no_timeout_is_refused_unless_that_is_accepted(graph):
    with pytest.raises(DeviceError, match=r"'controller_timeout_s'.*'accept_no_timeout: true'"):
        RosControllersArm(RosControllersParams()).connect()


@pytest.mark.parametrize(('blink_s', 'must_be_seen'), [(0.006, False), (0.1, True)])
def test_a_blink_of_the_subscription_in_the_slide_lifts_the_finger(graph, make_explorer, blink_s, must_be_seen):
    """One of 6 ms falls between two looks of the arm now and then, and does nothing."""
    explorer = make_explorer()
    with NodeProcess('texture_simulation', 'twist_controller', HELD):
        explorer.connect()
        client = graph.peer.create_client(SetParameters, 'twist_controller/set_parameters')
        graph.until(client.service_is_ready)
        blink = SetParameters.Request(parameters=[Parameter('blink_s', value=blink_s).to_parameter_msg()])
        exploration, since_ns = explored(explorer, lambda: client.call_async(blink))
        assert since_ns, exploration.outcome
        assert exploration.outcome.lifted, exploration.outcome.message
        assert not (must_be_seen and exploration.outcome.success)
        if not exploration.outcome.success:
            assert 'for a moment nobody listened' in exploration.outcome.message
        explorer.close()


def test_a_finger_that_a_killed_explorer_left_pressed_is_lifted_on_request_before_anything_else(graph, make_explorer):
    with NodeProcess('texture_simulation', 'twist_controller', HELD):
        killed = make_explorer()
        killed.connect()
        exploration, since_ns = explored(killed, killed.arm.close)  # stands still and presses, as after SIGKILL
        assert since_ns, exploration.outcome
        killed.connect()
        assert killed.arm.state().position[2] < 0.0
        height_m = killed.lift()
        killed.close()
    assert height_m > 0.001


def test_a_hand_over_without_the_messages_of_the_controller_manager_is_refused(graph, monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(controller_topics.importlib, 'import_module', missing)
    topics = controller_topics.RosTopics(replace(PATIENT, controller_manager='controller_manager'))
    try:
        with pytest.raises(DeviceError, match='which needs controller_manager_msgs; install it'):
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
