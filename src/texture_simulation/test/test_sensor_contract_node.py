"""Every sensor with a device in the lifecycle node: configured, active, inactive and cleaned up, again and again."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from texture_msgs import msg

from texture_core.errors import InvalidParameter
from texture_core.ros.qos import SENSOR_QOS
from texture_drivers.nodes.sensor import SensorNode
from texture_simulation.devices.faults import FrameFaults
from texture_simulation.rig import CASES, Rig

pytestmark = pytest.mark.ros
DEADLINE_S = 30.0
OK, WARN, ERROR = b'\x00', b'\x01', b'\x02'


class Graph:
    """The node, and one that listens."""

    def __init__(self, rig: Rig, name: str, context: Any) -> None:
        given = {'sensor': name, 'device': str(rig.link), 'config': rig.case.config, 'autostart': False}
        overrides = [Parameter(key, value=value) for key, value in given.items()]
        self.node = SensorNode(context=context, parameter_overrides=overrides)
        self.listener = rclpy.create_node('listener', context=context)
        self.batches: list[Any] = []
        self.status: Any = None
        self.listener.create_subscription(msg.TactileSignal, rig.case.topic, self.batches.append, SENSOR_QOS)
        self.listener.create_subscription(DiagnosticArray, '/diagnostics', self._note, 10)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)
        self.executor.add_node(self.listener)

    def _note(self, array: Any) -> None:
        self.status = array.status[0]

    def spin_until(self, reached: Callable[[], bool]) -> None:
        deadline_s = time.monotonic() + DEADLINE_S
        while not reached():
            assert time.monotonic() < deadline_s, self.status
            self.executor.spin_once(timeout_sec=0.1)

    def more(self) -> None:
        self.batches.clear()
        self.spin_until(lambda: len(self.batches) > 5)

    def level(self, wanted: bytes) -> Any:
        self.spin_until(lambda: self.status is not None and self.status.level == wanted)
        return self.status

    def close(self) -> None:
        self.node.shutdown()
        self.executor.shutdown()
        self.node.destroy_node()
        self.listener.destroy_node()


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.setenv('ROS_DOMAIN_ID', '24')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    context = rclpy.Context()
    context.init()
    yield context
    context.try_shutdown()


@pytest.fixture
def make(context: Any, tmp_path: Path) -> Iterator[Callable[[str], tuple[Rig, Graph]]]:
    made: list[Any] = []

    def make(name: str) -> tuple[Rig, Graph]:
        rig = Rig(name, tmp_path / name)
        graph = Graph(rig, name, context)
        made.extend([graph, rig])
        return rig, graph

    yield make
    for item in made:
        item.close()


@pytest.mark.parametrize('name', CASES)
def test_a_life_from_configuring_to_cleaning_up(make: Any, name: str) -> None:
    rig, graph = make(name)
    turns = 3 if name == 'tsf85' else 1
    for _ in range(turns):
        assert graph.node.trigger_configure() == TransitionCallbackReturn.SUCCESS
        for _ in range(turns):
            assert graph.node.trigger_activate() == TransitionCallbackReturn.SUCCESS
            graph.more()
            assert graph.node.trigger_deactivate() == TransitionCallbackReturn.SUCCESS
            rig.another().open()  # inactive, it lets go of the device
        assert graph.node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    assert graph.node.trigger_shutdown() == TransitionCallbackReturn.SUCCESS


def test_the_level_falls_with_each_fault_and_rises_again(make: Any) -> None:
    rig, graph = make('daq')
    graph.level(WARN)  # not active yet
    graph.node.trigger_configure()
    graph.node.trigger_activate()
    graph.level(OK)
    rig.set(frame_faults=FrameFaults(skip=0.02))
    assert 'samples lost' in graph.level(WARN).message
    rig.set(frame_faults=FrameFaults())
    graph.level(OK)
    rig.do(rig.device.unplug)
    assert str(rig.link) in graph.level(ERROR).message
    rig.do(rig.device.plug)
    graph.level(OK)
    rig.set(mute=True)
    graph.level(ERROR)
    rig.set(mute=False)
    values = {value.key: value.value for value in graph.level(OK).values}
    assert int(values['reopened']) >= 1
    assert abs(float(values['device clock slow by [ppm]'])) < 5000


def test_parameters_that_the_sensor_refuses_end_the_node_with_a_sentence(context: Any) -> None:
    for given, sentence in (({'finger': 2}, 'a TSF-85 has the fingers'), ({'config': '{im: true}'}, "mean 'imu'")):
        overrides = [Parameter(key, value=value) for key, value in given.items()]
        with pytest.raises(InvalidParameter, match=sentence):
            SensorNode(context=context, parameter_overrides=overrides)
