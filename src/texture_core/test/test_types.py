# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from texture_core import errors
from texture_core.errors import DeviceError, InvalidData
from texture_core.types import (
    MAX_CHARACTERS,
    FingerReceiver,
    FingerSender,
    FingerState,
    SlideMotion,
    TactileSignal,
    checked_label,
    group_similar,
    loopback_address,
    quaternion,
    quaternion_matrix,
    rotation_matrix,
    rotation_vector,
)


def batch(first: int, count: int, **changes: object) -> TactileSignal:
    values = {
        'stamp_ns': 0,
        'sensor': 'tsf85/dynamic',
        'channels': ('dynamic',),
        'units': ('count',),
        'sampling_rate_hz': 1000.0,
        'first_sample': first,
        'samples': np.zeros((count, 1), dtype=np.float32),
        **changes,
    }
    return TactileSignal(**values)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    'changes',
    [
        {'samples': np.zeros(10, dtype=np.float32)},
        {'samples': np.zeros((10, 2), dtype=np.float32)},
        {'sampling_rate_hz': 0.0},
        {'sampling_rate_hz': float('nan')},
        {'sampling_rate_hz': 1e12},
        {'first_sample': -1},
        {'units': ('count', 'count')},
    ],
)
def test_a_signal_that_contradicts_itself_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(InvalidData, match='tsf85/dynamic'):
        batch(0, 10, **changes)


@pytest.mark.parametrize(
    ('units', 'common'), [(('Pa', 'Pa'), 'Pa'), (('Pa', 'N'), ''), ((), '')], ids=['equal', 'different', 'unknown']
)
def test_the_common_unit_is_that_of_all_channels(units: tuple[str, ...], common: str) -> None:
    signal = batch(0, 10, channels=('a', 'b'), units=units, samples=np.zeros((10, 2), dtype=np.float32))
    assert signal.common_unit == common


@pytest.mark.parametrize('label', ['', 'cork', 'Kork Nr. 3 (fein)', 'höckrig', 'x' * MAX_CHARACTERS])
def test_a_plain_label_is_taken_without_the_white_space_around_it(label: str) -> None:
    assert checked_label(f' {label}\n') == label


@pytest.mark.parametrize('label', ['../../etc/x', 'a\\b', 'bell\x07', 'two\nlines'])
def test_a_label_that_names_a_path_or_cannot_be_printed_is_refused(label: str) -> None:
    with pytest.raises(InvalidData, match='slash, a backslash or a character that cannot be printed'):
        checked_label(label)


def test_a_long_label_is_refused_with_its_length_and_the_sentence_stays_short() -> None:
    with pytest.raises(InvalidData, match='has 100000 characters; at most 100') as raised:
        checked_label('x' * 100_000)
    assert len(str(raised.value)) < 200


def test_a_quarter_turn_about_z_brings_x_to_y() -> None:
    assert rotation_matrix([0.0, 0.0, np.pi / 2]) @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])


def test_a_quaternion_of_length_zero_is_no_rotation() -> None:
    assert np.isnan(quaternion_matrix((0.0, 0.0, 0.0, 0.0))).all()


@pytest.mark.parametrize('angle_rad', [0.0, 1e-9, 0.3, 2.0, np.pi - 1e-9, np.pi])
@pytest.mark.parametrize('axis', [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.0, 0.8), (-2 / 3, 1 / 3, 2 / 3)])
def test_rotation_vector_quaternion_and_matrix_are_the_same_turn(angle_rad: float, axis: tuple[float, ...]) -> None:
    matrix = rotation_matrix(angle_rad * np.array(axis))
    vector = rotation_vector(matrix)
    assert rotation_matrix(vector) == pytest.approx(matrix, abs=1e-12)
    assert np.linalg.norm(vector) == pytest.approx(angle_rad, abs=1e-8)
    longer = 3.0 * np.array(quaternion(vector))
    assert quaternion_matrix(longer) == pytest.approx(matrix, abs=1e-12)


ASKED = SlideMotion('linear_slide', 0.0, 0.1, 2.0, 1.0)


