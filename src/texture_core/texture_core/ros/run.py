"""Run a node until a signal stops it, and release all its resources."""

from __future__ import annotations

import signal
import socket
import sys
import threading
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from texture_core.errors import TextureError
from texture_core.ros.parameters import warn_of_unknown

try:  # from rclpy 7.1.4 on; half the computing time per message
    from rclpy.experimental import EventsExecutor as OneThread
except ImportError:
    OneThread = SingleThreadedExecutor

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
ANSWERING_S = 2.0  # the longest that callbacks may take to answer once the node is shut down


def run(
    make_node: Callable[[], Any], args: Sequence[str] | None = None, make_executor: Callable[[], Executor] = OneThread
) -> None:
    """Make the node, spin it until a signal ends it, destroy it; exit with 2 and one sentence on a user's error.

    The node's `shutdown` method, if it has one, is called before it is destroyed, while it can still publish: it joins
    threads and closes devices.

    Parameters
    ----------
    make_node
        Makes the node when ROS is initialised.
    args
        Arguments of the command line; None for those of the process.
    make_executor
        Makes the executor that spins it.
    """
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    stopped = threading.Event()
    for number in STOP_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN or number != signal.SIGHUP:  # as nohup wants it
            signal.signal(number, lambda _number, _frame: stopped.set())
    node = executor = None
    try:
        node = make_node()
        warn_of_unknown(node)
        executor = make_executor()
        executor.add_node(node)
        _wake_on_signals(executor)
        while rclpy.ok() and not stopped.is_set():
            executor.spin_once(timeout_sec=1.0)
    except ExternalShutdownException:
        pass
    except TextureError as error:
        print(f'{getattr(make_node, "__name__", "node")}: {error}', file=sys.stderr)
        sys.exit(2)
    finally:
        if node is not None:
            getattr(node, 'shutdown', lambda: None)()
            if executor is not None:
                executor.shutdown(ANSWERING_S)  # who waited for an answer still gets it
            node.destroy_node()
        rclpy.try_shutdown()


def _wake_on_signals(executor: Executor) -> None:
    """Let a signal end the executor's wait at once: Python's own handlers run only after it."""
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)

    def wait() -> None:
        while reader.recv(1):
            executor.wake()

    # Both ends live as long as the process; the thread keeps no node alive.
    threading.Thread(target=wait, daemon=True, name='signals').start()
    _KEPT.append(writer)


_KEPT: list[socket.socket] = []
