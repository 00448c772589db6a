# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import signal
import threading
import time
from contextlib import ExitStack, contextmanager, nullcontext
from functools import partial
from unittest.mock import MagicMock

import pytest
import rclpy
from rclpy.action import ActionServer, CancelResponse
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger
from texture_msgs import action, msg

from texture_bringup import operator as operators
from texture_bringup.feed import Feed
from texture_core.errors import LaunchFailed, MotionAborted, MotionRefused, UnknownName
from texture_core.ros import STATE_QOS, quality_of_service, to_msg
from texture_core.ros_testing import LocalGraph
from texture_core.types import ExplorationRequest, ExplorationState, Phase
from texture_exploration.explorer import CONNECTING

# An explorer that answers at the end finds nobody there any more.
pytestmark = [pytest.mark.realtime, pytest.mark.ros, pytest.mark.filterwarnings('ignore:failed to send response')]
DOMAIN = 62


@contextmanager
def silent_explorer(taken=None, goals=None, begin=None, result=None):
    """An explorer that takes a goal once `begin` is set, sets `taken`, answers `result`, if any; `goals` are taken."""
    context, over, left = Context(), threading.Event(), threading.Event()
    taken = taken or threading.Event()
    context.init(domain_id=DOMAIN)
    node = Node('explorer', context=context)

    def hang(goal):
        taken.set()
        (goals if goals is not None else []).append(goal)
        if result is None:
            over.wait(60.0)
        goal.abort()
        executor.create_task(left.set)  # after what this answer asks of the executor
        return action.Explore.Result(**{} if result is None else {'result': result})

    server = ActionServer(node, action.Explore, 'explore', hang, cancel_callback=lambda _goal: CancelResponse.ACCEPT)
    node.create_service(Trigger, 'explorer/stop', lambda _request, answer: answer)
    executor = MultiThreadedExecutor(2, context=context)
    executor.add_node(node)
    thread = threading.Thread(target=lambda: (begin is None or begin.wait(60.0), executor.spin()))
    thread.start()
    try:
        yield
    finally:
        over.set()
        if taken.is_set():
            left.wait(10.0)
        executor.shutdown()
        thread.join(10.0)
        server.destroy()
        node.destroy_node()
        context.try_shutdown()


def test_an_explorer_that_says_nothing_although_ros_lists_it_is_given_up_within_seconds_and_its_goal_cancelled():
    goals = []
    with silent_explorer(goals=goals), operators.Operator(domain_id=DOMAIN) as operator:
        operator.wait_for_explorer(30.0)
        begin_s = time.monotonic()
        with pytest.raises(
            MotionAborted, match=r'the explorer has vanished; .* look at the robot, and at the output of'
        ):
            operator.explore(ExplorationRequest('linear_slide'))
        assert time.monotonic() - begin_s < 7.0
        while not goals[0].is_cancel_requested:
            assert time.monotonic() - begin_s < 20.0


def test_a_wrong_namespace_is_named_with_those_that_have_an_explorer():
    with LocalGraph(DOMAIN) as graph, operators.Operator('lefft', DOMAIN) as operator:
        for namespace in ('left', 'right'):
            graph.add(partial(rclpy.create_node, 'explorer', namespace=namespace))
        with pytest.raises(
            LaunchFailed,
            match=r'ROS_DOMAIN_ID 62 and namespace /lefft \(.* explorers in /left, /right: choose .* `texture dash',
        ):
            operator.wait_for_explorer(5.0)


def test_a_misspelled_node_is_named_with_the_nearest_that_is_there_and_a_missing_one_with_the_place(monkeypatch):
    for name in ('OFFERED_S', 'SETTINGS_S'):
        monkeypatch.setattr(operators, name, 3.0)
    with LocalGraph(DOMAIN) as graph, operators.Operator('left', DOMAIN) as operator:
        graph.add(partial(rclpy.create_node, 'emulator', namespace='left'))
        near = "no running node 'emulater'; did you mean 'emulator'\\? Known: emulator$"
        with pytest.raises(UnknownName, match=near):
            operator.set_parameters('emulater', {'surface': 'glass'})
        with pytest.raises(UnknownName, match=near):
            operator.set_active('emulater', active=True)
        with pytest.raises(LaunchFailed, match='no lifecycle node'):
            operator.set_active('emulator', active=True)
        with pytest.raises(LaunchFailed, match='no classifier answers in the ROS_DOMAIN_ID 62 and namespace /left; st'):
            operator.remove('cork')


def test_an_explorer_that_was_started_again_is_not_waited_for(monkeypatch):
    monkeypatch.setattr(operators, 'RETRY_PERIOD_S', 0.3)
    with silent_explorer(), ExitStack() as later, operators.Operator(domain_id=DOMAIN) as operator:
        operator.wait_for_explorer(30.0)
        second = threading.Timer(1.0, lambda: later.enter_context(silent_explorer()))
        second.start()
        with pytest.raises(MotionAborted, match=r'was restarted.*; the finger may still press: .* call `texture lift`'):
            operator.explore(ExplorationRequest('linear_slide'))
        second.join()


