"""What a TSF-85 puts on the wire, written from its protocol and not from the driver's code.

Packets: `9A 00 58 length payload`; payload items big-endian, item byte = type | finger << 2. Firmware from 1.1.7 on
stamps with 64 bits and sends an image when there is a new one; older firmware stamps with 16 bits and repeats the
images every millisecond in packets of their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Counts = NDArray[np.int16]
Image = NDArray[np.uint16]

TAXELS = 28
FINGERS = 2
RESTING_ACCELERATION = b'\x00\x00\x00\x00\x40\x00'  # 1 g along z at 16384 counts/g
RESTING_ROTATION = bytes(6)


class Tsf85Encoder:
    """Make the packets of consecutive milliseconds; a finger that does not sense and the inertial sensors rest.

    Parameters
    ----------
    finger
        The finger that senses, 0 or 1.
    long_stamps
        64-bit stamps (firmware from 1.1.7 on) or 16-bit ones.
    stamped
        Whether there are stamps at all.
    """

    def __init__(self, finger: int = 0, long_stamps: bool = True, stamped: bool = True) -> None:
        self._finger = finger
        self._plugged = (True,) * FINGERS
        self._long_stamps = long_stamps
        self._stamped = stamped
        self._stamp_type = '>u8' if long_stamps else '>u2'
        self._template = np.frombuffer(self._resting_packet(), dtype=np.uint8)
        self._stamp_at = slice(5, 5 + np.dtype(self._stamp_type).itemsize) if stamped else slice(4, 4)

    def plug(self, plugged: Sequence[bool]) -> None:
        """Send items of the fingers that are plugged in alone, one flag a finger."""
        self._plugged = tuple(plugged)
        self._template = np.frombuffer(self._resting_packet(), dtype=np.uint8)

    def _resting_packet(self) -> bytes:
        items = b'\x70' + bytes(8 if self._long_stamps else 2) if self._stamped else b''
        for finger in self._present:
            head = finger << 2
            items += bytes([0x20 | head, 0, 0])
            items += bytes([0x30 | head]) + RESTING_ACCELERATION + bytes([0x40 | head]) + RESTING_ROTATION
        return bytes([0x9A, 0x00, 0x58, len(items)]) + items

    def encode(self, first_ms: int, dynamic: Counts, image: Image, image_is_new: bool) -> bytes:
        """Return the bytes of some milliseconds; see `packets`.

        Parameters
        ----------
        first_ms
            Device's clock at the first millisecond.
        dynamic : (n,) or (n, 2)
            Dynamic values, a row for each millisecond.
        image : (n_taxels,) or (2, n_taxels)
            Taxel image.
        image_is_new
            Whether the image changed since the last call.

        Returns
        -------
        bytes
            Packets one after the other.
        """
        return b''.join(self.packets(first_ms, dynamic, image, image_is_new))

    def packets(self, first_ms: int, dynamic: Counts, image: Image, image_is_new: bool) -> Iterator[bytes]:
        """Yield the packets of some milliseconds.

        Parameters
        ----------
        first_ms
            The device's clock at the first of them.
        dynamic : (n,) or (n, 2)
            Of the finger that senses, or of both.
        image : (n_taxels,) or (2, n_taxels)
            The same.
        image_is_new
            Whether it has changed since the last call.

        Yields
        ------
        bytes
            One packet each.
        """
        rows = np.tile(self._template, (len(dynamic), 1))
        stamps = (first_ms + np.arange(len(dynamic))).astype(self._stamp_type)  # 16 bits wrap, as they do in the device
        if self._stamped:
            rows[:, self._stamp_at] = stamps[:, None].view(np.uint8)
        for finger, counts in self._by_finger(dynamic.T):
            at = self._stamp_at.stop + self._present.index(finger) * 17 + 1
            rows[:, at : at + 2] = counts.astype('>i2')[:, None].view(np.uint8)
        images = [_image_packet(finger, taxels) for finger, taxels in self._by_finger(image)]
        for number, row in enumerate(rows):
            if not self._long_stamps or (image_is_new and number == 0):
                yield from images
            yield row.tobytes()

    def _by_finger(self, values: NDArray[Any]) -> Iterator[tuple[int, NDArray[Any]]]:
        """Yield finger and values of each that senses and is plugged in, (n,) or (2, n)."""
        each = [(self._finger, values)] if values.ndim == 1 else enumerate(values)
        yield from ((finger, row) for finger, row in each if self._plugged[finger])

    @property
    def _present(self) -> list[int]:
        return [finger for finger, plugged in enumerate(self._plugged) if plugged]


def _image_packet(finger: int, taxels: NDArray[Any]) -> bytes:
    return bytes([0x9A, 0x00, 0x58, 1 + 2 * len(taxels), 0x10 | finger << 2]) + taxels.astype('>u2').tobytes()
