"""The PapillArray's protocol: bytes to packets, packets to measurements. Knows no port and no clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from struct import Struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_drivers.papillarray import tables

U16 = Struct('<H')
Values = NDArray[np.float32]
Bytes = NDArray[np.uint8]


class PapillArrayParser:
    """Turn a byte stream into the contents of packets, whatever is lost or added on the way.

    The checksum is a sum: a byte 0 more or less does not change it. So a packet is believed only if the one before it,
    valid or not believed for that alone, was as long.
    """

    def __init__(self) -> None:
        self.packets = 0
        self.refused = 0  # start marks that led to no packet
        self.refused_bytes = 0
        self.restart()

    def restart(self) -> None:
        """Forget what has begun, as after opening the port."""
        self._length = -1  # of the last packet with a right checksum; -1 before the first one
        self._buffer = b''

    def feed(self, data: bytes) -> list[bytes]:
        """Return what stands between start mark and checksum of each packet completed by `data`."""
        self._buffer += data
        packets = []
        while self._skip_to_start():
            end = self._end()
            if end is None:
                break
            if not end:
                self._refuse(len(tables.START))
                continue
            content = self._buffer[len(tables.START) : end - tables.CHECKSUM_BYTES]
            self._buffer = self._buffer[end + len(tables.END) :]
            if len(content) == self._length:
                packets.append(content)
            else:
                self.refused += self._length >= 0
                self.refused_bytes += end + len(tables.END)
            self._length = len(content)
        self.packets += len(packets)
        return packets

    def _skip_to_start(self) -> bool:
        """Drop what comes before a start mark; return whether there is one."""
        start = self._buffer.find(tables.START)
        passed = start if start >= 0 else max(0, len(self._buffer) - len(tables.START) + 1)
        self.refused_bytes += passed
        self._buffer = self._buffer[passed:]
        return start >= 0

    def _refuse(self, length: int) -> None:
        self.refused += 1
        self.refused_bytes += length
        self._buffer = self._buffer[length:]

    def _end(self) -> int | None:
        """Return where the end mark of the packet in front stands; 0 if it is damaged, None if more must come."""
        buffer, first = self._buffer, len(tables.START) + tables.CHECKSUM_BYTES
        following = buffer.find(tables.START, len(tables.START))
        limit = min(following if following >= 0 else len(buffer), tables.MAX_PACKET_BYTES)
        end = buffer.find(tables.END, first, limit)
        while end >= 0:
            checksum_at = end - tables.CHECKSUM_BYTES
            if sum(buffer[len(tables.START) : checksum_at]) % 2**16 == U16.unpack_from(buffer, checksum_at)[0]:
                return end
            end = buffer.find(tables.END, end + 1, limit)
        return 0 if following >= 0 or len(buffer) >= tables.MAX_PACKET_BYTES else None


class Measurements(NamedTuple):
    """What packets of one layout hold.

    Parameters
    ----------
    counters : (n_packets,)
        Number of each packet; wraps at 32 bits.
    times_us : (n_packets,)
        The hub's clock.
    pillars
        Of each array, (n_packets, 6 · n_pillars): forces (N) and displacements (mm) of each pillar.
    wholes
        Of each array, (n_packets, 6): force (N) and torque (N mm); none if the hub does not send it.
    """

    counters: NDArray[np.int64]
    times_us: NDArray[np.int64]
    pillars: Sequence[Values]
    wholes: Sequence[Values]


@dataclass(frozen=True)
class PacketLayout:
    """Where the measurements stand in a packet.

    Parameters
    ----------
    hub
        Offset of counter and time.
    pillars
        Of each array, the offsets of the six values of each pillar.
    wholes
        Of each array, the offset of its six values.
    """

    hub: int
    pillars: tuple[tuple[int, ...], ...]
    wholes: tuple[int, ...]

    def decode(self, packets: Sequence[bytes]) -> Measurements:
        """Return the measurements of packets that have this layout, and all the same length."""
        rows: Bytes = np.frombuffer(b''.join(packets), dtype=np.uint8).reshape(len(packets), -1)
        counters = np.ascontiguousarray(rows[:, self.hub : self.hub + 4]).view('<u4')[:, 0]
        times_us = np.ascontiguousarray(rows[:, self.hub + 4 : self.hub + tables.HUB_BYTES]).view('<u8')[:, 0]
        return Measurements(
            counters.astype(np.int64),
            times_us.astype(np.int64),
            [_floats(rows, offsets) for offsets in self.pillars],
            [_floats(rows, (offset,)) for offset in self.wholes],
        )


def _floats(rows: Bytes, offsets: Sequence[int]) -> Values:
    """Return the six values at each offset, (n_packets, 6 · n_offsets)."""
    columns = (np.array(offsets)[:, None] + np.arange(tables.VALUES_BYTES)).ravel()
    return np.ascontiguousarray(rows[:, columns]).view('<f4').astype(np.float32)


def layout_of(packet: bytes) -> PacketLayout | None:
    """Return the layout of a packet's content, or None if its blocks do not fit it.

    The index ends where the first block begins. The counts in a block tell its length: it must end where the next one
    begins, or with the packet; only the blocks of slip, whose content is not known here, may be of any length.
    """
    blocks = _index(packet)
    if blocks is None or not {tables.HUB, tables.PILLARS} <= set(blocks):
        return None
    size = packet[0]
    hub = blocks[tables.HUB]
    pillars = _pillars(packet, blocks[tables.PILLARS], size)
    wholes = _wholes(packet, blocks[tables.WHOLE], size) if tables.WHOLE in blocks else ((), None)
    if pillars is None or wholes is None:
        return None
    ends = {tables.HUB: hub + tables.HUB_BYTES, tables.PILLARS: pillars[1], tables.WHOLE: wholes[1]}
    following = dict(zip(blocks, [*list(blocks.values())[1:], len(packet)], strict=True))
    if any(ends.get(kind, end) != end for kind, end in following.items()):
        return None
    return PacketLayout(hub, pillars[0], wholes[0])


def _index(packet: bytes) -> Mapping[int, int] | None:
    """Return the offset of each type of block, in their order; None if there is no valid index."""
    if not packet or packet[0] not in (1, 2, 4):
        return None
    size, at, first = packet[0], 1, len(packet)
    blocks: dict[int, int] = {}
    while at < first:
        if at + tables.TYPE_BYTES + size > len(packet):
            return None
        kind = U16.unpack_from(packet, at)[0]
        offset = int.from_bytes(packet[at + tables.TYPE_BYTES : at + tables.TYPE_BYTES + size], 'little')
        at += tables.TYPE_BYTES + size
        if kind in blocks or offset > len(packet) or offset < max(blocks.values(), default=at):
            return None
        blocks[kind] = offset
        first = next(iter(blocks.values()))
    return blocks if at == first else None


def _counted(packet: bytes, at: int, size: int) -> tuple[int, int] | None:
    """Return a count and where what follows its table of offsets begins; None beyond the end."""
    if at + tables.COUNT_BYTES > len(packet):
        return None
    count = U16.unpack_from(packet, at)[0]
    return count, at + tables.COUNT_BYTES + count * size


def _values(packet: bytes, at: int, count: int) -> tuple[tuple[int, ...], int] | None:
    """Return the offsets of the six values of each of `count` items, and where they end; None if they do not fit."""
    item_bytes = tables.TYPE_BYTES + tables.VALUES_BYTES
    starts = [at + number * item_bytes for number in range(min(count, tables.MAX_PACKET_BYTES))]
    end = at + count * item_bytes
    if end > len(packet) or any(U16.unpack_from(packet, start)[0] != tables.VALUES_TYPE for start in starts):
        return None
    return tuple(start + tables.TYPE_BYTES for start in starts), end


def _pillars(packet: bytes, at: int, size: int) -> tuple[tuple[tuple[int, ...], ...], int] | None:
    """Return the offsets of each pillar of each array, and where the block ends; None if it does not fit."""
    arrays = _counted(packet, at, size)
    if arrays is None or not 1 <= arrays[0] <= tables.SENSORS:
        return None
    found, at = [], arrays[1]
    for _ in range(arrays[0]):
        counted = _counted(packet, at, size)
        values = _values(packet, counted[1], counted[0]) if counted else None
        if values is None:
            return None
        found.append(values[0])
        at = values[1]
    return tuple(found), at


def _wholes(packet: bytes, at: int, size: int) -> tuple[tuple[int, ...], int] | None:
    """Return the offset of the values of each whole array, and where the block ends; None if it does not fit."""
    counted = _counted(packet, at, size)
    return _values(packet, counted[1], counted[0]) if counted else None
