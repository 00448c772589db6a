# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A bag replayed through the running nodes gives the estimates that the evaluation gets from it."""

import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from texture_core.ros import from_msg
from texture_core.ros_testing import LocalGraph, NodeProcess
from texture_core.types import TextureEstimate
from texture_estimation.model import TextureModel, load_model
from texture_evaluation.evaluate import run_model
from texture_evaluation.train import train_from_bags
from texture_recordings.dataset import SlideDataset
from texture_recordings.public_sets import import_biotac20
from texture_recordings.ros import TOPICS
from texture_recordings.slides import find_slides

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

CLASSIFIER_LATE_S = 5.0  # a loaded machine starts it so much later than the other nodes
Estimates = dict[str, list[TextureEstimate]]


def offline(model: TextureModel, bags: Path, slides: str) -> Estimates:
    cut = SlideDataset.from_bags([bags], slides).windows(model.recipe.feature_set)
    return {slide.exploration_id: run_model(model, events)[1] for slide, events in cut}


def live(model: Path, bags: Path, slides: str, rate: float, domain_id: int) -> tuple[Estimates, dict[str, str]]:
    """Return the estimates of the running nodes and the last numbers of the feature extractor's diagnosis.

    A recorder listens from the beginning, and the classifier starts as the last one.
    """
    received: defaultdict[str, list[TextureEstimate]] = defaultdict(list)
    health: dict[str, str] = {}
    wanted = {slide.exploration_id for slide in find_slides([bags], slides)}

    def on_estimate(message: object) -> None:
        estimate = from_msg(message)
        received[estimate.exploration_id].append(estimate)

    def node(package: str, name: str, **parameters: object) -> NodeProcess:
        return NodeProcess(package, name, parameters, domain_id=domain_id)

    with (
        LocalGraph(domain_id, 120.0) as graph,
        node('texture_recordings', 'record', out=str(model.with_name('recorded'))),
        node('texture_features', 'feature_extractor', recipe=str(model)),
        node('texture_recordings', 'replay', bag=str(bags), slides=slides, rate=rate, deadline_s=60.0) as replay,
    ):
        for topic, read in (('texture', on_estimate), ('diagnostics', reader_of(health))):
            kind, qos, name = TOPICS[topic]
            graph.peer.create_subscription(kind, name, read, qos)
        graph.until(lambda: graph.peer.count_publishers('signal') and graph.peer.count_subscribers('features') == 1)
        late_s = time.monotonic() + CLASSIFIER_LATE_S
        graph.until(lambda: time.monotonic() > late_s)
        with node('texture_estimation', 'classifier', model=str(model)):
            graph.until(lambda: wanted <= ended(received))
            assert replay.wait(60.0) == 0, replay.output
            counted = health.copy()
            graph.until(lambda: health != counted)  # a diagnosis after the last window
    return {name: estimates for name, estimates in received.items() if name in wanted}, health


def ended(received: Estimates) -> set[str]:
    return {name for name, estimates in received.items() if estimates[-1].final}


def reader_of(health: dict[str, str]) -> Callable[[object], None]:
    def read(message: object) -> None:
        for status in message.status:  # type: ignore[attr-defined]
            if status.name.endswith('feature_extractor'):
                health.update({pair.key: pair.value for pair in status.values})
                health['count'] = str(int(health.get('count', 0)) + 1)

    return read


def assert_equal(live_estimates: Estimates, offline_estimates: Estimates) -> None:
    assert live_estimates.keys() == offline_estimates.keys()
    for name, expected in offline_estimates.items():
        got = live_estimates[name]
        assert [(e.label, e.windows, e.final, e.stamp_ns, e.message) for e in got] == [
            (e.label, e.windows, e.final, e.stamp_ns, e.message) for e in expected
        ]
        np.testing.assert_allclose(
            [e.probabilities for e in got], [e.probabilities for e in expected], rtol=0, atol=1e-6
        )


@pytest.mark.parametrize(
    ('rate', 'slides', 'domain_id'), [pytest.param(1.0, '5', 53, marks=pytest.mark.benchmark), (5.0, '5-6', 54)]
)
def test_simulated_slides_are_evaluated_live_as_offline(
    rate: float, slides: str, domain_id: int, simulated: Path, tmp_path: Path
) -> None:
    train_from_bags('vibration-and-taxels', [simulated], '1-4', tmp_path / 'model')
    estimates, health = live(tmp_path / 'model.npz', simulated, slides, rate, domain_id)
    assert_equal(estimates, offline(load_model(tmp_path / 'model'), simulated, slides))
    assert (health['lost_samples'], health['skipped']) == ('0', '0')


@pytest.mark.benchmark
@pytest.mark.parametrize(('recipe', 'rate'), [('default', 1.0), ('vibration-and-taxels', 5.0)])
def test_recorded_slides_are_evaluated_live_as_offline(recipe: str, rate: float, tmp_path: Path, data: Path) -> None:
    materials = ['material03', 'material05', 'material12']
    import_biotac20(data / 'biotac20', tmp_path / 'bags', '1-4,40', materials)
    train_from_bags(recipe, [tmp_path / 'bags'], '1-4', tmp_path / 'model')
    estimates, health = live(tmp_path / 'model.npz', tmp_path / 'bags', '5', rate, 55)
    assert_equal(estimates, offline(load_model(tmp_path / 'model'), tmp_path / 'bags', '5'))
    assert (health['lost_samples'], health['skipped']) == ('0', '0')
    assert len(estimates) == len(materials)
