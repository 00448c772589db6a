# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A program that knows the interfaces alone: it reads numbers, and never a sentence."""

import dataclasses
import threading

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from texture_msgs import msg
from texture_msgs.action import Explore
from texture_msgs.msg import ExplorationRequest, ExplorationResult, ExplorationState, ModelInfo, TextureEstimate

from texture_core.ros import FEATURE_QOS, STATE_QOS, WaitingExecutor, quality_of_service, to_msg
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
R, E = ExplorationResult, TextureEstimate


class Program:
    """Explores, and says in one word what it does with the answer."""

    def __init__(self, node, spin_until):
        self._until = spin_until
        self._explore = ActionClient(node, Explore, 'explore')
        self._stop = node.create_client(Trigger, 'explorer/stop')
        self._labels = {}
        self.phases = []
        node.create_subscription(ModelInfo, 'model_info', self._on_model, quality_of_service('model_info'))
        node.create_subscription(ExplorationState, 'exploration', lambda one: self.phases.append(one.phase), STATE_QOS)

    def _on_model(self, info):
        self._labels[info.model, info.revision] = list(info.labels)

    def explore(self, meanwhile=lambda _goal: None, **request):
        """Return the result of an exploration and the status of its goal; `meanwhile` is called in its slide."""
        self._until(self._explore.server_is_ready)
        self.phases.clear()
        sent = self._explore.send_goal_async(Explore.Goal(request=ExplorationRequest(**request)))
        self._until(sent.done)
        ending = sent.result().get_result_async()
        self._until(lambda: ending.done() or ExplorationState.PHASE_SLIDE in self.phases)
        if not ending.done():
            meanwhile(sent.result())
        self._until(ending.done)
        return ending.result().result.result, ending.result().status

    def stop(self, _goal=None):
        self._until(self._stop.service_is_ready)
        self._stop.call_async(Trigger.Request())

    def next_step(self, result):
        """Return what to do after a result, by its numbers alone."""
        if result.error_code == R.ERROR_NONE:
            return self.decision(result.texture)
        if result.error_code in (R.ERROR_UNKNOWN_MOTION, R.ERROR_INVALID_REQUEST):
            return 'correct the request'
        if result.error_code in (R.ERROR_BUSY, R.ERROR_NOT_ACTIVE, R.ERROR_ARM_NOT_READY):
            return 'ask later'
        return 'explore again' if result.lifted else 'call a person'

    def decision(self, estimate):
        """Return the label that may be used, or what to do without one."""
        if estimate.rejection == E.REJECTION_NONE:
            labels = self._labels[estimate.model, estimate.revision]
            assert labels[int(np.argmax(estimate.probabilities))] == estimate.label
            return estimate.label
        return {
            E.REJECTION_NOVEL: 'teach it',
            E.REJECTION_AMBIGUOUS: 'slide elsewhere',
            E.REJECTION_OUTSIDE_TRAINING: 'slide as trained',
            E.REJECTION_TOO_LITTLE_EVIDENCE: 'slide longer',
            E.REJECTION_NO_MODEL: 'load a model',
            E.REJECTION_TOO_LITTLE_TRAINING: 'train more',
        }[estimate.rejection]


class World:
    """An explorer on a simulated arm, in a thread of its own, and the program."""

    def __init__(self, graph, **parameters):
        self.explorer = ExplorerNode(
            parameter_overrides=[Parameter(name, value=value) for name, value in {**STILL, **parameters}.items()]
        )
        self.arm = self.explorer._explorer.arm
        self._executor = WaitingExecutor()
        self._executor.add_node(self.explorer)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()
        self.program = Program(graph.peer, graph.until)

    def shove(self, _goal):
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


def test_a_program_tells_every_end_of_an_exploration_by_its_code(graph):
    with World(graph, force_limit_n=8.0) as world:
        explore, act = world.program.explore, world.program.next_step
        aborted = GoalStatus.STATUS_ABORTED
        cases = {
            R.ERROR_UNKNOWN_MOTION: (lambda: explore(motion='linear_slid'), aborted, 'correct the request'),
            R.ERROR_INVALID_REQUEST: (lambda: explore(**{**QUICK, 'force_n': 50.0}), aborted, 'correct the request'),
            R.ERROR_STOPPED: (lambda: explore(world.program.stop, **SLOW), aborted, 'explore again'),
            R.ERROR_CANCELLED: (
                lambda: explore(lambda goal: goal.cancel_goal_async(), **SLOW),
                GoalStatus.STATUS_CANCELED,
                'explore again',
            ),
            R.ERROR_ARM_FAULT: (lambda: explore(lambda _: world.arm.fail('stop'), **SLOW), aborted, 'call a person'),
            R.ERROR_NONE: (lambda: explore(**QUICK), GoalStatus.STATUS_SUCCEEDED, 'slide longer'),
        }
        for code, (happens, status, action) in cases.items():
            result, ended = happens()
            assert (result.error_code, ended, act(result)) == (code, status, action), result.message
        timeout = ExplorationRequest(**SLOW).timeout
        timeout.sec = 2
        assert explore(**SLOW, timeout=timeout)[0].error_code == R.ERROR_TIMEOUT
        busy = []
        explore(lambda _: busy.append(second(graph, world.program)), **SLOW)
        assert busy == [R.ERROR_BUSY]
        result, _ = explore(world.shove, **SLOW)
        assert (result.error_code, act(result)) == (R.ERROR_FORCE_LIMIT, 'explore again'), result.message
        world.explorer.trigger_deactivate()
        result, _ = explore(**QUICK)
        assert (result.error_code, act(result)) == (R.ERROR_NOT_ACTIVE, 'ask later')


