# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The explorer as others meet it: over ROS, on a simulated arm in real time."""

import gc
import math
import re
import signal
import time
from contextlib import closing
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from texture_msgs import msg, srv
from tf2_msgs.msg import TFMessage

from texture_core.errors import DeviceError, ExplorationError, InvalidParameter
from texture_core.ros import ESTIMATE_QOS, SENSOR_QOS, STATE_QOS, check_names, quality_of_service, to_msg, to_ns
from texture_core.ros_testing import LocalGraph, NodeProcess
from texture_core.types import FingerReceiver, Phase, Rejection, TextureEstimate, quaternion_matrix
from texture_exploration.arms.arm import SurfaceFrame
from texture_exploration.arms.simulated import SimulatedArm
from texture_exploration.exploration import STILL_MOVING, ExplorationOutcome
from texture_exploration.motions import MOTIONS
from texture_exploration.nodes.explorer import STATIC_QOS, ExplorerNode

QUICK = {'motion': 'linear_slide', 'speed_m_s': 0.1, 'distance_m': 0.02}
SLOW = {'motion': 'linear_slide', 'speed_m_s': 0.01, 'distance_m': 0.1}
DEADLINE_S = 20.0
Result = msg.ExplorationResult
OK = Result.ERROR_NONE

pytestmark = [pytest.mark.realtime, pytest.mark.ros]


def phase_of(state):
    return tuple(Phase)[state.phase].value


def request_of(timeout_s=0, **fields):
    return msg.ExplorationRequest(timeout=Duration(sec=timeout_s), **fields)


class World:
    """An explorer and who asks it."""

    def __init__(self, graph, **parameters):
        values = {'start_height_m': 0.002, 'state_timeout_s': 1.0, 'watch_signal': False, **parameters}
        self.graph = graph
        self.explorer, self.peer, self.until = graph.add(ExplorerNode, **values), graph.peer, graph.until
        self.states = graph.listen(msg.ExplorationState, 'exploration', STATE_QOS)
        self.diagnostics = graph.listen(DiagnosticArray, '/diagnostics')
        self.explore = self.peer.create_client(srv.Explore, 'explore')
        self.until(self.explore.service_is_ready)

    def estimate(self, answer):
        """Answer each state of an exploration with an estimate."""
        publisher = self.peer.create_publisher(msg.TextureEstimate, 'texture', ESTIMATE_QOS)
        self.until(publisher.get_subscription_count)

        def on_state(state):
            if state.exploration_id:
                publisher.publish(to_msg(answer(state)))

        self.peer.create_subscription(msg.ExplorationState, 'exploration', on_state, STATE_QOS)
        return publisher

    def call(self, **request):
        return self.explore.call_async(srv.Explore.Request(request=request_of(**request)))

    def result(self, future):
        self.until(future.done)
        return future.result()

    def explored(self, **request):
        return self.result(self.call(**request)).result

    def phases(self, exploration_id):
        def seen():
            return [phase_of(state) for state in self.states if state.exploration_id == exploration_id]

        # The result may be here before the last state is.
        self.until(lambda: seen()[-1:] in (['done'], ['aborted']))
        return [phase for before, phase in zip([None, *seen()], seen(), strict=False) if phase != before]


@pytest.fixture
def graph():
    with LocalGraph(68, deadline_s=DEADLINE_S) as graph:
        yield graph
    gc.collect()  # an explorer that could not start, which the next one would find


@pytest.fixture
def make_world(graph):
    return partial(World, graph)


@pytest.fixture
def world(make_world):
    return make_world()


