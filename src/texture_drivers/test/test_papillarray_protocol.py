# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The PapillArray's packets."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from texture_drivers.papillarray import Measurements, PapillArrayParser, layout_of

START, END = bytes.fromhex('55667788'), bytes.fromhex('AABBCCDD')


def content(counter: int = 0, arrays: int = 1, pillars: int = 2, slip: bytes = b'') -> bytes:
    """What stands between start mark and checksum, built by hand; offsets are u16."""
    values = [struct.pack('<H6f', 2, counter + p, 2.0, 3.0, 0.1, 0.2, 0.3) for p in range(pillars)]
    array = struct.pack('<H', pillars) + bytes(2 * pillars) + b''.join(values)
    whole = struct.pack('<H6f', 2, 10.0, 20.0, 30.0, 1.0, 2.0, 3.0)
    blocks = {
        1: struct.pack('<IQ', counter, 1_000_000 + 2000 * counter),
        3: struct.pack('<H', arrays) + bytes(2 * arrays) + array * arrays,
        4: struct.pack('<H', arrays) + bytes(2 * arrays) + whole * arrays,
        **({5: slip} if slip else {}),
    }
    at, index = 1 + 4 * len(blocks), b'\x02'
    for kind, block in blocks.items():
        index += struct.pack('<HH', kind, at)
        at += len(block)
    return index + b''.join(blocks.values())


def packet(counter: int, **more: object) -> bytes:
    inner = content(counter, **more)
    return START + inner + struct.pack('<H', sum(inner) % 65536) + END


def stream(numbers: range) -> bytes:
    return b''.join(packet(number) for number in numbers)


def decoded(packets: list[bytes]) -> Measurements:
    layout = layout_of(packets[0])
    assert layout is not None
    return layout.decode(packets)


def counters(packets: list[bytes]) -> list[int]:
    return list(decoded(packets).counters) if packets else []


def test_a_packet_gives_its_counter_time_pillars_and_whole() -> None:
    found = decoded([content(5, arrays=2)])
    assert (found.counters[0], found.times_us[0]) == (5, 1_010_000)
    np.testing.assert_allclose(found.pillars[1][0], [5, 2, 3, 0.1, 0.2, 0.3, 6, 2, 3, 0.1, 0.2, 0.3], rtol=1e-6)
    np.testing.assert_allclose(found.wholes[0][0], [10, 20, 30, 1, 2, 3])


def test_the_first_packet_is_believed_when_the_second_is_as_long() -> None:
    parser = PapillArrayParser()
    assert counters(parser.feed(stream(range(10)))) == list(range(1, 10))
    assert parser.refused == 0


@given(st.lists(st.integers(1, 300), max_size=20))
@settings(deadline=None)
def test_it_does_not_matter_how_the_bytes_are_cut(lengths: list[int]) -> None:
    whole = stream(range(12))[30:]
    cuts = np.cumsum([0, *lengths])
    parser = PapillArrayParser()
    pieces = [whole[a:b] for a, b in zip(cuts, [*cuts[1:], None], strict=True)]
    assert counters([found for piece in pieces for found in parser.feed(piece)]) == list(range(2, 12))


@pytest.mark.parametrize('at', range(0, len(packet(5)), 3))
def test_a_lost_byte_costs_no_more_than_two_packets_and_nothing_false_is_believed(at: int) -> None:
    damaged = packet(5)[:at] + packet(5)[at + 1 :]
    parser = PapillArrayParser()
    packets = [p for p in parser.feed(stream(range(5)) + damaged + stream(range(6, 12))) if layout_of(p)]
    assert {content(number) for number in range(12)} >= set(packets)
    assert {1, 2, 3, 4, 7, 8, 9, 10, 11} <= set(counters(packets))


def test_a_byte_0_more_passes_the_checksum_and_is_refused_for_the_length() -> None:
    inner = content(5)
    damaged = START + inner[:10] + b'\x00' + inner[10:] + struct.pack('<H', sum(inner) % 65536) + END
    parser = PapillArrayParser()
    assert counters(parser.feed(stream(range(5)) + damaged + stream(range(6, 12)))) == [1, 2, 3, 4, *range(7, 12)]
    assert parser.refused == 2


@pytest.mark.parametrize('bit', range(8))
def test_a_changed_bit_is_refused(bit: int) -> None:
    for at in range(4, len(packet(5)) - 4):
        damaged = bytearray(packet(5))
        damaged[at] ^= 1 << bit
        found = PapillArrayParser().feed(stream(range(5)) + bytes(damaged) + stream(range(6, 8)))
        assert counters(found) == [1, 2, 3, 4, 6, 7]


@pytest.mark.parametrize(
    'inner',
    [
        b'',
        content(5)[:-1],
        content(5) + b'\x00',
        content(5).replace(b'\x03\x00', b'\x09\x00', 1),  # no pillars
        b'\x03' + content(5)[1:],
        b'\x02' * 40,
    ],
)
def test_a_content_whose_blocks_do_not_fit_has_no_layout(inner: bytes) -> None:
    assert layout_of(inner) is None
