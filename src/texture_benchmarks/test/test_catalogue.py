# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import json
import re
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Text

from texture_benchmarks.catalogue import BENCHMARKS, run_benchmark
from texture_benchmarks.generalisation import generalisation_chart
from texture_benchmarks.overview import computing_chart, sliding_chart
from texture_benchmarks.scenes import ablation_chart
from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.trust import failures_chart
from texture_bringup.command import main
from texture_evaluation.charts import DPI, REDUCED, chart

pytestmark = pytest.mark.ros

PAGES = Path(__file__).resolve().parents[3] / 'docs'


def test_every_benchmark_has_its_line_on_the_page_and_make_runs_some() -> None:
    page = (PAGES / 'benchmarks.md').read_text()
    assert re.findall(r'^\| `([\w-]+)` \|', page, re.MULTILINE) == list(BENCHMARKS)
    [made] = re.findall(r'^BENCHMARKS := (.*)', (PAGES.parent / 'Makefile').read_text(), re.MULTILINE)
    assert set(made.split()) < set(BENCHMARKS)


@pytest.mark.parametrize(
    ('name', 'draw'),
    [
        ('generalisation', generalisation_chart),
        ('overview', sliding_chart),
        ('overview', computing_chart),
        ('scenes', ablation_chart),
        ('trust', failures_chart),
    ],
)
def test_the_charts_of_the_pages_can_be_read_on_a_phone_and_drawn_from_the_stored_figures(
    name, draw, tmp_path: Path, monkeypatch
) -> None:
    numbers = json.loads((PAGES / 'charts' / f'{name}.json').read_text(encoding='utf-8'))['numbers']
    sizes: list[float] = []

    def note_sizes(figure: Figure, path: Path, **options: object) -> None:
        saved(figure, path, **options)
        sizes.extend(text.get_fontsize() for text in figure.findobj(Text) if text.get_text())

    saved = Figure.savefig
    monkeypatch.setattr(Figure, 'savefig', note_sizes)
    path = draw(numbers, tmp_path / 'chart.png')
    width_in = imread(path).shape[1] / DPI
    assert min(sizes) / 72 / width_in * 380 >= 9, 'text below 9 pixels on a phone'


@pytest.mark.parametrize('quick', [True, False])
def test_the_json_and_the_picture_of_a_quick_run_are_marked(quick: bool, tmp_path: Path, monkeypatch) -> None:
    def drawn(options: BenchmarkOptions) -> BenchmarkResult:
        with chart(options.out / 'chart.svg', (3.0, 3.0)) as figure:
            texts = figure.texts
        return BenchmarkResult('slides', 'halves', {'texts': [one.get_text() for one in texts]})

    monkeypatch.setitem(BENCHMARKS, 'scale', drawn)
    _, path = run_benchmark('scale', BenchmarkOptions(tmp_path, quick=quick))
    written = json.loads(path.read_text())
    assert written['numbers']['texts'] == ([REDUCED] if quick else [])
    assert written.get('reduced', '') == (REDUCED if quick else '')
    assert written['split'] == (f'{REDUCED}; part of: halves' if quick else 'halves')


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
