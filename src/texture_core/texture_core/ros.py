# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The suite's types as messages, its parameters in ROS, quality of service, diagnostics, and how a node runs."""

from __future__ import annotations

import array
import contextlib
import difflib
import json
import signal
import socket
import sys
import threading
import time
import typing
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import rclpy
from builtin_interfaces.msg import Duration as DurationMessage
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy._rclpy_pybind11 import RCLError
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Header
from texture_msgs import msg

from texture_core.config import Parameter, check_parameter_file, from_mapping, parameters_of, ros_domain, unknown_name
from texture_core.errors import InvalidParameter, TextureError
from texture_core.types import (
    DATA_CLASSES,
    NANOSECONDS,
    QUALITIES,
    AnyArray,
    Array,
    MessageCodec,
)

# --------------------
# A node's health on /diagnostics: one status, its level and its numbers.

LEVELS = {'OK': DiagnosticStatus.OK, 'WARN': DiagnosticStatus.WARN, 'ERROR': DiagnosticStatus.ERROR}
ENDED = 'ended'  # the value that the last report of a node carries
LISTENERS = 'listeners'  # the value of a feature extractor: names of the nodes that get its vectors
PERIOD_S = 1.0
ACKNOWLEDGED_S = 1.0  # the longest that a node waits at its end for the readers of that report
DiagnosticReport = tuple[str, str, Mapping[str, Any]]


