from __future__ import annotations

import socket
import time

import pytest
import rclpy
from rclpy.parameter import Parameter

from texture_core.errors import DeviceError
from texture_core.finger import FingerState
from texture_simulation.nodes.leap_hand import LeapHandNode
from texture_simulation.nodes.rails import RailsNode

pytestmark = pytest.mark.ros

DEADLINE_S = 20.0
NODES = {'rails': RailsNode, 'leap_hand': LeapHandNode}


@pytest.fixture
def ros(monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', '113')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    rclpy.init()
    yield
    rclpy.shutdown()


@pytest.mark.parametrize('name', NODES)
def test_the_device_lives_with_its_node_and_tells_where_the_finger_is(name, ros, tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bench:
        bench.bind(('127.0.0.1', 0))
        bench.settimeout(DEADLINE_S)
        values = {'link': str(tmp_path / name), 'finger_port': bench.getsockname()[1]}
        node = NODES[name](parameter_overrides=[Parameter(key, value=value) for key, value in values.items()])
        before_ns = time.monotonic_ns()
        while (state := FingerState.from_bytes(bench.recv(1024))).time_ns < before_ns:
            pass
        assert (state.z_m, state.force_n) == (pytest.approx(0.01), 0.0)
        assert (tmp_path / name).exists()
        assert node._report()[0] == 'OK'
        node.shutdown()
        assert not (tmp_path / name).exists()
        node.destroy_node()


def test_a_link_that_cannot_be_made_is_told(ros, tmp_path):
    (tmp_path / 'file').touch()
    with pytest.raises(DeviceError, match='no link at'):
        RailsNode(parameter_overrides=[Parameter('link', value=str(tmp_path / 'file'))])
