# SPDX-License-Identifier: Apache-2.0
"""Every sensor with a device in the lifecycle node: configured, active, inactive and cleaned up, again and again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.lifecycle import TransitionCallbackReturn
from sensor_rig import CASES, Rig
from texture_msgs import msg

from texture_core.errors import InvalidParameter
from texture_core.ros import SENSOR_QOS
from texture_core.ros_testing import LocalGraph
from texture_drivers.nodes.sensor import SensorNode
from texture_simulation.devices.fingers import FrameFaults

pytestmark = [pytest.mark.realtime, pytest.mark.ros]
OK, WARN, ERROR = b'\x00', b'\x01', b'\x02'


class Ear:
    """The node, and what it publishes."""

    def __init__(self, graph: LocalGraph, rig: Rig, name: str) -> None:
        self.node = graph.add(SensorNode, sensor=name, device=str(rig.link), config=rig.case.config, autostart=False)
        self._batches = graph.listen(msg.TactileSignal, rig.case.topic, SENSOR_QOS)
        self._reports = graph.listen(DiagnosticArray, '/diagnostics')
        self._until = graph.until

    def more(self) -> None:
        self._batches.clear()
        self._until(lambda: len(self._batches) > 5)

    def level(self, wanted: bytes) -> Any:
        self._until(lambda: self._reports and self._reports[-1].status[0].level == wanted)
        return self._reports[-1].status[0]


@pytest.fixture
def graph() -> Iterator[LocalGraph]:
    with LocalGraph(66) as graph:
        yield graph


@pytest.fixture
def make(graph: LocalGraph, tmp_path: Path) -> Iterator[Callable[[str], tuple[Rig, Ear]]]:
    with ExitStack() as rigs:

        def make(name: str) -> tuple[Rig, Ear]:
            rig = rigs.enter_context(Rig(name, tmp_path / name))
            return rig, Ear(graph, rig, name)

        yield make


@pytest.mark.parametrize('name', CASES)
def test_a_life_from_configuring_to_cleaning_up(make: Any, name: str) -> None:
    rig, ear = make(name)
    turns = 3 if name == 'tsf85' else 1
    for _ in range(turns):
        assert ear.node.trigger_configure() == TransitionCallbackReturn.SUCCESS
        for _ in range(turns):
            assert ear.node.trigger_activate() == TransitionCallbackReturn.SUCCESS
            ear.more()
            assert ear.node.trigger_deactivate() == TransitionCallbackReturn.SUCCESS
            rig.another().open()  # inactive, it lets go of the device
        assert ear.node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    assert ear.node.trigger_shutdown() == TransitionCallbackReturn.SUCCESS


def test_the_level_falls_with_each_fault_and_rises_again(make: Any) -> None:
    rig, ear = make('daq')
    ear.level(WARN)  # not active yet
    ear.node.trigger_configure()
    ear.node.trigger_activate()
    ear.level(OK)
    rig.set(frame_faults=FrameFaults(skip=0.02))
    assert 'samples lost' in ear.level(WARN).message
    rig.set(frame_faults=FrameFaults())
    ear.level(OK)
    rig.run_locked(rig.device.unplug)
    assert str(rig.link) in ear.level(ERROR).message
    rig.run_locked(rig.device.plug)
    ear.level(OK)
    rig.set(silent=True)
    ear.level(ERROR)
    rig.set(silent=False)
    values = {value.key: value.value for value in ear.level(OK).values}
    assert int(values['reopened']) >= 1
    assert abs(float(values['device clock slow by [ppm]'])) < 5000


def test_parameters_that_the_sensor_refuses_end_the_node_with_a_sentence(graph: LocalGraph) -> None:
    for given, sentence in (({'finger': 2}, 'a TSF-85 has the fingers'), ({'config': '{im: true}'}, "mean 'imu'")):
        with pytest.raises(InvalidParameter, match=sentence):
            graph.add(SensorNode, **given)
