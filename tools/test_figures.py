# SPDX-License-Identifier: Apache-2.0
"""Numbers in the pages are those of the stored JSON, and no measured number stands without its source."""

from __future__ import annotations

import json
from pathlib import Path

import figures
import pytest

STORED = {
    'numbers': {
        'default': {'accuracy': 0.8114, 'time s/window': 0.000162, 'breakdown': None},
        'rows': [{'ms': 2.0}, {'ms': 5.25}],
    },
}


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a page of a repository that has one stored chart, 'speed'."""
    (tmp_path / 'docs').mkdir()
    (tmp_path / 'speed.json').write_text(json.dumps(STORED))
    monkeypatch.setattr(figures, 'CHARTS', tmp_path)
    monkeypatch.setattr(figures, 'UNCONVERTED', frozenset())
    figures.numbers.cache_clear()
    yield tmp_path / 'README.md'
    figures.numbers.cache_clear()


@pytest.mark.parametrize(
    ('comment', 'printed'),
    [
        ('speed/default/accuracy;.1%', '81.1'),
        ('speed/default/time s~1window;.0f*1e6', '162'),
        ('speed/rows/*/ms;max .2f', '5.25'),
        ('speed/rows/1/ms minus speed/rows/0/ms;.1f', '3.2'),
        ('speed/rows/0/ms minus speed/rows/1/ms;.1f', '−3.2'),
        ('speed/rows;len d', '2'),
        ('speed/default/breakdown;.2f', '–'),
    ],
)
def test_a_number_is_filled_from_its_source(page: Path, comment: str, printed: str) -> None:
    page.write_text(f'It was ?<!--={comment}--> here.')
    assert figures.write(page.parent) == ['README.md']
    assert page.read_text() == f'It was {printed}<!--={comment}--> here.'
    assert figures.check(page.parent) == []


def test_a_number_that_disagrees_with_its_source_is_a_fault(page: Path) -> None:
    page.write_text('Of the windows 82.0<!--=speed/default/accuracy;.1%--> % were right.')
    [fault] = figures.check(page.parent)
    assert fault == 'README.md:1: 82.0 stands for speed/default/accuracy, which is 81.1'


def test_an_example_in_code_is_left_as_it_is(page: Path) -> None:
    page.write_text('Write\n\n    Here ?<!--=speed/default/accuracy;.1%--> %\n\nand run it.')
    assert figures.write(page.parent) == []
    assert figures.check(page.parent) == []


@pytest.mark.parametrize('source', ['speed/default/gone', 'speed/rows/7/ms', 'gone/default/accuracy'])
def test_a_source_that_is_gone_is_a_fault(page: Path, source: str) -> None:
    page.write_text(f'Of the windows 81.1<!--={source};.1%--> % were right.')
    assert len(figures.check(page.parent)) == 1


def test_a_comment_without_a_number_before_it_is_a_fault(page: Path) -> None:
    page.write_text('Of the windows <!--=speed/default/accuracy;.1%--> % were right.')
    assert len(figures.check(page.parent)) == 1


@pytest.mark.parametrize('number', ['81.1 %', '5 ms', '0.4 N', '2 points', '1.5 m/s', '160 Hz', '3 dB'])
def test_a_number_with_a_unit_needs_a_source(page: Path, number: str) -> None:
    page.write_text(f'# Page\n\nHere it was {number} in the end.')
    [fault] = figures.check(page.parent)
    assert fault.startswith('README.md:3:')


@pytest.mark.parametrize(
    'text',
    [
        'Windows last 0.5 s. <!-- constants -->',
        '<!-- constants: section -->\n\nWindows last 0.5 s.',
        'It took 2 min. <!-- measured once -->',
        '| recipe | after 5 s |\n|---|---|\n| gain of 3 dB | good |',
        'Windows\n\n<!-- constants: page -->',
        'Write `0.5 s`.\n\n```\n5 ms\n```',
        'There are 5 slides and 3 surfaces, at 81.1<!--=speed/default/accuracy;.1%--> %.',
    ],
)
def test_constants_code_counts_and_included_numbers_need_none(page: Path, text: str) -> None:
    page.write_text(text)
    assert figures.check(page.parent) == []


def test_the_marker_of_a_section_ends_with_it(page: Path) -> None:
    page.write_text('# Page\n\n## One\n\n<!-- constants: section -->\n\n5 ms\n\n### Below\n\n6 ms\n\n## Two\n\n7 ms')
    [fault] = figures.check(page.parent)
    assert "'7 ms'" in fault


def test_every_number_of_the_pages_is_the_stored_one_and_has_a_source() -> None:
    assert figures.check() == []
