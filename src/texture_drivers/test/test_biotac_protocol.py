# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from texture_drivers.biotac import ERROR_WORDS, LAYOUTS, decode, sampling_command

BIOTAC, BIOTAC_SP = LAYOUTS['biotac'], LAYOUTS['biotac_sp']
# Words worked out by hand: seven bits and odd parity, five bits, 00 and odd parity.
WORDS = {
    0: bytes([0b0000000_1, 0b00000_00_1]),
    4095: bytes([0b1111111_0, 0b11111_00_0]),
    2021: bytes([0b0111111_1, 0b00101_00_1]),  # 63 * 32 + 5
    1739: bytes([0b0110110_1, 0b01011_00_0]),  # 54 * 32 + 11
}


def slot(command: int, *values: int) -> bytes:
    return bytes([command, 0]) + b''.join(WORDS[value] for value in values)


def test_sampling_commands_are_those_of_the_header_file() -> None:
    known = {
        'pac': 0x80, 'pdc': 0x83, 'tac': 0x85, 'tdc': 0x86, 'electrode1': 0xA2, 'electrode2': 0xA4,
        'electrode3': 0xA7, 'electrode19': 0xC7, 'electrode20': 0xC8, 'electrode24': 0xD0,
    }  # fmt: skip
    assert {channel: sampling_command(channel) for channel in known} == known


def test_a_frame_samples_pac_in_every_second_slot() -> None:
    assert len(BIOTAC.slots) == 44
    assert BIOTAC.slots[:4] == ('electrode1', 'pac', 'electrode2', 'pac')
    assert BIOTAC.slots[36:] == ('electrode19', 'pac', 'pdc', 'pac', 'tac', 'pac', 'tdc', 'pac')
    assert (BIOTAC.frame_rate_hz, BIOTAC.pac_rate_hz, BIOTAC.pac_per_frame) == (100.0, 2200.0, 22)
    assert (len(BIOTAC_SP.slots), BIOTAC_SP.pac_per_frame, BIOTAC_SP.pac_rate_hz) == (54, 27, 2200.0)
    assert BIOTAC_SP.frame_rate_hz == pytest.approx(81.48, abs=0.01)


@pytest.mark.parametrize('value', WORDS)
def test_words_written_by_hand_give_their_values(value: int) -> None:
    replies = decode(slot(0x80, value) * 44, BIOTAC, fingers=1)
    assert replies.pac.shape == (22, 1)
    assert (replies.pac == value).all()
    assert not replies.damaged.any()


def test_each_channel_and_finger_gets_its_own_word() -> None:
    frame = [slot(0xA2, 0, 0, 0), slot(0x80, 1739, 1739, 1739)] * 22
    frame[0] = slot(0xA2, 1739, 2021, 4095)  # electrode 1
    frame[38] = slot(0x83, 4095, 0, 0)  # PDC
    frame[42] = slot(0x86, 0, 0, 2021)  # TDC
    replies = decode(b''.join(frame), BIOTAC, fingers=3)
    assert replies.slow.shape == (1, 22, 3)
    slow = dict(zip(BIOTAC.slow_channels, replies.slow[0].tolist(), strict=True))
    assert slow['electrode1'] == [1739, 2021, 4095]
    assert slow['pdc'] == [4095, 0, 0]
    assert slow['tdc'] == [0, 0, 2021]
    assert slow['tac'] == slow['electrode19'] == [0, 0, 0]
    assert (replies.pac == 1739).all()


def test_a_parity_error_is_counted_and_leaves_the_other_fingers_alone() -> None:
    frame = bytearray(slot(0x80, 2021, 1739, 4095) * 44)
    frame[1 * 8 + 2] ^= 0x80  # slot 1 (PAC 0), first finger, first byte
    frame[3 * 8 + 5] ^= 0x01  # slot 3 (PAC 1), second finger, the parity bit of the second byte
    replies = decode(bytes(frame), BIOTAC, fingers=3)
    assert np.argwhere(np.isnan(replies.pac)).tolist() == [[0, 0], [1, 1]]
    assert replies.pac[0, 1:].tolist() == [1739, 4095]
    assert replies.pac[1, [0, 2]].tolist() == [2021, 4095]
    assert replies.damaged.tolist() == [1, 1, 0]
    assert replies.refused.tolist() == [0, 0, 0]


def test_a_place_without_a_biotac_gives_no_numbers() -> None:
    for line in (b'\x00', b'\xff'):
        replies = decode((b'\x80\x00' + WORDS[2021] + line * 2) * 44, BIOTAC, fingers=2)
        assert replies.damaged.tolist() == [0, 44]
        assert np.isnan(replies.pac[:, 1]).all()


@pytest.mark.parametrize('word', ERROR_WORDS)
def test_error_words_are_no_values(word: int) -> None:
    replies = decode((b'\x80\x00' + word.to_bytes(2, 'big')) * 44, BIOTAC, fingers=1)
    assert replies.refused.tolist() == replies.damaged.tolist() == [44]
    assert np.isnan(replies.slow).all()


def test_every_single_flipped_bit_is_noticed() -> None:
    for bit in range(16):
        word = (int.from_bytes(WORDS[2021], 'big') ^ 1 << bit).to_bytes(2, 'big')
        assert decode((b'\x80\x00' + word) * 44, BIOTAC, fingers=1).damaged.tolist() == [44]
