# SPDX-License-Identifier: Apache-2.0
"""Against bytes written by hand."""

import numpy as np
import pytest

from texture_drivers.tsf85 import SIGNAL, FingerStream, SampleFrameSplitter, Tsf85Parser
from texture_simulation.devices.fingers import Tsf85Encoder

IMAGE = np.arange(28, dtype=np.uint16) + 0x1000
IMAGE_HEX = ''.join(f'10{i:02X}' for i in range(28))
STILL = '0000 0000 4000', '0000 0000 0000'


def test_a_millisecond_of_both_fingers_with_a_long_stamp() -> None:
    came = Tsf85Encoder().encode(0x0102, np.array([-2], dtype=np.int16), IMAGE, image_is_new=False)
    expected = (
        f'9A 00 58 2B 70 0000000000000102 20 FFFE 30 {STILL[0]} 40 {STILL[1]} 24 0000 34 {STILL[0]} 44 {STILL[1]}'
    )
    assert came == bytes.fromhex(expected)


def test_the_second_finger_with_a_short_stamp_that_wraps() -> None:
    encoder = Tsf85Encoder(finger=1, long_stamps=False)
    came = encoder.encode(0xFFFF, np.array([258, 259], dtype=np.int16), IMAGE, image_is_new=False)
    rest = f'20 0000 30 {STILL[0]} 40 {STILL[1]}'
    image = f'9A 00 58 39 14 {IMAGE_HEX}'
    first = f'9A 00 58 25 70 FFFF {rest} 24 0102 34 {STILL[0]} 44 {STILL[1]}'
    second = f'9A 00 58 25 70 0000 {rest} 24 0103 34 {STILL[0]} 44 {STILL[1]}'
    assert came == bytes.fromhex(image + first + image + second)


def test_new_firmware_sends_an_image_once() -> None:
    encoder = Tsf85Encoder()
    came = encoder.encode(0, np.zeros(3, dtype=np.int16), IMAGE, image_is_new=True)
    assert came.startswith(bytes.fromhex(f'9A 00 58 39 10 {IMAGE_HEX} 9A'))
    assert came.count(bytes.fromhex(IMAGE_HEX)) == 1


def test_without_stamps_the_index_jumps_over_lost_packets_and_the_times_are_right_again() -> None:
    encoder, parser, splitter, finger = (
        Tsf85Encoder(stamped=False),
        Tsf85Parser(),
        SampleFrameSplitter(0),
        FingerStream(),
    )
    errors_ms: dict[int, float] = {}
    for first_ms in range(0, 6000, 10):
        packets = list(encoder.packets(first_ms, np.arange(first_ms, first_ms + 10, dtype=np.int16), IMAGE, False))
        data = b'' if 3000 <= first_ms < 3200 else b''.join(packets)
        for batch in finger.place(splitter.frames(parser.feed(data)), (first_ms + 10) * 1_000_000).get(SIGNAL, []):
            sent_ms = int(batch.samples[0, 0])
            errors_ms[sent_ms] = batch.stamp_ns / 1e6 - sent_ms
    assert max(abs(error) for ms, error in errors_ms.items() if ms < 3000) < 2.0
    assert max(abs(error) for ms, error in errors_ms.items() if ms > 3800) < 2.0
    assert finger.cutter.lost == pytest.approx(200, abs=2)
