"""Run a node until it is told to stop, and leave nothing behind."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from texture_core.errors import TextureError


def run(make_node: Callable[[], Any], args: Sequence[str] | None = None, threads: int = 1) -> None:
    """Make the node, spin it until SIGINT or SIGTERM, destroy it; exit with 2 and one sentence on a user's error.

    The node's `shutdown` method, if it has one, is called before it is destroyed: it joins threads and closes devices.
    """
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    stopped = []

    def stop(number: int, _frame: object) -> None:
        stopped.append(number)
        rclpy.try_shutdown()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    node = None
    try:
        node = make_node()
        executor = SingleThreadedExecutor() if threads == 1 else MultiThreadedExecutor(num_threads=threads)
        executor.add_node(node)
        while rclpy.ok():
            executor.spin_once(timeout_sec=1.0)
    except ExternalShutdownException:
        pass
    except TextureError as error:
        print(f'{getattr(make_node, "__name__", "node")}: {error}', file=sys.stderr)
        sys.exit(2)
    finally:
        if node is not None:
            getattr(node, 'shutdown', lambda: None)()
            node.destroy_node()
        rclpy.try_shutdown()
