# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import json
import os
import re
import signal
from functools import partial
from pathlib import Path

import pytest

from texture_benchmarks import catalogue
from texture_benchmarks.catalogue import BENCHMARKS, LONG, run_all
from texture_benchmarks.commands import benchmark as command
from texture_benchmarks.generalisation import generalisation_chart
from texture_benchmarks.overview import computing_chart, sliding_chart
from texture_benchmarks.scale import scale_chart
from texture_benchmarks.scenes import ablation_chart
from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult
from texture_bringup.command import main
from texture_core.errors import InvalidData

pytestmark = pytest.mark.ros

PAGES = Path(__file__).resolve().parents[3] / 'docs'
NAMES = ('good', 'killed', 'bad', 'clock', 'missing')


def act(name: str, folder: Path) -> int:
    if name == 'killed':
        os.kill(os.getpid(), signal.SIGKILL)
    if name == 'bad':
        raise ValueError('deliberately, for the test')
    (folder / name).touch(exist_ok=False)
    return 3 if name == 'missing' else 0


def test_one_that_fails_or_is_killed_stops_no_other(tmp_path: Path) -> None:
    codes = run_all(NAMES, partial(act, folder=tmp_path))
    assert codes == {'good': 0, 'killed': -signal.SIGKILL, 'bad': 1, 'clock': 0, 'missing': 3}


def test_every_benchmark_has_its_line_on_the_page_and_what_is_scheduled_exists() -> None:
    assert set(LONG) < set(BENCHMARKS)
    page = (PAGES / 'benchmarks.md').read_text()
    assert re.findall(r'^\| `([\w-]+)` \|', page, re.MULTILINE) == list(BENCHMARKS)


@pytest.mark.parametrize(
    ('name', 'draw', 'keys'),
    [
        ('generalisation', generalisation_chart, ()),
        ('overview', sliding_chart, ()),
        ('overview', computing_chart, ()),
        ('scale', scale_chart, ('textures, default',)),
        ('scenes', ablation_chart, ()),
    ],
)
def test_the_charts_of_the_pages_can_be_drawn_from_the_stored_figures(name, draw, keys, tmp_path: Path) -> None:
    numbers = json.loads((PAGES / 'charts' / f'{name}.json').read_text(encoding='utf-8'))['numbers']
    for key in keys:
        numbers = numbers[key]
    assert draw(numbers, tmp_path / 'chart.png').is_file()


def good(benchmark: BenchmarkOptions) -> BenchmarkResult:
    return BenchmarkResult('none', 'none', {})


def bad(benchmark: BenchmarkOptions) -> BenchmarkResult:
    raise ArithmeticError('deliberately, for the test')


def missing(benchmark: BenchmarkOptions) -> BenchmarkResult:
    raise InvalidData('no folder of recorded data was given')


@pytest.fixture
def benches(monkeypatch: pytest.MonkeyPatch) -> dict:
    benches = {'missing': missing, 'overview': good, 'good': good}
    monkeypatch.setattr(command, 'BENCHMARKS', benches)
    monkeypatch.setattr(catalogue, 'BENCHMARKS', benches)
    return benches


def test_all_go_on_when_data_is_missing_and_what_takes_long_runs_on_request(benches, tmp_path: Path, capfd) -> None:
    assert set(LONG) > {'overview'}
    for more, count in (([], 1), (['--long'], 2)):
        assert main(['benchmark', 'all', '--out', str(tmp_path), '--data', str(tmp_path), *more]) == 0
        output = capfd.readouterr().out
        assert f'{count} benchmarks in ' in output
        assert 'missing: left out: no folder of recorded data was given' in output
        assert 'left out, for their data is missing: missing; failed: none' in output


def test_all_go_on_when_one_fails_and_the_command_ends_with_1(benches, tmp_path: Path, capfd) -> None:
    benches['clock'] = bad
    benches['last'] = good
    assert main(['benchmark', 'all', '--out', str(tmp_path), '--data', str(tmp_path)]) == 1
    output = capfd.readouterr()
    assert '2 benchmarks in ' in output.out
    assert 'failed: clock' in output.out
    assert 'deliberately' in output.err
    assert (tmp_path / 'good.json').is_file()


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [(['benchmark', 'overvew'], "did you mean 'overview'?"), (['benchmark', 'overview', '--quick'], '--data')],
)
def test_a_mistake_is_answered_with_one_sentence_and_exit_code_2(arguments, sentence, capsys, monkeypatch) -> None:
    monkeypatch.delenv('TEXTURE_DATA', raising=False)
    assert main(arguments) == 2
    output = capsys.readouterr().err
    assert sentence in output
    assert output.count('\n') == 1


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        ('benchmark latency --out /proc/x', "'/proc/x' cannot be used"),
        ('endurance --duration 0', '--duration is 0; it must be above 0'),
    ],
)
def test_a_wrong_option_is_refused_before_anything_runs(
    arguments: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments.split()) == 2
    assert sentence in capsys.readouterr().err
