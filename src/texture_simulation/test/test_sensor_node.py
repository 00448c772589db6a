# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The generic sensor node with a device, and with a recording: real node, real topics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.lifecycle import TransitionCallbackReturn
from sensor_msgs.msg import Imu
from sensor_rig import CASES, Rig
from std_srvs.srv import Trigger
from texture_msgs import msg

from texture_core.errors import InvalidParameter
from texture_core.ros import SENSOR_QOS, STATE_QOS, to_msg, to_ns
from texture_core.ros_testing import LocalGraph
from texture_core.types import ExplorationState, Phase
from texture_drivers.nodes.sensor import SensorNode

pytestmark = [pytest.mark.realtime, pytest.mark.ros]


@pytest.fixture
def graph() -> Iterator[LocalGraph]:
    with LocalGraph(80) as graph:
        yield graph


def test_the_daq_finger_is_published_in_volts_under_its_names(graph: LocalGraph, tmp_path: Path) -> None:
    signal = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    with Rig('daq', tmp_path / 'daq'):
        graph.add(SensorNode, sensor='daq', device=str(tmp_path / 'daq'))
        graph.until(lambda: len(signal) > 20)
    assert (signal[-1].sensor, set(signal[-1].units), signal[-1].sampling_rate_hz) == ('daq', {'V'}, 2500.0)
    assert signal[-1].channels[::4] == ['pvdf_outer_1', 'strain_outer_1']
    assert np.median(np.diff(signal[-1].samples[::8])) == pytest.approx(10 / 2**15, rel=1e-3)


def test_the_inertial_unit_is_published_as_imu_too(graph: LocalGraph, tmp_path: Path) -> None:
    signals = graph.listen(msg.TactileSignal, 'signal_imu', SENSOR_QOS)
    imus = graph.listen(Imu, 'imu/data_raw', SENSOR_QOS)
    with Rig('tsf85', tmp_path / 'tsf85') as rig:
        graph.add(SensorNode, sensor='tsf85', device=str(rig.link))
        graph.until(lambda: len(imus) > 20 and len(signals) > 20)
    rows = {to_ns(signal.header.stamp): list(signal.samples[:6]) for signal in signals}
    found = {to_ns(imu.header.stamp): imu for imu in imus}
    shared = [stamp for stamp in rows if stamp in found]
    assert shared
    for stamp in shared:
        a, w = found[stamp].linear_acceleration, found[stamp].angular_velocity
        assert [a.x, a.y, a.z, w.x, w.y, w.z] == pytest.approx(rows[stamp], nan_ok=True)
    assert imus[0].header.frame_id == signals[0].header.frame_id
    assert imus[0].orientation_covariance[0] == -1.0  # no orientation


def test_a_tare_is_requested_and_the_baseline_is_published_and_subtracted(graph: LocalGraph, tmp_path: Path) -> None:
    def feed(device: Any, first: int, ticks: int) -> None:
        device.measure({'signal': np.full((ticks, 15, 1), 0.25)})

    case = replace(CASES['anyskin'], feed=feed)
    signal = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    baselines = graph.listen(msg.TactileSignal, 'signal_baseline', STATE_QOS)
    with Rig('anyskin', tmp_path / 'anyskin', case=case) as rig:
        node = graph.add(
            SensorNode,
            sensor='anyskin',
            device=str(rig.link),
            config=case.config,
            subtract_baseline=True,
            tare_s=0.2,
        )
        graph.until(lambda: signal)
        response = node._on_tare(Trigger.Request(), Trigger.Response())
        assert response.success
        graph.until(lambda: baselines)
        graph.until(lambda: signal[-1].tared)
    assert len(baselines[-1].samples) == 15
    assert baselines[-1].samples[0] == pytest.approx(0.25)
    assert np.abs(signal[-1].samples).max() == 0.0


def test_drift_while_nothing_touches_and_another_publisher_are_named_on_diagnostics(
    graph: LocalGraph, tmp_path: Path
) -> None:
    rng, drift = np.random.default_rng(0), [0]

    def feed(device: Any, first: int, ticks: int) -> None:
        counts = np.round(20.0 * rng.normal(size=(ticks, 8))).astype(np.int16)
        counts[:, 0] += drift[0]
        device.measure({'signal': counts[:, :, None]})

    case = replace(CASES['daq'], feed=feed)
    signal = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    reports = graph.listen(DiagnosticArray, '/diagnostics')
    baselines = graph.listen(msg.TactileSignal, 'signal_baseline', STATE_QOS)
    states = graph.peer.create_publisher(msg.ExplorationState, 'exploration', STATE_QOS)

    with Rig('daq', tmp_path / 'daq', case=case) as rig:
        node = graph.add(SensorNode, sensor='daq', device=str(rig.link), config=case.config, tare_s=0.2)
        graph.until(lambda: states.get_subscription_count() and signal)
        states.publish(to_msg(ExplorationState(1, 'a', 'linear_slide', Phase.DONE)))
        assert node._on_tare(Trigger.Request(), Trigger.Response()).success
        graph.until(lambda: baselines)
        drift[0] = 2000
        graph.until(lambda: reports and 'c0 has drifted' in reports[-1].status[0].message)
        graph.peer.create_publisher(msg.TactileSignal, 'signal', SENSOR_QOS)
        graph.until(lambda: "another node publishes on '/signal'" in reports[-1].status[0].message)


