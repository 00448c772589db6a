# SPDX-License-Identifier: Apache-2.0
import pytest
from hypothesis import given
from hypothesis import strategies as st

from texture_drivers.tsf85 import (
    AUTOSEND,
    DYNAMIC,
    STATIC,
    TIMESTAMP,
    Item,
    Packet,
    Tsf85Parser,
    start_command,
    stop_command,
)

# Written by hand from the protocol: autosend, 8 bytes of payload: stamp 0x6C1E ms, finger 0: 258, ...
SHORT_STAMP = bytes.fromhex('9A 00 58 06 70 6C1E 20 0102')
LONG_STAMP = bytes.fromhex('9A 00 58 0F 70 0000000000006C1E 20 FFFE 24 8000')
IMAGE = bytes.fromhex('9A 00 58 39 14') + bytes(range(56))
INERTIAL = bytes.fromhex('9A 7F 61 07 30 0001 FFFF 4000')


def test_a_short_stamp_and_a_dynamic_value_are_read() -> None:
    assert Tsf85Parser().feed(SHORT_STAMP) == [
        Packet(AUTOSEND, (Item(TIMESTAMP, 0, (0x6C1E,)), Item(DYNAMIC, 0, (258,))))
    ]


def test_a_long_stamp_and_both_fingers_are_read() -> None:
    (packet,) = Tsf85Parser().feed(LONG_STAMP)
    assert packet.items == (Item(TIMESTAMP, 0, (0x6C1E,)), Item(DYNAMIC, 0, (-2,)), Item(DYNAMIC, 1, (-32768,)))


def test_an_image_of_the_second_finger_has_28_big_endian_taxels() -> None:
    (packet,) = Tsf85Parser().feed(IMAGE)
    (item,) = packet.items
    assert (item.kind, item.finger) == (STATIC, 1)
    assert item.values[:2] == (0x0001, 0x0203)
    assert len(item.values) == 28


def test_a_packet_comes_out_with_its_last_byte_wherever_the_stream_is_cut() -> None:
    stream = SHORT_STAMP + LONG_STAMP + IMAGE + INERTIAL
    parser = Tsf85Parser()
    came = [len(parser.feed(stream[i : i + 1])) for i in range(len(stream))]
    assert sum(came) == 4
    assert came[len(SHORT_STAMP) - 1] == 1
    assert parser.refused_bytes == 0


@pytest.mark.parametrize(
    ('reason', 'packet'),
    [
        ("one finger's dynamic value twice, the other's with a flipped bit", '9A 00 58 06 20 0102 20 0304'),
        ('no data command', '9A 00 E3 03 20 0102'),
        ('unknown type 0x80', '9A 00 58 03 80 0102'),
        ('index bits', '9A 00 58 03 21 0102'),
        ('third finger', '9A 00 58 03 28 0102'),
        ('items too short for the payload', '9A 00 58 04 20 0102 00'),
        ('items too long for the payload', '9A 00 58 02 20 01'),
        ('no item', '9A 00 58 00'),
    ],
)
def test_a_packet_is_refused_for(reason: str, packet: str) -> None:
    parser = Tsf85Parser()
    assert parser.feed(bytes.fromhex(packet) + SHORT_STAMP) == Tsf85Parser().feed(SHORT_STAMP), reason
    assert parser.refused >= 1
    assert parser.refused_bytes == len(bytes.fromhex(packet))


def test_a_packet_that_lost_a_byte_is_refused_even_if_the_stream_pauses_there() -> None:
    parser = Tsf85Parser()
    assert parser.feed(SHORT_STAMP[:-1] + b'\x9a') == []
    assert len(parser.feed(SHORT_STAMP[1:])) == 1
    assert parser.packets == 1


@given(st.binary(max_size=600))
def test_the_stream_is_found_again_after_any_noise(noise: bytes) -> None:
    packets = Tsf85Parser().feed(noise + SHORT_STAMP * 60)
    assert packets[-20:] == Tsf85Parser().feed(SHORT_STAMP) * 20


def test_the_commands_are_those_of_the_vendor() -> None:
    assert start_command() == bytes.fromhex('9A 00 58 01 01')
    assert start_command(16) == bytes.fromhex('9A 00 58 01 10')
    assert stop_command() == bytes.fromhex('9A 00 58 01 00')
    with pytest.raises(ValueError, match='1 to 255'):
        start_command(0)
