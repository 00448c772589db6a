"""A launcher as a child of another program, which watches and ends it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from texture_core.errors import LaunchFailed

DEATH = re.compile(r'\[launch\] .* (died with|was killed by) .*')
STOP_DEADLINE_S = 15.0  # the launcher itself kills after 8 s


class ChildLauncher:
    """Run `texture launch FILE …` beside this program; use it in a `with` block.

    Parameters
    ----------
    file
        Path or name of the launch file.
    arguments
        Launch arguments.
    environment
        Environment of the nodes.
    log
        File for everything the nodes say.
    together
        Whether the launch ends when one node dies, even if the launch file would start it again.
    """

    def __init__(
        self,
        file: str,
        arguments: Mapping[str, object],
        environment: Mapping[str, str],
        log: Path,
        *,
        together: bool = True,
    ) -> None:
        self.log = log
        self._options = ['--parent', str(os.getpid()), *['--together'] * together]
        self._given = [f'{name}:={value}' for name, value in arguments.items()]
        self._file = file
        self._environment = environment
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> ChildLauncher:
        command = [sys.executable, '-m', 'texture_launch', *self._options]
        with self.log.open('wb') as log:
            self._process = subprocess.Popen(
                [*command, self._file, *self._given],
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,  # Ctrl-C reaches this program, which then stops the nodes in its own order
            )
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def check(self) -> None:
        """Raise LaunchFailed, with what the log says, if the nodes have ended.

        Raises
        ------
        LaunchFailed
            If they have.
        """
        if self._process is not None and self._process.poll() is not None:
            raise LaunchFailed(f'{self._reason()}; everything the nodes said is in {self.log}')

    def wait(self, deadline_s: float) -> int:
        """Wait until the nodes have ended by themselves; return the exit code of the launcher."""
        assert self._process is not None
        return self._process.wait(deadline_s)

    def stop(self) -> None:
        """Stop the nodes and wait until none is left."""
        if self._process is None:
            return
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(STOP_DEADLINE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()  # its nodes end with it
            self._process.wait()

    def _reason(self) -> str:
        """Return the sentence of the log that names what went wrong: a node that died, else the last line."""
        lines = self.log.read_text(errors='replace').splitlines()
        deaths = [line.removeprefix('[launch] ') for line in lines if DEATH.fullmatch(line)]
        last = lines[-1] if lines else 'the launcher ended without a word'
        return f'node {deaths[0]}' if deaths else last
