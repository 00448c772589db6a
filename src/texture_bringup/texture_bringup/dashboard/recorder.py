"""The recordings that the page asks for: each a process of its own, one at a time."""

from __future__ import annotations

import os
from pathlib import Path

from texture_core.errors import InvalidParameter, LaunchFailed
from texture_launch.child import ChildLauncher


class Recorder:
    """Begins and ends recordings.

    Parameters
    ----------
    folder
        Where the bags go; made if missing.
    namespace
        Of what is recorded.
    """

    def __init__(self, folder: Path, namespace: str) -> None:
        self.bag = ''  # that is being recorded
        self.fault = ''  # with which the last recording ended
        self._folder = folder
        self._namespace = namespace.strip('/')
        self._child: ChildLauncher | None = None

    def begin(self, name: str) -> str:
        """Begin a recording of this name; return what is to be said.

        Raises
        ------
        InvalidParameter
            If one is going on already, or the folder cannot be written.
        """
        if self._child is not None:
            raise InvalidParameter(f"'{self.bag}' is being recorded already; end that first")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            arguments = {'out': self._folder / name, 'namespace': self._namespace}
            self._child = ChildLauncher('record', arguments, os.environ, self._folder / f'{name}.log').__enter__()
        except OSError as error:
            raise InvalidParameter(f"nothing can be recorded in '{self._folder}': {error.strerror}") from error
        self.fault = ''
        self.bag = str(self._folder / name)
        return f"recording to '{self.bag}'"

    def end(self) -> str:
        """Complete the recording, if there is one; return what is to be said."""
        child, self._child = self._child, None
        if child is None:
            return 'nothing is being recorded'
        child.stop()
        bag, self.bag = self.bag, ''
        return f"'{bag}' is complete"

    def watch(self) -> None:
        """Take note of a recording that ended by itself."""
        child = self._child
        if child is None:
            return
        try:
            child.check()
        except LaunchFailed as error:
            self._child, self.bag, self.fault = None, '', str(error)
