"""What the demonstration says while it runs, for a reader who sees the suite for the first time."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TextIO

MARGIN = ' ' * 8


class ProgressLog:
    """Tell what happens, each chapter with the time since the start; in a `with` block no line is left open.

    Parameters
    ----------
    clock
        Seconds, from any start.
    out
        Where to.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic, out: TextIO = sys.stdout) -> None:
        self._clock = clock
        self._out = out
        self._start_s = clock()
        self._line_is_open = False

    def __enter__(self) -> ProgressLog:
        return self

    def __exit__(self, *_: object) -> None:
        if self._line_is_open:
            self._write('\n')

    def section(self, text: str) -> None:
        """Begin something new."""
        self._write(f'\n[{self._clock() - self._start_s:3.0f} s]  {text}\n')

    def line(self, text: str) -> None:
        """Say something within the chapter."""
        self._write(f'{MARGIN}{text}\n')

    def part(self, text: str, *, first: bool = False, last: bool = False) -> None:
        """Say a part of a line, for what takes its time.

        Parameters
        ----------
        text
            What is printed.
        first, last
            Whether it begins a line, and whether it ends one.
        """
        self._write(f'{MARGIN * first}{text}{chr(10) * last}')

    def _write(self, text: str) -> None:
        print(text, end='', file=self._out, flush=True)
        self._line_is_open = not text.endswith('\n')
