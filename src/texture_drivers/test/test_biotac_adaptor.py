from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_msgs.msg import String
from texture_msgs import msg

from texture_core.errors import InvalidParameter, UnknownName
from texture_core.ros.qos import SENSOR_QOS
from texture_drivers.nodes.biotac_adaptor import BiotacAdaptor

pytestmark = pytest.mark.ros
DEADLINE_S = 20.0
Make = Callable[..., BiotacAdaptor]


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.setenv('ROS_DOMAIN_ID', '71')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    context = rclpy.Context()
    context.init()
    yield context
    context.shutdown()


@pytest.fixture
def make(context: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    # Stands in for the user's package: something that can be subscribed to, under the right names.
    package = SimpleNamespace(msg=SimpleNamespace(BioTacHand=String))
    monkeypatch.setitem(sys.modules, 'biotac_sensors', package)
    monkeypatch.setitem(sys.modules, 'biotac_sensors.msg', package.msg)
    nodes: list[BiotacAdaptor] = []

    def make(**overrides: Any) -> BiotacAdaptor:
        given = [Parameter(name, value=value) for name, value in overrides.items()]
        nodes.append(BiotacAdaptor(context=context, parameter_overrides=given))
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()


def hand(n: int, electrodes: int = 19) -> SimpleNamespace:
    sec, nanosec = divmod(1_700_000_000_000_000_000 + n * 10_000_000, 1_000_000_000)
    finger = SimpleNamespace(
        bt_serial='BT-1',
        bt_position=1,
        tdc_data=3,
        tac_data=2,
        pdc_data=1,
        pac_data=[7] * 22,
        electrode_data=[5] * electrodes,
    )
    stamp = SimpleNamespace(sec=sec, nanosec=nanosec)
    return SimpleNamespace(header=SimpleNamespace(stamp=stamp), bt_data=[finger])


def test_messages_of_another_driver_become_signals_and_faults_are_reported(context: Any, make: Make) -> None:
    node = make(frame_id='tip')
    listener = rclpy.create_node('listener', context=context)
    signals: list[Any] = []
    reports: list[Any] = []
    listener.create_subscription(msg.TactileSignal, 'signal', signals.append, SENSOR_QOS)
    listener.create_subscription(DiagnosticArray, '/diagnostics', reports.append, 10)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    executor.add_node(listener)
    deadline_s, n = time.monotonic() + DEADLINE_S, 0
    while not (signals and reports) and time.monotonic() < deadline_s:
        node._on_message(hand(n))
        n += 1
        executor.spin_once(timeout_sec=0.01)
    assert (signals[0].sensor, signals[0].header.frame_id) == ('biotac/pac', 'tip')
    assert np.array(signals[0].samples).tolist() == [7.0] * 22
    node._on_message(hand(n, electrodes=5))
    reports.clear()
    while not reports and time.monotonic() < deadline_s:
        executor.spin_once(timeout_sec=0.1)
    status = reports[0].status[0]
    assert (status.level, status.hardware_id) == (b'\x02', 'BT-1')
    assert '5 electrodes' in status.message
    assert {value.key: value.value for value in status.values}['refused messages'] == '1'
    listener.destroy_node()


def test_a_message_package_that_is_missing_is_told_in_one_sentence(make: Make) -> None:
    with pytest.raises(InvalidParameter, match=r'cannot be imported .*build the package'):
        make(message_type='no_such_msgs/msg/BioTacHand')


def test_a_message_of_unknown_layout_is_told_with_the_known_ones(make: Make) -> None:
    with pytest.raises(UnknownName, match='BioTacHand, BiotacAll'):
        make(message_type='biotac_sensors/msg/BioTacFoot')