@pytest.mark.parametrize(('lifted', 'ending'), [(True, 'shut down; the finger was lifted'), (False, 'shut down')])
def test_an_aborted_exploration_says_that_the_finger_was_lifted_if_that_is_known(lifted, ending):
    code, message = msg.ExplorationResult.ERROR_STOPPED, 'the explorer was shut down'
    result = msg.ExplorationResult(error_code=code, message=message, exploration_id='a', lifted=lifted)
    with silent_explorer(result=result), operators.Operator(domain_id=DOMAIN) as operator:
        operator.wait_for_explorer(30.0)
        ended = operator.explore(ExplorationRequest('linear_slide'))
        assert (ended.message, ended.lifted) == (f'the explorer was {ending}', lifted)


def test_an_explorer_that_fails_without_a_word_is_no_success_and_the_operator_reads_where_to_look():
    with silent_explorer(result=msg.ExplorationResult()), operators.Operator(domain_id=DOMAIN) as operator:
        operator.wait_for_explorer(30.0)
        with pytest.raises(
            MotionAborted, match=r'has failed and gives no reason; look at the robot, and at the output'
        ):
            operator.explore(ExplorationRequest('linear_slide'))


def test_an_explorer_that_does_not_keep_the_timeout_is_left(monkeypatch):
    monkeypatch.setattr(operators, 'CANCEL_DEADLINE_S', 0.5)
    with silent_explorer(), operators.Operator(domain_id=DOMAIN) as operator:
        operator.wait_for_explorer(30.0)
        with pytest.raises(MotionAborted, match=r'no result within the timeout of 0\.2 s; the exploration was'):
            operator.explore(ExplorationRequest('linear_slide', timeout_s=0.2))


@pytest.mark.parametrize('accepted', [False, True])
def test_ctrl_c_says_that_the_robot_must_be_looked_at_when_the_explorer_does_not_confirm_the_end(monkeypatch, accepted):
    monkeypatch.setattr(operators, 'CANCEL_DEADLINE_S', 0.5)
    taken, sent = threading.Event(), []

    def press_ctrl_c():
        if taken.is_set() or (sent and not accepted):
            raise KeyboardInterrupt

    with silent_explorer(taken), operators.Operator(domain_id=DOMAIN, guard=press_ctrl_c) as operator:
        operator.wait_for_explorer(30.0)
        sent.append(True)
        with pytest.raises(KeyboardInterrupt, match=r'has not confirmed within 0\.5 s that the finger was lifted'):
            operator.explore(ExplorationRequest('linear_slide'))


def test_ctrl_c_once_more_does_not_end_the_wait_for_the_end_of_the_exploration(monkeypatch):
    monkeypatch.setattr(operators, 'CANCEL_DEADLINE_S', 0.5)
    ending, before = Future(), signal.signal(signal.SIGINT, signal.default_int_handler)  # as the command does
    try:
        with operators.Operator(domain_id=DOMAIN) as operator:
            operator._executor.create_task(signal.raise_signal, signal.SIGINT)
            assert 'has not confirmed' in str(operator._cancel(MagicMock(), ending))
    finally:
        signal.signal(signal.SIGINT, before)


def test_ctrl_c_after_the_motion_was_completed_tells_its_id():
    def press_ctrl_c():
        if taken.is_set():
            raise KeyboardInterrupt

    taken = threading.Event()
    completed = msg.ExplorationResult(error_code=0, exploration_id='a', message='completed', lifted=True)
    with (
        silent_explorer(taken, result=completed),
        operators.Operator(domain_id=DOMAIN, guard=press_ctrl_c) as operator,
    ):
        operator.wait_for_explorer(30.0)
        with pytest.raises(operators.Interrupted, match=r'^the exploration has ended: completed$') as interrupted:
            operator.explore(ExplorationRequest('linear_slide'))
    assert interrupted.value.completed == 'a'


@pytest.mark.parametrize('end', ['no answer', 'Ctrl-C'])
def test_a_request_that_is_accepted_after_its_client_gave_up_is_cancelled_at_once(monkeypatch, end):
    monkeypatch.setattr(operators, 'ACCEPT_S', 0.5)
    monkeypatch.setattr(operators, 'CANCEL_DEADLINE_S', 0.5)
    begin, goals, sent = threading.Event(), [], []

    def press_ctrl_c():
        if sent and end == 'Ctrl-C':
            raise KeyboardInterrupt

    with silent_explorer(goals=goals, begin=begin):
        with operators.Operator(domain_id=DOMAIN, guard=press_ctrl_c) as operator:
            operator.wait_for_explorer(30.0)
            sent.append(True)
            with pytest.raises((MotionAborted, KeyboardInterrupt), match='not confirmed'):
                operator.explore(ExplorationRequest('linear_slide'))
        begin.set()
        deadline_s = time.monotonic() + 10.0
        while not (goals and goals[0].is_cancel_requested):
            assert time.monotonic() < deadline_s
            time.sleep(0.01)


