# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A client of the suite's nodes: explore, call services, set parameters."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any
from uuid import uuid4

from action_msgs.msg import GoalInfo, GoalStatus
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import ParameterType
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from rclpy.utilities import get_rmw_implementation_identifier
from std_srvs.srv import Trigger
from texture_msgs import action, msg, srv

from texture_bringup.feed import Feed
from texture_bringup.launcher import MAY_PRESS, typed
from texture_core.cli import task
from texture_core.config import ros_domain, unknown_name
from texture_core.errors import (
    ExplorationError,
    InvalidData,
    InvalidParameter,
    LaunchFailed,
    MotionAborted,
    MotionRefused,
    TextureError,
)
from texture_core.ros import FEATURE_QOS, LEVELS, SENSOR_QOS, STATE_QOS, from_msg, has_ended, quality_of_service, to_msg
from texture_core.types import (
    NANOSECONDS,
    ExplorationRequest,
    ExplorationState,
    FeatureVector,
    RoughnessEstimate,
    TextureEstimate,
)
from texture_exploration.explorer import CONNECTING


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Raise the KeyboardInterrupt of a signal behind the block: within rclpy it would become another error."""
    if threading.current_thread() is not threading.main_thread():  # which alone gets signals
        yield
        return
    caught: list[int] = []
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    ours = [number for number, handler in before.items() if handler is signal.default_int_handler]
    for number in ours:
        signal.signal(number, lambda got, _frame: caught.append(got))
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, before[number])
    if caught:
        raise KeyboardInterrupt


def middleware() -> str:
    """Return the name of the implementation of ROS that is used."""
    return str(get_rmw_implementation_identifier())


# --------------------
# Parameters of a node from texts, by the types that the node has declared.

TYPES = {
    ParameterType.PARAMETER_BOOL: 'bool',
    ParameterType.PARAMETER_INTEGER: 'int',
    ParameterType.PARAMETER_DOUBLE: 'float',
    ParameterType.PARAMETER_STRING: 'str',
}


def parameter_from_text(name: str, text: str, kind: int) -> Parameter:
    """Return a parameter of a declared type."""
    if kind not in TYPES:
        raise InvalidParameter(f"parameter '{name}' is a list, which cannot be set from a text; give it at the start")
    return Parameter(name, value=typed(text, TYPES[kind], f"parameter '{name}'"))


# --------------------
# Messages of the nodes in a namespace, for display.

HISTORY_NS = 3 * NANOSECONDS


def subscribe(node: Node, feed: Feed, on_bad: Callable[[InvalidData], None], *, history: bool = True) -> None:
    """Pass all messages from now on to a feed; `on_bad` is called with the error of an inconsistent message.

    Without `history`, latched states and estimates that were sent before are left out, but for the last seconds.
    """
    oldest_ns = time.time_ns() - HISTORY_NS

    def taking(take: Callable[[Any], None]) -> Callable[..., None]:
        def on_message(message: Any) -> None:
            try:
                take(from_msg(message))
            except InvalidData as error:
                on_bad(error)

        # By the time of sending: a replayed message bears the time of its recording. EventsExecutor has no `info`.
        def on_new(message: Any, info: Mapping[str, int]) -> None:
            if isinstance(message, msg.ModelInfo) or info['source_timestamp'] >= oldest_ns:
                on_message(message)

        return on_message if history else on_new

    def note_diagnostics(message: DiagnosticArray) -> None:
        ours = node.get_namespace().rstrip('/') + '/'
        for status in message.status:
            if status.name.startswith(ours):
                level, name = LEVEL_NAMES.get(status.level, 'ERROR'), status.name.removeprefix(ours)
                feed.node_statuses.update(name, level, status.message, time.monotonic(), has_ended(status))

    for topic, (kind, take) in feed.topics.items():
        node.create_subscription(getattr(msg, kind), topic, taking(take), quality_of_service(topic))
    node.create_subscription(DiagnosticArray, '/diagnostics', note_diagnostics, 100)


# --------------------
# What an operator does with the running nodes: explore, stop, set parameters.

STEP_S = 0.1
LEVEL_NAMES = {value: name for name, value in LEVELS.items()}
CANCEL_DEADLINE_S = 10.0
FEATURES_DEADLINE_S = 30.0
# An explorer that explores sends feedback, and else its idle state once a second: silent for this long, it has ended or
# hangs. ROS lists a killed one for another 20 s.
GONE_S = 4.0
# Time until a goal is accepted: it is short, unless the request has been lost with an explorer that just died.
ACCEPT_S, CONFIRM_S = 15.0, 1.0
# Time to find a service, and time for its answer: a tare takes up to 65 s, an arm up to 96 s to connect again.
OFFERED_S, ANSWER_S = 10.0, 120.0
STOP_S = 3.0
CHOOSE = 'choose its namespace by --namespace, also of `texture dashboard`'
EMERGENCY = 'if the arm moves, use the emergency stop of the robot'
NOT_STOPPED = f'the explorer has not answered the stop within {STOP_S:g} s; {EMERGENCY}'
SETTINGS_S = 10.0  # to find the parameters of a node
RETRY_PERIOD_S = 5.0
# What this process has discovered, the others discover soon after.
DISCOVERY_S = 1.0
# The transition that brings a lifecycle node one step nearer to being active, or to being inactive, by its state.
STEPS: Mapping[bool, Mapping[str, int]] = {
    True: {'unconfigured': Transition.TRANSITION_CONFIGURE, 'inactive': Transition.TRANSITION_ACTIVATE},
    False: {'active': Transition.TRANSITION_DEACTIVATE},
}
LOOK = 'look at the robot, and at the output of the explorer'
VANISHED = f'the explorer has vanished; if it was exploring, the finger may still touch the surface: {LOOK}'
FAILED = f'the explorer has failed and gives no reason; {LOOK}'
Progress = Callable[[ExplorationState, TextureEstimate], None]


@dataclass(frozen=True)
class ExplorationResult:
    """The answer to an exploration."""

    error: ExplorationError
    message: str
    exploration_id: str
    texture: TextureEstimate
    roughness: RoughnessEstimate
    labels: tuple[str, ...] = ()  # of the probabilities
    lifted: bool = False  # known to be free of the surface

    @property
    def success(self) -> bool:
        """Whether the motion was completed."""
        return self.error is ExplorationError.NONE


class Interrupted(KeyboardInterrupt):
    """Ctrl-C in an exploration: how that ended, and its id if it was completed all the same."""

    def __init__(self, sentence: str, completed: str = '') -> None:
        super().__init__(sentence)
        self.completed = completed


def _unconfirmed() -> Interrupted:
    """Return what an operator must know whose stop was not answered."""
    return Interrupted(
        f'the explorer has not confirmed within {CANCEL_DEADLINE_S:g} s that the finger was lifted; look at the robot, '
        'and use its emergency stop if it moves'
    )


def _given_up(goal: Any, why: str) -> MotionAborted:
    """Cancel a request that is given up, as an explorer that only hung must not begin it later; return the error."""
    goal.cancel_goal_async()
    return MotionAborted(why)


def _message(result: Any) -> str:
    """Return how an exploration ended, and of an aborted one that the finger was lifted, if that is known."""
    return f'{result.message or FAILED}{"; the finger was lifted" * bool(result.error_code and result.lifted)}'


class Operator:
    """A client of the nodes of one namespace; use it in a `with` block, from one thread."""

    def __init__(
        self, namespace: str = '', domain_id: int | None = None, guard: Callable[[], None] = lambda: None
    ) -> None:
        self._guard = guard
        self._context = Context()
        self._domain_id = ros_domain() if domain_id is None else domain_id
        with uninterrupted():
            self._context.init(args=[], domain_id=self._domain_id)  # not those of the command: NAME:=VALUE would remap
            self._node = Node('operator', namespace=namespace or None, context=self._context, enable_rosout=False)
            self._executor = SingleThreadedExecutor(context=self._context)
            self._executor.add_node(self._node)
            self._explore = ActionClient(self._node, action.Explore, 'explore')
            self._settings: dict[str, AsyncParameterClient] = {}  # of each node, made once: all nodes remember it
            self._heard_s = 0.0  # of the explorer
            self._info = msg.ExplorerInfo()
            self._on_info(partial(setattr, self, '_info'))
        self._states: Any = None  # not subscribed yet: who waits for listeners would count it
        self._vectors: list[FeatureVector] | None = None  # not subscribed yet

    def __enter__(self) -> Operator:
        return self

    def __exit__(self, *_: object) -> None:
        with uninterrupted():
            self._explore.destroy()
            self._executor.shutdown()
            self._node.destroy_node()
            self._context.try_shutdown()

    def wait_for_explorer(self, deadline_s: float, quiet_s: float | None = None) -> None:
        """Wait until explorations can be requested; the wait is shown after `quiet_s`."""
        advice, ours = 'start one, such as the emulator with `texture launch emulator`', self._node.get_namespace()
        missing = f'no explorer answers in the ROS_DOMAIN_ID {self._domain_id} and namespace {ours}'
        try:
            with task(f"waiting for an explorer in the namespace '{ours}', which may be starting", quiet_s=quiet_s):
                self.wait_until(self._explore.server_is_ready, deadline_s, f'{missing}; {advice}')
        except KeyboardInterrupt:
            raise KeyboardInterrupt('nothing was requested') from None
        except LaunchFailed as error:
            others = ', '.join(sorted({*self._explorers()} - {ours}))
            if not others:
                raise
            raise LaunchFailed(
                f'{missing} (waited {deadline_s:.0f} s); there are explorers in {others}: {CHOOSE}'
            ) from error

    def _explorers(self) -> list[str]:
        """Return the namespace of each explorer that is there."""
        return [space for name, space in self._node.get_node_names_and_namespaces() if name == 'explorer']

    def wait_for_node(self, name: str, deadline_s: float) -> None:
        """Wait until a node of the namespace is there."""
        namespace = self._node.get_namespace()
        missing = f"node '{namespace.rstrip('/')}/{name}' was not found; look at its output"
        self.wait_until(lambda: (name, namespace) in self._node.get_node_names_and_namespaces(), deadline_s, missing)

    def wait_for_signal(self, deadline_s: float) -> None:
        """Wait until the sensor delivers samples."""
        batches: list[msg.TactileSignal] = []
        subscription = self._node.create_subscription(msg.TactileSignal, 'signal', batches.append, SENSOR_QOS)
        missing = "no samples arrive on 'signal'; is the sensor connected?"
        try:
            self.wait_until(lambda: bool(batches), deadline_s, missing)
        finally:
            self._node.destroy_subscription(subscription)

    def watch_stops(self) -> Callable[[], bool]:
        """Return what says whether the explorer was told to stop since, between explorations, too; see `explore`."""
        ends: list[int] = []
        self._on_info(lambda info: ends.append(info.last_error_code))
        return lambda: any(end == ExplorationError.STOPPED != before for before, end in pairwise(ends))

    def explore(
        self,
        request: ExplorationRequest,
        on_progress: Progress = lambda _state, _texture: None,
        stopped: Callable[[], bool] = lambda: False,
    ) -> ExplorationResult:
        """Explore, and return what was measured; Ctrl-C stops the exploration, and is raised as `Interrupted` then.

        `stopped` says whether the explorer was told to stop, which may be before it has the request.
        """

        def on_feedback(message: Any) -> None:
            self._heard_s = time.monotonic()
            on_progress(from_msg(message.feedback.state), from_msg(message.feedback.texture))

        self._states = self._states or self._node.create_subscription(
            msg.ExplorationState, 'exploration', self._hear, STATE_QOS, raw=True
        )
        goal_id = GoalInfo().goal_id
        goal_id.uuid = list(uuid4().bytes)
        self._complete(Future(), STEP_S)  # a caller who waited for something else has not heard of a stop yet
        if stopped():
            raise MotionRefused('the request was stopped before it was sent', ExplorationError.STOPPED)
        accepted = self._explore.send_goal_async(action.Explore.Goal(request=to_msg(request)), on_feedback, goal_id)
        try:
            self._wait_until_accepted(accepted)
        except MotionAborted as error:
            withdrawn = self._withdraw(goal_id)
            self._complete(withdrawn, CONFIRM_S)
            confirmed = withdrawn.done() and withdrawn.result().goals_canceling  # none if the goal is unknown there
            raise MotionAborted(
                f'{error}; {"it has" if confirmed else "look at the robot: it has not"} confirmed that the request is '
                'withdrawn'
            ) from error
        except KeyboardInterrupt:  # the explorer may have the request already
            self._withdraw(goal_id)
            with suppress(KeyboardInterrupt):
                self._complete(accepted, CANCEL_DEADLINE_S)
            goal = accepted.result()
            raise (self._cancel(goal, goal.get_result_async()) if goal else _unconfirmed()) from None
        goal, cancelled = accepted.result(), False
        endings = [goal.get_result_async()]
        deadline_s = time.monotonic() + (request.timeout_s + CANCEL_DEADLINE_S if request.timeout_s else math.inf)
        self._heard_s = asked_s = time.monotonic()
        try:
            while not any(ending.done() for ending in endings) and (now_s := time.monotonic()) < deadline_s:
                if stopped() and not cancelled:  # once it is accepted: the explorer does not know an earlier cancel
                    goal.cancel_goal_async()
                    cancelled = True
                self._step()
                if now_s - self._heard_s > GONE_S:
                    raise _given_up(goal, VANISHED)
                if now_s - asked_s > RETRY_PERIOD_S:  # a restarted explorer answers that the goal is unknown
                    endings.append(goal.get_result_async())
                    asked_s = now_s
        except KeyboardInterrupt:
            raise self._cancel(goal, endings[0]) from None
        answer = next((ending.result() for ending in endings if ending.done()), None)
        if answer is None:
            raise _given_up(
                goal, f'no result within the timeout of {request.timeout_s:g} s; the exploration was cancelled'
            )
        if answer.status == GoalStatus.STATUS_UNKNOWN:
            raise MotionAborted(
                f'the explorer was restarted and does not know this exploration, which was aborted; {MAY_PRESS}'
            )
        result = answer.result.result
        if not result.message:
            raise MotionAborted(FAILED)
        return ExplorationResult(
            ExplorationError(result.error_code),
            _message(result),
            result.exploration_id,
            from_msg(result.texture),
            from_msg(result.roughness),
            tuple(result.labels),
            result.lifted,
        )

    def explore_with_features(
        self,
        request: ExplorationRequest,
        on_progress: Progress = lambda _state, _texture: None,
        stopped: Callable[[], bool] = lambda: False,
    ) -> tuple[ExplorationResult, list[FeatureVector]]:
        """Explore as `explore` does, and also return the features of the windows; none of an aborted exploration."""
        if self._vectors is None:  # listen from now on
            heard = self._vectors = []
            self._node.create_subscription(
                msg.FeatureVector, 'features', lambda message: heard.append(from_msg(message)), FEATURE_QOS
            )
            missing = "no node publishes on 'features'; is the feature_extractor running?"
            self.wait_until(lambda: self._node.count_publishers('features') > 0, FEATURES_DEADLINE_S, missing)
            self._complete(Future(), DISCOVERY_S)
        vectors = self._vectors
        vectors.clear()
        explored = self.explore(request, on_progress, stopped)
        if not explored.success:
            return explored, []

        def over() -> bool:
            return any(vector.last and vector.exploration_id == explored.exploration_id for vector in vectors)

        self.wait_until(over, FEATURES_DEADLINE_S, "the features of the slide do not arrive on 'features'")
        return explored, [one for one in vectors if one.exploration_id == explored.exploration_id and not one.last]

    def stop(self) -> tuple[bool, str]:
        """Stop any motion; return whether the explorer did, and its message."""
        return self.call('explorer/stop', f'no explorer runs there; {EMERGENCY}', NOT_STOPPED, STOP_S)

    def call(self, service: str, advice: str, silent: str = '', answer_s: float = ANSWER_S) -> tuple[bool, str]:
        """Call a `Trigger`; return whether it succeeded, and its message.

        `advice` is for a missing service, `silent` the sentence for one that gives no answer.
        """
        name = f"the service '{self._node.resolve_service_name(service)}'"
        missing = f'no node offers {name}; {advice}'
        silent = silent or f'{name} has not answered yet; look at the robot, and at the output of its node'
        answer = self._ask(Trigger, service, Trigger.Request(), missing, silent, answer_s=answer_s)
        return bool(answer.success), str(answer.message)

    def set_active(self, node: str, active: bool) -> str:
        """Bring a lifecycle node to the state 'active', over 'inactive', or from it back to 'inactive'."""
        missing = f"no lifecycle node '{node}' answers; start it, or give its --namespace"
        silent = f"node '{node}' has not answered yet; look at its output"
        for _ in range(3):  # two transitions at most, and a look at the state behind them
            with self._naming(node):
                state = self._ask(GetState, f'{node}/get_state', GetState.Request(), missing, silent)
            label = str(state.current_state.label)
            if label not in STEPS[active]:
                break
            request = ChangeState.Request(transition=Transition(id=STEPS[active][label]))
            answer = self._ask(ChangeState, f'{node}/change_state', request, missing, silent)
            if not answer.success:
                raise LaunchFailed(f"node '{node}' is {label} and refuses to change; its output gives the reason")
        return label

    def add(self, label: str, exploration_id: str = '') -> tuple[int, str]:
        """Add an exploration, the last one if '', to a texture; return its number of windows and a sentence."""
        request = srv.AddTexture.Request(label=label, exploration_id=exploration_id)
        answer = self._ask_classifier(srv.AddTexture, 'classifier/add_texture', request)
        return int(answer.examples), str(answer.message)

    def remove(self, label: str) -> str:
        """Remove all slides that were added as a texture; return what happened in a sentence."""
        request = srv.RemoveTexture.Request(label=label)
        return str(self._ask_classifier(srv.RemoveTexture, 'classifier/remove_texture', request).message)

    def remove_last_added(self) -> str:
        """Let the classifier remove the slide that was added last; return what happened. Raises as `add` does."""
        return str(self._ask_classifier(Trigger, 'classifier/remove_last_added', Trigger.Request()).message)

    def watch(self, feed: Feed, show: Callable[[], None]) -> None:
        """Let a feed take what the nodes publish, and call `show` after each message, until Ctrl-C."""
        subscribe(self._node, feed, lambda _error: None, history=False)
        while True:
            self._step()
            show()

    def _ask_classifier(self, kind: Any, name: str, request: Any) -> Any:
        """Return the answer of a service of the classifier that succeeded."""
        missing = (
            f'no classifier answers in the ROS_DOMAIN_ID {self._domain_id} and namespace {self._node.get_namespace()}; '
            f'start the launch, or {CHOOSE}'
        )
        silent = 'the classifier has not answered yet; look at its output'
        answer = self._ask(kind, name, request, missing, silent)
        if not answer.success if kind is Trigger else answer.error_code:
            raise InvalidData(answer.message)
        return answer

    def _ask(self, kind: Any, name: str, request: Any, missing: str, silent: str, *, answer_s: float = ANSWER_S) -> Any:
        """Return the answer of a service; the sentences are for one that nobody offers, and one without an answer."""
        client = self._node.create_client(kind, name)
        try:
            self.wait_until(client.service_is_ready, OFFERED_S, missing)
            future = client.call_async(request)
            self.wait_until(future.done, answer_s, silent)
        finally:
            self._node.destroy_client(client)
        return future.result()

    def parameters(self, node: str, names: Sequence[str]) -> list[Any]:
        """Return the values of parameters of a node, in the order of their names."""
        client = self._parameters_of(node)
        answer = self._answer(node, client.get_parameters(list(names)))
        return [parameter_value_to_python(one) for one in answer.values]

    def set_parameters(self, node: str, values: Mapping[str, Any]) -> None:
        """Set parameters of a node; a text is read as the type that it has declared. UnknownName has the nearest."""
        client = self._parameters_of(node)
        known = self._answer(node, client.list_parameters([], 10)).result.names
        for name in values:
            if name not in known:
                raise unknown_name(name, known, f'parameter of {node}')
        declared = self._answer(node, client.get_parameters(list(values))).values
        read = [
            parameter_from_text(name, str(values[name]), one.type) for name, one in zip(values, declared, strict=True)
        ]
        for parameter, outcome in zip(read, self._answer(node, client.set_parameters(read)).results, strict=True):
            if not outcome.successful:
                raise InvalidParameter(f"node '{node}' refused parameter '{parameter.name}': {outcome.reason}")

    def _parameters_of(self, node: str) -> AsyncParameterClient:
        if node not in self._settings:
            self._settings[node] = AsyncParameterClient(self._node, node)
        client = self._settings[node]
        with self._naming(node):
            self.wait_until(client.services_are_ready, SETTINGS_S, f"no node '{node}' answers; start it, or {CHOOSE}")
        return client

    @contextmanager
    def _naming(self, node: str) -> Iterator[None]:
        """Name the nodes of the namespace where the block fails as no node of this name is among them."""
        try:
            yield
        except LaunchFailed as error:
            us, ours = self._node.get_name(), self._node.get_namespace()
            there = {name for name, space in self._node.get_node_names_and_namespaces() if space == ours} - {us}
            if not there or node in there:
                raise
            raise unknown_name(node, there, 'running node') from error

    def _answer(self, node: str, future: Future) -> Any:
        """Return the answer of a node that may run without an explorer."""
        self.wait_until(future.done, ANSWER_S, f"node '{node}' has not answered yet")
        return future.result()

    def _wait_until_accepted(self, accepted: Future) -> None:
        """Wait for the answer to a request, and first until the explorer has connected to its arm."""

        def connects() -> bool:
            return bool(self._info.message.startswith(CONNECTING))

        silent = 'the explorer has not answered yet; stop it, and check that no second one runs'
        while not accepted.done():
            self.wait_until(lambda: accepted.done() or connects(), ACCEPT_S, silent, MotionAborted)
            self.wait_until(
                lambda: accepted.done() or not connects() or not self._explore.server_is_ready(),
                ANSWER_S,
                self._info.message,
                MotionAborted,
            )
            if connects() and not accepted.done():
                raise MotionAborted(VANISHED)

    def _on_info(self, take: Callable[[Any], None]) -> None:
        """Subscribe to what the explorer can do, which is latched."""
        self._node.create_subscription(msg.ExplorerInfo, 'explorer_info', take, quality_of_service('explorer_info'))

    def _hear(self, _state: bytes) -> None:
        self._heard_s = time.monotonic()

    def wait_until(
        self, condition: Callable[[], bool], deadline_s: float, complaint: str, error: type[TextureError] = LaunchFailed
    ) -> None:
        """Wait until a condition holds, or raise the error with the complaint.

        What to do, behind its first semicolon, is not shown before the time is over.
        """
        deadline = time.monotonic() + deadline_s
        with task(f'waiting: {complaint.partition("; ")[0]}'):
            while not condition():
                if time.monotonic() > deadline:
                    raise error(f'{complaint} (waited {deadline_s:.0f} s)')
                self._step()

    def _step(self) -> None:
        self._guard()
        with uninterrupted():
            self._executor.spin_once(timeout_sec=STEP_S)

    def _complete(self, future: Future, deadline_s: float) -> None:
        """Spin until a future is done or the time is over, and raise Ctrl-C only then; the guard is not asked."""
        end_s = time.monotonic() + deadline_s
        with uninterrupted():
            while not future.done() and time.monotonic() < end_s:
                self._executor.spin_once(timeout_sec=STEP_S)

    def _withdraw(self, goal_id: Any) -> Future:
        """Cancel a request that was not accepted: an explorer that accepts it later must not run it."""
        handle = ClientGoalHandle(self._explore, goal_id, action.Explore.Impl.SendGoalService.Response())
        return handle.cancel_goal_async()

    def _cancel(self, goal: Any, ending: Future) -> Interrupted:
        """Cancel, wait until the finger is lifted, and return how it ended."""
        goal.cancel_goal_async()
        with suppress(KeyboardInterrupt), task(f'waiting for the end of the exploration; {EMERGENCY}'):
            self._complete(ending, CANCEL_DEADLINE_S)
        if not ending.done():
            return _unconfirmed()
        result = ending.result().result.result
        completed = '' if result.error_code else result.exploration_id
        return Interrupted(f'the exploration has ended: {_message(result)}', completed)
