"""State of a simulated finger: what emulated arms send to the emulator, over UDP on loopback."""

from __future__ import annotations

import contextlib
import socket
import struct
from dataclasses import astuple, dataclass

FORMAT = struct.Struct('<4sq7d')
MAGIC = b'TTF1'
LOOPBACK = '127.0.0.1'


@dataclass(frozen=True)
class FingerState:
    """Position, velocity and normal force of a fingertip at one time, in the frame of the surface.

    x and y lie in the surface, z points away from it; m, m/s and N. `time_ns` is of CLOCK_MONOTONIC, which all
    processes of one machine share: the receiver extrapolates from it.
    """

    time_ns: int
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    vx_m_s: float = 0.0
    vy_m_s: float = 0.0
    vz_m_s: float = 0.0
    force_n: float = 0.0

    def to_bytes(self) -> bytes:
        """Return the datagram: magic, time, seven doubles, little endian."""
        return FORMAT.pack(MAGIC, *astuple(self))

    @classmethod
    def from_bytes(cls, data: bytes) -> FingerState | None:
        """Return the state in a datagram, or None if it is not one."""
        if len(data) != FORMAT.size or not data.startswith(MAGIC):
            return None
        _, time_ns, *numbers = FORMAT.unpack(data)
        return cls(time_ns, *numbers)


class FingerSender:
    """Sends finger states to the emulator on a UDP port of this machine, which need not listen; port 0: sends none."""

    def __init__(self, port: int) -> None:
        self._address = (LOOPBACK, port)
        self._socket: socket.socket | None = None

    def send(self, state: FingerState) -> None:
        """Send one datagram."""
        if not self._address[1]:
            return
        if self._socket is None:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with contextlib.suppress(OSError):
            self._socket.sendto(state.to_bytes(), self._address)

    def close(self) -> None:
        """Close the socket; the next datagram opens it again."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
