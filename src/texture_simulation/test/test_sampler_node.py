"""The generic sensor node with the DAQ finger, the PVDF finger and a recording: real node, real topics."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from texture_msgs import msg

from texture_core.ros.qos import SENSOR_QOS
from texture_drivers.nodes.sensor import SensorNode
from texture_simulation.devices.daq import EmulatedDaq
from texture_simulation.devices.pvdf import EmulatedPvdf

pytestmark = pytest.mark.ros
DEADLINE_S = 30.0


class Bench:
    """An emulated device whose time passes."""

    def __init__(self, feel: Callable[[int, int], None]) -> None:
        self._feel = feel
        self.lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        start_s, done_ms = time.monotonic(), 0
        while not self._stop.wait(0.005):
            due_ms = int(1000 * (time.monotonic() - start_s))
            with self.lock:
                self._feel(done_ms, due_ms)
            done_ms = due_ms

    def close(self) -> None:
        self._stop.set()
        self._thread.join()


class Graph:
    """The sensor node and a listener to all it publishes."""

    def __init__(self, context: Any, **parameters: Any) -> None:
        self.messages: dict[str, list[Any]] = {'signal': [], 'signal_static': []}
        self.values: dict[str, str] = {}
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        self.node = SensorNode(context=context, parameter_overrides=overrides)
        self.listener = rclpy.create_node('listener', context=context)
        for topic, found in self.messages.items():
            self.listener.create_subscription(msg.TactileSignal, topic, found.append, SENSOR_QOS)
        self.listener.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)
        self.executor.add_node(self.listener)

    def _on_diagnostics(self, message: Any) -> None:
        self.values = {value.key: value.value for status in message.status for value in status.values}

    def spin_until(self, condition: Callable[[], bool]) -> None:
        deadline_s = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < deadline_s, 'it did not happen in time'
            self.executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        self.node.shutdown()
        self.node.destroy_node()
        self.listener.destroy_node()


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Graph]]:
    monkeypatch.setenv('ROS_DOMAIN_ID', '80')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    context = rclpy.Context()
    context.init()
    graphs: list[Graph] = []

    def make(**parameters: Any) -> Graph:
        graphs.append(Graph(context, **parameters))
        return graphs[-1]

    yield make
    for graph in graphs:
        graph.close()
    context.shutdown()


def test_the_daq_finger_streams_and_survives_replugging(start: Callable[..., Graph], tmp_path: Path) -> None:
    device = EmulatedDaq(tmp_path / 'daq', np.random.default_rng(0))
    device.plug()
    bench = Bench(lambda a, b: device.feel(np.full(((b * 5) // 2 - (a * 5) // 2, 8), 1000, dtype=np.int16)))
    try:
        graph = start(sensor='daq', device=str(tmp_path / 'daq'), frame_id='tip')
        signal = graph.messages['signal']
        graph.spin_until(lambda: len(signal) > 50)
        assert (signal[-1].sensor, signal[-1].unit, signal[-1].sampling_rate_hz) == ('daq', 'V', 2500.0)
        assert signal[-1].channels[::4] == ['pvdf_outer_1', 'strain_outer_1']
        assert set(signal[-1].samples) == {np.float32(1000 * 10 / 2**15)}
        before = signal[-1].first_sample
        with bench.lock:
            device.unplug()
            device.plug()
        signal.clear()
        graph.spin_until(lambda: bool(signal) and graph.values.get('reopened') == '1')
        assert signal[-1].first_sample > before
    finally:
        bench.close()
        device.unplug()


def test_the_pvdf_finger_publishes_film_and_force(start: Callable[..., Graph], tmp_path: Path) -> None:
    device = EmulatedPvdf(tmp_path / 'pvdf', np.random.default_rng(0))
    device.plug()

    def feel(since_ms: int, until_ms: int) -> None:
        films, forces = (until_ms * rate // 1000 - since_ms * rate // 1000 for rate in (4096, 64))
        device.feel(np.full(films, 500, dtype=np.int16), np.full(forces, 300, dtype=np.int16))

    bench = Bench(feel)
    try:
        graph = start(sensor='pvdf', device=str(tmp_path / 'pvdf'))
        graph.spin_until(lambda: len(graph.messages['signal']) > 20 and len(graph.messages['signal_static']) > 20)
        assert graph.messages['signal'][-1].samples[0] == pytest.approx(1.0)  # pC
        assert graph.messages['signal_static'][-1].samples[0] == pytest.approx(1.5)  # N
    finally:
        bench.close()
        device.unplug()


def test_a_recording_is_played_as_a_sensor(start: Callable[..., Graph], tmp_path: Path) -> None:
    np.savez(tmp_path / 'slide.npz', samples=np.arange(500.0)[:, None], rate_hz=1000.0, channels=['film'])
    graph = start(sensor='file', device=str(tmp_path / 'slide.npz'), config='{loop: true, unit: Pa}')
    signal = graph.messages['signal']
    graph.spin_until(lambda: len(signal) > 60)
    assert (signal[-1].sensor, signal[-1].unit, signal[-1].channels) == ('file/slide', 'Pa', ['film'])
    assert all(message.samples[0] == message.first_sample % 500 for message in signal)
