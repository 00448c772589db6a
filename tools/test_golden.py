# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The suite gives the results of the stored golden set on fixed slides; see golden.py on what to do if not."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import golden
import pytest


def test_every_recipe_and_arm_is_in_the_golden_set() -> None:
    stored = {row.partition(' on ')[0] for row in json.loads(golden.STORED.read_text())}
    assert stored == {*golden.every_recipe(), *golden.ARMS}


# Public recordings take minutes of computing time in all: they are checked with the benchmarks.
@pytest.mark.parametrize(
    'source',
    [
        pytest.param(name, marks=pytest.mark.benchmark if source.data_set else ())
        for name, source in golden.SOURCES.items()
    ],
)
def test_the_recipes_give_the_stored_results(source: str) -> None:
    if not golden.available(golden.SOURCES[source]):
        pytest.skip(f'no recorded data in {golden.DATA}; set TEXTURE_DATA to its folder')
    assert golden.check(f' on {source}') == []


@pytest.mark.parametrize(
    'arm', [pytest.param(arm, marks=pytest.mark.realtime if arm in golden.REAL_TIME else ()) for arm in golden.ARMS]
)
def test_the_arms_and_hands_are_sent_what_they_were_sent(arm: str) -> None:
    if not golden.arm_available(arm):
        pytest.skip('dynamixel-sdk is missing')
    assert golden.check(arm) == []


def test_a_number_that_differs_beyond_rounding_is_named() -> None:
    stored = {'final': {'confidence': 0.5, 'label': 'cork'}, 'features': [[1.0, 2.0]]}
    assert (
        list(
            golden.differences(stored, {'final': {'confidence': 0.5 + 1e-9, 'label': 'cork'}, 'features': [[1.0, 2.0]]})
        )
        == []
    )
    changed = {'final': {'confidence': 0.5, 'label': 'felt'}, 'features': [[1.0, 2.001]]}
    assert list(golden.differences(stored, changed)) == [
        '/features/0/1: stored 2.0, found 2.001',
        '/final/label: stored cork, found felt',
    ]


@pytest.mark.parametrize('use', ['--check', '--write'])
def test_a_word_that_no_row_has_is_refused_in_one_sentence(
    use: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, 'argv', ['golden.py', use, '--only', 'defualt'])
    before = golden.STORED.read_bytes()
    assert golden.main() == 2
    output = capsys.readouterr()
    assert output.out == ''
    assert output.err.startswith("golden: no row that can be computed here has 'defualt' in its name")
    assert output.err.count('\n') == 1
    assert golden.STORED.read_bytes() == before


def test_a_part_that_cannot_be_compared_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(golden, 'DATA', tmp_path)
    monkeypatch.setattr(golden, 'rows', lambda only: {name: golden.stored_rows()[name] for name in golden.names(only)})
    monkeypatch.setattr(sys, 'argv', ['golden.py', '--check', '--only', 'default on '])
    assert golden.main() == 0
    assert capsys.readouterr().out.splitlines() == [
        '0 differences in 2 rows',
        'not compared, as data or a library is missing here: default on biotac20',
    ]
