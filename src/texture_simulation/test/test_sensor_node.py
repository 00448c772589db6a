# SPDX-License-Identifier: Apache-2.0
"""The generic sensor node with a device, and with a recording: real node, real topics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, KeyValue
from sensor_rig import CASES, Rig, biotac
from std_srvs.srv import Trigger
from texture_msgs import msg

from texture_core.ros import SENSOR_QOS, STATE_QOS, to_msg
from texture_core.ros_testing import LocalGraph
from texture_core.types import ExplorationState, Phase
from texture_drivers import health as stream_watch
from texture_drivers.nodes.sensor import SensorNode
from texture_simulation.devices.fingers import EmulatedBioTac

pytestmark = [pytest.mark.realtime, pytest.mark.ros]


@pytest.fixture
def graph() -> Iterator[LocalGraph]:
    with LocalGraph(80) as graph:
        yield graph


def test_a_finger_of_a_biotac_board_is_published_and_replugging_survived(graph: LocalGraph, tmp_path: Path) -> None:
    link = tmp_path / 'biotac'
    fast, slow = (graph.listen(msg.TactileSignal, topic, SENSOR_QOS) for topic in ('signal', 'signal_static'))
    reports = graph.listen(DiagnosticArray, '/diagnostics')
    device = EmulatedBioTac(link, np.random.default_rng(0), ('BT-0', 'BT-1'))
    with Rig('biotac', link, case=biotac(fingers=2), device=device) as rig:
        graph.add(SensorNode, sensor='biotac', device=str(link), finger=1, frame_id='tip')
        graph.until(lambda: len(fast) > 20 and len(slow) > 20)
        assert (fast[-1].sensor, fast[-1].sampling_rate_hz, fast[-1].header.frame_id) == ('biotac/pac', 2200.0, 'tip')
        assert set(np.diff(fast[-1].samples) % 4096) == {2.0}
        assert (slow[-1].channels[:4], len(slow[-1].samples) % 22) == (['tdc', 'tac', 'pdc', 'electrode1'], 0)
        before = fast[-1].first_sample
        rig.run_locked(device.unplug)
        rig.run_locked(device.plug)
        fast.clear()
        graph.until(lambda: fast)
        graph.until(lambda: reports and KeyValue(key='reopened', value='1') in reports[-1].status[0].values)
        assert fast[-1].first_sample > before


def test_the_daq_finger_is_published_in_volts_under_its_names(graph: LocalGraph, tmp_path: Path) -> None:
    signal = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    with Rig('daq', tmp_path / 'daq'):
        graph.add(SensorNode, sensor='daq', device=str(tmp_path / 'daq'))
        graph.until(lambda: len(signal) > 20)
    assert (signal[-1].sensor, set(signal[-1].units), signal[-1].sampling_rate_hz) == ('daq', {'V'}, 2500.0)
    assert signal[-1].channels[::4] == ['pvdf_outer_1', 'strain_outer_1']
    assert np.median(np.diff(signal[-1].samples[::8])) == pytest.approx(10 / 2**15, rel=1e-3)


def test_a_tare_is_asked_for_and_the_baseline_is_published_and_subtracted(graph: LocalGraph, tmp_path: Path) -> None:
    def feed(device: Any, first: int, ticks: int) -> None:
        device.sample(np.full((4 * ticks, 1, 9, 6), 0.25))

    case = replace(CASES['papillarray'], feed=feed)
    signal = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    baselines = graph.listen(msg.TactileSignal, 'signal_baseline', STATE_QOS)
    with Rig('papillarray', tmp_path / 'papillarray', case=case) as rig:
        node = graph.add(
            SensorNode,
            sensor='papillarray',
            device=str(rig.link),
            config=case.config,
            subtract_baseline=True,
            tare_s=0.2,
        )
        graph.until(lambda: signal)
        response = node._on_tare(Trigger.Request(), Trigger.Response())
        assert response.success
        graph.until(lambda: baselines)
        graph.until(lambda: signal[-1].sensor == 'papillarray/pillars (tared)')
        assert rig.device.biases == 1
    assert len(baselines[-1].samples) == 54
    assert np.abs(baselines[-1].samples).max() == 0.0  # the hub has set its own bias first
    assert np.abs(signal[-1].samples).max() == 0.0


def test_drift_saturation_and_a_dead_channel_are_named_on_diagnostics(
    graph: LocalGraph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One channel stands at the end of its range, one never changes, and one leaves its level while nothing touches."""
    rng, drift = np.random.default_rng(0), [0]

    def feed(device: Any, first: int, ticks: int) -> None:
        counts = np.round(20.0 * rng.normal(size=(ticks, 8))).astype(np.int16)
        counts[:, 0] += drift[0]
        counts[:, 3], counts[:, 7] = 2**15 - 1, 500
        device.sample(counts)

    monkeypatch.setattr(stream_watch, 'DEAD_S', 2.0)
    case = replace(CASES['daq'], feed=feed)
    signal = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    reports = graph.listen(DiagnosticArray, '/diagnostics')
    baselines = graph.listen(msg.TactileSignal, 'signal_baseline', STATE_QOS)
    states = graph.peer.create_publisher(msg.ExplorationState, 'exploration', STATE_QOS)

    def reported(*sentences: str) -> None:
        graph.until(lambda: all(one in (reports[-1].status[0].message if reports else '') for one in sentences))

    with Rig('daq', tmp_path / 'daq', case=case) as rig:
        node = graph.add(SensorNode, sensor='daq', device=str(rig.link), config=case.config, tare_s=0.2)
        graph.until(lambda: states.get_subscription_count() and signal)
        states.publish(to_msg(ExplorationState(1, 'a', 'linear_slide', Phase.DONE)))
        reported('c3 is saturated', 'c7', 'is dead: it does not change')
        assert node._on_tare(Trigger.Request(), Trigger.Response()).success
        graph.until(lambda: baselines)
        drift[0] = 2000
        reported('c0 has drifted off its baseline; tare again without load')


def test_a_tare_without_a_sensor_is_refused(graph: LocalGraph, tmp_path: Path) -> None:
    node = graph.add(SensorNode, sensor='daq', device=str(tmp_path / 'missing'))
    response = node._on_tare(Trigger.Request(), Trigger.Response())
    assert not response.success
    assert response.message == 'the sensor delivers no samples; see its message on /diagnostics'


def test_a_recording_is_played_as_a_sensor(graph: LocalGraph, tmp_path: Path) -> None:
    np.savez(tmp_path / 'slide.npz', samples=np.arange(500.0)[:, None], rate_hz=1000.0, channels=['film'])
    signal = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    graph.add(SensorNode, sensor='file', device=str(tmp_path / 'slide.npz'), config='{loop: true, unit: Pa}')
    graph.until(lambda: len(signal) > 60)
    assert (signal[-1].sensor, signal[-1].units, signal[-1].channels) == ('file/slide', ['Pa'], ['film'])
    assert all(message.samples[0] == message.first_sample % 500 for message in signal)
