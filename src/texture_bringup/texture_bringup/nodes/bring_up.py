# SPDX-License-Identifier: Apache-2.0
"""Bring the nodes of a robot up in order: wait for those that compute, then activate the one that moves."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.node import Node
from rclpy.task import Future

from texture_core.config import param
from texture_core.errors import DeviceError
from texture_core.ros import declare, run

POLL_S = 0.1
# What brings a lifecycle node from a state one step nearer to 'active'.
STEPS = {
    'unconfigured': (Transition.TRANSITION_CONFIGURE, 'configured'),
    'inactive': (Transition.TRANSITION_ACTIVATE, 'activated'),
}


@dataclass(frozen=True)
class BringUpParams:
    """Parameters of the node that waits for all others in order."""

    nodes: str = param(
        'sensor feature_extractor classifier explorer',
        'Nodes, separated by spaces, in the order in which they are waited for.',
    )
    lifecycle_nodes: str = param(
        'sensor explorer', 'Which of the nodes are configured and activated, separated by spaces.'
    )
    timeout_s: float = param(
        60.0, 'How long each node may take to appear and to answer.', unit='s', low=0.1, high=3600.0
    )


class BringUp(Node):
    """Go through the nodes one after the other, and end; a node that does not come ends it with its name.

    Raises
    ------
    DeviceError
        If a node is not there or refuses a transition; those behind it are not activated.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('bring_up', **kwargs)
        self._params = declare(self, BringUpParams)
        self._waiting = deque(self._params.nodes.split())
        self._lifecycle = frozenset(self._params.lifecycle_nodes.split())
        self._asked: tuple[Future, Callable[[Any], None]] | None = None
        self._made: dict[str, Any] = {}  # clients by the name of their service
        self._deadline_s = time.monotonic() + self._params.timeout_s
        self.create_timer(POLL_S, self._step)

    def _step(self) -> None:
        """Do what can be done now."""
        if not self._waiting:
            self.get_logger().info(f'all nodes are up: {self._params.nodes}')
            rclpy.try_shutdown()
            return
        if self._asked is not None and self._asked[0].done():
            (future, use), self._asked = self._asked, None
            use(future.result())
        elif time.monotonic() > self._deadline_s:
            raise DeviceError(self._missing())
        elif self._asked is None and self._is_there(self._waiting[0]):
            self._advance(self._waiting[0])

    def _advance(self, name: str) -> None:
        if name in self._lifecycle:
            self._ask(GetState, f'{name}/get_state', GetState.Request(), self._on_state)
        else:
            self._next('is there')

    def _on_state(self, answer: GetState.Response) -> None:
        label = answer.current_state.label
        if label == 'active':
            self._next('is active')
        elif label in STEPS:
            transition, done = STEPS[label]
            request = ChangeState.Request(transition=Transition(id=transition))
            self._ask(
                ChangeState, f'{self._waiting[0]}/change_state', request, lambda answer: self._on_step(answer, done)
            )

    def _on_step(self, answer: ChangeState.Response, done: str) -> None:
        if not answer.success:
            raise DeviceError(f"node '{self._full(self._waiting[0])}' could not be {done}; it says why above")

    def _ask(self, kind: Any, name: str, request: Any, use: Callable[[Any], None]) -> None:
        """Send a request as soon as somebody answers it."""
        client = self._made[name] = self._made.get(name) or self.create_client(kind, name)
        if client.service_is_ready():
            self._asked = client.call_async(request), use

    def _next(self, how: str) -> None:
        self.get_logger().info(f"'{self._full(self._waiting.popleft())}' {how}")
        self._deadline_s = time.monotonic() + self._params.timeout_s

    def _is_there(self, name: str) -> bool:
        found = {f'{namespace.rstrip("/")}/{node}' for node, namespace in self.get_node_names_and_namespaces()}
        return self._full(name) in found

    def _missing(self) -> str:
        name, timeout_s = self._waiting[0], self._params.timeout_s
        later = ', '.join(list(self._waiting)[1:])
        also = f'; not activated or looked for: {later}' if later else ''
        problem = 'does not answer' if self._is_there(name) else 'is not there'
        return f"node '{self._full(name)}' {problem} (waited {timeout_s:g} s); look at its output{also}"

    def _full(self, name: str) -> str:
        return f'{self.get_namespace().rstrip("/")}/{name}'


def main() -> None:
    """Run the node."""
    run(BringUp)
