"""Consistent overhead byte stuffing: any bytes without the byte zero, for one byte more in 254.

A block is its length and the bytes up to the next zero, which is left out; a block of 255 has no zero after it.

Source: Cheshire & Baker 1999, "Consistent Overhead Byte Stuffing".
"""

from __future__ import annotations

FULL_BLOCK = 255
LONGEST_RUN = FULL_BLOCK - 1


def stuff(data: bytes) -> bytes:
    """Return `data` without zero bytes."""
    ended = data + b'\x00'
    blocks = []
    position = 0
    while True:
        run = data[position : min(ended.index(0, position), position + LONGEST_RUN)]
        blocks.append(bytes([len(run) + 1]) + run)
        zeros = len(run) < LONGEST_RUN
        position += len(run) + zeros
        if position >= len(data) + zeros:
            return b''.join(blocks)


def unstuff(stuffed: bytes) -> bytes | None:
    """Return what was stuffed, or None if `stuffed` is damaged; it must hold no zero byte."""
    runs = []
    position = 0
    while position < len(stuffed):
        length = stuffed[position]
        run = stuffed[position + 1 : position + length]
        if len(run) < length - 1:
            return None
        runs.append(run)
        position += length
        if length < FULL_BLOCK and position < len(stuffed):
            runs.append(b'\x00')
    return b''.join(runs)
