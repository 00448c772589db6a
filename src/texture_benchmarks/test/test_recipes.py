# SPDX-License-Identifier: Apache-2.0
import json
import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import BENCHMARKS
from texture_benchmarks.frontier import TrainingSize, costs
from texture_benchmarks.overview import PEERS, SHOWN, SOURCES, methods_of
from texture_benchmarks.recipes import (
    QUICK_RECIPES,
    VIBRATION,
    Setting,
    at_rate,
    comparable,
    figures_of,
)
from texture_benchmarks.study import BenchmarkOptions
from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS, ExplorationState, Phase, TactileSignal
from texture_estimation.recipe import load_recipe
from texture_evaluation.cross_validation import ChronologicalSplit, cross_validate
from texture_papers.protocol import digest_of
from texture_recordings.dataset import LabelledSlide, SlideDataset, find_slides

pytestmark = pytest.mark.ros

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')
SLIDES = [LabelledSlide(Path('bag'), f'{s}/{k}', s, k, k, None) for s in ('cork', 'felt') for k in range(1, 11)]


def slide_signals(gap: int = 0) -> LabelledSlide:
    """Return a tone of 100 Hz at 2200 Hz in batches of 44 samples; `gap` samples are lost after 0.5 s."""
    rows = [slice(start, start + 44) for start in range(0, 4400, 44)]
    tone = np.sin(2 * np.pi * 100.0 * np.arange(4400 + gap) / 2200.0).astype(np.float32)[:, None]
    batches = []
    for part in rows:
        first = part.start + (gap if part.start >= 1100 else 0)
        stamp = round(first / 2200.0 * NANOSECONDS)
        batches.append(TactileSignal(stamp, 's', ('a',), (), 2200.0, first, tone[first : first + 44]))
    state = ExplorationState(0, 'e', 'linear_slide', Phase.SLIDE, steady_s=2.0, speed_m_s=0.02, surface='cork')
    return replace(SLIDES[0], signals={'signal': batches}, states=[state])


def test_another_rate_keeps_a_tone_and_its_losses() -> None:
    for gap in (0, 220):
        batches = at_rate(slide_signals(gap), 'signal', 1000.0).signals['signal']
        assert len(batches) == (2 if gap else 1)
        assert [after.first_sample - before.next_sample for before, after in pairwise(batches)] == [100] * bool(gap)
        assert sum(len(batch.samples) for batch in batches) == 2000
        middle = batches[0].samples[100:400, 0]
        np.testing.assert_allclose(middle, np.sin(2 * np.pi * 0.1 * np.arange(100, 400)), atol=0.01)


def test_recipes_are_compared_on_windows_of_one_length_without_what_the_session_reports() -> None:
    linear = comparable(load_recipe('ets-linear-svm'), 1000.0, of_motion=False)
    assert linear.feature_set.as_mapping()['inputs']['signal'].keys() == {'features'}
    vote = comparable(load_recipe('ets-linear-svm-vote'), 1000.0, of_motion=True)
    assert vote.feature_set.windows.length_s == 0.1
    assert vote.feature_set.as_mapping()['inputs']['signal']['stretch_to_m_s'] == 0.15
    spectrum = comparable(load_recipe('hu-log-pca-svm'), 1000.0, of_motion=False).feature_set
    assert (spectrum.windows.length_s, spectrum.inputs[0].features[0][1].points) == (0.5, 250)


@pytest.mark.parametrize(
    ('name', 'voters', 'length_s'),
    [
        ('ets-linear-svm-vote', 5, 0.1),
        ('ets-linear-ann-vote', 5, 0.1),
        ('ets-circular-svm', 7, 0.07),
        ('ets-circular-ann', 7, 0.07),
    ],
)
def test_recipes_that_vote_are_compared_with_the_vote_they_ship_with(name: str, voters: int, length_s: float) -> None:
    setting = Setting(SlideDataset((slide_signals(),)), [], 1000.0, of_motion=False)
    tried = setting.recipe(name)
    assert tried.evidence == load_recipe(name).evidence
    assert (tried.evidence.group, tried.feature_set.windows.length_s) == (voters, length_s)


def test_a_recipe_is_tested_on_slides_outside_its_training(simulated: Path) -> None:
    dataset = SlideDataset.from_bags([simulated])
    recipe = comparable(load_recipe('default'), 1000.0, of_motion=False)
    result = cross_validate(recipe, dataset, ChronologicalSplit(4 / 6))
    assert len(result.pooled) == 6
    figures = figures_of(result)
    assert figures['window_accuracy'] > 0.8
    assert figures['unclassified_windows'] == 0.0
    assert len(find_slides([simulated])) == len(dataset)


