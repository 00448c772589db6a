# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Two arms in two namespaces, one of them with two fingers, as a user starts them: they explore at once."""

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

pytestmark = [pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from texture_msgs.msg import TactileSignal

from texture_bringup.launcher import ChildLauncher
from texture_bringup.operator import ExplorationResult, Operator
from texture_core.ros import SENSOR_QOS
from texture_core.ros_testing import LocalGraph
from texture_core.types import ExplorationRequest
from texture_evaluation.train import train_from_bags
from texture_recordings.bags import topics_in
from texture_simulation.offline import SlidePlan, write_simulated

DOMAIN = 84
DEADLINE_S = 90.0
SURFACES = {'left': 'glass', 'right': 'ridge_2mm_deep'}
SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.05)
LONG = ExplorationRequest('linear_slide', speed_m_s=0.01, force_n=1.0, distance_m=0.09)
FINGERS = 'finger0/signal finger1/signal'
STREAMS = ('left/signal', 'right/finger0/signal', 'right/finger1/signal')
# A busy machine may hold up the emulated robots for longer than real ones are allowed to be silent.
PATIENT = {
    'state_timeout_s': 2.0,
    'estimate_timeout_s': 20.0,
    'signal_timeout_s': 3.0,
}


@pytest.fixture
def arms(tmp_path: Path, two_surfaces: Path):
    (tmp_path / 'patient.yaml').write_text(yaml.safe_dump({'/**': {'ros__parameters': PATIENT}}))
    plan = SlidePlan(slides=4, speed_m_s=0.05, force_n=1.0, slide_s=1.0, fingers=2)
    bags = write_simulated(tmp_path / 'bags', plan, np.random.default_rng(0), surfaces=tuple(SURFACES.values()))
    train_from_bags('two-fingers', bags, out=tmp_path / 'pair')
    models = {'left': two_surfaces / 'model.npz', 'right': tmp_path / 'pair.npz'}
    given: dict[str, Any] = {'robot': 'emulator', 'right_sensor': 'tsf85_pair', 'right_signal_topics': FINGERS}
    given |= {'right_recipe': 'two-fingers', 'record_both': True, 'both_bag': tmp_path / 'bag'}
    for arm, surface in SURFACES.items():
        given[f'{arm}_surface'], given[f'{arm}_model'] = surface, models[arm]
        given[f'{arm}_params'] = tmp_path / 'patient.yaml'
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_LOG_DIR': str(tmp_path)}
    environment['XDG_RUNTIME_DIR'] = str(tmp_path)  # the arms share all but the namespace
    with ChildLauncher('two_arms', given, environment, tmp_path / 'nodes.log') as launcher:
        yield launcher


def at_once(do: Callable[[str], ExplorationResult]) -> dict[str, ExplorationResult]:
    """Do something with each arm at the same time."""
    with ThreadPoolExecutor() as pool:
        done: dict[str, Future[ExplorationResult]] = {arm: pool.submit(do, arm) for arm in SURFACES}
        return {arm: future.result() for arm, future in done.items()}


def reported(reports: list[DiagnosticArray], level: bytes = DiagnosticStatus.ERROR) -> dict[str, str]:
    """Return what nodes reported at that level last, by their names."""
    statuses = [status for report in reports for status in report.status]
    return {status.name: status.message for status in statuses if status.level == level}


def test_two_arms_explore_at_once_with_their_own_estimates_and_a_finger_that_drops_out_is_named(arms, tmp_path) -> None:
    def explore(arm: str) -> ExplorationResult:
        with Operator(arm, DOMAIN, arms.check) as operator:
            operator.wait_for_explorer(DEADLINE_S)
            operator.wait_for_listeners(('exploration', 'features'), 1, arms.check)
            return operator.explore(SLIDE)

    def lose_a_finger(arm: str) -> ExplorationResult:
        lost: list[str] = []

        def on_progress(state: Any, _texture: Any) -> None:
            if arm == 'right' and state.phase.value == 'slide' and not lost:
                lost.append(state.exploration_id)
                with Operator(arm, DOMAIN, arms.check) as other:
                    other.set_parameters('emulator', {'unplugged_finger': 1})

        with Operator(arm, DOMAIN, arms.check) as operator:
            operator.wait_for_explorer(DEADLINE_S)
            return operator.explore(LONG if arm == 'right' else SLIDE, on_progress)

    with LocalGraph(DOMAIN, deadline_s=DEADLINE_S) as graph:
        reports = graph.listen(DiagnosticArray, '/diagnostics')
        streams = [graph.listen(TactileSignal, name, SENSOR_QOS) for name in STREAMS]
        graph.until(lambda: all(streams))
        frames = [batches[-1].header.frame_id for batches in streams]
        assert frames == ['left/fingertip', 'right/finger0/fingertip', 'right/finger1/fingertip']
        explored = at_once(explore)
        assert {arm: result.message for arm, result in explored.items()} == dict.fromkeys(
            SURFACES, 'the motion was completed'
        ), arms.log.read_text()
        assert {arm: result.texture.label for arm, result in explored.items()} == SURFACES
        assert all(result.texture.final and result.texture.windows for result in explored.values())

        explored = at_once(lose_a_finger)
        assert (explored['left'].success, explored['left'].texture.label) == (True, SURFACES['left'])
        assert not explored['right'].success
        assert explored['right'].message.startswith("no samples on 'right/finger1/signal' for")
        reports.clear()  # what was read before the explorations: sensors waited for their devices
        graph.until(lambda: 'finger1' in reported(reports).get('/right/sensor', ''))
        graph.until(lambda: 'finger1' in reported(reports, DiagnosticStatus.WARN).get('/right/feature_extractor', ''))
        assert '/left/sensor' not in reported(reports)
    arms.stop()
    assert 'finger1/signal' in topics_in(tmp_path / 'bag', 'right')
    assert {'signal', 'exploration', 'texture'} <= set(topics_in(tmp_path / 'bag', 'left'))
