"""An emulated robot on a serial line as a process of its own, with switches for its faults.

It is run as `python -m MODULE LINK FINGER_PORT`. Each line on its standard input is a command, each answer a line of
JSON, and it ends with its standard input.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from texture_core.errors import DeviceError


class EmulatedRobotProcess:
    """The robot from `with` to the end of the block; `ask` sends a command and returns the answer.

    Parameters
    ----------
    module
        Module that calls `serve`.
    link
        Device path to make.
    finger_port
        UDP port on loopback that receives the finger states.
    """

    def __init__(self, module: str, link: Path, finger_port: int) -> None:
        self.link = link
        self._module = module
        self._command = [sys.executable, '-m', module, str(link), str(finger_port)]
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> EmulatedRobotProcess:
        self._process = subprocess.Popen(self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._answer()
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()

    def ask(self, command: str) -> Any:
        """Send a command and return the answer."""
        assert self._process is not None and self._process.stdin is not None
        self._process.stdin.write(command + '\n')
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> Any:
        assert self._process is not None and self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise DeviceError(f'the process {self._module} ended; its output tells why')
        return json.loads(line)


def serve(actions: Mapping[str, Callable[[str], Any]]) -> None:
    """Say that the robot is there, then answer commands until the standard input ends."""
    print(json.dumps('ready'), flush=True)
    for line in sys.stdin:
        command, _, argument = line.strip().partition(' ')
        print(json.dumps(actions[command](argument)), flush=True)
