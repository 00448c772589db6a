# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The client of the examples knows the messages alone: every end of an exploration gives it another next step."""

import dataclasses
import threading

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from explore_client import Next, TextureClient, next_step, probabilities
from rclpy.parameter import Parameter
from texture_msgs import msg
from texture_msgs.msg import ExplorationResult, ExplorationState

from texture_core.ros import FEATURE_QOS, WaitingExecutor, to_msg
from texture_core.ros_testing import LocalGraph
from texture_core.types import FeatureVector
from texture_estimation.acceptance import NEVER, Acceptance, Limits
from texture_estimation.nodes.classifier import Classifier
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train
from texture_exploration.nodes.explorer import ExplorerNode
from texture_features.feature_set import LabelledFeatures

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

DEADLINE_S = 60.0
QUICK = {'motion': 'linear_slide', 'speed_m_s': 0.1, 'distance_m': 0.02}
SLOW = {'motion': 'linear_slide', 'speed_m_s': 0.01, 'distance_m': 0.1}
STILL = {'start_height_m': 0.002, 'state_timeout_s': 1.0, 'watch_signal': False}
NAMES = ('signal/f0', 'signal/f1')
R, SLIDE = ExplorationResult, ExplorationState.PHASE_SLIDE


def explore(graph, client, meanwhile=lambda: None, **request):
    """Return the result of an exploration and the status of its goal; `meanwhile` is called in its slide."""
    client.start(**request)
    graph.until(lambda: client.is_complete() or (client.feedback and client.feedback.state.phase == SLIDE))
    if not client.is_complete():
        meanwhile()
    graph.until(client.is_complete)
    return client.result(), client._ending.result().status


class World:
    """An explorer on a simulated arm, in its own thread."""

    def __init__(self, **parameters):
        self.explorer = ExplorerNode(
            parameter_overrides=[Parameter(name, value=value) for name, value in {**STILL, **parameters}.items()]
        )
        self.arm = self.explorer._explorer.arm
        self._executor = WaitingExecutor()
        self._executor.add_node(self.explorer)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def shove(self):
        """Press the finger for a moment."""
        self.arm.push(20.0)
        threading.Timer(0.3, self.arm.push, [0.0]).start()

    def _spin(self):
        while not self._over.is_set():
            self._executor.spin_once(timeout_sec=0.05)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.explorer.shutdown()
        self._over.set()
        self._thread.join()
        self._executor.shutdown()
        self.explorer.destroy_node()


@pytest.fixture
def graph():
    with LocalGraph(74, deadline_s=DEADLINE_S) as graph:
        yield graph


@pytest.fixture
def client(graph):
    client = TextureClient()
    yield client
    client.destroy_node()


def test_the_client_tells_every_end_of_an_exploration_by_its_code(graph, client):
    with World(force_limit_n=8.0) as world:
        aborted = GoalStatus.STATUS_ABORTED
        workspace = {'motion': 'linear_slide', 'use_start': True, 'start_x_m': 0.5}
        cases = {
            R.ERROR_UNKNOWN_MOTION: ({'motion': 'linear_slid'}, None, aborted, Next.CORRECT_REQUEST),
            R.ERROR_INVALID_REQUEST: ({**QUICK, 'force_n': 50.0}, None, aborted, Next.CORRECT_REQUEST),
            R.ERROR_UNUSED_FIELD: ({**QUICK, 'turns': 2.0}, None, aborted, Next.CORRECT_REQUEST),
            R.ERROR_OUTSIDE_WORKSPACE: (workspace, None, aborted, Next.CORRECT_REQUEST),
            R.ERROR_STOPPED: (SLOW, client.stop, aborted, Next.EXPLORE_AGAIN),
            R.ERROR_CANCELLED: (SLOW, client.cancel, GoalStatus.STATUS_CANCELED, Next.EXPLORE_AGAIN),
            R.ERROR_TIMEOUT: ({**SLOW, 'timeout': Duration(sec=2)}, None, aborted, Next.EXPLORE_AGAIN),
            R.ERROR_ARM_FAULT: (SLOW, lambda: world.arm.fail('stop'), aborted, Next.CALL_A_PERSON),
            R.ERROR_NONE: (QUICK, None, GoalStatus.STATUS_SUCCEEDED, Next.SLIDE_LONGER),
            R.ERROR_FORCE_LIMIT: (SLOW, world.shove, aborted, Next.EXPLORE_AGAIN),
        }
        for code, (request, meanwhile, status, step) in cases.items():
            result, ended = explore(graph, client, meanwhile or (lambda: None), **request)
            assert (result.error_code, ended, next_step(result)) == (code, status, step), result.message
        busy = []

        def ask_too():
            other = TextureClient()
            busy.append(explore(graph, other, **QUICK)[0])
            other.destroy_node()
            client.stop()

        explore(graph, client, ask_too, **SLOW)
        assert (busy[0].error_code, next_step(busy[0])) == (R.ERROR_BUSY, Next.ASK_LATER)
        world.explorer.trigger_deactivate()
        result, _ = explore(graph, client, **QUICK)
        assert (result.error_code, next_step(result)) == (R.ERROR_NOT_ACTIVE, Next.ASK_LATER)


