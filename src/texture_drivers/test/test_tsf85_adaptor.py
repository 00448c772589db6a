from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_msgs.msg import Header, Int16MultiArray, String
from texture_msgs import msg

from texture_core.errors import InvalidParameter
from texture_core.ros.qos import SENSOR_QOS
from texture_drivers.nodes.tsf85_adaptor import Tsf85Adaptor
from texture_drivers.tsf85.messages import MessageStream

pytestmark = pytest.mark.ros
DEADLINE_S = 20.0


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.setenv('ROS_DOMAIN_ID', '23')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    # Stands in for the vendor's package: types that can be sent, under the right names.
    types = SimpleNamespace(Dynamic=String, Timestamp=Header, StaticData=Int16MultiArray)
    monkeypatch.setitem(sys.modules, 'robotiq_tsf', SimpleNamespace(msg=types))
    monkeypatch.setitem(sys.modules, 'robotiq_tsf.msg', types)
    context = rclpy.Context()
    context.init()
    yield context
    context.shutdown()


def packet(n: int) -> dict[str, Any]:
    return {
        'Dynamic': SimpleNamespace(data=[SimpleNamespace(value=n)] * 2),
        'StaticData': SimpleNamespace(taxels=[SimpleNamespace(values=[n] * 28)] * 2),
        'Timestamp': SimpleNamespace(values=[n, n]),
    }


def test_the_vendors_messages_become_signals_and_silence_is_reported(context: Any) -> None:
    node = Tsf85Adaptor(context=context, parameter_overrides=[Parameter('frame_id', value='tip')])
    listener = rclpy.create_node('listener', context=context)
    signals: list[Any] = []
    reports: list[Any] = []
    listener.create_subscription(msg.TactileSignal, 'signal', signals.append, SENSOR_QOS)
    listener.create_subscription(DiagnosticArray, '/diagnostics', lambda array: reports.append(array.status[0]), 10)
    sender = listener.create_publisher(String, 'TactileSensor/Dynamic', SENSOR_QOS)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    executor.add_node(listener)
    deadline_s = time.monotonic() + DEADLINE_S
    try:
        while not any('start the driver' in report.message for report in reports):
            assert time.monotonic() < deadline_s
            executor.spin_once(timeout_sec=0.1)
        n = 0
        while not (signals and reports[-1].level == b'\x00'):
            assert time.monotonic() < deadline_s
            for name, message in packet(n).items():
                node._take(name)(message, {'source_timestamp': 10**18 + n * 1_000_000 + (name == 'Timestamp')})
            n += 1
            executor.spin_once(timeout_sec=0.001)
        assert (signals[0].sensor, signals[0].header.frame_id) == ('tsf85/dynamic', 'tip')
        assert np.ptp(np.array(signals[0].samples) - signals[0].first_sample - np.arange(len(signals[0].samples))) == 0
        assert sender.get_subscription_count() == 1
    finally:
        node.destroy_node()
        listener.destroy_node()


def test_a_message_is_handed_over_with_the_time_at_which_it_was_sent(
    context: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[tuple[str, int]] = []
    monkeypatch.setattr(MessageStream, 'take', lambda _, topic, message, ns: taken.append((topic, ns)))
    node = Tsf85Adaptor(context=context)
    sender = node.create_publisher(String, 'TactileSensor/Dynamic', SENSOR_QOS)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    deadline_s = time.monotonic() + DEADLINE_S
    try:
        while not taken:
            assert time.monotonic() < deadline_s
            sender.publish(String())
            executor.spin_once(timeout_sec=0.1)
        assert taken[0][0] == 'Dynamic'
        assert abs(time.time_ns() - taken[0][1]) < 5e9
    finally:
        node.destroy_node()


def test_a_package_that_is_missing_is_told_in_one_sentence(context: Any) -> None:
    with pytest.raises(InvalidParameter, match=r"'package' .*no_such_msgs.* cannot be imported"):
        Tsf85Adaptor(context=context, parameter_overrides=[Parameter('package', value='no_such_msgs')])
