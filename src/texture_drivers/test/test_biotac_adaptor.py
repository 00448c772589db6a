# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String
from texture_msgs import msg

from texture_core.errors import InvalidParameter, UnknownName
from texture_core.ros import SENSOR_QOS
from texture_core.ros_testing import LocalGraph
from texture_drivers.nodes.biotac_adaptor import BiotacAdaptor

pytestmark = pytest.mark.ros


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> Iterator[LocalGraph]:
    # Stands in for the user's package: something that can be subscribed to, under the right names.
    package = SimpleNamespace(msg=SimpleNamespace(BioTacHand=String))
    monkeypatch.setitem(sys.modules, 'biotac_sensors', package)
    monkeypatch.setitem(sys.modules, 'biotac_sensors.msg', package.msg)
    with LocalGraph(71) as graph:
        yield graph


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


def test_messages_of_another_driver_become_signals_and_faults_are_reported(graph: LocalGraph) -> None:
    node = graph.add(BiotacAdaptor, frame_id='tip')
    signals = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    reports = graph.listen(DiagnosticArray, '/diagnostics')
    numbers = itertools.count()

    def heard() -> bool:
        node._on_message(hand(next(numbers)))
        return bool(signals and reports)

    graph.until(heard)
    assert (signals[0].sensor, signals[0].header.frame_id) == ('biotac/pac', 'tip')
    assert np.array(signals[0].samples).tolist() == [7.0] * 22
    node._on_message(hand(next(numbers), electrodes=5))
    reports.clear()
    graph.until(lambda: reports)
    status = reports[0].status[0]
    assert (status.level, status.hardware_id) == (b'\x02', 'BT-1')
    assert '5 electrodes' in status.message
    values = {value.key: value.value for value in status.values}
    assert (values['refused messages'], values['lost before the start']) == ('1', 'unknown')


def test_a_bridge_tells_what_it_misses_and_that_nobody_knows_what_was_missed_before(graph: LocalGraph) -> None:
    node = graph.add(BiotacAdaptor)
    for number in (0, 1, 2, 12, 13):  # nine of ten messages of 22 samples did not come
        node._on_message(hand(number))
    level, sentence, values = node._report()
    assert (level, sentence) == ('WARN', '198 samples lost since the last report')
    assert (values['lost'], values['lost before the start']) == (198, 'unknown')


def test_a_message_package_that_is_missing_is_reported_in_one_sentence(graph: LocalGraph) -> None:
    with pytest.raises(InvalidParameter, match=r'cannot be imported .*build the package'):
        graph.add(BiotacAdaptor, message_type='no_such_msgs/msg/BioTacHand')


def test_a_message_of_unknown_layout_is_reported_with_the_known_ones(graph: LocalGraph) -> None:
    with pytest.raises(UnknownName, match='BioTacHand, BiotacAll'):
        graph.add(BiotacAdaptor, message_type='biotac_sensors/msg/BioTacFoot')