class Diagnostics:
    """Publish a status once a second, and on request."""

    def __init__(self, node: Any, report: Callable[[], DiagnosticReport], hardware_id: str = '') -> None:
        self._node = node
        self._report = report
        self.hardware_id = hardware_id
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # With use_sim_time the node's time stands still until the recording begins.
        self._timer = node.create_timer(PERIOD_S, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publish(self) -> None:
        """Publish the status now."""
        self._publish(*self._report())

    def end(self) -> None:
        """Publish the status marked as the last one, so that a regular end is not reported as silence."""
        level, message, numbers = self._report()
        self._publish(level, message, {**numbers, ENDED: True})
        self._publisher.wait_for_all_acked(Duration(seconds=ACKNOWLEDGED_S))

    def _publish(self, level: str, message: str, numbers: Mapping[str, Any]) -> None:
        status = DiagnosticStatus(
            level=LEVELS[level],
            name=self._node.get_fully_qualified_name(),
            message=message,
            hardware_id=self.hardware_id,
            values=[KeyValue(key=str(key), value=_text(value)) for key, value in numbers.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)


def has_ended(status: DiagnosticStatus) -> bool:
    """Return whether a status is the last one of a node that ended regularly."""
    return any(value.key == ENDED for value in status.values)


def _text(value: Any) -> str:
    return f'{value:.6g}' if isinstance(value, float) else str(value)


# --------------------
# Names of frames on tf, which has no namespaces.


def frame_name(namespace: str, name: str) -> str:
    """Return the name on tf of the frame `name` of a node in a namespace, such as 'left/fingertip'."""
    if '/' in name or not name:
        return name
    return f'{namespace.strip("/")}/{name}'.lstrip('/')


# --------------------
# A lifecycle node that survives a request which its state does not allow.


class PatientLifecycleNode(LifecycleNode):
    """Refuse an unknown or untimely transition; rclpy raises it as an error, which would end the process.

    rclpy offers no place to refuse it but a private method, which the service handler calls.
    """

    def _LifecycleNodeMixin__change_state(self, transition_id: int) -> TransitionCallbackReturn:  # noqa: N802
        try:
            return super()._LifecycleNodeMixin__change_state(transition_id)  # type: ignore[misc]
        except RCLError as error:
            self.get_logger().warning(f'the transition {transition_id} was refused: {error}')
            return TransitionCallbackReturn.FAILURE


# --------------------
# Declare the fields of a parameter dataclass as ROS parameters and read them back, checked.

T = TypeVar('T')
TYPES = {
    bool: RosParameter.Type.BOOL,
    int: RosParameter.Type.INTEGER,
    float: RosParameter.Type.DOUBLE,
    str: RosParameter.Type.STRING,
    list[str]: RosParameter.Type.STRING_ARRAY,
    list[float]: RosParameter.Type.DOUBLE_ARRAY,
}
UNBOUNDED = 1e300
SOURCES = ('--params-file', '--param', '-p')
_SOURCES: list[tuple[str, str]] = []  # those of this process, with their text


def declare(node: Any, cls: type[T], *, changeable: bool = False) -> T:
    """Declare every field of `cls` with its description, unit and range; return the values of the node."""
    if not hasattr(node, 'given'):
        node.given = _given(node)
    for item in parameters_of(cls):
        if node.has_parameter(item.name):
            continue
        for source, values in node.given:  # each is checked, the last one counts
            if item.name in values:
                try:
                    value = item.check(values[item.name].value)
                except InvalidParameter as error:
                    raise InvalidParameter(f"node '{node.get_name()}', {source}: {error}") from error
                node._parameter_overrides[item.name] = RosParameter(item.name, TYPES[item.type], value)
        node.declare_parameter(item.name, item.default, _descriptor(item, read_only=not changeable))
    return read(node, cls)


def _given(node: Any) -> list[tuple[str, Mapping[str, RosParameter]]]:
    """Return the parameters in each file and `-p` of the command line, or those that the constructor got.

    One by one: ROS joins them by section, where a later file does not replace an earlier one whose section comes later,
    or whose value has another type, such as 15.0 before 'high'.
    """
    given = []
    for option, text in _SOURCES:
        if option == '--params-file' and getattr(node, 'owns_file', False):
            check_parameter_file(Path(text), node.get_fully_qualified_name())
        with node.context.handle:
            alone = rclpy_implementation.Node(
                node.get_name(), node.get_namespace(), node.context.handle, ['--ros-args', option, text], False, False
            )
        given.append((f"'{option} {text}'", alone.get_parameters(RosParameter)))
        alone.destroy_when_not_in_use()
    return given or [('its constructor', dict(node._parameter_overrides))]


def read(node: Any, cls: type[T]) -> T:
    """Return the declared parameters of `cls` with their present values."""
    return from_mapping(cls, {item.name: node.get_parameter(item.name).value for item in parameters_of(cls)})


def on_change(node: Any, cls: type[T], apply: Callable[[T], None]) -> None:
    """Call `apply` with the new values before a change of parameters is accepted; refused values are not set."""
    known = {item.name for item in parameters_of(cls)}

    def check(changes: list[RosParameter]) -> SetParametersResult:
        changed = {change.name: change.value for change in changes if change.name in known}
        if not changed:
            return SetParametersResult(successful=True)
        present = {name: node.get_parameter(name).value for name in known}
        try:
            apply(from_mapping(cls, {**present, **changed}))
        except InvalidParameter as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(check)


# Two letters swapped in a short name ('x_hihg_m') are above it, most pairs of different names are below.
MISSPELLED = 0.85


def check_names(node: Any) -> None:
    """Refuse a parameter that was given and is nearly one of the node's; log a warning for others that are unknown.

    Names in the node's `names_elsewhere`, if it has them, belong to alternatives that it did not choose.
    A node with `shares_file` reads only its parameters from the file of another node, such as the pose of a surface.
    One with `owns_file` refuses a file with a section for another node: a misnamed section would have no effect.
    """
    if getattr(node, 'shares_file', False):
        return
    declared = set(node._parameters)
    elsewhere = getattr(node, 'names_elsewhere', ())
    for name in sorted(set(node._parameter_overrides) - declared):
        if name.startswith('qos_overrides.'):
            continue
        near = difflib.get_close_matches(name, declared, n=1, cutoff=MISSPELLED)
        if near and name not in elsewhere:
            raise InvalidParameter(
                f"node '{node.get_name()}' has no parameter '{name}'; did you mean '{near[0]}'? Correct the name, or, "
                'if it belongs to another node, give it to that one'
            )
        node.get_logger().warning(f'this has no effect: {unknown_name(name, declared, "parameter")}')
        del node._parameter_overrides[name]  # said once


def _descriptor(item: Parameter, *, read_only: bool) -> ParameterDescriptor:
    unit = f' [{item.unit}]' if item.unit else ''
    descriptor = ParameterDescriptor(
        name=item.name,
        type=TYPES[item.type].value,
        description=f'{item.description}{unit}',
        additional_constraints=item.range_text if item.choices else '',
        dynamic_typing=False,
        read_only=read_only,
    )
    if item.low is None and item.high is None:
        return descriptor
    low = item.low if item.low is not None else -UNBOUNDED
    high = item.high if item.high is not None else UNBOUNDED
    if item.type is int:
        limits = IntegerRange(from_value=int(max(low, -(2**62))), to_value=int(min(high, 2**62)))
        descriptor.integer_range = [limits]
    elif item.type is float or typing.get_origin(item.type) is None:
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(low), to_value=float(high))]
    return descriptor


