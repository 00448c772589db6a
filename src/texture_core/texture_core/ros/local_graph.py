"""A ROS graph on this machine alone, for a test: nodes in one thread, waits on conditions, nothing left behind."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, TypeVar
from unittest import mock

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

NodeT = TypeVar('NodeT')
POLL_S = 0.05


class LocalGraph:
    """Nodes under test and a `peer` that plays the others, from `with` to the end of the block.

    Parameters
    ----------
    domain_id
        ROS domain, which no other test may use.
    deadline_s
        For each wait; generous, as a busy machine is slow.
    """

    def __init__(self, domain_id: int, deadline_s: float = 30.0) -> None:
        self._environment = {'ROS_DOMAIN_ID': str(domain_id), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
        self._deadline_s = deadline_s

    def __enter__(self) -> LocalGraph:
        with ExitStack() as stack:
            stack.enter_context(mock.patch.dict(os.environ, self._environment))
            rclpy.init()
            stack.callback(rclpy.try_shutdown)
            self._executor = SingleThreadedExecutor()
            self._closing = stack.pop_all()
        self.peer = self._spun(rclpy.create_node('peer'))
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._closing.close()

    def add(self, kind: Callable[..., NodeT], **parameters: Any) -> NodeT:
        """Return a new node with these parameters."""
        given = [Parameter(name, value=value) for name, value in parameters.items()]
        return self._spun(kind(parameter_overrides=given))

    def listen(self, kind: type, topic: str, qos: Any = 10) -> list[Any]:
        """Return the list to which the messages of a topic will be added.

        Parameters
        ----------
        kind
            Type of the messages.
        topic
            Name of the topic.
        qos
            Quality of service, or the depth of the queue.

        Returns
        -------
        list
            Grows while the graph spins.
        """
        received: list[Any] = []
        self.peer.create_subscription(kind, topic, received.append, qos)
        return received

    def spin_once(self, timeout_s: float = POLL_S) -> None:
        """Let one thing happen."""
        self._executor.spin_once(timeout_sec=timeout_s)

    def until(self, condition: Callable[[], Any]) -> None:
        """Let things happen until the condition holds.

        Raises
        ------
        TimeoutError
            If the condition does not hold within the deadline.
        """
        deadline = time.monotonic() + self._deadline_s
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError(f'not within {self._deadline_s:g} s')
            self.spin_once()

    def _spun(self, node: Any) -> Any:
        self._executor.add_node(node)
        self._closing.callback(node.destroy_node)
        self._closing.callback(getattr(node, 'shutdown', lambda: None))
        return node
