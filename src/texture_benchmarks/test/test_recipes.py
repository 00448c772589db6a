import os
import sys
import types
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import BENCHMARKS
from texture_benchmarks.recipes import (
    QUICK_RECIPES,
    VIBRATION,
    Setting,
    _jobs,
    _shipped,
    at_rate,
    comparable,
    figures_of,
    trained_every,
)
from texture_benchmarks.study import BenchmarkOptions
from texture_core.errors import InvalidData, ModelMismatch
from texture_core.types import NANOSECONDS, ExplorationState, Phase, TactileSignal
from texture_estimation.recipe import load_recipe
from texture_evaluation.cross_validation import ChronologicalSplit, cross_validate
from texture_recordings.dataset import LabelledSlide, SlideDataset, cut_slide, find_slides
from texture_recordings.tables import import_tables, mapping_from

pytestmark = pytest.mark.ros

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')
SLIDES = [LabelledSlide(Path('bag'), f'{s}/{k}', s, k, k, None) for s in ('cork', 'felt') for k in range(1, 11)]


def test_training_windows_begin_at_a_multiple_of_a_short_hop() -> None:
    parts = comparable(load_recipe('ets-circular-svm'), 1000.0, of_motion=False)
    assert parts.training.hop_s == pytest.approx(0.56)  # eight parts of 0.07 s: the first multiple over 0.5 s
    assert comparable(load_recipe('hu-pca-svm'), 1000.0, of_motion=False).training.hop_s == 0.5


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


def test_a_missing_input_is_named() -> None:
    with pytest.raises(ModelMismatch, match="no 'signal_static', only signal; the windows need signal, signal_static"):
        cut_slide(slide_signals(), load_recipe('kaboli-svm').feature_set)


def test_a_recipe_is_tested_on_slides_outside_its_training(simulated: Path) -> None:
    dataset = SlideDataset.from_bags([simulated])
    recipe = comparable(load_recipe('default'), 1000.0, of_motion=False)
    result = cross_validate(recipe, dataset, ChronologicalSplit(4 / 6))
    assert len(result.pooled) == 6
    figures = figures_of(result)
    assert figures['window_accuracy'] > 0.8
    assert figures['unclassified_windows'] == 0.0
    assert len(find_slides([simulated])) == len(dataset)


def test_copies_of_the_slides_are_trained_on_only_where_asked_for() -> None:
    recipe = load_recipe('default')
    assert comparable(recipe, 1000.0, of_motion=False, augmented=True).augmentation == recipe.augmentation
    assert comparable(recipe, 1000.0, of_motion=False).augmentation.copies == 0


def test_training_windows_may_overlap_where_test_windows_do_not(simulated: Path) -> None:
    dataset = SlideDataset.from_bags([simulated])
    recipe = comparable(load_recipe('jamali-naive-bayes-5'), 1000.0, of_motion=False)
    [plain], [more] = (
        cross_validate(one, dataset, ChronologicalSplit(4 / 6)).folds for one in (recipe, trained_every(0.25, recipe))
    )
    # twelve slides of 1 s, windows of 0.5 s
    assert (plain.model.training['windows'], more.model.training['windows']) == (24, 36)
    windows = [[len(found.estimates) for found in fold.results.values()] for fold in (plain, more)]
    assert windows[0] == windows[1]


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


def test_recipes_without_vibration_are_not_tried_on_vibration_alone(tmp_path: Path) -> None:
    options = BenchmarkOptions(tmp_path, DATA)
    vibration = Setting(SlideDataset((at_rate(slide_signals(), 'signal', 1000.0),)), [], 1000.0, of_motion=False)
    tried = {name for job in _jobs({VIBRATION: vibration}, _shipped(options)) for name in job.recipes}
    assert {'default', 'fast', 'hu-pca-svm'} <= tried
    assert not any(name.startswith('taxels') for name in tried)


class NearestMean:
    """A classifier with the interface of aeon's: windows (n, n_channels, n_samples) by their power."""

    def fit(self, X: np.ndarray, y: np.ndarray) -> 'NearestMean':
        power = np.log(X.var(axis=(1, 2)))
        self.labels = np.unique(y)
        self.means = np.array([power[y == label].mean() for label in self.labels])
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        power = np.log(X.var(axis=(1, 2)))
        return self.labels[np.abs(power[:, None] - self.means).argmin(axis=1)]


def loud_and_quiet(folder: Path) -> Path:
    rng = np.random.default_rng(0)
    mapping = mapping_from({
        'files': '{material}_*.npy',
        'streams': {'signal': {'columns': ['0', '1'], 'rate_hz': 1000.0}},
        'label': {'column': 'material'},
    })  # fmt: skip
    (folder / 'in').mkdir()
    for material, amplitude in (('loud', 3.0), ('quiet', 1.0)):
        for number in range(3):
            np.save(folder / 'in' / f'{material}_{number}.npy', amplitude * rng.normal(size=(2500, 2)))
    import_tables(mapping, folder / 'in', folder / 'bags')
    return folder / 'bags'


@pytest.mark.benchmark
def test_a_recipe_and_estimators_of_ones_own_stand_beside_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType('my_estimators')
    module.NearestMean = NearestMean
    monkeypatch.setitem(sys.modules, 'my_estimators', module)
    recipe = tmp_path / 'default.yaml'
    recipe.write_text(
        'windows: {length_s: 0.5, hop_s: 0.5}\ninputs: {signal: {features: [log_variance]}}\n'
        'learner: texture_papers.jamali:NaiveBayes\n'
    )
    methods = (str(recipe), 'sklearn.naive_bayes:GaussianNB', 'my_estimators:NearestMean')
    options = BenchmarkOptions(tmp_path / 'out', quick=True, own_methods=methods, own_bags=(loud_and_quiet(tmp_path),))
    result = BENCHMARKS['recipes'](options)
    [cells] = result.numbers['own recordings'].values()
    assert {'default (own)', 'GaussianNB', 'NearestMean', 'default'} == set(cells)
    assert cells['default (own)']['window_accuracy'] == cells['NearestMean']['window_accuracy'] == 1.0
    assert all(cell['latency_us']['median'] > 0 for cell in cells.values())
    assert '| NearestMean |' in (tmp_path / 'out' / 'recipes_own.md').read_text()
    assert result.name == 'recipes_own'
    assert result.split == '3 folds by slide'


def test_a_recipe_that_needs_what_the_slides_lack_is_refused(tmp_path: Path) -> None:
    recipe = tmp_path / 'slow.yaml'
    recipe.write_text('inputs: {signal_static: {features: [mean]}}\nlearner: texture_papers.jamali:NaiveBayes\n')
    options = BenchmarkOptions(
        tmp_path / 'out', quick=True, own_methods=(str(recipe),), own_bags=(loud_and_quiet(tmp_path),)
    )
    with pytest.raises(InvalidData, match=r"slow.yaml' needs signal_static; the slides have signal"):
        BENCHMARKS['recipes'](options)