@pytest.mark.parametrize(
    ('parameters', 'code'),
    [
        ({'stiffness_n_m': 0.0, 'approach_travel_m': 0.005}, R.ERROR_NO_SURFACE),
        ({'watch_signal': True}, R.ERROR_NO_SIGNAL),
    ],
    ids=['no surface', 'no signal'],
)
def test_the_client_tells_a_missing_surface_or_sensor_by_its_code(graph, client, parameters, code):
    with World(**parameters):
        result, _ = explore(graph, client, **QUICK)
        assert (result.error_code, next_step(result)) == (code, Next.EXPLORE_AGAIN), result.message


@pytest.fixture(scope='module')
def model():
    rng = np.random.default_rng(0)
    values = np.repeat([[0.0, 0.0], [4.0, 0.0]], 96, axis=0) + rng.normal(size=(192, 2))
    labels = np.repeat(['cork', 'felt'], 96)
    groups = np.array([f'{label}/{k // 4}' for k, label in enumerate(labels)])
    return train(load_recipe('default'), LabelledFeatures(values, labels, groups, NAMES, 'kind', 0.5, 0.25))


# The centre of the windows, their number, other values of theirs, and the next step of the client.
SLIDES = {
    'a trained surface': ((4.0, 0.0), 8, {}, Next.USE_LABEL),
    'a new surface': ((60.0, 60.0), 8, {}, Next.TRAIN_IT),
    'another motion': ((4.0, 0.0), 8, {'motion': 'circular', 'speed_m_s': 9.0}, Next.SLIDE_AS_TRAINED),
    'no window': ((4.0, 0.0), 0, {}, Next.SLIDE_LONGER),
    'features of another recipe': ((4.0, 0.0), 8, {'feature_set': 'other'}, Next.LOAD_A_MODEL),
    'a doubtful surface': ((4.0, 0.0), 8, {}, Next.SLIDE_ELSEWHERE),
    'a surface of few slides': ((4.0, 0.0), 8, {}, Next.TRAIN_MORE),
}


def with_acceptance(model, **changes):
    return dataclasses.replace(model, acceptance=dataclasses.replace(model.acceptance, **changes))


def test_the_client_tells_every_rejection_by_its_code(graph, client, model, tmp_path):
    domain = dataclasses.replace(model.acceptance.domain, speed_m_s=(0.05, 0.05))
    models = {
        'a doubtful surface': with_acceptance(
            model, levels=np.where(np.arange(len(Limits._fields)) == 3, NEVER, model.acceptance.levels)
        ),
        'a surface of few slides': dataclasses.replace(model, acceptance=Acceptance(12)),
        'another motion': with_acceptance(model, domain=domain),
    }
    classifier = graph.add(Classifier)
    with World():
        windows = graph.peer.create_publisher(msg.FeatureVector, 'features', FEATURE_QOS)
        graph.until(lambda: windows.get_subscription_count() and classifier.count_subscribers('texture'))
        for name, (centre, count, values, step) in SLIDES.items():
            path = models.get(name, model).save(tmp_path / name.replace(' ', '_'))
            [taken] = classifier.set_parameters([Parameter('model', value=str(path))])
            assert taken.successful, taken.reason

            def slide(centre=centre, count=count, values=values):
                exploration_id = client.feedback.state.exploration_id
                for k, row in enumerate(np.random.default_rng(1).normal(centre, size=(count, 2))):
                    given = {'feature_set': 'kind', **values}
                    windows.publish(to_msg(FeatureVector(k * 10**8, exploration_id, 0.5, 0.1, NAMES, row, **given)))
                windows.publish(to_msg(FeatureVector(10**9, exploration_id, 0.0, 0.1, last=True)))

            result, _ = explore(graph, client, slide, **QUICK)
            assert result.error_code == R.ERROR_NONE, result.message
            assert next_step(result) == step, (name, result.texture)
            assert result.texture.decided <= (step == Next.USE_LABEL)
            if step == Next.USE_LABEL:
                named = probabilities(result)
                assert set(named) == {'cork', 'felt'}
                assert result.texture.label == max(named, key=named.get) == 'felt'
