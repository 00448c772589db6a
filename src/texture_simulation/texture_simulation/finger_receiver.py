"""Receive finger states from emulated arms: datagrams on loopback."""

from __future__ import annotations

import socket

from texture_core.errors import DeviceError
from texture_core.finger_state import LOOPBACK, FingerState


class FingerStateReceiver:
    """A bound UDP socket, read without waiting; port 0 takes any free one.

    Raises
    ------
    DeviceError
        If the port is taken.
    """

    def __init__(self, port: int) -> None:
        self.received = 0
        self.refused = 0  # datagrams that are no finger state
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((LOOPBACK, port))
        except OSError as error:
            self._socket.close()
            raise DeviceError(
                f'UDP port {port} for the finger cannot be opened: {error}; choose another, or end what has it'
            ) from error

    @property
    def port(self) -> int:
        """The port in use."""
        return int(self._socket.getsockname()[1])

    def states(self) -> list[FingerState]:
        """Return what has come since the last call."""
        states = []
        while (data := self._receive()) is not None:
            state = FingerState.from_bytes(data)
            self.received += 1
            self.refused += state is None
            if state is not None:
                states.append(state)
        return states

    def _receive(self) -> bytes | None:
        try:
            return self._socket.recv(256)
        except BlockingIOError:
            return None

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()