def test_what_an_arm_misses_of_the_motion_asked_for_makes_no_other_kind() -> None:
    missed = [
        replace(ASKED, speed_m_s=0.098, force_n=2.2, direction_rad=0.02),
        ASKED,
        replace(ASKED, speed_m_s=0.103, force_n=1.9, direction_rad=math.tau - 0.02),
    ]
    assert group_similar(missed) == [ASKED] * 3


@pytest.mark.parametrize(
    'other',
    [{'direction_rad': 3.0}, {'direction_rad': 0.4}, {'speed_m_s': 0.05}, {'force_n': 1.0}, {'motion': 'circular'}],
)
def test_other_directions_speeds_forces_and_names_are_other_kinds(other: dict[str, float]) -> None:
    assert group_similar([ASKED, replace(ASKED, **other)]) == [ASKED, replace(ASKED, **other)]


def test_a_kind_is_as_long_as_its_middle_slide() -> None:
    slides = [replace(ASKED, duration_s=seconds) for seconds in (0.9, 1.0, 9.0)]
    assert group_similar(slides) == [ASKED] * 3


def test_the_emulator_is_told_the_state_of_the_finger_if_there_is_one(tmp_path: Path) -> None:
    path = tmp_path / 'left' / 'finger'
    sender, silent = FingerSender(str(path)), FingerSender('')
    sender.send(FingerState(6))  # nobody is there yet
    for _ in range(2):  # the second emulator takes the place of one that has ended
        emulator = FingerReceiver(str(path))
        assert emulator.states() == []
        silent.send(FingerState(0))
        states = [FingerState(7, 0.1, -0.2, 0.003, 0.05, 0.0, -0.01, 1.5), FingerState(8)]
        for state in states:
            sender.send(state)
        path.write_bytes(b'X' * 70)  # of another program
        assert emulator.states(10.0) == states
        emulator.close()
        assert not path.exists()
        sender.send(FingerState(9))
    sender.close()


def test_a_sender_never_waits_for_an_emulator_that_does_not_read(tmp_path: Path) -> None:
    emulator, sender = FingerReceiver(str(tmp_path / 'finger')), FingerSender(str(tmp_path / 'finger'))
    for time_ns in range(2000):
        sender.send(FingerState(time_ns))
    held = [state.time_ns for state in emulator.states()]
    assert held == list(range(len(held)))
    assert len(held) > 900
    sender.send(FingerState(-1))
    assert emulator.states() == [FingerState(-1)]
    sender.close()
    emulator.close()


def test_one_emulator_has_a_pipe_and_no_other_file_stands_at_its_place(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    with pytest.raises(DeviceError, match=r'cannot be made: .* no other file'):
        FingerReceiver(str(tmp_path / 'file'))
    emulator = FingerReceiver(str(tmp_path / 'finger'))
    with pytest.raises(DeviceError, match=r'another emulator uses the pipe .* namespace'):
        FingerReceiver(str(tmp_path / 'finger'))
    emulator.close()


def test_each_emulated_controller_has_a_loopback_address_of_its_own() -> None:
    addresses = [loopback_address(f'/tmp/{name}/ur') for name in ('left', 'right')]
    assert len(set(addresses)) == 2
    assert all(re.fullmatch(r'127(\.\d{1,3}){3}', address) for address in addresses)
    assert loopback_address('192.168.0.10') == '192.168.0.10'


@pytest.mark.parametrize(
    ('given', 'shown'),
    [
        ("'x' is bad: bad\n  line 3\n    ^", "'x' is bad: bad line 3 ^"),
        (
            f"'x' is bad: {FileNotFoundError(2, 'No such file', '/x')}; give another",
            "'x' is bad: No such file; give another",
        ),
        ('x' * 10_000, 'x' * (errors.MAX_CHARACTERS - 1) + '…'),
    ],
)
def test_an_error_is_one_short_line_without_numbers_of_the_operating_system(given: str, shown: str) -> None:
    assert str(InvalidData(given)) == shown
