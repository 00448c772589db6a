"""Sample frames of one finger, one a millisecond, from packets that may hold any of its measurements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from texture_drivers.tsf85 import tables
from texture_drivers.tsf85.protocol import Packet

MOTION_HOLD = 10  # sets; firmware that sends what is new may be a set late with it, not more
UNKNOWN = (float('nan'),) * 3


class SampleFrame(NamedTuple):
    """One millisecond of one finger: the dynamic value, the taxel image if one came with it, the inertial values."""

    stamp_ms: int | None
    dynamic: int
    image: tuple[int, ...] | None = None
    motion: tuple[float, ...] = ()


class SampleFrameSplitter:
    """Turn packets into the sample frames of one finger: a dynamic item starts a frame, what came before it joins it.

    Parameters
    ----------
    finger
        Index of the finger, 0 or 1.
    motion_kinds
        Kinds of inertial items that are wanted, in order.
    """

    def __init__(self, finger: int, motion_kinds: Sequence[int] = ()) -> None:
        self._finger = finger
        self._image: tuple[int, ...] | None = None
        self._motion: dict[int, tuple[float, ...]] = dict.fromkeys(motion_kinds, UNKNOWN)
        self._ages = dict.fromkeys(motion_kinds, 0)

    def frames(self, packets: Sequence[Packet]) -> list[SampleFrame]:
        """Return the sets in a row of packets."""
        found: list[SampleFrame] = []
        for packet in packets:
            stamp, dynamic = self._numbers(packet)
            for value in dynamic:
                found.append(SampleFrame(stamp, value, self._image, self._newest_motion()))
                self._image = None
        return found

    def _numbers(self, packet: Packet) -> tuple[int | None, list[int]]:
        """Return the stamp and the dynamic values of a packet; the rest is kept for the next set."""
        stamp, dynamic = None, []
        for kind, finger, values in packet.items:
            if kind == tables.TIMESTAMP:
                stamp = values[0] if stamp is None or finger == self._finger else stamp
            elif finger != self._finger:
                continue
            elif kind == tables.DYNAMIC:
                dynamic.append(values[0])
            elif kind == tables.STATIC:
                self._image = values
            elif kind in self._motion:
                self._motion[kind], self._ages[kind] = values, 0
        return stamp, dynamic

    def _newest_motion(self) -> tuple[float, ...]:
        """Return the newest inertial values, NaN for those that have not come for long."""
        values: tuple[float, ...] = ()
        for kind, newest in self._motion.items():
            values += newest if self._ages[kind] < MOTION_HOLD else UNKNOWN
            self._ages[kind] += 1
        return values
