# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from binascii import crc_hqx

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from texture_core.framing import CRC_START, CounterUnwrapper, Frame, FrameDecoder, cobs_decode, cobs_encode, pack

BODIES = st.lists(st.binary(max_size=40), min_size=2, max_size=8)


def numbered(sequence, body=b'', kind=1):
    return Frame(kind, 1, sequence, 1000 * sequence, 1, 1, body)


def bitwise_crc(data: bytes) -> int:
    """The definition: shift out, and where a one leaves, subtract the polynomial x^16 + x^12 + x^5 + 1."""
    register = 0xFFFF
    for byte in data:
        register ^= byte << 8
        for _ in range(8):
            register = (register << 1) ^ (0x1021 if register & 0x8000 else 0)
            register &= 0xFFFF
    return register


def test_the_checksum_has_the_published_check_value():
    assert crc_hqx(b'123456789', CRC_START) == 0x29B1 == bitwise_crc(b'123456789')


def test_a_frame_worked_by_hand_is_read_and_written():
    frame = Frame(0x42, 1, 7, 1000, 1, 2, b'\x00\x11\x00')
    # Kind 42, version 01, sequence 0700, time E8030000, rows 01, columns 02, body 001100, checksum B403. COBS puts the
    # distance to the next zero before each run without one.
    assert bitwise_crc(bytes.fromhex('42 01 0700 E8030000 01 02 001100')) == 0x03B4
    by_hand = bytes.fromhex('04 420107  03 E803  01  03 0102  02 11  03 B403  00')
    assert FrameDecoder().feed(by_hand) == [frame]
    assert pack(frame) == by_hand


# Cheshire & Baker 1999, figures 2 and 3, and runs as long as a code byte can say.
@pytest.mark.parametrize(
    ('plain', 'stuffed'),
    [
        ('', '01'),
        ('00', '01 01'),
        ('45 00 00 2C 4C 79 00 00 40 06 4F 37', '02 45 01 04 2C 4C 79 01 05 40 06 4F 37'),
        ('01' * 253 + '00', 'FE' + '01' * 253 + '01'),
        ('01' * 254 + '00 02', 'FF' + '01' * 254 + '01 02 02'),
        ('01' * 255, 'FF' + '01' * 254 + '02 01'),
    ],
)
def test_stuffing_by_hand(plain: str, stuffed: str) -> None:
    assert cobs_encode(bytes.fromhex(plain)) == bytes.fromhex(stuffed)
    assert cobs_decode(bytes.fromhex(stuffed)) == bytes.fromhex(plain)


@given(st.binary(max_size=600))
def test_stuffed_bytes_hold_no_zero_and_come_back(data: bytes) -> None:
    assert 0 not in cobs_encode(data)
    assert cobs_decode(cobs_encode(data)) == data


def test_frames_come_out_the_same_however_the_stream_is_cut():
    frames = [numbered(i, bytes([i, 0, 255 - i])) for i in range(20)]
    deframer = FrameDecoder()
    stream = b''.join(map(pack, frames))
    assert [frame for byte in stream for frame in deframer.feed(bytes([byte]))] == frames


def test_missing_numbers_are_counted_for_each_kind_over_the_wrap():
    deframer = FrameDecoder()
    sent = [(1, 65534), (2, 9), (1, 1), (2, 10), (1, 2)]  # of kind 1 are missing 65535 and 0
    frames = deframer.feed(b''.join(pack(numbered(sequence, kind=kind)) for kind, sequence in sent))
    assert [frame.lost for frame in frames] == [0, 0, 2, 0, 0]
    assert deframer.lost == 2


def test_a_frame_that_comes_twice_is_given_once():
    deframer = FrameDecoder()
    assert len(deframer.feed(pack(numbered(5)) * 2 + pack(numbered(6)))) == 2
    assert (deframer.repeated, deframer.lost, deframer.bad_frames) == (1, 0, 0)


def test_numbers_that_go_back_are_a_device_that_began_again_and_no_loss():
    deframer = FrameDecoder()
    deframer.feed(b''.join(pack(numbered(i)) for i in (300, 301, 0, 1)))
    assert (deframer.lost, deframer.frames) == (0, 4)


def test_every_flipped_bit_is_noticed():
    good = pack(numbered(1, bytes(range(40))))
    for position in range(8 * (len(good) - 1)):
        damaged = bytearray(good)
        damaged[position // 8] ^= 1 << position % 8
        deframer = FrameDecoder()
        deframer.feed(b'\x00')
        assert deframer.feed(bytes(damaged)) == []
        assert deframer.bad_frames >= 1


def test_joining_in_the_middle_of_a_frame_is_no_fault():
    deframer = FrameDecoder()
    assert len(deframer.feed(pack(numbered(1, b'half'))[3:] + pack(numbered(2, b'whole')))) == 1
    assert (deframer.bad_frames, deframer.lost) == (0, 0)


def test_after_a_restart_numbers_may_begin_anywhere():
    deframer = FrameDecoder()
    deframer.feed(pack(numbered(500)) + b'\x07unfinished')
    deframer.restart()
    assert len(deframer.feed(pack(numbered(0)))) == 1
    assert (deframer.lost, deframer.bad_frames, deframer.frames) == (0, 0, 2)


@settings(deadline=None)
@given(noise=st.binary(max_size=200), bodies=BODIES)
def test_after_any_noise_at_most_one_frame_is_lost(noise, bodies):
    frames = FrameDecoder().feed(noise + b''.join(pack(numbered(i, body)) for i, body in enumerate(bodies)))
    assert [frame.body for frame in frames][-(len(bodies) - 1) :] == bodies[1:]


@settings(deadline=None)
@given(bodies=BODIES, dropped=st.integers(0, 10_000))
def test_a_dropped_byte_costs_at_most_two_frames_and_the_loss_is_counted(bodies, dropped):
    deframer = FrameDecoder()
    deframer.feed(pack(numbered(0)))
    stream = b''.join(pack(numbered(i + 1, body)) for i, body in enumerate(bodies))
    position = dropped % len(stream)
    end = pack(numbered(len(bodies) + 1))
    frames = deframer.feed(stream[:position] + stream[position + 1 :] + end + end)
    assert len(bodies) + 1 - len(frames) == deframer.lost <= 2


@settings(deadline=None)
@given(st.lists(st.integers(-(2**15), 2**15 - 1), max_size=50))
def test_a_wrapping_counter_is_followed_forwards_and_back(steps):
    counter, truth = CounterUnwrapper(16), 2**20
    counter.advance(truth % 2**16)
    offset = truth - (counter.value or 0)
    for step in steps:
        truth += step
        assert counter.step(truth % 2**16) == step
        assert counter.advance(truth % 2**16) == truth - offset