def test_a_tare_without_a_sensor_is_refused(graph: LocalGraph, tmp_path: Path) -> None:
    node = graph.add(SensorNode, sensor='daq', device=str(tmp_path / 'missing'))
    response = node._on_tare(Trigger.Request(), Trigger.Response())
    assert not response.success
    assert response.message == 'the sensor delivers no samples; see its message on /diagnostics'


@pytest.mark.parametrize('phase', [Phase.APPROACH, Phase.CONTACT, Phase.SLIDE, Phase.LIFT, Phase.ABORTED])
def test_a_finger_that_may_touch_something_is_not_tared_until_it_is_lifted(
    graph: LocalGraph, tmp_path: Path, phase: Phase
) -> None:
    def feed(device: Any, first: int, ticks: int) -> None:
        device.measure({'signal': np.full((ticks, 15, 1), 0.25)})

    case = replace(CASES['anyskin'], feed=feed)
    answers: list[Trigger.Response] = []
    signal = graph.listen(msg.TactileSignal, 'signal', SENSOR_QOS)
    baselines = graph.listen(msg.TactileSignal, 'signal_baseline', STATE_QOS)
    states = graph.peer.create_publisher(msg.ExplorationState, 'exploration', STATE_QOS)

    def is_tared() -> bool:
        answers.append(node._on_tare(Trigger.Request(), Trigger.Response()))
        return bool(answers[-1].success)

    with Rig('anyskin', tmp_path / 'anyskin', case=case) as rig:
        node = graph.add(SensorNode, sensor='anyskin', device=str(rig.link), config=case.config, tare_s=0.2)
        graph.until(lambda: states.get_subscription_count() and signal)
        states.publish(to_msg(ExplorationState(1, 'a', 'linear_slide', phase)))
        graph.until(lambda: not is_tared())
        assert answers[-1].message.startswith('nothing is tared: the finger may touch something')
        assert f"the phase '{phase.value}'" in answers[-1].message
        states.publish(to_msg(ExplorationState(2, '', '', Phase.IDLE)))
        graph.until(lambda: not is_tared())
        baselines.clear()
        assert not is_tared()
        assert not baselines
        states.publish(to_msg(ExplorationState(3, 'a', 'linear_slide', Phase.ABORTED, lifted=True)))
        graph.until(is_tared)


# One of each kind of topics: of a single finger, of several, and in addition to the signal.
@pytest.mark.parametrize('name', ['tsf85', 'biotac_hand', 'pvdf', 'anyskin', 'tsf85_pair'])
def test_a_life_from_configuring_to_cleaning_up(graph: LocalGraph, tmp_path: Path, name: str) -> None:
    turns = 2 if name == 'tsf85' else 1
    with Rig(name, tmp_path / name) as rig:
        node = graph.add(SensorNode, sensor=name, device=str(rig.link), config=rig.case.config, autostart=False)
        batches = graph.listen(msg.TactileSignal, rig.case.topic, SENSOR_QOS)
        reports = graph.listen(DiagnosticArray, '/diagnostics')
        graph.until(lambda: reports and reports[-1].status[0].message == 'the sensor is not active')
        for _ in range(turns):
            assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
            for _ in range(turns):
                assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
                batches.clear()
                graph.until(lambda: len(batches) > 5)
                assert node.trigger_deactivate() == TransitionCallbackReturn.SUCCESS
                rig.another().open()  # inactive, it lets go of the device
            assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
        assert node.trigger_shutdown() == TransitionCallbackReturn.SUCCESS


def test_parameters_that_the_sensor_refuses_end_the_node_with_a_sentence(graph: LocalGraph) -> None:
    for given, sentence in (({'finger': 2}, 'a TSF-85 has the fingers'), ({'config': '{im: true}'}, "mean 'imu'")):
        with pytest.raises(InvalidParameter, match=sentence):
            graph.add(SensorNode, **given)
