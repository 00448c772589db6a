# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What waits long keeps nobody else waiting, and takes no computing time."""

import os
import threading
import time
from unittest import mock

import pytest
import rclpy
from rclpy.action import ActionClient, ActionServer
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Empty
from std_srvs.srv import Trigger
from texture_msgs.action import Explore
from texture_msgs.msg import ExplorationResult

from texture_core.ros import WaitingExecutor

pytestmark = pytest.mark.ros
DEADLINE_S = 20.0


class Patient(Node):
    """Answers only when it is released, and receives the messages of others."""

    def __init__(self):
        super().__init__('patient')
        self.released, self.heard = threading.Event(), 0
        self.create_service(Trigger, 'wait', self._wait, callback_group=ReentrantCallbackGroup())
        self.create_subscription(Empty, 'word', self._hear, 10)
        self.words = self.create_publisher(Empty, 'word', 10)
        self.asking = self.create_client(Trigger, 'wait')

    def _wait(self, _request, response):
        self.released.wait(DEADLINE_S)
        response.success = True
        return response

    def _hear(self, _word):
        self.heard += 1


@pytest.fixture
def world():
    environment = {'ROS_DOMAIN_ID': '78', 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    with mock.patch.dict(os.environ, environment):
        rclpy.init()
        node, executor = Patient(), WaitingExecutor()
        executor.add_node(node)
        assert node.asking.wait_for_service(DEADLINE_S)
        yield node, executor
        node.released.set()
        executor.shutdown(DEADLINE_S)
        node.destroy_node()
        rclpy.try_shutdown()


def spin_until(executor, condition):
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline
        executor.spin_once(timeout_sec=0.05)


def test_the_result_of_an_action_that_ends_at_the_shutdown_is_sent(world):
    node, executor = world

    def slide(goal):
        node.released.wait(DEADLINE_S)
        goal.abort()
        return Explore.Result(result=ExplorationResult(message='the finger was lifted'))

    server = ActionServer(node, Explore, 'slide', slide, callback_group=ReentrantCallbackGroup())
    asking = Node('asking')
    client, reader = ActionClient(asking, Explore, 'slide'), SingleThreadedExecutor()
    reader.add_node(asking)

    def both_until(condition):
        spin_until(executor, lambda: reader.spin_once(timeout_sec=0.05) or condition())

    both_until(client.server_is_ready)
    accepted = client.send_goal_async(Explore.Goal())
    both_until(accepted.done)
    result = accepted.result().get_result_async()
    both_until(lambda: any(future._callbacks for future in server._result_futures.values()))
    node.released.set()
    executor.shutdown(DEADLINE_S)
    spin_until(reader, result.done)
    assert result.result().result.result.message == 'the finger was lifted'
    reader.shutdown()
    client.destroy()
    asking.destroy_node()
    server.destroy()


def test_others_are_heard_while_many_wait(world):
    node, executor = world
    answers = [node.asking.call_async(Trigger.Request()) for _ in range(8)]
    for number in range(1, 101):
        node.words.publish(Empty())
        spin_until(executor, lambda number=number: node.heard == number)
    assert not any(answer.done() for answer in answers)
    node.released.set()
    spin_until(executor, lambda: all(answer.done() for answer in answers))
    assert all(answer.result().success for answer in answers)


def test_each_callback_runs_once_and_waiting_costs_nothing(world):
    """A pass of the executor handles one thing or sleeps: rclpy's own made thousands of passes for these."""
    node, executor = world
    answer = node.asking.call_async(Trigger.Request())
    passes = []
    node.create_timer(0.005, lambda: node.words.publish(Empty()))

    def enough():
        passes.append(1)
        return node.heard >= 100

    spin_until(executor, enough)
    assert len(passes) < 400  # a timer and a message each, and a few waits
    node.released.set()
    spin_until(executor, answer.done)


def test_what_a_waiting_callback_raises_is_raised(world):
    node, executor = world

    def fail(_request, _response):
        raise ZeroDivisionError('of the service')

    node.create_service(Trigger, 'fail', fail, callback_group=ReentrantCallbackGroup())
    asking = node.create_client(Trigger, 'fail')
    assert asking.wait_for_service(DEADLINE_S)
    asking.call_async(Trigger.Request())
    with pytest.raises(ZeroDivisionError, match='of the service'):
        spin_until(executor, lambda: False)
