# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The nodes that answer feature vectors: what they have in common, and what each adds."""

import dataclasses

import numpy as np
import pytest
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from texture_msgs import msg, srv

from texture_core.errors import ModelMismatch
from texture_core.ros import ESTIMATE_QOS, FEATURE_QOS, from_msg, to_msg
from texture_core.ros_testing import LocalGraph
from texture_core.types import Rejection
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.model import load_model
from texture_estimation.nodes.classifier import IN_PART, Classifier
from texture_estimation.nodes.roughness_estimator import RoughnessEstimator
from texture_estimation.roughness import (
    Grades,
    RoughnessAccumulator,
    RoughnessRecipe,
    load_roughness_model,
    train_grades,
)
from texture_features.feature_set import LabelledFeatures

pytestmark = pytest.mark.ros
GRADE_NAMES = ('signal/signal_energy/f', 'signal/peak_to_median_power/f')
GRADE_RECIPE = {'inputs': {'signal': {'features': ['log_variance', 'peak_to_median_power']}}}
NODES = {
    'classifier': (Classifier, 'model', 'cloth_slide'),
    'roughness_estimator': (RoughnessEstimator, 'roughness_model', 'grade_2'),
}


class NodeUnderTest:
    """The node under test, a peer that plays the extractor, and the estimates that it hears."""

    def __init__(self, graph, kind, model=''):
        self.node = graph.add(kind, model=str(model))
        self._graph, peer = graph, graph.peer
        message, topic = kind.estimate
        self._received = graph.listen(message, topic, ESTIMATE_QOS)
        self.features = peer.create_publisher(msg.FeatureVector, 'features', FEATURE_QOS)
        graph.until(lambda: self.features.get_subscription_count() and peer.count_publishers(topic) == 1)

    def ask(self, vectors, first=0):
        """Publish vectors, with their numbers from `first` on, and return the estimates up to the final one."""
        self._received.clear()
        for number, vector in enumerate(vectors, first):
            self.features.publish(to_msg(dataclasses.replace(vector, sequence=number)))
        self._graph.until(lambda: self._received and self._received[-1].final)
        return [from_msg(message) for message in self._received]

    def report(self):
        return self.node._report()

    def set_model(self, path):
        [result] = self.node.set_parameters([Parameter('model', value=str(path))])
        return result

    def call(self, kind, name, **fields):
        client = self._graph.peer.create_client(kind, name)
        self._graph.until(client.service_is_ready)
        future = client.call_async(kind.Request(**fields))
        self._graph.until(future.done)
        return future.result()


@pytest.fixture
def graph():
    with LocalGraph(72) as graph:
        yield graph


@pytest.fixture
def cloth_slide(examples):
    return examples.vectors('felt/0')


@pytest.fixture(scope='module')
def roughness_model():
    """Return a model of five textures whose first feature is their grade."""
    rng = np.random.default_rng(0)
    grades = {f't{grade}': float(grade) for grade in range(1, 6)}
    labels = np.repeat(list(grades), 10)
    values = np.stack([[grades[label], 0.5] for label in labels]) + 0.1 * rng.normal(size=(50, 2))
    examples = LabelledFeatures(values, labels, labels, GRADE_NAMES, 'abcd1234 signal=1000Hz*1', 0.5, 0.5)
    return train_grades(RoughnessRecipe.from_mapping(GRADE_RECIPE, 'test'), examples, Grades(grades), 'felt')


@pytest.fixture
def grade_2(roughness_model, slide_of):
    return slide_of(roughness_model, np.array([[2.0, 0.5]] * 2), force_n=2.0)


@pytest.fixture(params=NODES)
def case(request, tmp_path):
    """Return a node, the path of a model for it, and the vectors of a slide over a trained surface."""
    kind, model, vectors = NODES[request.param]
    return kind, request.getfixturevalue(model).save(tmp_path / 'm'), request.getfixturevalue(vectors)


def recognised(estimate):
    return getattr(estimate, 'label', '') == 'felt' or getattr(estimate, 'valid', False)


def test_a_model_may_be_given_later_and_a_bad_one_changes_nothing(graph, case, tmp_path):
    kind, path, vectors = case
    node = NodeUnderTest(graph, kind)
    assert 'no model is loaded' in node.ask(vectors)[-1].message
    assert node.report()[0] == 'WARN'
    refused = node.set_model(tmp_path / 'none.npz')
    assert not refused.successful
    assert 'there is no model' in refused.reason
    assert node.set_model(path).successful
    assert recognised(node.ask(vectors)[-1])
    assert not node.set_model(tmp_path / 'none.npz').successful
    assert recognised(node.ask(vectors)[-1])
    assert node.report()[0] == 'OK'


def test_who_joins_late_still_gets_the_final_estimate(graph, case):
    kind, path, vectors = case
    node = NodeUnderTest(graph, kind, path)
    final = node.ask(vectors)[-1]
    late = graph.listen(*kind.estimate, ESTIMATE_QOS)
    graph.until(lambda: late and late[-1].final)
    assert from_msg(late[-1]) == final


def test_broken_messages_are_counted_and_survived(graph, case):
    kind, path, vectors = case
    node = NodeUnderTest(graph, kind, path)
    node.features.publish(msg.FeatureVector(names=['a'], values=[1.0, 2.0]))
    assert recognised(node.ask(vectors)[-1])
    assert node.report()[2]['invalid_messages'] == 1


