"""What a BioTac bridge puts on the wire, written from its protocol and not from the driver's code.

Reply of a slot: the command's two bytes, then two bytes for each BioTac: seven and five bits of the value, each byte
with a last bit that makes its number of ones odd. Frame: COBS(kind u8, version u8, sequence u16, time_us u32, rows u8,
columns u8, body, CRC-16/CCITT-FALSE u16), then a zero; little endian, numbered kind by kind. Kind 'B' holds one reply
to all slots, kind 'S' the serial numbers, separated by commas.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.uint16]
Bytes = NDArray[np.uint8]

VERSION = 1
PAC, PDC, TAC, TDC, ELECTRODE_1 = 0, 1, 2, 3, 17  # indices of the sampling commands


def with_parity(upper: Bytes) -> Bytes:
    """Return bytes with bit 0 set so that the number of ones is odd."""
    ones = np.unpackbits(upper[..., None], axis=-1).sum(axis=-1)
    complete: Bytes = upper | (1 - ones % 2).astype(np.uint8)
    return complete


def commands(electrodes: int) -> Bytes:
    """Return the sampling command of each slot, (2 * electrodes + 6,): every second one is PAC."""
    slow = np.array([*range(ELECTRODE_1, ELECTRODE_1 + electrodes), PDC, TAC, TDC], dtype=np.uint8)
    indices = np.stack([slow, np.full_like(slow, PAC)], axis=1).ravel()
    return with_parity(np.uint8(0x80) | indices << np.uint8(1))


def encode_replies(values: Values, absent: Sequence[int] = ()) -> Bytes:
    """Return the replies to whole frames.

    Parameters
    ----------
    values : (n_frames, n_slots, n_fingers) counts, 0 to 4095
    absent
        Places without a BioTac: their line stays low.

    Returns
    -------
    (n_frames, n_slots * (2 + 2 * n_fingers))
    """
    n_frames, n_slots, n_fingers = values.shape
    replies = np.zeros((n_frames, n_slots, 2 + 2 * n_fingers), dtype=np.uint8)
    replies[:, :, 0] = commands(n_slots // 2 - 3)
    replies[:, :, 2::2] = with_parity((values >> 5 << 1).astype(np.uint8))
    replies[:, :, 3::2] = with_parity(((values & 31) << 3).astype(np.uint8))
    for finger in absent:
        replies[:, :, 2 + 2 * finger : 4 + 2 * finger] = 0
    return replies.reshape(n_frames, n_slots * (2 + 2 * n_fingers))


def reply_frame(sequence: int, time_us: int, values: Values, reply: bytes, version: int = VERSION) -> bytes:
    """Return one reply on the wire; `values`, (n_slots, n_fingers), are what it holds.

    Parameters
    ----------
    sequence
        Running number of the frame; wraps at 16 bits.
    time_us
        Device's time of its first row; wraps at 32 bits.
    values : (n_slots, n_fingers)
        Counts, 0 to 4095.
    reply
        Bytes of the reply.
    version
        Version of the protocol.

    Returns
    -------
    bytes
        The whole frame.
    """
    rows, columns = values.shape
    return _frame(struct.pack('<cBHIBB', b'B', version, sequence % 2**16, time_us % 2**32, rows, columns) + reply)


def serials_frame(sequence: int, time_us: int, serials: Sequence[str]) -> bytes:
    """Return the serial numbers on the wire.

    Parameters
    ----------
    sequence
        Running number of the frame; wraps at 16 bits.
    time_us
        Device's time of its first row; wraps at 32 bits.
    serials
        Serial number of each place; '' for an empty one.

    Returns
    -------
    bytes
        The whole frame.
    """
    header = struct.pack('<cBHIBB', b'S', VERSION, sequence % 2**16, time_us % 2**32, 1, len(serials))
    return _frame(header + ','.join(serials).encode('ascii'))


def _frame(content: bytes) -> bytes:
    return stuff(content + struct.pack('<H', binascii.crc_hqx(content, 0xFFFF))) + b'\x00'


def stuff(content: bytes) -> bytes:
    """Return content in COBS: no zero byte, a length before every run."""
    blocks = []
    for run in content.split(b'\x00'):
        full, rest = run[: len(run) // 254 * 254], run[len(run) // 254 * 254 :]
        blocks += [b'\xff' + full[i : i + 254] for i in range(0, len(full), 254)]
        blocks.append(bytes([len(rest) + 1]) + rest)
    return b''.join(blocks)
