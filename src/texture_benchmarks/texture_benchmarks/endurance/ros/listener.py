"""A node that takes messages in a thread of its own."""

from __future__ import annotations

import contextlib
import threading
from types import TracebackType
from typing import Any, TypeVar

from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

Own = TypeVar('Own', bound='Listener')


class Listener:
    """Hold a node that spins from `with` to the end of the block.

    Parameters
    ----------
    name
        Name of the node.
    domain_id
        ROS domain.
    **options
        Further arguments of the node.
    """

    def __init__(self, name: str, domain_id: int, **options: Any) -> None:
        self._context = Context()
        self._context.init(domain_id=domain_id)
        self.node = Node(name, context=self._context, **options)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name=name, daemon=True)

    def __enter__(self: Own) -> Own:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._context.try_shutdown()
        self._thread.join()
        self.node.destroy_node()

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()