# --------------------
# Quality of service of every topic of the suite, as `texture_core.types` states it.


def quality_of_service(topic: str) -> QoSProfile:
    """Return the profile of a topic of the suite."""
    quality = QUALITIES[topic]
    return QoSProfile(
        depth=quality.depth,
        reliability=ReliabilityPolicy.RELIABLE if quality.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if quality.latched else DurabilityPolicy.VOLATILE,
    )


SENSOR_QOS, FEATURE_QOS = quality_of_service('signal'), quality_of_service('features')
ESTIMATE_QOS, STATE_QOS = quality_of_service('texture'), quality_of_service('exploration')


# --------------------
# Run a node until a signal stops it, and release all its resources.

try:  # from rclpy 7.1.4 on; half the computing time per message
    from rclpy.experimental import EventsExecutor as OneThread
except ImportError:
    OneThread = SingleThreadedExecutor

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
ANSWERING_S = 2.0  # the longest that callbacks may take to answer once the node is shut down


def run(
    make_node: Callable[[], Any],
    args: Sequence[str] | None = None,
    make_executor: Callable[[], Executor] = OneThread,
    on_stop: Callable[[], None] = lambda: None,
) -> None:
    """Make the node, spin it until a signal ends it, destroy it; exit with 2 and one sentence on a user's error.

    The node's `shutdown` method, if it has one, is called before it is destroyed, while it can still publish: it joins
    threads and closes devices. A node that shuts ROS down because of a user's error keeps that as `error`.

    Parameters
    ----------
    make_node
        Makes the node when ROS is initialised.
    args
        Arguments of the command line; None for those of the process.
    make_executor
        Makes the executor that spins it.
    on_stop
        Called in the signal's handler, also while the node is still being made: a wait for a device ends then.
    """
    _SOURCES[:] = [pair for pair in pairwise(sys.argv if args is None else args) if pair[0] in SOURCES]
    stopped = threading.Event()

    def stop(_number: int, _frame: Any) -> None:
        stopped.set()
        on_stop()

    for number in STOP_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN or number != signal.SIGHUP:  # as nohup wants it
            signal.signal(number, stop)
    node = executor = None
    try:
        for option, text in _SOURCES:
            if option == '--params-file':
                check_parameter_file(Path(text))
        ros_domain()
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
        check_names(node)
        executor = make_executor()
        executor.add_node(node)
        _wake_on_signals(executor)
        with contextlib.suppress(ExternalShutdownException):
            while rclpy.ok() and not stopped.is_set():
                executor.spin_once(timeout_sec=1.0)
        if (error := getattr(node, 'error', None)) is not None:
            raise error
    except ExternalShutdownException:
        pass
    except TextureError as error:
        print(f'texture: {error}', file=sys.stderr)
        sys.exit(2)
    finally:
        if node is not None:
            getattr(node, 'shutdown', lambda: None)()
            if executor is not None:
                executor.shutdown(ANSWERING_S)  # a client that waits for an answer still gets it
            node.destroy_node()
        rclpy.try_shutdown()
        _SOURCES.clear()
        for number in STOP_SIGNALS:  # another one must not interrupt the shutdown
            signal.signal(number, signal.SIG_IGN)


def _wake_on_signals(executor: Executor) -> None:
    """Let a signal end the executor's wait at once: Python runs its handlers only after it."""
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)

    def wait() -> None:
        while reader.recv(1):
            executor.wake()

    # Both ends exist as long as the process; the thread keeps no node alive.
    threading.Thread(target=wait, daemon=True, name='signals').start()
    _KEPT.append(writer)


_KEPT: list[socket.socket] = []


# --------------------
# Run a node inside a command, like a separately started one.


