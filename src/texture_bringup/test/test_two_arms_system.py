# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Two arms in two namespaces, one of them with two fingers, as a user starts them: they explore at once."""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from texture_msgs.msg import TactileSignal

from texture_bringup.operator import ExplorationResult, Operator
from texture_core.ros import SENSOR_QOS
from texture_core.ros_testing import LocalGraph
from texture_core.types import ExplorationRequest
from texture_evaluation.train import train_from_bags
from texture_recordings.bags import topics_in
from texture_simulation.offline import SlidePlan, write_simulated

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

DOMAIN = 84
DEADLINE_S = 90.0
SURFACES = {'left': 'glass', 'right': 'ridge_2mm_deep'}
SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.05)
LONG = ExplorationRequest('linear_slide', speed_m_s=0.01, force_n=1.0, distance_m=0.09)
FINGERS = 'finger0/signal finger1/signal'
STREAMS = ('left/signal', 'right/finger0/signal', 'right/finger1/signal')


@pytest.fixture
def arms(launched, tmp_path: Path, two_surfaces: Path, monkeypatch):
    monkeypatch.setenv('XDG_RUNTIME_DIR', str(tmp_path))  # the arms share all but the namespace
    plan = SlidePlan(slides=4, speed_m_s=0.05, force_n=1.0, slide_s=1.0, fingers=2)
    bags = write_simulated(tmp_path / 'bags', plan, np.random.default_rng(0), surfaces=tuple(SURFACES.values()))
    train_from_bags('two-fingers', bags, out=tmp_path / 'pair')
    given: dict[str, Any] = {'robot': 'emulator', 'right_sensor': 'tsf85_pair', 'right_signal_topics': FINGERS}
    given |= {'right_recipe': 'two-fingers', 'record_both': True, 'both_bag': tmp_path / 'bag'}
    given |= {'left_model': two_surfaces / 'model.npz', 'right_model': tmp_path / 'pair.npz'}
    given |= {f'{arm}_surface': surface for arm, surface in SURFACES.items()}
    with launched('two_arms', DOMAIN, tmp_path, {'estimate_timeout_s': 20.0}, **given) as launcher:
        yield launcher


def at_once(operators: Mapping[str, Operator], explore: Callable[..., ExplorationResult]) -> dict[str, Any]:
    """Explore with each arm at the same time."""
    with ThreadPoolExecutor() as pool:
        done = {arm: pool.submit(explore, arm, operator) for arm, operator in operators.items()}
        return {arm: future.result() for arm, future in done.items()}


def reported(reports: list[DiagnosticArray], level: bytes = DiagnosticStatus.ERROR) -> dict[str, str]:
    """Return what nodes reported at that level last, by their names."""
    statuses = [status for report in reports for status in report.status]
    return {status.name: status.message for status in statuses if status.level == level}


def test_two_arms_explore_at_once_with_their_own_estimates_and_a_finger_that_drops_out_is_named(arms, tmp_path) -> None:
    def lose_a_finger(arm: str, operator: Operator) -> ExplorationResult:
        lost: list[str] = []

        def on_progress(state: Any, _texture: Any) -> None:
            if arm == 'right' and state.phase.value == 'slide' and not lost:
                lost.append(state.exploration_id)
                with Operator(arm, guard=arms.check) as other:
                    other.set_parameters('emulator', {'unplugged_finger': 1})

        return operator.explore(LONG if arm == 'right' else SLIDE, on_progress)

    with LocalGraph(DOMAIN, deadline_s=DEADLINE_S) as graph:
        reports = graph.listen(DiagnosticArray, '/diagnostics')
        streams = [graph.listen(TactileSignal, name, SENSOR_QOS) for name in STREAMS]
        graph.until(lambda: all(streams))
        frames = [batches[-1].header.frame_id for batches in streams]
        assert frames == ['left/fingertip', 'right/finger0/fingertip', 'right/finger1/fingertip']
        operators = {arm: arms.operator(arm, senses=False) for arm in SURFACES}
        explored = at_once(operators, lambda _arm, operator: operator.explore(SLIDE))
        assert {arm: result.message for arm, result in explored.items()} == dict.fromkeys(
            SURFACES, 'the motion was completed'
        ), arms.log.read_text()
        assert {arm: result.texture.label for arm, result in explored.items()} == SURFACES
        assert all(result.texture.final and result.texture.windows for result in explored.values())

        explored = at_once(operators, lose_a_finger)
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
