"""The port that takes programs in URScript."""

from __future__ import annotations

from texture_simulation.devices.ur.controller import EmulatedController

LONGEST_SCRIPT = 1_000_000
END = b'\nend\n'


class ScriptSession:
    """The conversation with one client, who sends programs and gets no answer."""

    def __init__(self, controller: EmulatedController) -> None:
        self._controller = controller
        self._received = b''

    def greeting(self) -> bytes:
        """Say nothing at the start."""
        return b''

    def receive(self, data: bytes) -> bytes:
        """Start a program once its last line is there."""
        self._received = (self._received + data)[-LONGEST_SCRIPT:]
        if self._received.endswith(END):
            self._controller.upload(self._received.decode('utf-8', 'replace'))
            self._received = b''
        return b''

    def close(self) -> None:
        """Leave nothing behind."""

    def package(self) -> bytes:
        """Say nothing unasked."""
        return b''
