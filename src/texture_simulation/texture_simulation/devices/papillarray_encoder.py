"""What the hub of PapillArrays puts on the wire, written from its protocol and not from the driver's code.

Packet: 55 66 77 88, index, blocks, sum of the bytes since the start mark (u16), AA BB CC DD; little endian. The index
is the size of an offset (u8), then type (u16) and offset of each block.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array

PILLARS, QUANTITIES = 9, 6
OFFSET_BYTES = 2
MARK_BYTES = 4
HUB, EACH_PILLAR, WHOLE = 1, 3, 4


class PapillArrayEncoder:
    """Make the packets of a hub.

    Parameters
    ----------
    arrays
        How many arrays it carries.
    hub_type
        Type of the block with counter and clock.
    """

    def __init__(self, arrays: int, hub_type: int = HUB) -> None:
        self._arrays = arrays
        blocks = {hub_type: bytes(12), EACH_PILLAR: self._pillars(), WHOLE: self._wholes()}
        offset = 1 + len(blocks) * (2 + OFFSET_BYTES)
        index, starts = bytes([OFFSET_BYTES]), {}
        for kind, block in blocks.items():
            starts[kind] = MARK_BYTES + offset
            index += struct.pack('<HH', kind, offset)
            offset += len(block)
        content = b'\x55\x66\x77\x88' + index + b''.join(blocks.values()) + bytes(2) + b'\xaa\xbb\xcc\xdd'
        self._template = np.frombuffer(content, dtype=np.uint8)
        self._hub = starts[hub_type]
        self._pillar_columns = self._columns(starts[EACH_PILLAR] + 2 + arrays * OFFSET_BYTES, PILLARS)
        self._whole_columns = self._columns(starts[WHOLE] + 2 + arrays * OFFSET_BYTES, 0)

    def packets(self, counter: int, times_us: Array, pillars: Array) -> Iterator[bytes]:
        """Yield the packets of consecutive measurements.

        Parameters
        ----------
        counter
            Number of the first packet; wraps at 32 bits.
        times_us : (n,)
            The hub's clock.
        pillars : (n, n_arrays, 9, 6)
            Forces (N) and displacements (mm) along x, y, z of each pillar.

        Returns
        -------
        iterator of bytes
            A packet for each measurement.
        """
        count = len(pillars)
        rows = np.tile(self._template, (count, 1))
        numbers = (counter + np.arange(count)).astype('<u4')
        rows[:, self._hub : self._hub + 4] = numbers[:, None].view(np.uint8)
        rows[:, self._hub + 4 : self._hub + 12] = times_us.astype('<u8')[:, None].view(np.uint8)
        wholes = np.zeros((count, self._arrays, QUANTITIES))
        wholes[..., :3] = pillars[..., :3].sum(axis=2)
        for columns, values in ((self._pillar_columns, pillars), (self._whole_columns, wholes)):
            rows[:, columns] = np.ascontiguousarray(values, dtype='<f4').reshape(count, -1).view(np.uint8)
        sums = rows[:, MARK_BYTES : -MARK_BYTES - 2].sum(axis=1, dtype=np.uint64) % 2**16
        rows[:, -MARK_BYTES - 2 : -MARK_BYTES] = sums.astype('<u2')[:, None].view(np.uint8)
        for row in rows:
            yield row.tobytes()

    def _pillars(self) -> bytes:
        pillar = struct.pack('<H', 2) + bytes(4 * QUANTITIES)
        array = struct.pack('<H', PILLARS) + bytes(PILLARS * OFFSET_BYTES) + pillar * PILLARS
        return struct.pack('<H', self._arrays) + bytes(self._arrays * OFFSET_BYTES) + array * self._arrays

    def _wholes(self) -> bytes:
        whole = struct.pack('<H', 2) + bytes(4 * QUANTITIES)
        return struct.pack('<H', self._arrays) + bytes(self._arrays * OFFSET_BYTES) + whole * self._arrays

    def _columns(self, at: int, pillars: int) -> NDArray[np.intp]:
        """Return where the values stand: of each pillar of each array, or of each whole array if there are none."""
        columns = []
        for _ in range(self._arrays):
            at += 2 + pillars * OFFSET_BYTES if pillars else 0
            for _ in range(max(1, pillars)):
                columns.append(at + 2 + np.arange(4 * QUANTITIES))
                at += 2 + 4 * QUANTITIES
        return np.concatenate(columns)
