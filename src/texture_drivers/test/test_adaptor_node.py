# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The adaptor in ROS: messages of another driver come in, signals go out, faults are on /diagnostics."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import Float32MultiArray
from texture_msgs import msg

from texture_core.errors import InvalidParameter
from texture_core.ros import SENSOR_QOS, to_stamp
from texture_core.ros_testing import LocalGraph
from texture_core.types import NANOSECONDS
from texture_drivers.nodes.adaptor import Adaptor

pytestmark = [pytest.mark.ros, pytest.mark.realtime]


@pytest.fixture
def graph() -> Iterator[LocalGraph]:
    with LocalGraph(65) as graph:
        yield graph


def test_messages_become_signals_and_silence_and_malformed_values_are_reported(
    graph: LocalGraph, tmp_path, capfd
) -> None:
    mapping = tmp_path / 'mine.yaml'
    mapping.write_text(
        'signals: {signal: {topic: tactile, type: std_msgs/msg/Float32MultiArray, values: [data], '
        "channels: [a, b, at_s], stamp: 'data[2]', units: [N], rate_hz: 1000, sensor: mine}}"
    )
    graph.add(Adaptor, mapping=str(mapping), frame_id='tip')
    signals = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    reports = graph.listen(DiagnosticArray, '/diagnostics')
    sender = graph.peer.create_publisher(Float32MultiArray, 'tactile', SENSOR_QOS)
    graph.until(lambda: any('start the driver' in report.status[0].message for report in reports))
    assert capfd.readouterr().err == ''  # it may start after the node
    graph.until(lambda: len(reports) > 5)
    assert "no message on '/tactile' yet; start the driver, or correct topic and type" in capfd.readouterr().err
    numbers = itertools.count()

    def heard() -> bool:
        number = next(numbers)
        sender.publish(Float32MultiArray(data=[float(number), 0.5, 1.0 + number / 1000]))
        return bool(signals)

    graph.until(heard)
    assert (signals[0].sensor, signals[0].header.frame_id, list(signals[0].units)) == ('mine', 'tip', ['N'] * 3)
    assert np.array(signals[0].samples)[1] == 0.5
    assert capfd.readouterr().err.count('the sensor delivers samples') == 1
    reports.clear()
    sender.publish(Float32MultiArray(data=[1.0]))
    graph.until(lambda: any('1 numbers; 3 are needed' in report.status[0].message for report in reports))
    values = {value.key: value.value for value in reports[-1].status[0].values}
    assert values['refused messages'] == '1'
    assert 'unknown' in values['losses']


def test_the_measured_rate_is_logged_and_a_change_of_it_is_an_error(graph: LocalGraph, capfd) -> None:
    graph.add(Adaptor, mapping='wrench')
    reports = graph.listen(DiagnosticArray, '/diagnostics')
    sender = graph.peer.create_publisher(WrenchStamped, 'wrench', SENSOR_QOS)
    now_ns, log = 1_700_000_000 * NANOSECONDS, []

    def logs(text: str, period_ns: int) -> bool:
        nonlocal now_ns
        now_ns += period_ns
        message = WrenchStamped()
        message.header.stamp = to_stamp(now_ns)
        sender.publish(message)
        log.append(capfd.readouterr().err)
        return text in ''.join(log)

    graph.until(lambda: logs("the rate of 'signal' was measured: 100 Hz; set rate_hz", 10_000_000))
    graph.until(lambda: logs('bring 50 samples a second instead of 100', 20_000_000))
    status = reports[-1].status[0]
    assert status.level == DiagnosticStatus.ERROR
    assert status.message.endswith('start the node again to measure it')
    log.clear()
    graph.until(lambda: logs('the sensor delivers samples', 10_000_000))


def test_each_signal_of_a_mapping_is_watched_alone_and_announced_with_all_others(
    graph: LocalGraph, tmp_path, capfd
) -> None:
    mapping = tmp_path / 'two.yaml'
    mapping.write_text(
        'signals:\n' + ''.join(
            f'  {name}: {{topic: {topic}, type: std_msgs/msg/Float32MultiArray, values: [data], channels: [a, at_s], '
            "stamp: 'data[1]', rate_hz: 100}\n"
            for name, topic in (('signal', 'fast'), ('signal_static', 'slow'))
        )
    )  # fmt: skip
    graph.add(Adaptor, mapping=str(mapping))
    reports = graph.listen(DiagnosticArray, '/diagnostics')
    senders = {name: graph.peer.create_publisher(Float32MultiArray, name, SENSOR_QOS) for name in ('fast', 'slow')}
    numbers, log = itertools.count(100), []

    def logs(text: str, **values: list[float]) -> bool:
        at_s = next(numbers) / 100
        for name, data in values.items():
            senders[name].publish(Float32MultiArray(data=[*data, at_s]))
            graph.spin_once(0.0)
        log.append(capfd.readouterr().err)
        return text in ''.join(log)

    signals = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    # Neither a silent signal nor one that does not fit the mapping is announced with the other.
    graph.until(lambda: logs("no message on '/slow' yet; start the driver, or correct topic and type", fast=[1]))
    graph.until(lambda: logs("on '/slow' the message holds 3 numbers; 2 are needed", fast=[1], slow=[1, 2]))
    assert not logs('the sensor delivers samples')
    for stopped, running in (('slow', 'fast'), ('fast', 'slow')):
        graph.until(lambda: logs('the sensor delivers samples', fast=[1], slow=[1]))
        log.clear()
        graph.until(lambda: logs(f"no message on '/{stopped}'; start the driver", **{running: [1]}))  # noqa: B023
        assert reports[-1].status[0].level == DiagnosticStatus.ERROR
        assert not logs('the sensor delivers samples')
    graph.until(lambda: logs('the sensor delivers samples', fast=[1], slow=[1]))
    assert {signal.sensor for signal in signals} == {'two/signal'}  # wherever the file lies
    other = graph.peer.create_publisher(msg.TactileSignal, 'signal', SENSOR_QOS)
    graph.until(
        lambda: logs('', fast=[1], slow=[1]) and "another node publishes on '/signal'" in reports[-1].status[0].message
    )
    other.destroy()


def test_a_package_that_is_missing_is_reported_in_one_sentence(graph: LocalGraph) -> None:
    with pytest.raises(InvalidParameter, match=r'robotiq_tsf/msg/Dynamic.* cannot be imported'):
        graph.add(Adaptor, mapping='robotiq_tsf')
