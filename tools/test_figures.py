# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables of figures in the pages are those of the stored JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import figures
import pytest

STORED = {
    'numbers': {
        'default': {'accuracy': 0.8114, 'time s/window': 0.000162, 'breakdown': None},
        'rows': [{'ms': 2.0}, {'ms': 5.25}, {'ms': -3.2}],
    },
}
EMPTY = '# Page\n\n<!-- table: one -->\n<!-- end -->\n'


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Return a repository with one stored chart, 'speed', and one page with the table 'one'."""
    for folder in ('charts', 'tables'):
        (tmp_path / 'docs' / folder).mkdir(parents=True)
    (tmp_path / 'docs/charts/speed.json').write_text(json.dumps(STORED))
    (tmp_path / 'docs/tables/one.md').write_text('| {speed/default/accuracy;.1%} % |\n')
    (tmp_path / 'README.md').write_text(EMPTY)
    return tmp_path


def run(root: Path, monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """Run the tool as a person does."""
    monkeypatch.setattr(sys, 'argv', ['figures.py', *arguments])
    for name in ('stale', 'outdated'):
        monkeypatch.setattr(figures, name, lambda *_: [])  # minutes on a busy machine: `make lint` has them
    return figures.main(root)


@pytest.mark.parametrize(
    ('source', 'printed'),
    [
        ('speed/default/accuracy;.1%', '81.1'),
        ('speed/default/time s~1window;.0f*1e6', '162'),
        ('speed/rows/1/ms;.2f', '5.25'),
        ('speed/rows/2/ms;.1f', '−3.2'),
        ('speed/default/breakdown;.2f', '–'),
    ],
)
def test_a_figure_is_filled_from_its_source(root: Path, source: str, printed: str) -> None:
    (root / 'docs/tables/one.md').write_text(f'| it was {{{source}}} |\n')
    assert figures.fill(EMPTY, root) == EMPTY.replace('<!-- end -->', f'| it was {printed} |\n<!-- end -->')


def test_a_filled_page_is_checked_and_a_changed_row_is_a_fault(
    root: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = root / 'README.md'
    assert run(root, monkeypatch, '--check') == 1
    assert run(root, monkeypatch) == 0
    assert run(root, monkeypatch, '--check') == 0
    page.write_text(page.read_text().replace('81.1', '82.0'))
    assert run(root, monkeypatch, '--check') == 1
    assert 'README.md: a table is not as stored' in capsys.readouterr().out


@pytest.mark.parametrize('source', ['speed/default/gone', 'speed/rows/7/ms', 'gone/default/accuracy', 'speed/default'])
def test_a_source_that_is_gone_is_a_fault(root: Path, monkeypatch: pytest.MonkeyPatch, source: str) -> None:
    (root / 'docs/tables/one.md').write_text(f'| {{{source};.1%}} |\n')
    assert run(root, monkeypatch, '--check') == 1


def test_a_table_that_is_missing_or_not_shown_is_a_fault(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(root, monkeypatch)
    (root / 'docs/tables/two.md').write_text('| 1 |\n')
    assert run(root, monkeypatch, '--check') == 1
    (root / 'docs/tables/two.md').unlink()
    (root / 'docs/tables/one.md').unlink()
    assert run(root, monkeypatch, '--check') == 1


def test_a_stored_experiment_of_other_code_than_todays_is_a_fault_that_gives_its_rows_and_the_command(
    root: Path,
) -> None:
    now = {'task, one': 'abcd1234', 'versions': 'numpy 2'}
    stored = {**now, 'task, one': 'ffff0000', 'task, gone': 'abcd1234'}
    (root / 'docs/charts/hu-tuned.json').write_text(json.dumps({'numbers': {'digests': stored}}))
    [fault] = figures.stale(root, {'hu-tuned': lambda: now, 'not stored': dict})
    assert 'task, one; task, gone; run texture experiment hu --tune --seeds 5' in fault
    (root / 'docs/charts/jamali.json').write_text(json.dumps({'numbers': {'digests': now}}))
    assert figures.stale(root, {'jamali': lambda: now}) == []


def test_figures_of_a_recipe_that_changed_are_a_fault_that_gives_its_name_and_the_command(root: Path) -> None:
    cells = {'taxels': {'default': {'definition': 'abcd1234'}, 'any-place': {'definition': 'ffff0000'}, 'svc': {}}}
    (root / 'docs/charts/overview.json').write_text(json.dumps({'numbers': cells}))
    today = {'default': 'abcd1234', 'any-place': 'abcd1234'}
    [fault] = figures.outdated(root, today.__getitem__)
    assert fault == ('overview.json: recipes changed since it was measured: any-place; run texture benchmark overview')
    assert figures.outdated(root, {**today, 'any-place': 'ffff0000'}.__getitem__) == []
    (root / 'docs/charts/scale.json').write_text(json.dumps({'numbers': {}, 'reduced': 'reduced run'}))
    [fault] = figures.outdated(root, {**today, 'any-place': 'ffff0000'}.__getitem__)
    assert fault == 'scale.json: it is of a reduced run; run texture benchmark scale'


def test_every_table_of_the_pages_is_the_stored_one(monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(figures.ROOT, monkeypatch, '--check') == 0
