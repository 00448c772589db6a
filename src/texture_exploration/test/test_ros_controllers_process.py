"""The arm behind an emulated controller that is a process of its own, seen only through its topics."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from std_srvs.srv import Trigger
from texture_msgs import msg, srv

from texture_core.errors import DeviceError
from texture_core.exploration import ExplorationRequest, Phase
from texture_core.node_process import NodeProcess, killed_on_error
from texture_core.ros.local_graph import LocalGraph
from texture_core.ros.qos import STATE_QOS
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.ros_controllers_params import RosControllersParams
from texture_exploration.explorer import Explorer
from texture_exploration.motions.touch import TouchParams
from texture_exploration.ros import controller_topics
from texture_exploration.safety import SafetyLimits

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

# Patient with a busy machine where that is not what is tried.
PATIENT = RosControllersParams(connect_timeout_s=30.0, deadman_s=1.0, max_impact_n=0.5)
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
from texture_exploration.arms.protocol import ArmCommand
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.ros_controllers_params import RosControllersParams

arm = RosControllersArm(RosControllersParams(connect_timeout_s=30.0, deadman_s=1.0))
arm.connect()
print('moving', flush=True)
while True:
    arm.command(ArmCommand(tangential_m_s=(0.01, 0.0)))
    time.sleep(0.01)
"""


@pytest.fixture
def graph():
    with LocalGraph(94, deadline_s=DEADLINE_S) as graph:
        yield graph


def explored(explorer, on_slide=None):
    """Return the exploration, after doing something in its slide, and when that was, ns."""
    exploration, done_ns = explorer.begin('one', SLIDE), 0
    while not exploration.ended.wait(0.002):
        if on_slide and not done_ns and exploration.state.phase is Phase.SLIDE:
            done_ns = time.monotonic_ns()
            on_slide()
    return exploration, done_ns


def test_a_controller_that_dies_in_the_slide_is_named_and_the_next_request_connects_again(graph, record_property):
    explorer = Explorer(RosControllersArm(PATIENT), TouchParams(), LIMITS, lambda state: None)
    with NodeProcess('texture_simulation', 'twist_controller', HELD) as controller:
        explorer.connect()
        exploration, since_ns = explored(explorer, lambda: controller.process.send_signal(signal.SIGKILL))
    assert since_ns
    assert not exploration.outcome.success
    # It shows by what comes first: no pose, no listener, or no motion.
    assert re.search('no pose has come|nobody listens|the controller on .* is not active', exploration.outcome.message)
    record_property('detected_s', (exploration.state.stamp_ns - since_ns) * 1e-9)
    with NodeProcess('texture_simulation', 'twist_controller', HELD):
        # Until its lease ends, the dead controller counts as a listener: on a busy machine the first commands may be
        # sent before the new one hears them, and the exploration is aborted by name.
        again = next((found for _ in range(3) if (found := explored(explorer)[0]).outcome.success), None)
    explorer.close()
    assert again is not None


def test_an_emulated_controller_that_is_interrupted_with_the_explorer_lets_it_lift_the_finger_first(graph):
    """As by Ctrl-C in the terminal of a launch; a real controller is not part of that launch."""
    explorer = Explorer(RosControllersArm(PATIENT), TouchParams(), LIMITS, lambda state: None)
    with NodeProcess('texture_simulation', 'twist_controller', HELD) as controller:
        explorer.connect()

        def interrupt():
            controller.process.send_signal(signal.SIGINT)
            explorer.stop('interrupted')

        exploration, since_ns = explored(explorer, interrupt)
        assert since_ns
        assert exploration.outcome.message == 'interrupted'  # anything else ends without a lift
        explorer.close()
        assert controller.process.wait(DEADLINE_S) == 0


def test_when_the_process_that_commands_is_killed_the_arm_comes_to_rest(graph, record_property):
    places = graph.listen(PoseStamped, 'tcp_pose_broadcaster/pose')
    with NodeProcess('texture_simulation', 'twist_controller', HELD):
        graph.until(lambda: places)
        command = [sys.executable, '-c', MOVING]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process, killed_on_error(process):
            graph.until(lambda: places[-1].pose.position.x > places[0].pose.position.x + 0.002)
            process.kill()
            killed_s = time.monotonic()
        moved = [places[-1].pose.position.x, time.monotonic()]

        def is_at_rest():
            x = places[-1].pose.position.x
            if abs(x - moved[0]) > 1e-9:
                moved[:] = x, time.monotonic()
            return time.monotonic() - moved[1] > 0.5

        graph.until(is_at_rest)
        record_property('stopped_s', moved[1] - killed_s)
        print(f'at rest {1e3 * (moved[1] - killed_s):.0f} ms after the death of who commanded')
        assert moved[1] - killed_s < 1.5


def end_by_ctrl_c(graph, explorer):
    explorer.process.send_signal(signal.SIGINT)
    assert explorer.wait(DEADLINE_S) == 0


def end_by_deactivation(graph, _explorer):
    client = graph.peer.create_client(ChangeState, 'explorer/change_state')
    graph.until(client.service_is_ready)
    request = ChangeState.Request()
    request.transition.id = Transition.TRANSITION_DEACTIVATE
    answer = client.call_async(request)
    graph.until(answer.done)
    assert answer.result().success


@pytest.mark.parametrize('end', [end_by_ctrl_c, end_by_deactivation])
def test_controllers_are_handed_back_with_the_finger_lifted_and_at_rest(graph, monkeypatch, tmp_path, end):
    log = tmp_path / 'switches'
    monkeypatch.setenv('MANAGED_LOG', str(log))
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join([str(Path(__file__).parent), os.environ.get('PYTHONPATH', '')]))
    states = graph.listen(msg.ExplorationState, 'exploration', STATE_QOS)
    with NodeProcess('texture_exploration', 'explorer', MANAGED) as explorer:
        client = graph.peer.create_client(srv.Explore, 'explore')
        graph.until(client.service_is_ready)
        client.call_async(srv.Explore.Request(motion='linear_slide', speed_m_s=0.01, force_n=1.0, distance_m=0.1))
        graph.until(lambda: any(state.phase_name == Phase.SLIDE.value for state in states))
        end(graph, explorer)
        taken, given_back = map(json.loads, log.read_text().splitlines())
    assert (taken['activated'], taken['deactivated']) == (['twist'], ['joints'])
    assert (given_back['activated'], given_back['deactivated']) == (['joints'], ['twist'])
    assert given_back['at_rest']
    assert given_back['height_m'] > 0.0  # in the slide it was pressed into the surface


def test_a_hand_over_without_the_messages_of_the_controller_manager_is_refused(graph, monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(controller_topics.importlib, 'import_module', missing)
    topics = controller_topics.RosTopics(RosControllersParams(controller_manager='controller_manager'))
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
    topics = controller_topics.RosTopics(RosControllersParams(connect_timeout_s=DEADLINE_S))
    silent = controller_topics.RosTopics(RosControllersParams(connect_timeout_s=0.2))
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
