"""Messages between the arm and its worker process: datagrams on a socket pair, one message each."""

from __future__ import annotations

import math
import struct
from dataclasses import astuple, dataclass

from texture_exploration.arms.protocol import Vector

COMMAND, STOP, RECOVER, REPORT, FAILURE = (bytes([number]) for number in range(1, 6))
COMMAND_FORMAT = struct.Struct('<q4d')
REPORT_FORMAT = struct.Struct('<q10di4?5I')
LARGEST = 4096


@dataclass(frozen=True)
class UrCommand:
    """Command to the arm in the base frame: a velocity, (3,), and perhaps a force that presses on the surface.

    `time_ns` is when it was commanded, of CLOCK_MONOTONIC: a wish that waited for the worker is old.
    """

    time_ns: int
    velocity_m_s: Vector
    force_n: float | None

    def to_bytes(self) -> bytes:
        """Return the message."""
        force = math.nan if self.force_n is None else self.force_n
        return COMMAND + COMMAND_FORMAT.pack(self.time_ns, *self.velocity_m_s, force)

    @classmethod
    def from_bytes(cls, data: bytes) -> UrCommand:
        """Return what a message says."""
        time_ns, vx, vy, vz, force = COMMAND_FORMAT.unpack(data[1:])
        return cls(time_ns, (vx, vy, vz), None if math.isnan(force) else force)


@dataclass(frozen=True)
class Counts:
    """What was counted since the arm was connected.

    `late`: gaps of more than 20 ms in what the controller sends. `refused`: commands that it did not take. `zeroed`:
    how often the force sensor was zeroed. `slow_acknowledgements`: commands that took longer than the watchdog waits
    while the arm moves; `slowest_acknowledgement_ms`: the longest that any took.
    """

    late: int = 0
    refused: int = 0
    zeroed: int = 0
    slow_acknowledgements: int = 0
    slowest_acknowledgement_ms: int = 0


@dataclass(frozen=True)
class UrReport:
    """What the controller measured last, in the base frame, and how it is.

    `time_ns` is when it arrived, of CLOCK_MONOTONIC. `force_n` is the force of the surroundings on the tool. `unsteady`
    says that the force sensor could not be zeroed, because the force changed all the while the finger rose; `zeroed`,
    that it was, since the arm was connected or recovered. `watchdog_s` is how long the controller's watchdog waits.
    """

    time_ns: int
    position_m: Vector
    velocity_m_s: Vector
    force_n: Vector
    watchdog_s: float
    safety_mode: int
    playing: bool
    silent: bool
    unsteady: bool
    zeroed: bool
    counts: Counts

    def to_bytes(self) -> bytes:
        """Return the message."""
        vectors = (*self.position_m, *self.velocity_m_s, *self.force_n, self.watchdog_s)
        status = (self.safety_mode, self.playing, self.silent, self.unsteady, self.zeroed, *astuple(self.counts))
        return REPORT + REPORT_FORMAT.pack(self.time_ns, *vectors, *status)

    @classmethod
    def from_bytes(cls, data: bytes) -> UrReport:
        """Return what a message says."""
        numbers = REPORT_FORMAT.unpack(data[1:])
        position, velocity, force = numbers[1:4], numbers[4:7], numbers[7:10]
        watchdog_s, safety_mode, playing, silent, unsteady, zeroed = numbers[10:16]
        status = (safety_mode, playing, silent, unsteady, zeroed, Counts(*numbers[16:]))
        return cls(numbers[0], position, velocity, force, watchdog_s, *status)


def failure_message(text: str) -> bytes:
    """Return the message that the worker gives up, and why."""
    return FAILURE + text.encode()[: LARGEST - 1]
