"""Where a simulated finger is: what emulated arms tell the emulated bench, over UDP on loopback."""

from __future__ import annotations

import struct
from dataclasses import astuple, dataclass

FORMAT = struct.Struct('<4sq7d')
MAGIC = b'TTF1'


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
