# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Header, Int16MultiArray, String
from texture_msgs import msg

from texture_core.errors import InvalidParameter, UnknownName
from texture_core.ros import SENSOR_QOS
from texture_core.ros_testing import LocalGraph
from texture_drivers.nodes.biotac_adaptor import BiotacAdaptor
from texture_drivers.nodes.tsf85_adaptor import Tsf85Adaptor
from texture_drivers.tsf85 import Tsf85MessageConverter

pytestmark = pytest.mark.ros


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> Iterator[LocalGraph]:
    # Stands in for the vendor's package: types that can be sent, under the right names.
    types = SimpleNamespace(Dynamic=String, Timestamp=Header, StaticData=Int16MultiArray)
    monkeypatch.setitem(sys.modules, 'robotiq_tsf', SimpleNamespace(msg=types))
    monkeypatch.setitem(sys.modules, 'robotiq_tsf.msg', types)
    with LocalGraph(65) as graph:
        yield graph


def packet(n: int) -> dict[str, Any]:
    return {
        'Dynamic': SimpleNamespace(data=[SimpleNamespace(value=n)] * 2),
        'StaticData': SimpleNamespace(taxels=[SimpleNamespace(values=[n] * 28)] * 2),
        'Timestamp': SimpleNamespace(values=[n, n]),
    }


def test_the_vendors_messages_become_signals_and_silence_is_reported(graph: LocalGraph) -> None:
    node = graph.add(Tsf85Adaptor, frame_id='tip')
    signals = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    reports = graph.listen(DiagnosticArray, '/diagnostics')
    sender = graph.peer.create_publisher(String, 'TactileSensor/Dynamic', SENSOR_QOS)
    graph.until(lambda: any('start the driver' in report.status[0].message for report in reports))
    numbers = itertools.count()

    def heard() -> bool:
        for _ in range(20):
            n = next(numbers)
            for name, message in packet(n).items():
                node._take(name)(message, {'source_timestamp': 10**18 + n * 1_000_000 + (name == 'Timestamp')})
        return bool(signals and reports[-1].status[0].level == b'\x00')

    graph.until(heard)
    assert (signals[0].sensor, signals[0].header.frame_id) == ('tsf85/dynamic', 'tip')
    assert np.ptp(np.array(signals[0].samples) - signals[0].first_sample - np.arange(len(signals[0].samples))) == 0
    assert sender.get_subscription_count() == 1


def test_a_message_is_handed_over_with_the_time_at_which_it_was_sent(
    graph: LocalGraph, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[tuple[str, int]] = []
    monkeypatch.setattr(Tsf85MessageConverter, 'take', lambda _, topic, message, ns: taken.append((topic, ns)))
    graph.add(Tsf85Adaptor)
    sender = graph.peer.create_publisher(String, 'TactileSensor/Dynamic', SENSOR_QOS)

    def handed_over() -> bool:
        sender.publish(String())
        return bool(taken)

    graph.until(handed_over)
    assert taken[0][0] == 'Dynamic'
    assert abs(time.time_ns() - taken[0][1]) < 5e9


def test_a_package_that_is_missing_is_reported_in_one_sentence(graph: LocalGraph) -> None:
    with pytest.raises(InvalidParameter, match=r"'package' .*no_such_msgs.* cannot be imported"):
        graph.add(Tsf85Adaptor, package='no_such_msgs')


@pytest.fixture
def kth_graph(monkeypatch: pytest.MonkeyPatch) -> Iterator[LocalGraph]:
    # Stands in for the user's package: something that can be subscribed to, under the right names.
    package = SimpleNamespace(msg=SimpleNamespace(BioTacHand=String))
    monkeypatch.setitem(sys.modules, 'biotac_sensors', package)
    monkeypatch.setitem(sys.modules, 'biotac_sensors.msg', package.msg)
    with LocalGraph(71) as kth_graph:
        yield kth_graph


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


def test_messages_of_another_driver_become_signals_and_faults_are_reported(kth_graph: LocalGraph) -> None:
    node = kth_graph.add(BiotacAdaptor, frame_id='tip')
    signals = kth_graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    reports = kth_graph.listen(DiagnosticArray, '/diagnostics')
    numbers = itertools.count()

    def heard() -> bool:
        node._on_message(hand(next(numbers)))
        return bool(signals and reports)

    kth_graph.until(heard)
    assert (signals[0].sensor, signals[0].header.frame_id) == ('biotac/pac', 'tip')
    assert np.array(signals[0].samples).tolist() == [7.0] * 22
    node._on_message(hand(next(numbers), electrodes=5))
    reports.clear()
    kth_graph.until(lambda: reports)
    status = reports[0].status[0]
    assert (status.level, status.hardware_id) == (b'\x02', 'BT-1')
    assert '5 electrodes' in status.message
    values = {value.key: value.value for value in status.values}
    assert (values['refused messages'], values['lost before the start']) == ('1', 'unknown')


def test_a_bridge_tells_what_it_misses_and_that_nobody_knows_what_was_missed_before(kth_graph: LocalGraph) -> None:
    node = kth_graph.add(BiotacAdaptor)
    for number in (0, 1, 2, 12, 13):  # nine of ten messages of 22 samples did not come
        node._on_message(hand(number))
    level, sentence, values = node._report()
    assert (level, sentence) == ('WARN', '198 samples lost since the last report')
    assert (values['lost'], values['lost before the start']) == (198, 'unknown')


def test_a_message_of_unknown_layout_is_reported_with_the_known_ones(kth_graph: LocalGraph) -> None:
    with pytest.raises(UnknownName, match='BioTacHand, BiotacAll'):
        kth_graph.add(BiotacAdaptor, message_type='biotac_sensors/msg/BioTacFoot')
