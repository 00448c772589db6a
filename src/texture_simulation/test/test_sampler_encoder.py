# SPDX-License-Identifier: Apache-2.0
import numpy as np

from texture_simulation.devices.fingers import SampledStream
from texture_simulation.devices.fingers import encode_samples as encode


def test_a_frame_is_what_the_protocol_says_byte_by_byte():
    counts = np.array([[0x0102, -1], [0, 0x7F00]], dtype=np.int16)
    data = encode(SampledStream(kind=1, rate_hz=2500.0, columns=2, rows=2), 65_536 + 3, 2**32 + 0x04030201, counts)
    # Before stuffing: 01 01 0300 01020304 02 02 | 0201 FFFF 0000 007F | checksum, whose bits were worked by hand.
    checksum = bitwise_crc(bytes.fromhex('01 01 0300 01020304 02 02 0201 FFFF 0000 007F')).to_bytes(2, 'little')
    stuffed = bytes.fromhex('04 01 01 03 0B 01 02 03 04 02 02 02 01 FF FF 01 01 04 7F') + checksum + b'\x00'
    assert data == stuffed


def bitwise_crc(data: bytes) -> int:
    """CRC-16/CCITT-FALSE by its definition."""
    register = 0xFFFF
    for byte in data:
        register ^= byte << 8
        for _ in range(8):
            register = ((register << 1) ^ (0x1021 if register & 0x8000 else 0)) & 0xFFFF
    return register