def test_a_service_call_explores_and_reports(make_world):
    world = make_world(surface_frame_id='table')
    before = world.peer.get_clock().now().nanoseconds
    response = world.explored(**QUICK, surface='cork')
    assert (response.error_code, response.message, response.lifted) == (OK, 'the motion was completed', True)
    assert not response.texture.label
    assert world.phases(response.exploration_id) == ['approach', 'contact', 'slide', 'lift', 'done']
    states = [state for state in world.states if state.exploration_id]
    assert {(state.surface, state.header.frame_id) for state in states} == {('cork', 'table')}
    stamps = [to_ns(state.header.stamp) for state in states]
    assert stamps == sorted(stamps)
    assert before < stamps[0] <= stamps[-1] < world.peer.get_clock().now().nanoseconds
    sliding = [state for state in states if state.phase == msg.ExplorationState.PHASE_SLIDE]
    begin, end = sliding[0], sliding[-1]
    passed_s = (to_ns(end.header.stamp) - to_ns(begin.header.stamp)) * 1e-9
    assert end.position.x - begin.position.x == pytest.approx(QUICK['speed_m_s'] * passed_s, abs=0.003)
    assert abs(end.position.y - begin.position.y) < 1e-3
    assert abs(end.position.z) < 2e-3  # pressed on the plane z = 0
    world.until(lambda: phase_of(world.states[-1]) == 'idle')


def test_a_request_that_two_explorers_would_take_is_refused_until_one_has_ended(make_world, monkeypatch):
    monkeypatch.setattr(SimulatedArm, 'base_frame_id', 'base')
    monkeypatch.setattr(SimulatedArm, 'surface_pose', (0.0,) * 6)
    world, several = make_world(), 'several explorers are in the ROS_DOMAIN_ID 68 and namespace /;'
    infos = world.graph.listen(msg.ExplorerInfo, 'explorer_info')
    with NodeProcess('texture_exploration', 'explorer', {'watch_signal': False}):
        world.until(lambda: sum(info.message.startswith(several) for info in infos) == 2)  # both know it
        refused = world.explored(**QUICK)
        assert (refused.error_code, refused.exploration_id) == (Result.ERROR_NOT_ACTIVE, '')
        assert refused.message.startswith(several)
        for service, sentence in (
            ('touch_surface', several),
            ('recover', several),
            ('lift', f'.*nothing touches it, of one arm; look at the others: {several}'),
            ('stop', f'.*, of one arm; look at the others: {several}'),
        ):
            client = world.peer.create_client(Trigger, f'explorer/{service}')
            world.until(client.service_is_ready)
            answer = world.result(client.call_async(Trigger.Request()))
            assert not answer.success
            assert re.match(sentence, answer.message)
        world.until(lambda: world.diagnostics and world.diagnostics[-1].status[0].message.startswith(several))
    world.until(lambda: world.peer.count_services('explore') == 1)
    assert world.explored(**QUICK).error_code == OK


def test_the_surface_is_broadcast_where_the_arm_believes_it_in_its_base_frame(make_world, monkeypatch):
    pose, here = (0.4, -0.1, 0.02, 0.2, -0.1, 0.5), (0.01, 0.02, 0.03)
    monkeypatch.setattr(SimulatedArm, 'base_frame_id', 'base')
    monkeypatch.setattr(SimulatedArm, 'surface_pose', pose)
    world, heard = make_world(surface_frame_id='table'), []
    world.peer.create_subscription(TFMessage, '/tf_static', heard.append, STATIC_QOS)
    world.until(lambda: heard)
    [transform] = heard[0].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ('base', 'table')
    shift, turned = transform.transform.translation, transform.transform.rotation
    in_base = quaternion_matrix((turned.x, turned.y, turned.z, turned.w)) @ here + (shift.x, shift.y, shift.z)
    assert in_base == pytest.approx(SurfaceFrame(pose).place_to_base(here))


@pytest.mark.parametrize(
    ('request_fields', 'sentence'),
    [
        ({'motion': 'linear_slid'}, "did you mean 'linear_slide'"),
        ({'surface': 'x' * 100_000}, 'has 100000 characters; at most 100'),
        ({'surface': '../../etc/x'}, 'slash'),
        ({'direction_rad': 1e300}, 'the direction is 5.72958e+301°; allowed is'),
        ({'direction_rad': math.nan}, 'the direction is nan°; allowed is'),
        ({'timeout_s': -1}, 'timeout_s is -1.0'),
    ],
)
def test_a_request_that_cannot_be_meant_is_refused_before_anything_moves(world, request_fields, sentence):
    response = world.explored(**{**QUICK, **request_fields})
    code = Result.ERROR_UNKNOWN_MOTION if 'motion' in request_fields else Result.ERROR_INVALID_REQUEST
    assert (response.error_code, response.lifted) == (code, False)
    assert sentence in response.message
    assert not response.exploration_id
    # Numbers that nobody knows are NaN, not the zeros of a new message.
    unknown = response.texture.confidence, response.roughness.grade, response.roughness.grade_std
    assert all(map(math.isnan, unknown))


