"""What a process writes, shown line by line."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import IO

CHUNK = 65536


class Output:
    """One stream of a process; `say` receives each line with the label in front."""

    def __init__(self, stream: IO[bytes], label: str, say: Callable[[str], None]) -> None:
        self.stream = stream
        self._label = label
        self._say = say
        self._rest = b''
        os.set_blocking(stream.fileno(), False)

    def read(self) -> bool:
        """Show the lines that have arrived; return whether anything had."""
        try:
            data = os.read(self.stream.fileno(), CHUNK)
        except BlockingIOError:
            return False
        *lines, self._rest = (self._rest + data).split(b'\n')
        self._show(lines)
        return bool(data)

    def close(self) -> None:
        """Show what is left, also of an unfinished line, and close the stream."""
        while self.read():
            pass
        self._show([self._rest] if self._rest else [])
        self.stream.close()

    def _show(self, lines: list[bytes]) -> None:
        for line in lines:
            self._say(f'[{self._label}] {line.decode(errors="replace").rstrip()}')