def test_an_estimate_without_all_vectors_of_its_exploration_is_rejected_and_the_next_one_is_whole(graph, case):
    kind, path, vectors = case
    node = NodeUnderTest(graph, kind, path)
    whole = node.ask(vectors)
    assert node.report()[2]['lost_vectors'] == 0
    part = node.ask(vectors[1:], first=1)  # the node was found after the first vector
    assert all(estimate.message.startswith(IN_PART) for estimate in part)
    if kind is Classifier:
        assert (whole[-1].accepted, part[-1].label) == (True, whole[-1].label)
        assert part[-1].rejection is Rejection.TOO_LITTLE_EVIDENCE
        assert not any(one.accepted or one.decided or one.prediction_set for one in part)
    else:
        assert whole[-1].valid
        assert not any(estimate.valid for estimate in part)
    assert (node.report()[0], node.report()[2]['lost_vectors']) == ('WARN', 1)
    node.features.publish(to_msg(vectors[0]))
    assert node.ask(vectors[1:])[-1].message.startswith(IN_PART)  # another extractor, amidst the exploration
    assert [estimate.message for estimate in node.ask(vectors)] == [estimate.message for estimate in whole]
    assert node.report()[2]['lost_vectors'] == 1


def test_a_wrong_model_at_the_start_is_an_error(graph, case, tmp_path):
    with pytest.raises(ModelMismatch, match='there is no model'):
        NodeUnderTest(graph, case[0], tmp_path / 'none.npz')


def test_a_node_publishes_what_the_same_vectors_give_offline(graph, case):
    kind, path, vectors = case
    received = NodeUnderTest(graph, kind, path).ask(vectors)
    evidence = (
        EvidenceAccumulator(load_model(path))
        if kind is Classifier
        else RoughnessAccumulator(load_roughness_model(path))
    )
    for came, expected in zip(received, [evidence.update(vector) for vector in vectors], strict=True):
        assert (came.windows, came.final, came.message) == (expected.windows, expected.final, expected.message)
        of = ('probabilities', 'confidence') if kind is Classifier else ('grade', 'grade_std')
        for name in of:
            np.testing.assert_allclose(getattr(came, name), getattr(expected, name), rtol=1e-6)
    assert recognised(received[-1])
    assert received[-1].processing_s > 0.0


def test_a_texture_is_learnt_from_one_exploration_kept_and_undone(graph, model, cloth_slide, tmp_path):
    path = model.save(tmp_path / 'm')
    node = NodeUnderTest(graph, Classifier, path)
    moved = [
        dataclasses.replace(v, values=v.values + (0.0 if v.last else 9.0), exploration_id='e7') for v in cloth_slide
    ]
    assert node.ask(moved)[-1].label != 'silk'
    answer = node.call(srv.AddTexture, 'classifier/add_texture', label='silk')
    assert (answer.error_code, answer.examples) == (answer.ERROR_NONE, len(cloth_slide) - 1)
    assert '5 textures, 1 slide added' in answer.message
    assert node.ask(moved)[-1].label == 'silk'
    assert node.ask(cloth_slide)[-1].label == 'felt'
    assert load_model(path).labels[-1] == 'silk'
    assert node.set_model(path).successful  # as after a restart
    assert node.ask(moved)[-1].label == 'silk'
    assert node.call(Trigger, 'classifier/remove_last_added').success
    assert node.ask(moved)[-1].label != 'silk'
    assert not node.call(Trigger, 'classifier/remove_last_added').success


def test_a_texture_is_removed_by_its_label_and_stays_removed_after_a_restart(graph, model, cloth_slide, tmp_path):
    path = model.save(tmp_path / 'm')
    node = NodeUnderTest(graph, Classifier, path)
    node.ask(cloth_slide)
    for label in ('silk', 'felt'):
        node.ask([dataclasses.replace(v, exploration_id=label) for v in cloth_slide])
        assert (
            node.call(srv.AddTexture, 'classifier/add_texture', label=label).error_code
            == srv.AddTexture.Response.ERROR_NONE
        )
    answer = node.call(srv.RemoveTexture, 'classifier/remove_texture', label='silk')
    assert (answer.error_code, answer.slides) == (answer.ERROR_NONE, 1)
    assert "removed 1 slide of 'silk'; 4 textures, 1 slide added" in answer.message
    assert load_model(path).labels == model.labels
    answer = node.call(srv.RemoveTexture, 'classifier/remove_texture', label='felt')
    assert 'stays as it was trained; 4 textures, 0 slides added' in answer.message
    refused = node.call(srv.RemoveTexture, 'classifier/remove_texture', label='felt')
    assert refused.error_code == refused.ERROR_NOT_ADDED
    assert 'no added slides' in refused.message


def test_what_cannot_be_added_is_answered_with_a_sentence(graph, model, tmp_path):
    node = NodeUnderTest(graph, Classifier)
    answer = node.call(srv.AddTexture, 'classifier/add_texture', label='silk')
    assert answer.error_code == answer.ERROR_NO_MODEL
    assert 'no model is loaded' in answer.message
    node.set_model(model.save(tmp_path / 'm'))
    answer = node.call(srv.AddTexture, 'classifier/add_texture', label='silk', exploration_id='e1')
    assert answer.error_code == answer.ERROR_NO_SLIDE
    assert 'explore first' in answer.message
    node.set_model(dataclasses.replace(model, examples=None).save(tmp_path / 'old'))
    assert 'train it again' in node.call(Trigger, 'classifier/remove_last_added').message


def test_two_classifiers_in_one_namespace_are_named(graph):
    first, _second = (graph.add(Classifier) for _ in range(2))
    graph.until(lambda: first.count_publishers('texture') == 2)
    level, sentence, _ = first._report()
    assert level == 'WARN'
    assert sentence == "2 nodes publish on '/texture'; end all but one, or give each a namespace"
