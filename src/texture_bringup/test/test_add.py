# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from texture_msgs import msg

from texture_core.ros import FEATURE_QOS, STATE_QOS, to_msg
from texture_core.ros_testing import LocalGraph
from texture_core.types import ExplorationState, FeatureVector, Phase
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
def graph():
    with LocalGraph(70, deadline_s=DEADLINE_S) as graph:
        yield graph


@pytest.fixture
def classifier(graph, model):
    return graph.add(Classifier, model=str(model))


def classify_slide(graph, exploration_id):
    """Publish windows of a new texture as an extractor does, until the classifier has them all."""
    publisher = graph.peer.create_publisher(msg.FeatureVector, 'features', FEATURE_QOS)
    estimates = graph.listen(msg.TextureEstimate, 'texture')
    graph.until(lambda: publisher.get_subscription_count() and graph.peer.count_publishers('texture'))
    for k, row in enumerate(np.random.default_rng(1).normal((0, 9, 0), size=(8, 3))):
        vector = FeatureVector(k * 10**8, exploration_id, 0.5, 0.1, NAMES, row, feature_set='kind')
        publisher.publish(to_msg(vector))
    publisher.publish(to_msg(FeatureVector(10**9, exploration_id, 0.0, 0.1, last=True)))
    graph.until(lambda: estimates and estimates[-1].final)
    graph.peer.destroy_publisher(publisher)
    return estimates[-1].label


@pytest.mark.usefixtures('classifier')
def test_a_texture_is_added_and_removed_from_the_command_line(graph, asked, capsys):
    assert classify_slide(graph, 'slide-1') in ('cork', 'felt', '')
    assert asked(graph, 'add', 'silk') == 0
    printed = capsys.readouterr().out
    assert (
        "added 'silk', a new texture, from 'slide-1'; 3 textures, 1 slide added since the training; "
        "'silk' has 8 windows" in printed
    )
    assert asked(graph, 'add', 'silk') == 2
    assert "'slide-1' was added as 'silk' already" in capsys.readouterr().err
    assert classify_slide(graph, 'slide-2') == 'silk'
    assert asked(graph, 'add', 'silk', 'slide-9') == 2
    assert 'Can be added: slide-1, slide-2' in capsys.readouterr().err
    assert asked(graph, 'remove', 'slik') == 2
    assert "did you mean 'silk'?" in capsys.readouterr().err
    assert asked(graph, 'remove', 'silk') == 0
    assert "removed 1 slide of 'silk'; 2 textures, 0 slides added" in capsys.readouterr().out
    assert classify_slide(graph, 'slide-3') != 'silk'
    assert asked(graph, 'add', 'oak') == 0
    assert asked(graph, 'add', '--undo') == 0
    assert classify_slide(graph, 'slide-5')
    assert asked(graph, 'add', 'corc') == 0
    added = "added 'corc', a new texture (did you mean 'cork'? `texture add --undo` takes it back), from 'slide-5'"
    assert added in capsys.readouterr().out
    assert asked(graph, 'add', '--undo') == 0
    assert classify_slide(graph, 'slide-4') != 'oak'


@pytest.mark.usefixtures('classifier')
def test_the_slide_before_an_exploration_that_never_slid_is_not_added_in_its_place(graph, asked, capsys):
    classify_slide(graph, 'slide-1')
    publisher = graph.peer.create_publisher(msg.ExplorationState, 'exploration', STATE_QOS)
    publisher.publish(to_msg(ExplorationState(1, 'stopped-2', 'linear_slide', Phase.APPROACH)))
    graph.until(publisher.get_subscription_count)
    assert publisher.wait_for_all_acked()
    assert asked(graph, 'add', 'silk') == 2
    assert "'stopped-2' is still running; wait for its end" in capsys.readouterr().err
    publisher.publish(to_msg(ExplorationState(1, '', '', Phase.IDLE)))
    assert publisher.wait_for_all_acked()
    assert asked(graph, 'add', 'silk') == 2
    assert "'stopped-2' has no usable window: it ended before its slide" in capsys.readouterr().err
    assert asked(graph, 'add', 'silk', 'slide-1') == 0
    classify_slide(graph, 'stopped-3')
    publisher.publish(to_msg(ExplorationState(1, 'stopped-3', 'linear_slide', Phase.ABORTED)))
    assert publisher.wait_for_all_acked()
    assert asked(graph, 'add', 'silk') == 2
    assert "exploration 'stopped-3' was aborted" in capsys.readouterr().err


def test_parameters_of_a_running_node_are_set_from_the_command_line(graph, classifier, asked, capsys):
    for value, sentence in (
        ('modle:=x', "no parameter of classifier 'modle'; did you mean 'model'?"),
        ('model:=/nowhere', "refused parameter 'model': "),
        ('model', ':='),
    ):
        assert asked(graph, 'set', 'classifier', value) == 2
        assert sentence in capsys.readouterr().err
    assert classifier._evidence.model is not None
    assert asked(graph, 'set', 'classifier', 'model:=') == 0
    assert classifier._evidence.model is None
