# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The client of the examples knows the messages alone: every end of an exploration gives it another next step."""

import threading

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from explore_client import Next, TextureClient, next_step, probabilities
from rclpy.node import Node
from rclpy.parameter import Parameter
from texture_msgs.msg import ExplorationResult, ExplorationState, ModelInfo, TextureEstimate

from texture_core.errors import ExplorationError
from texture_core.ros import ESTIMATE_QOS, STATE_QOS, WaitingExecutor, quality_of_service
from texture_core.ros_testing import LocalGraph
from texture_core.types import Rejection
from texture_exploration.nodes.explorer import ExplorerNode

pytestmark = pytest.mark.ros

QUICK = {'motion': 'linear_slide', 'speed_m_s': 0.1, 'distance_m': 0.02}
SLOW = {'motion': 'linear_slide', 'speed_m_s': 0.01, 'distance_m': 0.1}
STILL = {'start_height_m': 0.002, 'state_timeout_s': 1.0, 'watch_signal': False}
R, E, SLIDE = ExplorationResult, TextureEstimate, ExplorationState.PHASE_SLIDE
REFUSED = {
    'UNKNOWN_MOTION': Next.FIX_REQUEST, 'INVALID_REQUEST': Next.FIX_REQUEST,
    'UNUSED_FIELD': Next.FIX_REQUEST, 'OUTSIDE_WORKSPACE': Next.FIX_REQUEST,
    'BUSY': Next.WAIT, 'NOT_ACTIVE': Next.WAIT, 'ARM_NOT_READY': Next.WAIT,
    'INTERNAL': Next.ASK_HELP,
}  # fmt: skip
REJECTED = {
    'NONE': Next.USE_LABEL, 'NOVEL': Next.TRAIN, 'AMBIGUOUS': Next.ELSEWHERE,
    'OUTSIDE_TRAINING': Next.AS_TRAINED, 'TOO_LITTLE_EVIDENCE': Next.LONGER, 'NO_MODEL': Next.LOAD_MODEL,
    'TOO_LITTLE_TRAINING': Next.TRAIN_MORE,
}  # fmt: skip


@pytest.mark.parametrize('error', ExplorationError)
def test_every_error_gives_a_next_step(error):
    lifted, pressing = (R(error_code=error, lifted=lifted, texture=E(rejection=0)) for lifted in (1, 0))
    aborted = (Next.RETRY, Next.ASK_HELP)  # a finger that may press is the business of a person
    expected = (Next.USE_LABEL,) * 2 if not error else (REFUSED[error.name],) * 2 if error.name in REFUSED else aborted
    assert (next_step(lifted), next_step(pressing)) == expected


@pytest.mark.parametrize('rejection', Rejection)
def test_every_rejection_gives_a_next_step(rejection):
    result = R(error_code=R.ERROR_NONE, texture=E(rejection=rejection, probabilities=[0.25, 0.75]))
    result.labels = ['cork', 'felt']
    assert next_step(result) == REJECTED[rejection.name]
    assert probabilities(result) == {'cork': 0.25, 'felt': 0.75}


def explore(graph, client, world, meanwhile=lambda: None, **request):
    """Return the result of an exploration and the status of its goal; `meanwhile` is called in its slide."""
    client.start(**request)
    graph.until(lambda: client.is_complete() or world.phase == SLIDE)
    answer = None if client.is_complete() else meanwhile()
    graph.until(client.is_complete)
    if answer:  # a stop also cancels what is requested before its answer
        graph.until(lambda: client.is_complete() and answer.done())
    return client.result(), client._ending.result().status


class World:
    """An explorer on a simulated arm and a stand-in for the classifier, in their own thread."""

    def __init__(self):
        self.rejection = E.REJECTION_NONE
        self.phase = ExplorationState.PHASE_IDLE
        given = [Parameter(name, value=value) for name, value in STILL.items()]
        self._nodes = self._explorer, classifier = ExplorerNode(parameter_overrides=given), Node('classifier')
        self._estimates = classifier.create_publisher(E, 'texture', ESTIMATE_QOS)
        labels = classifier.create_publisher(ModelInfo, 'model_info', quality_of_service('model_info'))
        labels.publish(ModelInfo(model='m', labels=['cork', 'felt']))
        classifier.create_subscription(ExplorationState, 'exploration', self._answer, STATE_QOS)
        self._executor = WaitingExecutor()
        for node in self._nodes:
            self._executor.add_node(node)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _answer(self, state):
        self.phase = state.phase
        if state.phase == ExplorationState.PHASE_LIFT:
            values = {'exploration_id': state.exploration_id, 'rejection': self.rejection, 'final': True}
            self._estimates.publish(E(label='cork', probabilities=[0.75, 0.25], confidence=0.75, model='m', **values))

    def _spin(self):
        while not self._over.is_set():
            self._executor.spin_once(timeout_sec=0.05)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._explorer.shutdown()
        self._over.set()
        self._thread.join()
        self._executor.shutdown()
        for node in self._nodes:
            node.destroy_node()


@pytest.fixture
def graph():
    with LocalGraph(74, deadline_s=60.0) as graph:
        yield graph


@pytest.fixture
def client(graph):
    client = TextureClient()
    yield client
    client.destroy_node()


@pytest.mark.realtime
def test_every_end_of_an_exploration_reaches_the_client_with_its_next_step(graph, client):
    aborted, again = GoalStatus.STATUS_ABORTED, Next.RETRY
    ends = (
        (R.ERROR_UNKNOWN_MOTION, {'motion': 'flight'}, None, aborted, Next.FIX_REQUEST),
        (R.ERROR_INVALID_REQUEST, {**QUICK, 'force_n': 50.0}, None, aborted, Next.FIX_REQUEST),
        (R.ERROR_STOPPED, SLOW, client.stop, aborted, again),
        (R.ERROR_CANCELLED, SLOW, client.cancel, GoalStatus.STATUS_CANCELED, again),
        (R.ERROR_TIMEOUT, {**SLOW, 'timeout': Duration(sec=2)}, None, aborted, again),
    )
    with World() as world:
        for code, request, meanwhile, status, step in ends:
            result, ended = explore(graph, client, world, meanwhile or (lambda: None), **request)
            assert (result.error_code, ended, next_step(result)) == (code, status, step), result.message
        for rejection in (E.REJECTION_NONE, E.REJECTION_NOVEL, E.REJECTION_AMBIGUOUS, E.REJECTION_OUTSIDE_TRAINING):
            world.rejection = rejection
            result, ended = explore(graph, client, world, **QUICK)
            assert (result.error_code, ended) == (R.ERROR_NONE, GoalStatus.STATUS_SUCCEEDED), result.message
            assert next_step(result) == REJECTED[Rejection(rejection).name]
            assert probabilities(result) == {'cork': 0.75, 'felt': 0.25}