def test_a_request_that_is_stopped_is_not_sent_or_cancelled_also_after_the_explorer_has_accepted_it():
    goals, cancelled = [], []

    def stopped():
        cancelled.extend(one.is_cancel_requested for one in goals)
        return len(cancelled) > 20  # by then its acceptance has arrived

    with silent_explorer(goals=goals), operators.Operator(domain_id=DOMAIN) as operator:
        operator.wait_for_explorer(30.0)
        with pytest.raises(MotionRefused, match='was stopped before it was sent'):
            operator.explore(ExplorationRequest('linear_slide'), stopped=lambda: True)
        with pytest.raises(MotionAborted, match='vanished'):  # this explorer never answers
            operator.explore(ExplorationRequest('linear_slide'), stopped=stopped)
        assert (cancelled[0], cancelled[-1], len(goals)) == (False, True, 1)


def test_a_stop_that_is_not_answered_says_within_seconds_to_use_the_emergency_stop():
    begin = threading.Event()
    with silent_explorer(begin=begin), operators.Operator(domain_id=DOMAIN) as operator:
        operator.wait_for_explorer(30.0)
        begin_s = time.monotonic()
        with pytest.raises(LaunchFailed, match='not answered the stop within 3 s; if the arm moves, use the emergency'):
            operator.stop()
        assert time.monotonic() - begin_s < 8.0
        begin.set()


def test_who_watches_sees_no_state_that_was_sent_long_before(monkeypatch):
    monkeypatch.setattr(operators, 'HISTORY_NS', 0)
    feed = Feed()

    def seen():
        return [past['id'] for past in feed.frame(0.0)['past']]

    with LocalGraph(DOMAIN) as graph, operators.Operator(domain_id=DOMAIN) as operator:
        publisher = graph.peer.create_publisher(msg.ExplorationState, 'exploration', STATE_QOS)

        def publish(name):
            publisher.publish(to_msg(ExplorationState(1, name, 'linear_slide', Phase.SLIDE)))

        def show():
            if publisher.get_subscription_count():
                publish('new')
            if 'new' in seen():
                raise KeyboardInterrupt

        publish('old')
        with pytest.raises(KeyboardInterrupt):
            operator.watch(feed, show)
    assert seen() == ['new']


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_ctrl_c_or_a_closed_terminal_ends_the_program_behind_what_rclpy_does_and_not_within(number):
    done, before = [], signal.signal(number, signal.default_int_handler)  # as the command does
    try:
        with pytest.raises(KeyboardInterrupt), operators.uninterrupted():
            signal.raise_signal(number)
            done.append('taken')
        assert done == ['taken']
        assert signal.getsignal(number) is signal.default_int_handler
    finally:
        signal.signal(number, before)


def test_an_explorer_that_connects_to_its_arm_is_waited_for_and_the_wait_says_so(monkeypatch):
    said = []
    monkeypatch.setattr(operators, 'task', lambda what, **_: said.append(what) or nullcontext())
    monkeypatch.setattr(operators, 'ACCEPT_S', 0.5)
    monkeypatch.setattr(operators, 'CANCEL_DEADLINE_S', 0.5)
    begin, waited_s = threading.Event(), 3.0
    with LocalGraph(DOMAIN) as graph, silent_explorer(begin=begin), operators.Operator(domain_id=DOMAIN) as operator:
        infos = graph.peer.create_publisher(msg.ExplorerInfo, 'explorer_info', quality_of_service('explorer_info'))
        infos.publish(msg.ExplorerInfo(message=f"{CONNECTING} 'ur'"))
        operator.wait_for_explorer(30.0)
        threading.Timer(waited_s, begin.set).start()
        begin_s = time.monotonic()
        with pytest.raises(MotionAborted, match='no result within the timeout'):  # it was accepted
            operator.explore(ExplorationRequest('linear_slide', timeout_s=0.2))
        assert time.monotonic() - begin_s > waited_s
    assert said[-1] == "waiting: the explorer is connecting to the arm 'ur'"


def test_advice_is_shown_after_a_timeout_only(monkeypatch):
    said = []
    monkeypatch.setattr(operators, 'task', lambda what, **_: said.append(what) or nullcontext())
    monkeypatch.setattr(operators, 'ACCEPT_S', 0.2)
    begin = threading.Event()
    with silent_explorer(begin=begin), operators.Operator(domain_id=DOMAIN) as operator:
        operator.wait_for_explorer(30.0)
        with pytest.raises(MotionAborted, match=r'has not answered yet; stop it, and check that no second one runs'):
            operator.explore(ExplorationRequest('linear_slide'))
        begin.set()
    assert said[0] == "waiting for an explorer in the namespace '/', which may be starting"
    assert said[-1] == 'waiting: the explorer has not answered yet'
