"""The generic sensor node with a BioTac: emulated bridge, real node, real topics."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from texture_msgs import msg

from texture_core.ros.local_graph import LocalGraph
from texture_core.ros.qos import SENSOR_QOS
from texture_drivers.nodes.sensor import SensorNode
from texture_simulation.devices.biotac import EmulatedBioTac

pytestmark = pytest.mark.ros


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


def test_the_sensor_node_publishes_a_biotac_and_survives_replugging(board: Board, tmp_path: Path) -> None:
    with LocalGraph(72) as graph:
        fast, slow = (graph.listen(msg.TactileSignal, topic, SENSOR_QOS) for topic in ('signal', 'signal_static'))
        reports = graph.listen(DiagnosticArray, '/diagnostics')
        graph.add(SensorNode, sensor='biotac', device=str(tmp_path / 'biotac'), finger=1, frame_id='tip')
        graph.until(lambda: len(fast) > 20 and len(slow) > 20)
        assert (fast[-1].sensor, fast[-1].sampling_rate_hz, fast[-1].header.frame_id) == ('biotac/pac', 2200.0, 'tip')
        assert set(fast[-1].samples) == {200.0}
        assert (slow[-1].channels[:4], len(slow[-1].samples) % 22) == (['tdc', 'tac', 'pdc', 'electrode1'], 0)
        before = fast[-1].first_sample
        board.replug()
        fast.clear()
        graph.until(lambda: fast)
        graph.until(lambda: any(value.key == 'reopened' and value.value == '1' for value in values(reports)))
        assert fast[-1].first_sample > before


def values(reports: list[Any]) -> list[Any]:
    return [value for report in reports for status in report.status for value in status.values]
