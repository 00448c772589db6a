# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bring the nodes of a robot up in order: wait for those that compute, then activate the one that moves."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from texture_bringup.operator import Operator
from texture_core.config import param
from texture_core.errors import DeviceError, LaunchFailed
from texture_core.ros import declare, run

LIFECYCLE = ('sensor', 'explorer')  # which of the nodes are configured and activated
STOPPED = threading.Event()  # this process was asked to end


@dataclass(frozen=True)
class BringUpParams:
    """Parameters of the node that waits for all others in order."""

    nodes: str = param(
        'sensor feature_extractor classifier explorer',
        'Nodes, separated by spaces, in the order in which they are waited for.',
    )
    timeout_s: float = param(
        60.0, 'How long each node may take to appear and to answer.', unit='s', low=0.1, high=3600.0
    )


class BringUp(Node):
    """Go through the nodes one after the other, in its constructor."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('bring_up', **kwargs)
        params = declare(self, BringUpParams)
        names = params.nodes.split()
        with Operator(self.get_namespace(), guard=_end_when_stopped) as operator:
            for place, name in enumerate(names, start=1):
                try:
                    operator.wait_for_node(name, params.timeout_s)
                    state = operator.set_active(name, True) if name in LIFECYCLE else 'there'
                except LaunchFailed as error:
                    later = f'; not activated or not reached: {", ".join(names[place:])}' if names[place:] else ''
                    raise DeviceError(f'{error}{later}') from error
                self.get_logger().info(f"'{name}' is {state}")
        self.get_logger().info(f'all nodes are up: {params.nodes}')


def _end_when_stopped() -> None:
    if STOPPED.is_set():
        raise ExternalShutdownException


def main() -> None:
    """Run the node until all others are up."""

    def bring_up() -> BringUp:
        node = BringUp()
        node.create_timer(0.0, rclpy.try_shutdown)
        return node

    run(bring_up, on_stop=STOPPED.set)
