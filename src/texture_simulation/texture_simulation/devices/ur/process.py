"""The emulated controller as a process of its own, for demonstrations and tests.

It cannot run in the process of its client: the constructors of ur-rtde hold Python's global lock until they are
answered.
"""

from __future__ import annotations

import dataclasses
import os
import selectors
import signal
import socket
import subprocess
import sys

from texture_core.errors import DeviceError
from texture_simulation.devices.ur.params import UrControllerParams
from texture_simulation.devices.ur.tables import DASHBOARD_PORT

START_S = 20.0
ANSWER_S = 10.0


class ControllerProcess:
    """Runs from `start` to `stop`, or as a context."""

    def __init__(self, params: UrControllerParams) -> None:
        self.params = params
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> ControllerProcess:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self) -> None:
        """Return when its ports are open.

        Raises
        ------
        DeviceError
            If they cannot be opened.
        """
        options = [f'--{name.replace("_", "-")}={value}' for name, value in dataclasses.asdict(self.params).items()]
        command = [sys.executable, '-m', 'texture_simulation.devices.ur', *options]
        self._process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        if not self._ready(self._process):
            self._process.kill()
            _, stderr = self._process.communicate()
            raise DeviceError(stderr.strip() or 'the emulated UR controller did not start')

    @property
    def running(self) -> bool:
        """Whether it is there."""
        return self._process is not None and self._process.poll() is None

    @property
    def pid(self) -> int:
        """Number of the process."""
        assert self._process is not None
        return self._process.pid

    def freeze(self) -> None:
        """Let it hang."""
        os.kill(self.pid, signal.SIGSTOP)

    def resume(self) -> None:
        """Let it go on."""
        os.kill(self.pid, signal.SIGCONT)

    def stop(self) -> None:
        """Kill it; may be called twice."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def ask(self, line: str) -> str:
        """Return the answer of its dashboard."""
        with socket.create_connection((self.params.ip, DASHBOARD_PORT), ANSWER_S) as connection:
            lines = connection.makefile('rw', encoding='utf-8')
            lines.readline()  # the banner
            lines.write(line + '\n')
            lines.flush()
            return lines.readline().strip()

    @staticmethod
    def _ready(process: subprocess.Popen[str]) -> bool:
        assert process.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            return bool(selector.select(START_S)) and process.stdout.readline() == 'ready\n'