def test_while_it_connects_it_says_to_which_arm(make_world, graph, monkeypatch):
    infos, connect = (
        graph.listen(msg.ExplorerInfo, 'explorer_info', quality_of_service('explorer_info')),
        SimulatedArm.connect,
    )
    told = []

    def slow(arm):
        graph.until(lambda: infos)
        told.append((infos[-1].ready, infos[-1].message))
        return connect(arm)

    monkeypatch.setattr(SimulatedArm, 'connect', slow)
    world = make_world()
    assert told == [(False, "the explorer is connecting to the arm 'simulated'")]
    world.until(lambda: infos[-1].ready)


@pytest.mark.parametrize(
    ('error', 'code'),
    [
        (DeviceError('the arm was lost'), Result.ERROR_ARM_NOT_READY),
        (InvalidParameter('of a planner'), Result.ERROR_INVALID_REQUEST),
    ],
)
def test_an_arm_that_is_lost_or_a_planner_that_fails_at_a_request_does_not_end_the_node(
    world, monkeypatch, error, code
):
    with monkeypatch.context() as patch:
        patch.setattr(world.explorer._explorer, '_prepare', Mock(side_effect=error))
        response = world.explored(**QUICK)
    assert (response.error_code, response.message) == (code, str(error))
    assert world.explored(**QUICK).error_code == OK


def test_a_parameter_that_only_counts_at_the_start_is_read_only(world):
    [outcome] = world.explorer.set_parameters([Parameter('arm', value='ur')])
    assert not outcome.successful
    assert world.explorer.get_parameter('arm').value == 'simulated'
    [outcome] = world.explorer.set_parameters([Parameter('approach_travel_m', value=0.04)])
    assert outcome.successful, outcome.reason


def test_a_parameter_of_another_arm_is_no_misspelled_one_and_no_topic_may_have_any_name(make_world):
    check_names(make_world(connect_timeout_s=2.0).explorer)
    with pytest.raises(InvalidParameter, match="no parameter 'x_hihg_m'; did you mean 'x_high_m'"):
        check_names(make_world(x_hihg_m=0.1).explorer)
    with pytest.raises(InvalidParameter, match=r"'signal_topics' is .*, which names no topics"):
        make_world(watch_signal=True, signal_topics="signal' x")


def test_a_sensor_that_falls_silent_in_the_slide_ends_it_and_the_next_exploration_works(make_world):
    world = make_world(watch_signal=True)
    signals = world.peer.create_publisher(msg.TactileSignal, 'signal', SENSOR_QOS)
    sensor = world.peer.create_timer(0.01, lambda: signals.publish(msg.TactileSignal()))
    world.until(signals.get_subscription_count)
    call = world.call(**SLOW)
    world.until(lambda: any(phase_of(state) == 'slide' for state in world.states))
    sensor.cancel()
    response = world.result(call).result
    assert (response.error_code, response.lifted) == (Result.ERROR_NO_SIGNAL, True)
    assert response.message.startswith("no samples on 'signal' for")
    sensor.reset()
    assert world.explored(**QUICK).error_code == OK


def logging_into(logged, **values):
    """Return what stands for an explorer with some values and logs pairs of level and text into a list."""
    levels = ('info', 'warning', 'error')
    logger = SimpleNamespace(**{name: partial(lambda name, text: logged.append((name, text)), name) for name in levels})
    return SimpleNamespace(get_logger=lambda: logger, **values)


@pytest.mark.parametrize(
    ('starts', 'said'), [(True, ('warning', 'no arm; the next request tries again')), (False, ('error', 'no arm'))]
)
def test_an_arm_that_is_not_there_is_a_warning_at_the_start_where_both_may_be_starting(starts, said):
    logged = []
    assert not ExplorerNode._tried(logging_into(logged, _autostart=starts), Mock(side_effect=DeviceError('no arm')))
    assert logged == [said]


