# SPDX-License-Identifier: Apache-2.0
import threading
import time

import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from texture_msgs import msg

from texture_bringup.command import main
from texture_core.ros import FEATURE_QOS, to_msg
from texture_core.types import FeatureVector
from texture_estimation.nodes.classifier import Classifier
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train
from texture_features.feature_set import LabelledFeatures

pytestmark = [pytest.mark.realtime, pytest.mark.ros]
DEADLINE_S = 60.0
NAMES = ('a', 'b', 'c')


@pytest.fixture
def model(tmp_path):
    rng = np.random.default_rng(0)
    values = np.repeat([[0.0, 0, 0], [9.0, 0, 0]], 24, axis=0) + rng.normal(size=(48, 3))
    labels = np.repeat(['cork', 'felt'], 24)
    groups = np.array([f'{label}/{k // 6}' for k, label in enumerate(labels)])
    examples = LabelledFeatures(values, labels, groups, NAMES, 'kind', 0.5, 0.25)
    return train(load_recipe('default'), examples).save(tmp_path / 'model')


@pytest.fixture
def classifier(model, monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', '70')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    rclpy.init(args=['--ros-args', '-p', f'model:={model}'])
    node, executor = Classifier(), SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, name='classifier')
    thread.start()
    yield node
    executor.shutdown()
    thread.join()
    node.destroy_node()
    rclpy.shutdown()


def classify_slide(node, exploration_id):
    """Publish windows of a new texture as an extractor does, until the classifier has them all."""
    peer = rclpy.create_node('peer')
    publisher = peer.create_publisher(msg.FeatureVector, 'features', FEATURE_QOS)
    estimates = []
    subscription = peer.create_subscription(msg.TextureEstimate, 'texture', estimates.append, 10)
    executor = SingleThreadedExecutor()
    executor.add_node(peer)
    deadline = time.monotonic() + DEADLINE_S
    try:
        while not (publisher.get_subscription_count() and peer.count_publishers('texture')):
            assert time.monotonic() < deadline
            executor.spin_once(timeout_sec=0.05)
        for k, row in enumerate(np.random.default_rng(1).normal((0, 9, 0), size=(8, 3))):
            vector = FeatureVector(k * 10**8, exploration_id, 0.5, 0.1, NAMES, row, feature_set='kind')
            publisher.publish(to_msg(vector))
        publisher.publish(to_msg(FeatureVector(10**9, exploration_id, 0.0, 0.1, last=True)))
        while not (estimates and estimates[-1].final):
            assert time.monotonic() < deadline
            executor.spin_once(timeout_sec=0.05)
    finally:
        executor.shutdown()
        peer.destroy_subscription(subscription)
        peer.destroy_node()
    return estimates[-1].label


def test_a_texture_is_added_and_removed_from_the_command_line(classifier, capsys):
    assert classify_slide(classifier, 'slide-1') in ('cork', 'felt', '')
    assert main(['add', 'silk']) == 0
    printed = capsys.readouterr().out
    assert "added 'silk' from 'slide-1'; 3 textures, 1 slide added since the training; 'silk' has 8 windows" in printed
    assert main(['add', 'silk']) == 2
    assert "'slide-1' was added as 'silk' already" in capsys.readouterr().err
    assert classify_slide(classifier, 'slide-2') == 'silk'
    assert main(['add', 'silk', 'slide-9']) == 2
    assert 'Can be added: slide-1, slide-2' in capsys.readouterr().err
    assert main(['add', '--undo']) == 0
    assert classify_slide(classifier, 'slide-3') != 'silk'


def test_a_texture_is_removed_by_its_label_from_the_command_line(classifier, capsys):
    classify_slide(classifier, 'slide-4')
    assert main(['add', 'oak']) == 0
    assert classify_slide(classifier, 'slide-5') == 'oak'
    assert main(['remove', 'oka']) == 2
    assert "did you mean 'oak'?" in capsys.readouterr().err
    assert main(['remove', 'oak']) == 0
    assert "removed 1 slide of 'oak'; 2 textures, 0 slides added" in capsys.readouterr().out
    assert classify_slide(classifier, 'slide-6') != 'oak'


def test_parameters_of_a_running_node_are_set_from_the_command_line(classifier, capsys):
    for value, sentence in (
        ('modle:=x', "no parameter of classifier 'modle'; did you mean 'model'?"),
        ('model:=/nowhere', "refused parameter 'model': "),
        ('model', ':='),
    ):
        assert main(['set', 'classifier', value]) == 2
        assert sentence in capsys.readouterr().err
    assert classifier._evidence.model is not None
    assert main(['set', 'classifier', 'model:=']) == 0
    assert classifier._evidence.model is None


@pytest.mark.parametrize('arguments', [['add'], ['add', 'silk', '--undo']])
def test_what_to_add_must_be_given(arguments, capsys):
    assert main(arguments) == 2
    assert 'label of the texture' in capsys.readouterr().err
