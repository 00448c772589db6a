"""A small node inside this process that publishes and listens: for benchmarks and tests of the running graph."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from texture_core.errors import DeviceError
from texture_core.ros.conversions import from_msg
from texture_recordings.ros.topics import TOPICS, Topic

POLL_S = 0.05


class Graph:
    """Take part in a ROS graph from `with` to the end of the block.

    Parameters
    ----------
    domain_id
        ROS domain; that of the environment if None.
    namespace
        Where the topics are.
    """

    def __init__(self, domain_id: int | None = None, namespace: str = '/') -> None:
        self._domain_id = domain_id
        self._namespace = namespace
        self._context = Context()

    def __enter__(self) -> Graph:
        self._context.init(domain_id=self._domain_id)
        self.node = Node('probe', context=self._context, namespace=self._namespace)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def publisher(self, topic: str) -> Any:
        """Return a publisher on a topic of the suite: 'signal', or 'finger1/signal' in a namespace of its own."""
        kind, qos, name = _in_namespace(topic)
        return self.node.create_publisher(kind, name, qos)

    def listen(self, topic: str, received: Callable[[Any], None]) -> None:
        """Call `received` with the data class of each message of a topic, or the message itself of /diagnostics."""
        kind, qos, name = _in_namespace(topic)
        convert = from_msg if kind.__module__.startswith('texture_msgs') else (lambda message: message)
        self.node.create_subscription(kind, name, lambda message: received(convert(message)), qos)

    def wait_until(self, condition: Callable[[], bool], deadline_s: float, what: str) -> None:
        """Take messages until the condition holds.

        Parameters
        ----------
        condition
            Called after each message.
        deadline_s
            Longest time to wait.
        what
            What is waited for, for the sentence of the error.

        Raises
        ------
        DeviceError
            If it does not within the deadline; `what` says what was waited for.
        """
        deadline = time.monotonic() + deadline_s
        while not condition():
            if time.monotonic() > deadline:
                raise DeviceError(f'{what}: nothing of it within {deadline_s:g} s; see what the nodes say')
            self._executor.spin_once(timeout_sec=POLL_S)

    def spin(self, seconds: float) -> None:
        """Take messages for so long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)


def _in_namespace(topic: str) -> Topic:
    namespace, _, short = topic.rpartition('/')
    found = TOPICS[short]
    return found._replace(name=f'{namespace}/{found.name}') if namespace else found