def run_node(make_node: Callable[[], Any], parameters: Mapping[str, Any], namespace: str = '') -> None:
    """Run a node with parameters until it ends or is stopped.

    A user's error ends the program with exit code 2 and one sentence, as for any node.
    """
    rules = [f'{name}:={json.dumps(value)}' for name, value in parameters.items()]  # JSON is YAML, strings quoted
    options = [part for rule in rules for part in ('-p', rule)]
    if namespace:
        options += ['-r', f'__ns:=/{namespace.strip("/")}']
    run(make_node, ['--ros-args', *options])


# --------------------
# ROS times as whole nanoseconds.


def to_ns(stamp: Time) -> int:
    """Return a message stamp as nanoseconds."""
    return stamp.sec * NANOSECONDS + stamp.nanosec


def to_stamp(time_ns: int) -> Time:
    """Return nanoseconds as a message stamp."""
    seconds, nanoseconds = divmod(int(time_ns), NANOSECONDS)
    return Time(sec=seconds, nanosec=nanoseconds)


# --------------------
# Data classes of texture_core to messages of rclpy and back, see `MessageCodec`.


def _numbers(code: str, values: AnyArray) -> array.array[float]:
    """Return numbers of type 'd' or 'f' as an array.array, which rclpy takes as it is; a list it checks one by one."""
    return array.array(code, np.ascontiguousarray(values, dtype=code).tobytes())


OF_MESSAGES = {getattr(msg, cls.__name__): cls for cls in DATA_CLASSES}
KINDS = {
    'std_msgs/msg/Header': Header,
    'builtin_interfaces/msg/Time': Time,
    'builtin_interfaces/msg/Duration': DurationMessage,
    'geometry_msgs/msg/Point': Point,
    **{f'texture_msgs/msg/{kind.__name__}': kind for kind in OF_MESSAGES},
}
CODEC = MessageCodec(
    KINDS.__getitem__,
    {
        tuple[float, ...]: (partial(array.array, 'd'), tuple),
        Array: (partial(_numbers, 'd'), partial(np.array, dtype=np.float64)),
        NDArray[np.float32]: (partial(_numbers, 'f'), partial(np.array, dtype=np.float32)),
    },
)


def to_msg(value: Any) -> Any:
    """Return the message of a data class of texture_core; InvalidData if a time in s is more than it can hold."""
    return CODEC.to_message(value)


def from_msg(message: Any) -> Any:
    """Return the data class of a message of texture_msgs; InvalidData if the message is inconsistent."""
    return CODEC.from_message(message, OF_MESSAGES[type(message)])


# --------------------
# An executor for nodes with callbacks that wait long, such as a service that answers after the motion.

ANSWER_POLL_S = 0.02


class WaitingExecutor(SingleThreadedExecutor):
    """Run callbacks one after the other, but each of a ReentrantCallbackGroup in a separate thread.

    Goals of action servers also run in separate threads. rclpy's MultiThreadedExecutor would do, but in Jazzy it
    does not sleep while a callback waits for a thread (ros2/rclpy #1547): with 100 messages of a sensor a second it
    takes 80 % of a core and starves the other threads of the process, such as the one that moves the arm.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._aside: list[Any] = []  # tasks in separate threads

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Send the answers of waiting callbacks, for `timeout_sec` at most, and start no further callback.

        The result of an action is sent by a callback that follows the one of the goal; rclpy's executor drops it.
        """
        deadline_s = time.monotonic() + (timeout_sec or 0.0)
        while self._unanswered() and time.monotonic() < deadline_s:
            self.spin_once(timeout_sec=ANSWER_POLL_S)
        return super().shutdown(timeout_sec)

    def _unanswered(self) -> bool:
        with self._tasks_lock:
            return self._context.ok() and any(not task.done() for task, _entity, _node in self._tasks)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Start one callback; raise the error of a callback."""
        with contextlib.suppress(TimeoutException, ShutdownException, ExternalShutdownException):
            task, entity, _node = self.wait_for_ready_callbacks(timeout_sec)
            if entity is not None and not isinstance(entity.callback_group, ReentrantCallbackGroup):
                task()
                task.result()
            elif task not in self._aside:
                self._aside.append(task)
                threading.Thread(target=task, name='waiting callback').start()
        for task in [task for task in self._aside if task.done()]:
            self._aside.remove(task)
            task.result()
