# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The notebooks of examples/ run from the first cell to the last, without a kernel."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parent.parent / 'examples').glob('*.ipynb'))


def cells(notebook: Path) -> list[str]:
    """Return the text of each cell of code."""
    content = json.loads(notebook.read_text(encoding='utf-8'))
    return [''.join(cell['source']) for cell in content['cells'] if cell['cell_type'] == 'code']


def test_there_is_a_notebook() -> None:
    assert [path.name for path in NOTEBOOKS] == ['recordings.ipynb']


@pytest.mark.benchmark
@pytest.mark.parametrize('notebook', NOTEBOOKS, ids=lambda path: path.name)
def test_every_cell_runs_after_those_above_it(
    notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr('tempfile.mkdtemp', lambda: str(tmp_path))
    names: dict[str, object] = {'__name__': '__main__'}
    for number, text in enumerate(cells(notebook), 1):
        exec(compile(text, f'{notebook.name}, cell {number}', 'exec'), names)
    output = capsys.readouterr().out
    assert '36 slides over 3 surfaces from 12 files' in output
    assert 'PairedComparison(first=' in output
    assert (tmp_path / 'figure.png').stat().st_size > 10_000


@pytest.mark.benchmark
@pytest.mark.parametrize('notebook', NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_is_kept_without_its_output(notebook: Path) -> None:
    content = json.loads(notebook.read_text(encoding='utf-8'))
    assert not any(cell.get('outputs') or cell.get('execution_count') for cell in content['cells'])
