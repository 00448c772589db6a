import dataclasses
import time

import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from texture_msgs import msg, srv

from texture_core.errors import ModelMismatch
from texture_core.features import FeatureVector
from texture_core.ros.conversions import from_msg, to_msg
from texture_core.ros.qos import ESTIMATE_QOS, FEATURE_QOS
from texture_estimation.evidence import Evidence
from texture_estimation.model import load_model
from texture_estimation.nodes.classifier import Classifier

pytestmark = pytest.mark.ros
DEADLINE_S = 20.0


class Bench:
    """The node under test, and a node that plays the extractor and hears the estimates."""

    def __init__(self):
        self.node = Classifier()
        self.peer = rclpy.create_node('peer')
        self.executor = SingleThreadedExecutor()
        for node in (self.node, self.peer):
            self.executor.add_node(node)
        self.estimates = []
        self.features = self.peer.create_publisher(msg.FeatureVector, 'features', FEATURE_QOS)
        self.peer.create_subscription(
            msg.TextureEstimate, 'texture', lambda m: self.estimates.append(from_msg(m)), ESTIMATE_QOS
        )
        self.spin_until(lambda: self.features.get_subscription_count() and self.peer.count_publishers('texture') == 1)

    def spin_until(self, condition):
        deadline = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < deadline, 'the condition did not come true in time'
            self.executor.spin_once(timeout_sec=0.05)

    def ask(self, vectors):
        """Publish vectors and return the estimates up to the final one."""
        self.estimates.clear()
        for vector in vectors:
            self.features.publish(to_msg(vector))
        self.spin_until(lambda: self.estimates and self.estimates[-1].final)
        return list(self.estimates)

    def set_model(self, path):
        [result] = self.node.set_parameters([Parameter('model', value=str(path))])
        return result

    def call(self, kind, name, **fields):
        client = self.peer.create_client(kind, name)
        self.spin_until(client.service_is_ready)
        future = client.call_async(kind.Request(**fields))
        self.spin_until(future.done)
        return future.result()

    def close(self):
        self.executor.shutdown()
        for node in (self.node, self.peer):
            node.destroy_node()


@pytest.fixture
def ros(monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', '41')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    started = []

    def start(*parameters):
        arguments = [part for parameter in parameters for part in ('-p', parameter)]
        rclpy.init(args=['--ros-args', *arguments] if arguments else None)
        started.append(None)
        started[-1] = Bench()
        return started[-1]

    yield start
    for bench in started:
        if bench:
            bench.close()
        rclpy.shutdown()


@pytest.fixture
def vectors(examples):
    rows = np.flatnonzero(examples.groups == 'felt/0')
    windows = [
        FeatureVector(
            number * 100_000_000, 'e1', 0.5, 0.1, examples.names, examples.values[row], feature_set=examples.feature_set
        )
        for number, row in enumerate(rows)
    ]
    return [*windows, FeatureVector(10**9, 'e1', 0.0, 0.1, last=True)]


def test_the_node_says_what_the_same_vectors_give_offline(ros, model, vectors, tmp_path):
    heard = ros(f'model:={model.save(tmp_path / "m")}').ask(vectors)
    evidence = Evidence(model)
    for came, expected in zip(heard, [evidence.update(vector) for vector in vectors], strict=True):
        assert (came.label, came.windows, came.final) == (expected.label, expected.windows, expected.final)
        np.testing.assert_allclose(came.probabilities, expected.probabilities)
    assert heard[-1].label == 'felt'
    assert heard[-1].processing_s > 0.0


def test_a_model_may_be_given_later_and_a_bad_one_changes_nothing(ros, model, vectors, tmp_path):
    bench = ros()
    assert 'no model is loaded' in bench.ask(vectors)[-1].message
    refused = bench.set_model(tmp_path / 'none.skops')
    assert not refused.successful
    assert 'cannot be read' in refused.reason
    assert bench.set_model(model.save(tmp_path / 'm')).successful
    assert bench.ask(vectors)[-1].label == 'felt'
    assert not bench.set_model(tmp_path / 'none.skops').successful
    assert bench.ask(vectors)[-1].label == 'felt'


def test_broken_messages_are_counted_and_survived(ros, model, vectors, tmp_path):
    bench = ros(f'model:={model.save(tmp_path / "m")}')
    bench.features.publish(msg.FeatureVector(names=['a'], values=[1.0, 2.0]))
    assert bench.ask(vectors)[-1].label == 'felt'
    assert bench.node._report()[2]['broken_messages'] == 1


def test_a_wrong_model_at_the_start_is_an_error(ros, tmp_path):
    with pytest.raises(ModelMismatch, match='cannot be read'):
        ros(f'model:={tmp_path / "none.skops"}')


def test_a_texture_is_learnt_from_one_exploration_kept_and_undone(ros, model, vectors, tmp_path):
    path = model.save(tmp_path / 'm')
    bench = ros(f'model:={path}')
    moved = [dataclasses.replace(v, values=v.values + (0.0 if v.last else 9.0), exploration_id='e7') for v in vectors]
    assert bench.ask(moved)[-1].label != 'silk'
    answer = bench.call(srv.LearnTexture, 'learn', label='silk')
    assert (answer.success, answer.examples) == (True, len(vectors) - 1)
    assert '5 textures known' in answer.message
    assert bench.ask(moved)[-1].label == 'silk'
    assert bench.ask(vectors)[-1].label == 'felt'
    assert load_model(path).labels[-1] == 'silk'
    assert bench.set_model(path).successful  # as after a restart
    assert bench.ask(moved)[-1].label == 'silk'
    assert bench.call(Trigger, 'undo_learning').success
    assert bench.ask(moved)[-1].label != 'silk'
    assert not bench.call(Trigger, 'undo_learning').success


def test_what_cannot_be_learnt_is_answered_with_a_sentence(ros, model, tmp_path):
    bench = ros()
    assert 'no model is loaded' in bench.call(srv.LearnTexture, 'learn', label='silk').message
    bench.set_model(model.save(tmp_path / 'm'))
    answer = bench.call(srv.LearnTexture, 'learn', label='silk', exploration_id='e1')
    assert not answer.success
    assert 'explore first' in answer.message
    bench.set_model(dataclasses.replace(model, examples=None).save(tmp_path / 'old'))
    assert 'train it again' in bench.call(Trigger, 'undo_learning').message
