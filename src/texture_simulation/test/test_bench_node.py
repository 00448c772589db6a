"""Bench and sensor node together in the graph."""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from texture_msgs.msg import TactileSignal

from texture_core.errors import UnknownName
from texture_core.ros.conversions import from_msg
from texture_core.ros.qos import SENSOR_QOS
from texture_drivers.nodes.sensor import SensorNode
from texture_simulation.nodes.bench import BenchNode

pytestmark = pytest.mark.ros

DEADLINE_S = 30.0


class Graph:
    """Both nodes and a probe in one executor."""

    def __init__(self, link: Path) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.bench = BenchNode(
            context=self.context,
            parameter_overrides=[Parameter('tsf85_link', value=str(link)), Parameter('finger_port', value=0)],
        )
        self.sensor = SensorNode(context=self.context, parameter_overrides=[Parameter('device', value=str(link))])
        self.probe = rclpy.create_node('probe', context=self.context)
        self.batches = []
        self.levels = {}
        self.probe.create_subscription(
            TactileSignal, 'signal', lambda message: self.batches.append(from_msg(message)), SENSOR_QOS
        )
        self.probe.create_subscription(DiagnosticArray, '/diagnostics', self._note, 10)
        self.executor = SingleThreadedExecutor(context=self.context)
        for node in (self.bench, self.sensor, self.probe):
            self.executor.add_node(node)

    def _note(self, message) -> None:
        for status in message.status:
            self.levels[status.name] = int.from_bytes(status.level, 'little'), status.message

    def spin_until(self, reached: Callable[[], bool]) -> None:
        deadline = time.monotonic() + DEADLINE_S
        while not reached():
            assert time.monotonic() < deadline
            self.executor.spin_once(timeout_sec=0.1)

    def set(self, node, **values):
        return node.set_parameters([Parameter(name, value=value) for name, value in values.items()])[0]

    def close(self) -> None:
        for node in (self.sensor, self.bench):
            node.shutdown()
        self.executor.shutdown()
        for node in (self.sensor, self.bench, self.probe):
            node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def graph(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Graph]:
    monkeypatch.setenv('ROS_DOMAIN_ID', '22')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    made = Graph(tmp_path / 'tsf85')
    yield made
    made.close()
    assert not os.path.lexists(tmp_path / 'tsf85')


def test_signals_flow_survive_a_replug_and_the_gap_is_in_the_index(graph: Graph) -> None:
    graph.spin_until(lambda: len(graph.batches) > 50)
    graph.spin_until(lambda: graph.levels.get('/sensor', (9, ''))[0] == 0)
    graph.bench._bench.unplug()
    graph.spin_until(lambda: graph.levels['/sensor'][0] == 2)
    last = graph.batches[-1]
    replugged = time.monotonic()
    graph.bench._bench.replug()
    graph.spin_until(lambda: graph.batches[-1] is not last)
    assert time.monotonic() - replugged < 5.0
    first = graph.batches[graph.batches.index(last) + 1]
    missing_s = (first.first_sample - last.next_sample) / 1000
    assert missing_s == pytest.approx((first.stamp_ns - last.end_ns) / 1e9, abs=0.02)
    graph.spin_until(lambda: graph.levels['/sensor'][0] == 0)


def test_the_surface_is_a_parameter_that_refuses_unknown_names(graph: Graph) -> None:
    result = graph.set(graph.bench, surface='ridge_3m')
    assert not result.successful
    assert "did you mean 'ridge_3mm'" in result.reason
    assert graph.set(graph.bench, surface='ridge_3mm').successful
    assert graph.bench.get_parameter('surface').value == 'ridge_3mm'
    assert not graph.set(graph.bench, seed=5).successful


def test_deactivating_stops_the_stream_and_activating_brings_it_back(graph: Graph) -> None:
    graph.spin_until(lambda: len(graph.batches) > 5)
    graph.sensor.trigger_deactivate()
    assert not graph.bench._bench.device.plugged or graph.sensor._reader is None
    graph.spin_until(lambda: not graph.bench._bench.device.streaming)
    graph.sensor.trigger_activate()
    count = len(graph.batches)
    graph.spin_until(lambda: len(graph.batches) > count + 5)


def test_a_sensor_that_no_catalogue_knows_is_refused_with_a_sentence(graph: Graph) -> None:
    with pytest.raises(UnknownName, match="did you mean 'tsf85'"):
        SensorNode(context=graph.context, parameter_overrides=[Parameter('sensor', value='tsf58')])
