# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Start nodes as processes, and a separate ROS graph for a test."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeVar
from unittest import mock

import rclpy
from rclpy.parameter import Parameter

from texture_core.config import executable
from texture_core.ros import WaitingExecutor

# --------------------
# Nodes of the suite as processes: start, measure the computing time, stop.

ENDS_WITHIN_S = 20.0
TICKS_PER_S = os.sysconf('SC_CLK_TCK')


@contextmanager
def killed_on_error(process: subprocess.Popen[Any]) -> Iterator[None]:
    """Kill a process when the block fails, because `Popen` would wait for its end for ever."""
    try:
        yield
    except BaseException:
        process.kill()
        raise


class NodeProcess:
    """A node in a separate process, from `with` to the end of the block."""

    def __init__(
        self,
        package: str,
        node: str,
        parameters: Mapping[str, Any] | None = None,
        *,
        namespace: str = '/',
        domain_id: int | None = None,
        program: Sequence[str] = (),
    ) -> None:
        self.name = node
        given = [part for name, value in (parameters or {}).items() for part in ('-p', f'{name}:={json.dumps(value)}')]
        self._command = [
            *(program or [str(executable(package, node))]),
            '--ros-args',
            '-r',
            f'__ns:={namespace}',
            *given,
        ]
        domain = {} if domain_id is None else {'ROS_DOMAIN_ID': str(domain_id)}
        self._environment = {**os.environ, 'PYTHONUNBUFFERED': '1', **domain}
        self._process: subprocess.Popen[bytes] | None = None
        # A file and not a pipe: a node with much output must not wait for a reader.
        self._folder = tempfile.TemporaryDirectory(prefix=f'{node}_')
        self._log = Path(self._folder.name) / 'output'

    def __enter__(self) -> NodeProcess:
        with self._log.open('wb') as log:
            self._process = subprocess.Popen(self._command, env=self._environment, stdout=log, stderr=subprocess.STDOUT)
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def process(self) -> subprocess.Popen[bytes]:
        """The process, once started."""
        if self._process is None:
            raise RuntimeError(f'{self.name} has not been started: use it in a with block')
        return self._process

    @property
    def output(self) -> str:
        """The output of the node so far."""
        return self._log.read_text(encoding='utf-8', errors='replace')

    def wait(self, timeout_s: float) -> int:
        """Wait for the end of a node; return its exit code."""
        return self.process.wait(timeout_s)

    def stop(self, number: int = signal.SIGINT) -> int:
        """End the node as Ctrl-C does, or harder if that does not help; return its exit code."""
        if self.process.poll() is None:
            self.process.send_signal(number)
            try:
                self.wait(ENDS_WITHIN_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
        return self.process.wait()

    def cpu_s(self) -> float:
        """Return the computing time used so far, user and system, s."""
        # The name of the command, in parentheses, may hold blanks: the fields are counted from behind it.
        fields = Path(f'/proc/{self.process.pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()
        return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


# --------------------
# A ROS graph on this machine alone, for a test: nodes in one thread, waits on conditions, complete clean-up.

NodeT = TypeVar('NodeT')
POLL_S = 0.05


class LocalGraph:
    """Nodes under test and a `peer` in place of all others, from `with` to the end of the block."""

    def __init__(self, domain_id: int, deadline_s: float = 30.0) -> None:
        self._environment = {'ROS_DOMAIN_ID': str(domain_id), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
        self._deadline_s = deadline_s

    def __enter__(self) -> LocalGraph:
        with ExitStack() as stack:
            stack.enter_context(mock.patch.dict(os.environ, self._environment))
            rclpy.init()
            stack.callback(rclpy.try_shutdown)
            self._executor = WaitingExecutor()
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
        """Return the list to which the messages of a topic will be added."""
        received: list[Any] = []
        self.peer.create_subscription(kind, topic, received.append, qos)
        return received

    def spin_once(self, timeout_s: float = POLL_S) -> None:
        """Execute one callback."""
        self._executor.spin_once(timeout_sec=timeout_s)

    def until(self, condition: Callable[[], Any]) -> None:
        """Execute callbacks until the condition holds."""
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


def filled(message: Any, values: Mapping[str, Any]) -> Any:
    """Return a message with the values of a mapping, as the command line gives them; rclpy checks names and types."""
    for name, value in values.items():
        setattr(message, name, filled(getattr(message, name), value) if isinstance(value, dict) else value)
    return message
