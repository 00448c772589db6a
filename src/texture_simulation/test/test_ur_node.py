from __future__ import annotations

import os

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter

from texture_simulation.nodes.ur_controller import UrControllerNode

pytestmark = pytest.mark.ros

IP = '127.0.0.65'
DEADLINE_S = 10.0


@pytest.fixture
def node(monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', '91')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    rclpy.init()
    node = UrControllerNode(parameter_overrides=[Parameter('ip', value=IP)])
    yield node
    node.shutdown()
    node.destroy_node()
    rclpy.shutdown()


def next_status(node):
    heard = []
    node.create_subscription(DiagnosticArray, '/diagnostics', heard.append, 10)
    end_ns = node.get_clock().now().nanoseconds + int(DEADLINE_S * 1e9)
    while not heard and node.get_clock().now().nanoseconds < end_ns:
        rclpy.spin_once(node, timeout_sec=0.1)
    return heard[0].status[0]


def test_the_controller_lives_and_ends_with_its_node_which_tells_if_it_dies(node):
    controller = node._controller
    assert controller.ask('robotmode') == 'Robotmode: RUNNING'
    assert (next_status(node).message, next_status(node).hardware_id) == ('the emulated controller runs', IP)
    os.kill(controller.pid, 9)
    os.waitid(os.P_PID, controller.pid, os.WEXITED | os.WNOWAIT)
    assert 'the emulated controller ended' in next_status(node).message
