"""What the arm and its worker process say to each other: datagrams on a socket pair, one message each."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

WISH, STOP, RECOVER, REPORT, TROUBLE = (bytes([number]) for number in range(1, 6))
WISH_FORMAT = struct.Struct('<4d?')
REPORT_FORMAT = struct.Struct('<q9di2?2I')
LARGEST = 4096


@dataclass(frozen=True)
class Wish:
    """What the arm shall do, in the base frame: a velocity, (3,), and perhaps a force that presses on the surface.

    `zero_first` allows to zero the force sensor if the arm is at rest.
    """

    velocity_m_s: tuple[float, float, float]
    force_n: float | None
    zero_first: bool

    def to_bytes(self) -> bytes:
        """Return the message."""
        force = math.nan if self.force_n is None else self.force_n
        return WISH + WISH_FORMAT.pack(*self.velocity_m_s, force, self.zero_first)

    @classmethod
    def from_bytes(cls, data: bytes) -> Wish:
        """Return what a message says."""
        vx, vy, vz, force, zero_first = WISH_FORMAT.unpack(data[1:])
        return cls((vx, vy, vz), None if math.isnan(force) else force, zero_first)


@dataclass(frozen=True)
class Report:
    """What the controller measured last, in the base frame, and how it is.

    `time_ns` is when it arrived, of CLOCK_MONOTONIC. `force_n` is the force of the surroundings on the tool. `late`
    counts gaps of more than 20 ms in what it sends, `refused` the commands that it did not take.
    """

    time_ns: int
    position_m: tuple[float, ...]
    velocity_m_s: tuple[float, ...]
    force_n: tuple[float, ...]
    safety_mode: int
    playing: bool
    silent: bool
    late: int
    refused: int

    def to_bytes(self) -> bytes:
        """Return the message."""
        vectors = (*self.position_m, *self.velocity_m_s, *self.force_n)
        status = (self.safety_mode, self.playing, self.silent, self.late, self.refused)
        return REPORT + REPORT_FORMAT.pack(self.time_ns, *vectors, *status)

    @classmethod
    def from_bytes(cls, data: bytes) -> Report:
        """Return what a message says."""
        time_ns, *numbers = REPORT_FORMAT.unpack(data[1:])
        return cls(time_ns, tuple(numbers[0:3]), tuple(numbers[3:6]), tuple(numbers[6:9]), *numbers[9:])


def trouble(text: str) -> bytes:
    """Return the message that the worker gives up, and why."""
    return TROUBLE + text.encode()[: LARGEST - 1]
