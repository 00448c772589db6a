from __future__ import annotations

import struct
from binascii import crc_hqx

from hypothesis import given, settings
from hypothesis import strategies as st

from texture_drivers.framing import CRC_START, Deframer, Frame, WrappingCounter

FRAME = Frame(0x42, 1, 7, 1000, 1, 2, b'\x00\x11\x00')


def wire(frame: Frame) -> bytes:
    content = struct.pack('<BBHIBB', *frame[:-1]) + frame.body
    content += struct.pack('<H', crc_hqx(content, 0xFFFF))
    return b''.join(bytes([len(run) + 1]) + run for run in content.split(b'\x00')) + b'\x00'  # runs below 254 bytes


def test_the_check_sum_is_crc16_ccitt_false() -> None:
    assert crc_hqx(b'123456789', CRC_START) == 0x29B1


def test_a_frame_written_by_hand_is_read() -> None:
    # header, body and CRC 03B4; COBS writes the distance to the next zero before each run without one
    blocks = bytes.fromhex('04 420107  03 e803  01  03 0102  02 11  03 b403')
    assert Deframer().feed(blocks + b'\x00') == [FRAME]


def test_long_runs_without_a_zero_are_read() -> None:
    for length in (241, 242, 243, 600):
        content = struct.pack('<BBHIBB', 1, 1, 0x101, 0x1010101, 1, 1) + b'\x01' * length
        content += struct.pack('<H', crc_hqx(content, 0xFFFF))
        full, rest = divmod(len(content), 254)
        assert b'\x00' not in content
        blocks = b''.join(b'\xff' + content[254 * i :][:254] for i in range(full))
        stream = blocks + (bytes([rest + 1]) + content[254 * full :] if rest else b'') + b'\x00'
        assert [len(frame.body) for frame in Deframer().feed(stream)] == [length]


def test_frames_are_found_however_the_stream_is_cut() -> None:
    stream = b''.join(wire(FRAME._replace(sequence=n)) for n in range(5))
    for size in (1, 2, 7, len(stream)):
        deframer = Deframer()
        found = [f.sequence for i in range(0, len(stream), size) for f in deframer.feed(stream[i : i + size])]
        assert found == [0, 1, 2, 3, 4]
        assert deframer.bad_frames == 0


def test_entering_in_the_middle_is_no_fault_but_a_damaged_frame_is() -> None:
    deframer = Deframer()
    assert deframer.feed(wire(FRAME)[5:] + wire(FRAME)) == [FRAME]
    assert deframer.bad_frames == 0
    damaged = bytearray(wire(FRAME))
    damaged[3] ^= 0x10
    assert deframer.feed(bytes(damaged) + wire(FRAME)) == [FRAME]
    assert deframer.bad_frames == 1


@settings(max_examples=50)
@given(st.lists(st.binary(max_size=200), max_size=20))
def test_arbitrary_bytes_never_raise_and_memory_stays_bounded(pieces: list[bytes]) -> None:
    deframer = Deframer(max_frame_bytes=64)
    for piece in pieces:
        deframer.feed(piece)
        assert len(deframer._rest) <= 65
    # In step again after the next zero byte.
    deframer.feed(b'\x00')
    assert deframer.feed(wire(FRAME)) == [FRAME]


def test_every_flipped_bit_is_noticed() -> None:
    good = wire(FRAME)
    for position in range(len(good) - 1):
        for bit in range(8):
            damaged = bytearray(good)
            damaged[position] ^= 1 << bit
            assert Deframer().feed(b'\x00' + bytes(damaged)) == []


def test_a_counter_is_followed_beyond_its_wrapping() -> None:
    counter = WrappingCounter(16)
    assert [counter.advance(reading) for reading in (65534, 65535, 1, 2)] == [65534, 65535, 65537, 65538]
    assert counter.step(2) == 0
    assert counter.step(1) == -1