def second(graph, program):
    """Return the error of a request during an exploration, which it then stops."""
    sent = program._explore.send_goal_async(Explore.Goal(request=ExplorationRequest(**QUICK)))
    graph.until(sent.done)
    ending = sent.result().get_result_async()
    graph.until(ending.done)
    program.stop()
    return ending.result().result.result.error_code


@pytest.mark.parametrize(
    ('parameters', 'code'),
    [
        ({'stiffness_n_m': 0.0, 'approach_travel_m': 0.005}, R.ERROR_NO_SURFACE),
        ({'watch_signal': True}, R.ERROR_NO_SIGNAL),
    ],
    ids=['no surface', 'no signal'],
)
def test_a_program_tells_a_missing_surface_or_sensor_by_its_code(graph, parameters, code):
    with World(graph, **parameters) as world:
        result, _ = world.program.explore(**QUICK)
        assert (result.error_code, world.program.next_step(result)) == (code, 'explore again'), result.message


@pytest.fixture(scope='module')
def model():
    rng = np.random.default_rng(0)
    values = np.repeat([[0.0, 0.0], [4.0, 0.0]], 96, axis=0) + rng.normal(size=(192, 2))
    labels = np.repeat(['cork', 'felt'], 96)
    groups = np.array([f'{label}/{k // 4}' for k, label in enumerate(labels)])
    return train(load_recipe('default'), LabelledFeatures(values, labels, groups, NAMES, 'kind', 0.5, 0.25))


# The centre of the windows, their number and what else they say, and what the program does.
SLIDES = {
    'a trained surface': ((4.0, 0.0), 8, {}, 'felt'),
    'a new surface': ((60.0, 60.0), 8, {}, 'teach it'),
    'another motion': ((4.0, 0.0), 8, {'motion': 'circular', 'speed_m_s': 9.0}, 'slide as trained'),
    'no window': ((4.0, 0.0), 0, {}, 'slide longer'),
    'features of another recipe': ((4.0, 0.0), 8, {'feature_set': 'other'}, 'load a model'),
    'a doubtful surface': ((4.0, 0.0), 8, {}, 'slide elsewhere'),
    'a surface of few slides': ((4.0, 0.0), 8, {}, 'train more'),
}


def with_acceptance(model, **changes):
    return dataclasses.replace(model, acceptance=dataclasses.replace(model.acceptance, **changes))


def test_a_program_tells_every_rejection_by_its_code(graph, model, tmp_path):
    domain = dataclasses.replace(model.acceptance.domain, speed_m_s=(0.05, 0.05))
    models = {
        'a doubtful surface': with_acceptance(
            model, levels=np.where(np.arange(len(Limits._fields)) == 3, NEVER, model.acceptance.levels)
        ),
        'a surface of few slides': dataclasses.replace(model, acceptance=Acceptance(12)),
        'another motion': with_acceptance(model, domain=domain),
    }
    classifier = graph.add(Classifier)
    with World(graph) as world:
        windows = graph.peer.create_publisher(msg.FeatureVector, 'features', FEATURE_QOS)
        graph.until(lambda: windows.get_subscription_count() and classifier.count_subscribers('texture'))
        ids = graph.listen(ExplorationState, 'exploration', STATE_QOS)
        for name, (centre, count, said, action) in SLIDES.items():
            path = models.get(name, model).save(tmp_path / name.replace(' ', '_'))
            [taken] = classifier.set_parameters([Parameter('model', value=str(path))])
            assert taken.successful, taken.reason

            def slide(_goal, centre=centre, count=count, said=said):
                exploration_id = ids[-1].exploration_id
                for k, row in enumerate(np.random.default_rng(1).normal(centre, size=(count, 2))):
                    values = {'feature_set': 'kind', **said}
                    windows.publish(to_msg(FeatureVector(k * 10**8, exploration_id, 0.5, 0.1, NAMES, row, **values)))
                windows.publish(to_msg(FeatureVector(10**9, exploration_id, 0.0, 0.1, last=True)))

            result, _ = world.program.explore(slide, **QUICK)
            assert result.error_code == R.ERROR_NONE, result.message
            assert world.program.next_step(result) == action, (name, result.texture)
            assert action == 'felt' or not result.texture.decided
