"""The processes of the nodes, as the output of the launcher tells them."""

from __future__ import annotations

import re
from pathlib import Path

STARTED = re.compile(r'\[launch\] (\S+) started \(process (\d+)\)')
ENDED = re.compile(r'\[launch\] (\S+) (?:died with|was killed by|has finished).*')


class Processes:
    """Follow the output of a launcher; use it from one thread.

    Parameters
    ----------
    log
        File with its output.

    Attributes
    ----------
    pids
        Process of each node that runs, by the node's name.
    lives
        All processes there have been, in their order: name and process.
    ends
        What the launcher said about each end.
    """

    def __init__(self, log: Path) -> None:
        self.pids: dict[str, int] = {}
        self.lives: list[tuple[str, int]] = []
        self.ends: list[str] = []
        self._log = log
        self._position = 0
        self._rest = ''

    def update(self) -> dict[str, int]:
        """Read on, and return the process of each node that runs."""
        with self._log.open(encoding='utf-8', errors='replace') as log:
            log.seek(self._position)
            text = self._rest + log.read()
            self._position = log.tell()
        *lines, self._rest = text.split('\n')
        for line in lines:
            self._note(line)
        return self.pids

    def _note(self, line: str) -> None:
        started, ended = STARTED.fullmatch(line), ENDED.fullmatch(line)
        if started:
            self.pids[started[1]] = int(started[2])
            self.lives.append((started[1], int(started[2])))
        elif ended:
            self.pids.pop(ended[1], None)
            self.ends.append(line.removeprefix('[launch] '))
