# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every line of the page on importing is run: commands, Python and mappings."""

from __future__ import annotations

import contextlib
import io
import os
import re
import runpy
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from texture_bringup.command import main
from texture_recordings.mapping import mapping_from

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / 'docs' / 'recordings.md').read_text()
_, TUTORIAL, REFERENCE, _ = re.split('## From a CSV to a figure|## The mapping|## Cross-validation', PAGE)
NAMED = re.compile(r'```yaml\n# (\S+\.yaml)\n(.*?)```', re.DOTALL)
BLOCK = re.compile(r'```yaml\n(.*?)```', re.DOTALL)
PYTHON = re.compile(r'```python\n(.*?)```', re.DOTALL)
COMMAND = re.compile(r'^    (texture .*)$', re.MULTILINE)


@pytest.fixture(scope='module')
def output(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Follow the page in an empty folder, and return what its commands print."""
    before, folder = Path.cwd(), tmp_path_factory.mktemp('reader')
    os.chdir(folder)
    printed = io.StringIO()
    try:
        for name, text in NAMED.findall(TUTORIAL):
            Path(name).write_text(text)
        argv, sys.argv = sys.argv, ['foreign_tables.py', 'my_csv']
        runpy.run_path(str(ROOT / 'examples' / 'foreign_tables.py'), run_name='__main__')
        sys.argv = argv
        with contextlib.redirect_stdout(printed):
            for line in COMMAND.findall(TUTORIAL):
                assert main(shlex.split(line)[1:]) == 0, line
            for block in PYTHON.findall(TUTORIAL):
                exec(compile(block, 'docs/recordings.md', 'exec'), {})
        yield printed.getvalue()
    finally:
        os.chdir(before)


@pytest.mark.benchmark
def test_the_page_shows_the_file_that_its_script_writes(output: str) -> None:
    first = Path('my_csv/2031-05-01, linen, v20.csv').read_text().split('\n')[:4]
    assert '\n'.join(first) in PAGE


@pytest.mark.benchmark
def test_the_page_shows_what_the_import_prints(output: str) -> None:
    shown = TUTORIAL.split('```text\n')[2].split('```')[0]
    assert output.count(shown) == 2  # once by --dry-run


@pytest.mark.benchmark
def test_a_reader_ends_with_figures_charts_and_a_file(output: str) -> None:
    for name in ('figure.png', 'figures.json', 'slides.parquet'):
        assert Path(name).stat().st_size > 200, name
    printed = TUTORIAL.split('```text\n')[3].split('```')[0]
    assert [line for line in printed.splitlines() if line.removesuffix('…') not in output] == []
    assert '72 (250, 3)' in output
    assert "72 ['cork_thick', 'linen', 'oak board']" in output


@pytest.mark.parametrize('text', BLOCK.findall(REFERENCE))
def test_a_mapping_of_the_page_is_one(text: str) -> None:
    mapping_from(yaml.safe_load(text))