def test_an_abort_is_logged_as_a_warning_and_a_finger_that_was_not_lifted_as_an_error():
    logged, stopped = [], ExplorationError.STOPPED
    for outcome in (
        ExplorationOutcome(ExplorationError.NONE, 'done', True),
        ExplorationOutcome(stopped, 'stopped', True),
        ExplorationOutcome(stopped, 'no lift', True, lifted=False),
        STILL_MOVING,
    ):
        ExplorerNode._log_end(logging_into(logged), '17', outcome)
    assert logged == [
        ('info', '17: done'),
        ('warning', '17: stopped; the finger was lifted'),
        ('error', '17: no lift'),
        ('error', '17: the explorer ended before the finger was lifted; look at the robot'),
    ]


def test_an_invalid_lifecycle_request_is_refused_and_the_explorer_lives(world):
    client = world.peer.create_client(ChangeState, 'explorer/change_state')
    world.until(client.service_is_ready)
    for number in (Transition.TRANSITION_CONFIGURE, 99) * 2:
        answer = world.result(client.call_async(ChangeState.Request(transition=Transition(id=number))))
        assert not answer.success
    assert world.explored(**QUICK).error_code == OK


def test_an_arm_in_a_protective_stop_is_recovered_by_a_service(world):
    recover = world.peer.create_client(Trigger, 'explorer/recover')
    assert recover.wait_for_service(DEADLINE_S)
    arm = world.explorer._explorer.arm
    connect, state = arm.connect, arm.state
    arm.state = lambda: replace(state(), fault='protective stop')
    arm.connect = lambda: (setattr(arm, 'state', state), connect())
    response = world.result(recover.call_async(Trigger.Request()))
    assert (response.success, response.message) == (True, 'the arm can move')
    assert world.explored(**QUICK).error_code == OK


def test_a_stop_in_the_slide_lifts_the_finger_and_answers_the_service_that_waits(world):
    stop = world.peer.create_client(Trigger, 'explorer/stop')
    world.until(stop.service_is_ready)
    call = world.call(**SLOW)
    world.until(lambda: any(phase_of(state) == 'slide' for state in world.states))
    stopped = world.result(stop.call_async(Trigger.Request()))
    assert (stopped.success, stopped.message) == (True, 'stopping; the finger is being lifted')
    response = world.result(call).result
    assert (response.error_code, response.lifted) == (Result.ERROR_STOPPED, True)
    assert response.message == 'stopped on request'
    call, stopping = world.call(**SLOW), stop.call_async(Trigger.Request())  # at once: the stop may be read first
    assert world.result(call).result.error_code == Result.ERROR_STOPPED
    world.result(stopping)
    assert world.explored(**QUICK).exploration_id


def test_a_request_may_name_a_motion_of_another_package_if_the_parameters_do(make_world, tmp_path, monkeypatch):
    (tmp_path / 'users_slides.py').write_text('from texture_exploration.motions import linear_slide as slide\n')
    monkeypatch.syspath_prepend(tmp_path)
    world = make_world(motions='users_slides:slide')
    assert world.explored(**{**QUICK, 'motion': 'users_slides:slide'}).exploration_id
    response = world.explored(motion='users_slides:linear_slide')
    assert response.error_code == Result.ERROR_UNKNOWN_MOTION
    assert f'Known: {", ".join(sorted((*MOTIONS, "users_slides:slide")))}' in response.message


def cork(state, **values):
    known = {'label': 'cork', 'rejection': Rejection.NONE, 'confidence': 0.99, 'decided': True, 'windows': 1}
    known['evidence_s'] = 0.5
    return TextureEstimate(to_ns(state.header.stamp), state.exploration_id, **{**known, **values})


