"""The generic sensor node with a BioTac: emulated bridge, real node, real topics."""

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
from texture_simulation.devices.biotac import EmulatedBioTac

pytestmark = pytest.mark.ros
DEADLINE_S = 30.0


class Board:
    """An emulated board of two fingers whose time passes."""

    def __init__(self, link: Path) -> None:
        self.device = EmulatedBioTac(link, np.random.default_rng(0), ('BT-0', 'BT-1'))
        self.device.plug()
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        start_s, frames = time.monotonic(), 0
        while not self._stop.wait(0.005):
            due = int((time.monotonic() - start_s) * 100) - frames
            frames += due
            with self._lock:
                self.device.advance(np.full((due, 44, 2), [100, 200], dtype=np.uint16))

    def replug(self) -> None:
        with self._lock:
            self.device.unplug()
            self.device.plug()

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.device.unplug()


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Board]:
    board = Board(tmp_path / 'biotac')
    yield board
    board.close()


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.setenv('ROS_DOMAIN_ID', '72')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    context = rclpy.Context()
    context.init()
    yield context
    context.shutdown()


def spin_until(executor: SingleThreadedExecutor, condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline_s, 'it did not happen in time'
        executor.spin_once(timeout_sec=0.1)


def test_the_sensor_node_publishes_a_biotac_and_survives_replugging(board: Board, context: Any, tmp_path: Path) -> None:
    given = {'sensor': 'biotac', 'device': str(tmp_path / 'biotac'), 'finger': 1, 'frame_id': 'tip'}
    node = SensorNode(
        context=context, parameter_overrides=[Parameter(name, value=value) for name, value in given.items()]
    )
    listener = rclpy.create_node('listener', context=context)
    fast: list[Any] = []
    slow: list[Any] = []
    reports: list[Any] = []
    listener.create_subscription(msg.TactileSignal, 'signal', fast.append, SENSOR_QOS)
    listener.create_subscription(msg.TactileSignal, 'signal_static', slow.append, SENSOR_QOS)
    listener.create_subscription(DiagnosticArray, '/diagnostics', reports.append, 10)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    executor.add_node(listener)
    try:
        spin_until(executor, lambda: len(fast) > 20 and len(slow) > 20)
        assert (fast[-1].sensor, fast[-1].sampling_rate_hz, fast[-1].header.frame_id) == ('biotac/pac', 2200.0, 'tip')
        assert set(fast[-1].samples) == {200.0}
        assert (slow[-1].channels[:4], len(slow[-1].samples) % 22) == (['tdc', 'tac', 'pdc', 'electrode1'], 0)
        before = fast[-1].first_sample
        board.replug()
        fast.clear()
        spin_until(executor, lambda: bool(fast))
        spin_until(executor, lambda: any(value.key == 'reopened' and value.value == '1' for value in values(reports)))
        assert fast[-1].first_sample > before
    finally:
        node.shutdown()
        node.destroy_node()
        listener.destroy_node()


def values(reports: list[Any]) -> list[Any]:
    return [value for report in reports for status in report.status for value in status.values]
