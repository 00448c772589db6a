"""Nodes of the suite as processes of their own: start, watch the computing time, stop."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from texture_core.errors import DeviceError

ENDS_WITHIN_S = 20.0
TICKS_PER_S = os.sysconf('SC_CLK_TCK')


def executable(package: str, node: str) -> Path:
    """Return the executable of a node in the first installation that has it.

    Raises
    ------
    DeviceError
        If none has.
    """
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    for prefix in filter(None, prefixes):
        path = Path(prefix) / 'lib' / package / node
        if path.is_file():
            return path
    raise DeviceError(f"no executable '{node}' of '{package}' is installed; build and source the workspace")


@contextmanager
def killed_on_error(process: subprocess.Popen[Any]) -> Iterator[None]:
    """Kill a process when the block fails, because `Popen` would wait for its end for ever.

    Parameters
    ----------
    process
        Which the block starts or watches.

    Raises
    ------
    BaseException
        What the block raised.
    """
    try:
        yield
    except BaseException:
        process.kill()
        raise


class NodeProcess:
    """A node in its own process, from `with` to the end of the block.

    Parameters
    ----------
    package, node
        Which executable.
    parameters
        ROS parameters; texts, numbers and booleans.
    namespace
        Where its relative topics are.
    domain_id
        ROS domain; that of the environment if None.
    program
        Command to run instead of the installed executable.
    """

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
        # A file and not a pipe: a node that says much must not wait for a reader.
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
        """The process, once started.

        Raises
        ------
        RuntimeError
            If it has not been started.
        """
        if self._process is None:
            raise RuntimeError(f'{self.name} has not been started: use it in a with block')
        return self._process

    @property
    def output(self) -> str:
        """What the node has said so far."""
        return self._log.read_text(encoding='utf-8', errors='replace')

    def wait(self, timeout_s: float) -> int:
        """Return the exit code of a node that ends by itself."""
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
