"""What every hand can do: hold with some fingers, and move others as arms move theirs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from texture_exploration.arms.protocol import ArmCommand, Vector


@dataclass(frozen=True)
class Fingertip:
    """Position, velocity and force of one fingertip, in the frame of its own patch of the object; see `ArmState`."""

    position: Vector
    velocity: Vector
    force_n: float


@dataclass(frozen=True)
class HandState:
    """All fingertips at one time of CLOCK_MONOTONIC; `fault` says why the hand cannot move, '' if it can."""

    time_ns: int
    fingers: Mapping[str, Fingertip]
    fault: str = ''


@dataclass(frozen=True)
class FingerSet:
    """Which fingers hold the object, and which slide on it."""

    hold: tuple[str, ...]
    slide: tuple[str, ...]


class Hand(Protocol):
    """A hand. Any method but `close` raises DeviceError if it cannot be reached."""

    finger_sets: Mapping[str, FingerSet]

    def connect(self) -> None:
        """Reach the hand and clear its faults; may be called again after `close`."""

    def close(self) -> None:
        """Let everything go; never raises, may be called twice."""

    def state(self) -> HandState:
        """Return the newest state at once."""

    def grip(self, forces_n: Mapping[str, float]) -> None:
        """Let fingers press with these forces from now on, whatever else is commanded; CommandRefused as `command`."""

    def command(self, fingers: Sequence[str], command: ArmCommand) -> None:
        """Let fingers follow a command; it holds for a fraction of a second. CommandRefused if it exceeds limits."""

    def warning(self) -> str:
        """Return in a sentence what is not as it should be although the hand moves, '' if nothing."""


@runtime_checkable
class RebootableHand(Protocol):
    """A hand whose motors latch errors until they are rebooted."""

    def reboot(self) -> str:
        """Let go, reboot what reports an error, stay unconnected; return in words what was done."""
