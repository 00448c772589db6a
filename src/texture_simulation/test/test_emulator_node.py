# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bench and sensor node together in the graph."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter
from texture_msgs.msg import TactileSignal

from texture_core.ros import SENSOR_QOS, from_msg
from texture_core.ros_testing import LocalGraph
from texture_drivers.nodes.sensor import SensorNode
from texture_simulation.nodes.emulator import EmulatorNode

pytestmark = [pytest.mark.realtime, pytest.mark.ros]


class Bed:
    """Bench and sensor node, and what they publish."""

    def __init__(self, graph: LocalGraph, link: Path) -> None:
        self.emulator = graph.add(EmulatorNode, sensor_link=str(link), finger_pipe=f'{link}_finger')
        self.sensor = graph.add(SensorNode, device=str(link))
        self.batches: list[Any] = []
        graph.peer.create_subscription(
            TactileSignal, 'signal', lambda message: self.batches.append(from_msg(message)), SENSOR_QOS
        )
        self._reports = graph.listen(DiagnosticArray, '/diagnostics')
        self.until = graph.until

    @property
    def level(self) -> int:
        """The newest level of the sensor; 9 if there is none."""
        levels = [status.level for report in self._reports for status in report.status if status.name == '/sensor']
        return int.from_bytes(levels[-1], 'little') if levels else 9

    def set(self, node: Any, **values: Any) -> Any:
        return node.set_parameters([Parameter(name, value=value) for name, value in values.items()])[0]


@pytest.fixture
def bed(tmp_path: Path) -> Iterator[Bed]:
    with LocalGraph(64) as graph:
        yield Bed(graph, tmp_path / 'tsf85')
    assert not os.path.lexists(tmp_path / 'tsf85')


def test_the_surface_is_a_parameter_that_refuses_unknown_names(bed: Bed) -> None:
    result = bed.set(bed.emulator, surface='ridge_3m')
    assert not result.successful
    assert "did you mean 'ridge_3mm'" in result.reason
    assert bed.set(bed.emulator, surface='ridge_3mm').successful
    assert bed.emulator.get_parameter('surface').value == 'ridge_3mm'
    assert not bed.set(bed.emulator, seed=5).successful


def test_the_plug_and_the_line_are_parameters(bed: Bed) -> None:
    bed.until(lambda: bed.level == 0)
    assert bed.set(bed.emulator, plugged=False).successful
    bed.until(lambda: bed.level == 2)
    assert bed.set(bed.emulator, plugged=True, bit_flips=0.02).successful
    bed.until(lambda: bed.sensor._sensor.counts['bogus'] > 5)
    assert bed.set(bed.emulator, bit_flips=0.0).successful
    bed.until(lambda: bed.level == 0)
    assert not bed.set(bed.emulator, bit_flips=2.0).successful
