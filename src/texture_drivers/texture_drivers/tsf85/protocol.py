"""The TSF-85's protocol: bytes to packets, commands to bytes. Knows no port and no clock."""

from __future__ import annotations

from collections.abc import Mapping
from struct import Struct
from typing import NamedTuple

from texture_drivers.tsf85 import tables


class Item(NamedTuple):
    """One measurement in a packet: its type, its finger and its numbers."""

    kind: int
    finger: int
    values: tuple[int, ...]


class Packet(NamedTuple):
    """What the device sent at once."""

    command: int
    items: tuple[Item, ...]


class Tsf85Parser:
    """Turn a byte stream into packets, whatever is lost or added on the way.

    The protocol has no checksum, so a packet is believed only if everything about it fits: a data command, known item
    types, index bits 0, a finger that exists, no item twice (a flipped type or finger would make a sample that never
    was), items that end exactly with the payload, and a start byte after it as far as one has come. A flipped value
    byte inside such a packet cannot be seen.

    Parameters
    ----------
    layout
        Kind of fingertip.
    """

    def __init__(self, layout: tables.Tsf85Layout = tables.TSF85) -> None:
        self.packets = 0
        self.refused = 0  # start bytes that led to no packet
        self.refused_bytes = 0
        self._items = layout.items
        self._buffer = b''

    def feed(self, data: bytes) -> list[Packet]:
        """Return the packets completed by `data`; what is refused is counted. Keeps fewer than 260 bytes."""
        buffer = self._buffer + data
        packets: list[Packet] = []
        position = 0
        while True:
            start = buffer.find(tables.START_BYTE, position)
            if start < 0:
                self.refused_bytes += len(buffer) - position
                position = len(buffer)
                break
            self.refused_bytes += start - position
            position = start
            if not _is_decidable(buffer, start):
                break
            packet = _packet_at(buffer, start, self._items)
            if packet is None:
                self.refused += 1
                self.refused_bytes += 1
                position += 1
            else:
                packets.append(packet)
                position = _end(buffer, start)
        self._buffer = buffer[position:]
        self.packets += len(packets)
        return packets


def _end(buffer: bytes, start: int) -> int:
    return start + tables.HEADER_BYTES + buffer[start + 3]


def _is_decidable(buffer: bytes, start: int) -> bool:
    """Return whether the packet has come completely, or enough of it to be refused."""
    if len(buffer) < start + tables.HEADER_BYTES:
        return False
    end = _end(buffer, start)
    if buffer[start + 2] not in tables.DATA_COMMANDS or end < len(buffer):
        return True
    # A packet that lost a byte borrows the next start byte as its last: wait for what follows.
    return end == len(buffer) and buffer[end - 1] != tables.START_BYTE


def _packet_at(buffer: bytes, start: int, layouts: Mapping[int, Struct]) -> Packet | None:
    command, end = buffer[start + 2], _end(buffer, start)
    if command not in tables.DATA_COMMANDS or (end < len(buffer) and buffer[end] != tables.START_BYTE):
        return None
    payload = buffer[start + tables.HEADER_BYTES : end]
    for timestamp in tables.TIMESTAMPS:
        items = _parse_items(payload, timestamp, layouts)
        if items:
            return Packet(command, items)
    return None


def _parse_items(payload: bytes, timestamp: Struct, layouts: Mapping[int, Struct]) -> tuple[Item, ...] | None:
    """Return the items of a payload, or None if they do not fit it exactly."""
    items = []
    item_bytes: set[int] = set()
    position = 0
    while position < len(payload):
        item_byte = payload[position]
        kind, finger = item_byte & tables.TYPE_MASK, (item_byte & tables.FINGER_MASK) >> tables.FINGER_SHIFT
        layout = timestamp if kind == tables.TIMESTAMP else layouts.get(kind)
        if layout is None or item_byte & tables.INDEX_MASK or finger >= tables.FINGERS or item_byte in item_bytes:
            return None
        if position + 1 + layout.size > len(payload):
            return None
        item_bytes.add(item_byte)
        items.append(Item(kind, finger, layout.unpack_from(payload, position + 1)))
        position += 1 + layout.size
    return tuple(items)


def start_command(period_ms: int = 1) -> bytes:
    """Return the command that makes the device send every `period_ms`, 1 to 255.

    Raises
    ------
    ValueError
        If the period is outside 1 to 255 ms.
    """
    if not 1 <= period_ms <= 255:
        raise ValueError(f'the period is {period_ms} ms; 1 to 255 can be sent')
    return _command(tables.AUTOSEND, bytes([period_ms]))


def stop_command() -> bytes:
    """Return the command that ends the stream."""
    return _command(tables.AUTOSEND, b'\x00')


def _command(command: int, payload: bytes) -> bytes:
    return bytes([tables.START_BYTE, 0, command, len(payload)]) + payload