@pytest.mark.benchmark
@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_recorded_slides_are_recognised_by_all_and_the_table_is_whole(tmp_path: Path) -> None:
    result = BENCHMARKS['recipes'](BenchmarkOptions(tmp_path, DATA, quick=True))
    assert all(chart.is_file() for chart in result.charts)
    for setting in ('biotac20, PAC at 1 kHz', 'biotac20, all channels'):
        cell = result.numbers[setting]['by time']['default']
        assert cell['window_accuracy'] > 0.5
        assert 0 < cell['latency_us']['median'] <= cell['latency_us']['p99']
        assert cell['train_s'] > 0
    head, _, *rows = (tmp_path / 'recipes.md').read_text().splitlines()
    assert 'biotac20, PAC at 1 kHz, random: window; slide (%)' in head
    assert {row.split(' | ')[0] for row in rows} == {f'| {name}' for name in QUICK_RECIPES}
    assert set(result.numbers['ntp21']) == {'one force out', 'one speed out'}


@pytest.mark.benchmark
@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_the_shorter_run_tries_the_vibration_of_later_slides(tmp_path: Path) -> None:
    result = BENCHMARKS['recipes_later'](BenchmarkOptions(tmp_path, DATA, quick=True))
    assert set(result.numbers) == {VIBRATION}
    assert set(result.numbers[VIBRATION]) == {'by time'}
    assert result.split == 'by time: trained on slides 1-30 of each surface, tested on the later ones'
    assert [chart.name for chart in result.charts] == ['recipes_later.png', 'recipes_later_sliding.png']


CHARTS = Path(__file__).resolve().parents[3] / 'docs' / 'charts'


def stored() -> dict:
    return {name: json.loads((CHARTS / f'{name}.json').read_text())['numbers'] for name in ('recipes_later', 'trust')}


def test_computing_is_added_to_the_sliding_time() -> None:
    peer = {'decisions': {'s': [0.5, 1.0], 'share': [0.6, 0.8]}, 'latency_us': {'median': 20_000.0}}
    methods = {method.name: method for method in methods_of({**stored(), 'peers': {'slow': peer}})}
    assert methods['slow'].seconds == pytest.approx([0.52, 1.02])
    assert methods['slow'].kind == PEERS
    measured = stored()['recipes_later']['biotac20, PAC at 1 kHz']['by time']
    current = {recipe for recipe, cell in measured.items() if cell['definition'] == digest_of(recipe)}
    drawn = {title for recipe, (title, _) in SHOWN.items() if recipe in current}
    assert drawn == set(methods) & {title for title, _ in SHOWN.values()}
    assert len(drawn) > 5


def test_a_figure_that_is_not_stored_is_asked_for(tmp_path: Path) -> None:
    assert any(SOURCES.values())
    with pytest.raises(InvalidData, match='run `texture benchmark recipes_later` first'):
        BENCHMARKS['overview'](BenchmarkOptions(tmp_path))


def test_a_training_takes_time_and_little_memory_where_only_means_are_kept() -> None:
    [found] = costs('texture_papers.jamali:NaiveBayes', [TrainingSize(200, 4)], limit_s=60.0, seed=0).values()
    assert 0 < found.seconds < 60
    assert 0 <= found.mebibytes < 100


def test_what_takes_too_long_is_not_tried_in_a_larger_size() -> None:
    sizes = [TrainingSize(windows, 4) for windows in (40, 80, 160)]
    assert list(costs('texture_papers.jamali:NaiveBayes', sizes, limit_s=0.0, seed=0)) == sizes[:1]
    assert list(costs('texture_papers.jamali:NaiveBayes', sizes, limit_s=60.0, seed=0)) == sizes


@pytest.mark.benchmark
@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_longer_windows_are_recognised_more_often(tmp_path: Path) -> None:
    result = BENCHMARKS['frontier'](BenchmarkOptions(tmp_path, DATA, quick=True))
    assert all(chart.is_file() for chart in result.charts)
    short, long = (result.numbers['by_window_length']['fast'][length] for length in ('0.1 s', '0.5 s'))
    assert short['window_accuracy'] < long['window_accuracy']
    assert result.numbers['trainings']['labels']['mlp'][0]['seconds'] > 0
