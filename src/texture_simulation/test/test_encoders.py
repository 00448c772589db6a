# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Against bytes written by hand."""

from __future__ import annotations

import numpy as np
import pytest

from texture_drivers.biotac import LAYOUTS, decode, sampling_command
from texture_simulation.devices.fingers import SampledStream, Tsf85Encoder, commands, encode_replies
from texture_simulation.devices.fingers import encode_samples as encode


@pytest.mark.parametrize('kind', LAYOUTS)
def test_the_emulator_and_the_driver_agree_on_every_value(kind: str) -> None:
    layout = LAYOUTS[kind]
    n_slots = len(layout.slots)
    values = np.resize(np.arange(4096), (100, n_slots, 2)).astype(np.uint16)
    assert commands(layout.electrodes).tolist() == [sampling_command(channel) for channel in layout.slots]
    replies = decode(encode_replies(values).tobytes(), layout, fingers=2)
    assert not replies.damaged.any()
    assert (replies.pac == values[:, 1::2].reshape(-1, 2)).all()
    assert (replies.slow == values[:, list(layout.slow_slots)]).all()


def test_a_frame_is_what_the_protocol_defines_byte_by_byte():
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


IMAGE = np.arange(28, dtype=np.uint16)[:, None] + 0x1000
IMAGE_HEX = ''.join(f'10{i:02X}' for i in range(28))
STILL = '0000 0000 4000', '0000 0000 0000'


def test_a_millisecond_of_both_fingers_with_a_long_stamp() -> None:
    came = b''.join(Tsf85Encoder().packets(0x0102, np.array([[-2]], dtype=np.int16), IMAGE, image_is_new=False))
    expected = (
        f'9A 00 58 2B 70 0000000000000102 20 FFFE 30 {STILL[0]} 40 {STILL[1]} 24 0000 34 {STILL[0]} 44 {STILL[1]}'
    )
    assert came == bytes.fromhex(expected)


def test_the_second_finger_with_a_short_stamp_that_wraps() -> None:
    encoder = Tsf85Encoder(finger=1, long_stamps=False)
    came = b''.join(encoder.packets(0xFFFF, np.array([[258], [259]], dtype=np.int16), IMAGE, image_is_new=False))
    rest = f'20 0000 30 {STILL[0]} 40 {STILL[1]}'
    image = f'9A 00 58 39 14 {IMAGE_HEX}'
    first = f'9A 00 58 25 70 FFFF {rest} 24 0102 34 {STILL[0]} 44 {STILL[1]}'
    second = f'9A 00 58 25 70 0000 {rest} 24 0103 34 {STILL[0]} 44 {STILL[1]}'
    assert came == bytes.fromhex(image + first + image + second)


def test_new_firmware_sends_an_image_once() -> None:
    encoder = Tsf85Encoder()
    came = b''.join(encoder.packets(0, np.zeros((3, 1), dtype=np.int16), IMAGE, image_is_new=True))
    assert came.startswith(bytes.fromhex(f'9A 00 58 39 10 {IMAGE_HEX} 9A'))
    assert came.count(bytes.fromhex(IMAGE_HEX)) == 1