def test_a_decided_texture_ends_the_slide_early(world):
    world.estimate(lambda state: cork(state, final=phase_of(state) in ('lift', 'done')))
    response = world.explored(**SLOW, early_stopping=True)
    assert response.error_code == OK
    assert response.message == "ended early: 'cork' is decided with 0.99 after 0.5 s of evidence"
    assert (response.texture.label, response.texture.final) == ('cork', True)
    assert max(state.progress for state in world.states if phase_of(state) == 'slide') < 0.5


@pytest.mark.parametrize(
    ('estimate', 'found'),
    [
        (lambda state: cork(state, windows=2), ('cork', 2, False)),  # without a final one the newest
        (lambda state: TextureEstimate(1, 'other', label='silk', windows=9), ('', 0, False)),  # of another exploration
    ],
)
def test_the_newest_estimate_of_this_exploration_is_given(make_world, estimate, found):
    world = make_world(estimate_timeout_s=0.2)
    publisher = world.estimate(estimate)
    publisher.publish(msg.TextureEstimate(rejection=200))  # inconsistent: it does not end the node
    texture = world.explored(**QUICK).texture
    assert (texture.label, texture.windows, texture.final) == found


def test_a_changed_limit_holds_for_the_next_request(world):
    slower = Parameter('max_speed_m_s', value=0.05)
    assert world.explorer.set_parameters([slower])[0].successful
    assert 'allowed is 0.002 to 0.05 m/s' in world.explored(**QUICK).message
    wrong = world.explorer.set_parameters([Parameter('force_limit_n', value=1.0)])[0]
    assert "it must be below 'force_limit_n'" in wrong.reason


def test_the_diagnostics_count_what_happened(world):
    response = world.explored(**QUICK)
    assert response.error_code == OK, response.message
    world.explored(motion='nothing')

    def numbers():
        return {pair.key: pair.value for array in world.diagnostics for pair in array.status[0].values}

    world.until(lambda: (numbers().get('done'), numbers().get('refused')) == ('1', '1'))
    assert numbers()['phase'] == 'idle'


@pytest.mark.parametrize(
    ('given', 'sentence'),
    [
        ({'max_forc_n': 8.0}, "has no parameter 'max_forc_n'; did you mean 'max_force_n'?"),
        ({'max_force_n': '6,5'}, "'max_force_n' is '6,5'; a number is needed, 0.01 to 50.0 N"),
    ],
)
def test_parameters_are_checked_before_the_arm_is_looked_for(given, sentence):
    arm = {'arm': 'ros_controllers', 'accept_no_timeout': True, 'accept_shared_group': True, 'connect_timeout_s': 0.5}
    with NodeProcess('texture_exploration', 'explorer', {**arm, **given}) as explorer:
        assert explorer.wait(3 * DEADLINE_S) == 2
        [line] = explorer.output.splitlines()
    assert sentence in line


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGTERM])
def test_a_signal_that_ends_the_process_in_the_slide_lifts_the_finger_and_answers_first(graph, tmp_path, number):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup it is ignored, and a node would inherit that
    pipe = str(tmp_path / 'finger')
    given = {'finger_pipe': pipe, 'watch_signal': False}
    with closing(FingerReceiver(pipe)) as emulator, NodeProcess('texture_exploration', 'explorer', given) as explorer:
        client = graph.peer.create_client(srv.Explore, 'explore')
        graph.until(client.service_is_ready)
        answer = client.call_async(srv.Explore.Request(request=request_of(**SLOW)))
        graph.until(lambda: any(finger.vx_m_s > 0.009 for finger in emulator.states(0.0)))
        explorer.process.send_signal(number)
        last = last_until_exit(emulator, explorer.process)
        graph.until(answer.done)
        assert explorer.process.returncode == 0
    assert last.force_n == 0
    assert last.z_m == pytest.approx(0.01, abs=0.001)
    assert answer.result().result.message == 'the explorer was shut down'


def last_until_exit(emulator, process):
    """Return the last finger state that a process sent; read all the while, the pipe holds those of 2 s."""
    deadline, last, ended = time.monotonic() + DEADLINE_S, None, False
    while not ended:
        assert time.monotonic() < deadline, 'the process did not end'
        ended = process.poll() is not None
        last = (emulator.states(0.05) or [last])[-1]
    return last
