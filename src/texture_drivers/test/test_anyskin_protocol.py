# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The AnySkin's frames, which have neither header nor checksum."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from texture_core.types import TactileSignal
from texture_drivers.anyskin import AnySkin, FrameParser
from texture_drivers.sensor import SensorParams

SIZE = 82


def frame(number: float, temperature_c: float = 30.0) -> bytes:
    """A frame whose first axis holds a number."""
    values = [temperature_c, 100.0 + number, -200.0, 300.0]
    return struct.pack('<4f', *values) + struct.pack('<4f', temperature_c, 5.0, 6.0, 7.0) * 4 + b'\r\n'


def stream(numbers: range) -> bytes:
    return b''.join(frame(number) for number in numbers)


def parsed(*pieces: bytes) -> tuple[list[float], list[int], FrameParser]:
    """Return the numbers of all frames, what is missing before each run, and the parser."""
    parser = FrameParser()
    runs = [run for piece in [b'\r\n', *pieces] for run in parser.feed(piece)]
    numbers = [float(value) - 100.0 for run in runs for value in run.values[:, 0, 1]]
    return numbers, [run.missing for run in runs], parser


def test_a_frame_of_the_manual_s_layout_gives_its_values() -> None:
    assert len(frame(0)) == SIZE
    runs = FrameParser().feed(b'\r\n' + stream(range(3)))
    assert runs[0].values.shape == (3, 5, 4)
    np.testing.assert_allclose(runs[0].values[0, 0], [30.0, 100.0, -200.0, 300.0])
    np.testing.assert_allclose(runs[0].values[0, 4], [30.0, 5.0, 6.0, 7.0])


def test_each_axis_of_each_magnetometer_is_in_its_channel() -> None:
    """Of the vendor's four values, temperature, x, y and z, the temperature is no channel."""
    skin = AnySkin(SensorParams(config='{rate_hz: 100.0}'))
    signals: list[TactileSignal] = []
    for number in range(50):
        signals += skin.feed(stream(range(number, number + 1)), number * 10_000_000).get('signal', [])
    values = dict(zip(signals[-1].channels, signals[-1].samples[-1], strict=True))
    assert values == {
        'm0_x': 149.0, 'm0_y': -200.0, 'm0_z': 300.0,
        **{f'm{number}_{axis}': value for number in range(1, 5) for axis, value in (('x', 5), ('y', 6), ('z', 7))},
    }  # fmt: skip


@pytest.mark.parametrize(('first', 'begin'), [(0, 1), (1, 1), (40, 1), (80, 1), (81, 2)])
def test_it_begins_with_the_first_frame_behind_a_whole_line_end(first: int, begin: int) -> None:
    parser = FrameParser()
    runs = parser.feed(stream(range(10))[first:])
    assert [float(value) - 100.0 for value in runs[0].values[:, 0, 1]] == list(range(begin, 10))
    assert parser.refused_bytes == begin * SIZE - first
    assert parser.refused == 0


def test_nothing_is_believed_before_three_frames_in_a_row() -> None:
    parser = FrameParser()
    assert parser.feed(b'\r\n' + stream(range(2))) == []
    assert len(parser.feed(stream(range(2, 3)))[0].values) == 3


@given(st.lists(st.integers(1, 200), max_size=30))
@settings(deadline=None)
def test_it_does_not_matter_how_the_bytes_are_cut(lengths: list[int]) -> None:
    whole = stream(range(12))[17:]
    cuts = np.cumsum([0, *lengths])
    pieces = [whole[a:b] for a, b in zip(cuts, [*cuts[1:], None], strict=True)]
    assert parsed(*pieces)[0] == parsed(whole)[0] == list(range(1, 12))


@pytest.mark.parametrize('at', [*range(0, SIZE, 7), 80, 81])
def test_a_lost_byte_costs_its_frame_and_if_it_was_of_the_end_the_next_one(at: int) -> None:
    damaged = frame(4)[:at] + frame(4)[at + 1 :]
    numbers, missing, parser = parsed(stream(range(4)) + damaged + stream(range(5, 12)))
    lost = {4, 5} if at >= SIZE - 2 else {4}  # behind a damaged end nothing is believed
    assert set(range(12)) - set(numbers) == lost
    assert sum(missing) == len(lost)
    assert parser.refused == 1


@pytest.mark.parametrize('at', [0, 3, 50, 80, 81])
@pytest.mark.parametrize('more', [b'\x00', b'\xff\r', b'\r\n'])
def test_added_bytes_cost_their_frame_and_are_counted(at: int, more: bytes) -> None:
    damaged = frame(4)[:at] + more + frame(4)[at:]
    numbers, missing, _ = parsed(stream(range(4)) + damaged + stream(range(5, 12)))
    assert set(range(12)) - set(numbers) <= {4, 5}
    assert set(numbers) <= set(range(12))
    assert len(numbers) + sum(missing) == 12


def test_a_byte_added_within_the_first_value_changes_none_that_is_believed() -> None:
    """Counted from its end the frame would fit, and only the smallest byte of its temperature would be another."""
    for at in range(4):
        damaged = frame(4)[:at] + b'\x07' + frame(4)[at:]
        parser = FrameParser()
        runs = parser.feed(stream(range(4)) + damaged + stream(range(5, 12)))
        assert {float(value) for run in runs for value in run.values[:, 0, 0]} == {30.0}
        assert sum(run.missing for run in runs) == 1


@pytest.mark.parametrize('value', [float('nan'), float('inf'), 60_000.0, 1e-20])
def test_a_value_that_no_magnetometer_measures_refuses_its_frame(value: float) -> None:
    impossible = frame(4)[:4] + struct.pack('<f', value) + frame(4)[8:]
    numbers, missing, parser = parsed(stream(range(4)) + impossible + stream(range(5, 9)))
    assert numbers == [0, 1, 2, 3, 5, 6, 7, 8]
    assert (sum(missing), parser.refused) == (1, 1)
