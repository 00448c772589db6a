# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import argparse
import json
import socket
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from foreign_tables import MAPPING, recordings, write_csv
from matplotlib.figure import Figure
from scipy.stats import beta
from sklearn.model_selection import (
    GroupShuffleSplit,
    LeaveOneGroupOut,
    PredefinedSplit,
    StratifiedGroupKFold,
    StratifiedKFold,
)

from texture_core.config import write_json
from texture_core.errors import InvalidData, InvalidParameter, ModelMismatch
from texture_core.types import TextureEstimate
from texture_estimation.recipe import Recipe
from texture_evaluation.commands import evaluate
from texture_evaluation.cross_validation import (
    ChronologicalSplit,
    CrossValidation,
    FoldResult,
    clustered,
    compare,
    comparison_chart,
    cross_validate,
    dask_backend,
    interval,
    parse_split,
    slide_counts,
    split_slides,
)
from texture_evaluation.evaluate import evaluate_dataset, sentence, table
from texture_evaluation.metrics import SlideResult
from texture_evaluation.train import train_from_bags
from texture_recordings.dataset import SlideDataset
from texture_recordings.mapping import load_mapping
from texture_recordings.tables import import_tables


@pytest.fixture
def silent_scheduler():
    with socket.create_server(('127.0.0.1', 0)) as server:
        yield f'tcp://127.0.0.1:{server.getsockname()[1]}'


def test_a_dask_scheduler_that_takes_connections_and_is_silent_is_named_in_time(silent_scheduler, monkeypatch):
    monkeypatch.setattr('texture_evaluation.cross_validation.ANSWER_S', 0.5)
    with pytest.raises(InvalidParameter, match='no Dask scheduler answers at'), dask_backend(silent_scheduler):
        pass


@pytest.mark.parametrize('address', ['foo://x', 'nonsense', 'http://127.0.0.1:8'])
def test_an_address_that_is_none_of_a_dask_scheduler_is_named(address):
    with pytest.raises(InvalidParameter, match=f"no Dask scheduler answers at '{address}'"), dask_backend(address):
        pass


RECIPE = Recipe.from_mapping(
    {
        'windows': {'length_s': 0.25, 'hop_s': 0.25},
        'inputs': {'signal': {'features': ['mean_log_bands']}},
        'learner': {'sklearn': {'estimator': 'sklearn.naive_bayes:GaussianNB'}},
        'training': {'hop_s': 0.25},
    },
    'small',
)
TONES_HZ = {'cork': 60.0, 'felt': 110.0, 'wood': 200.0, 'slate': 350.0}
SPEEDS_M_S = (0.02, 0.04, 0.08)


def tones(slides: int = 6, *, seed: int = 0, shuffled: bool = False) -> SlideDataset:
    """Return slides of 1 s whose label is the frequency of a tone in little noise."""
    rng = np.random.default_rng(seed)
    labels = [label for _ in range(slides) for label in TONES_HZ]
    time_s = np.arange(1000) / 1000.0
    samples = [
        np.sin(2 * np.pi * (TONES_HZ[label] * time_s + rng.random()))[:, None] + 0.1 * rng.normal(size=(1000, 1))
        for label in labels
    ]
    given = rng.permutation(labels).tolist() if shuffled else labels
    speeds = [SPEEDS_M_S[(number // len(TONES_HZ)) % len(SPEEDS_M_S)] for number in range(len(labels))]
    return SlideDataset.from_arrays({'signal': samples}, given, {'signal': 1000.0}, speed_m_s=speeds, force_n=1.0)


def test_tones_are_distinguished_in_every_fold() -> None:
    result = cross_validate(RECIPE, tones(), StratifiedGroupKFold(3))
    figures = result.as_json()
    assert figures['window_accuracy'] == figures['slide_accuracy'] == 1.0
    assert [fold['window_accuracy'] for fold in figures['folds']] == [1.0] * 3
    assert figures['n_slides'] == 24
    # The chance that 24 of 24 slides are right is 5 % at the lower edge.
    assert figures['window_accuracy_interval'] == [pytest.approx(0.05 ** (1 / 24)), 1.0]


def test_slides_of_two_rates_are_refused_with_the_first_that_differs() -> None:
    samples = [np.random.default_rng(0).normal(size=(n, 1)) for n in (1000, 2000)]
    one, other = (
        SlideDataset.from_arrays({'signal': [each]}, ['oak'], {'signal': float(len(each))}, speed_m_s=0.05, force_n=1.0)
        for each in samples
    )
    slides = SlideDataset((*one.slides, replace(other.slides[0], number=2, bag=Path('fast'))))
    with pytest.raises(ModelMismatch, match=r"'oak/2' in 'fast' has signal=2000Hz\*1 of .* signal=1000Hz\*1"):
        slides.features(RECIPE.feature_set)


@pytest.mark.parametrize('n', [1, 4, 20, 100])
def test_slides_that_are_all_right_or_all_wrong_have_the_exact_bound(n: int) -> None:
    edge = float(beta.ppf(0.05, n, 1))  # Clopper & Pearson 1934
    right, wrong = np.ones((n, 2)), np.tile([0.0, 3.0], (n, 1))
    assert interval(right) == [pytest.approx(edge), 1.0]
    assert interval(wrong) == [0.0, pytest.approx(1.0 - edge)]


def test_clusters_that_are_alike_or_one_wrong_window_narrow_no_interval() -> None:
    alike = np.array([[2.0, 3.0]] * 3 + [[0.0, 0.0]])  # a cluster without answers is none
    edge = 0.05 ** (1 / 3)
    assert interval(alike) == pytest.approx([2.0 / 3.0 * edge, 1.0 - edge / 3.0])
    windows = np.full((20, 2), 156.0)
    windows[0, 0] -= 1.0
    assert interval(windows) == [pytest.approx(3119 / 3120 * 0.05 ** (1 / 20)), 1.0]


def test_shuffled_labels_are_recognised_by_chance_alone() -> None:
    figures = cross_validate(RECIPE, tones(15, shuffled=True), StratifiedGroupKFold(5)).as_json()
    # 60 slides of four labels: 25 % by chance, and 3 standard deviations of a binomial fraction are 17 %.
    assert 0.08 < figures['slide_accuracy'] < 0.42


@pytest.mark.parametrize(
    ('splitter', 'groups'),
    [
        (StratifiedGroupKFold(3), 'slide'),
        (GroupShuffleSplit(4, test_size=0.25, random_state=0), 'slide'),
        (LeaveOneGroupOut(), 'speed'),
        (ChronologicalSplit(0.5), 'slide'),
    ],
)
def test_a_group_is_never_on_both_sides(splitter: object, groups: str) -> None:
    dataset = tones()
    columns = dict(zip(dataset.names, dataset.names if groups == 'slide' else dataset.condition(groups), strict=True))
    folds = cross_validate(RECIPE, dataset, splitter, groups=groups).folds
    assert folds
    for fold in folds:
        assert fold.results
        assert not {columns[name] for name in fold.trained_on} & {columns[name] for name in fold.results}


def test_a_chronological_split_tests_later_slides_only() -> None:
    [fold] = cross_validate(RECIPE, tones(), ChronologicalSplit(0.75)).folds
    last_trained = {name.split('/')[0]: int(name.split('/')[1]) for name in sorted(fold.trained_on)}
    assert last_trained == dict.fromkeys(TONES_HZ, 4)
    assert {int(name.split('/')[1]) for name in fold.results} == {5, 6}


def test_several_processes_give_the_results_of_one() -> None:
    one, two = (cross_validate(RECIPE, tones(), StratifiedGroupKFold(2), n_jobs=jobs).as_json() for jobs in (1, 2))
    assert one == two


def test_a_single_fold_gives_the_figures_of_train_and_evaluate(simulated: Path) -> None:
    dataset = SlideDataset.from_bags([simulated])
    model = train_from_bags('default', [simulated], '1-4')
    report = evaluate_dataset(model, dataset.select('5-6'))
    result = cross_validate(model.recipe, dataset, ChronologicalSplit(4 / 6))
    [fold] = result.folds
    assert [list(one.window_labels) for one in fold.results.values()] == [
        list(one.window_labels) for one in report.known
    ]
    for one, other in zip(fold.results.values(), report.known, strict=True):
        np.testing.assert_array_equal([e.confidence for e in one.estimates], [e.confidence for e in other.estimates])
        assert [e.evidence_s for e in one.estimates] == [e.evidence_s for e in other.estimates]
        assert one.end.prediction_set == other.end.prediction_set


def test_answers_of_one_cluster_count_together() -> None:
    counts = np.array([[1.0, 1.0], [0.0, 1.0], [1.0, 1.0], [1.0, 2.0]])
    np.testing.assert_array_equal(clustered(counts, ['b', 'a', 'b', 'a']), [[1.0, 3.0], [2.0, 2.0]])
    alike = np.repeat([[1.0, 1.0], [0.0, 1.0]], 10, axis=0)
    assert interval(alike, ['a'] * 10 + ['b'] * 10) == [0.0, 1.0]  # two draws
    assert interval(alike, list('abcdefghijklmnopqrst')) == interval(alike)


@pytest.mark.parametrize(
    ('splitter', 'groups', 'sentence'),
    [
        (StratifiedGroupKFold(7), 'slide', "'cork' has 6 slides, too few for 7 folds"),
        (LeaveOneGroupOut(), 'force', 'the slides cannot be split'),
        (LeaveOneGroupOut(), 'session', r'all are of one session, .*; import or record slides of a second session, '),
        ('stratified:3', 'slide', r"the splitter is 'stratified:3'; give one of scikit-learn"),
        (StratifiedKFold, 'slide', r'the splitter is <class .*StratifiedKFold.*>; give one of scikit-learn'),
        (LeaveOneGroupOut(), np.zeros(3), 'groups have the shape'),
        (
            LeaveOneGroupOut(),
            np.tile(list(TONES_HZ), 6),
            r'trained are .*; tested are cork; use the split stratified$',
        ),
    ],
)
def test_impossible_splits_are_refused_with_a_sentence(splitter: object, groups: object, sentence: str) -> None:
    with pytest.raises(InvalidData, match=sentence):
        cross_validate(RECIPE, tones(), splitter, groups=groups)


def test_bags_and_copies_of_slides_are_no_data_set(simulated: Path, tmp_path: Path) -> None:
    for validate in (split_slides, lambda *given: cross_validate(RECIPE, *given)):
        with pytest.raises(InvalidData, match=r"the data set is \['bags'\]; give a SlideDataset, such as"):
            validate(['bags'], StratifiedKFold(2))
    copied = list(np.random.default_rng(0).normal(size=(2, 2000, 1))) * 3
    dataset = SlideDataset.from_arrays({'signal': copied}, ['cork', 'felt'] * 3, {'signal': 1000.0})
    with pytest.raises(InvalidData, match="the slides 'cork/1' and 'cork/2' have the same samples; a copy is no"):
        cross_validate(RECIPE, dataset, StratifiedKFold(3))
    with pytest.raises(InvalidData, match=rf"\(in '{simulated}/\w+' and '{simulated}/\w+'\) have the same samples"):
        train_from_bags('default', [simulated, simulated])


def test_a_missing_force_or_speed_is_distinguished_from_other_values_that_are_not_finite() -> None:
    signals = {'signal': list(np.random.default_rng(0).normal(size=(6, 600, 1)))}
    for recipe, given, lacking in (('any-place', 'speed_m_s', 'force'), ('any-speed', 'force_n', 'speed')):
        dataset = SlideDataset.from_arrays(signals, ['cork', 'felt'] * 3, {'signal': 1000.0}, **{given: 0.5})
        with pytest.raises(InvalidData, match=f'4 of 4 slides came without {lacking}, which .*or take another recipe$'):
            cross_validate(recipe, dataset, StratifiedGroupKFold(3))


@pytest.mark.filterwarnings('error')
def test_a_splitter_that_knows_no_groups_is_taken_without_a_warning_of_its_library() -> None:
    assert cross_validate(RECIPE, tones(), StratifiedKFold(3)).as_json()['slide_accuracy'] == 1.0


def test_a_surface_of_one_session_trains_but_is_not_tested() -> None:
    dataset = tones()
    sessions = np.where(np.arange(24) < 12, 'monday', 'tuesday')
    sessions[dataset.labels == 'cork'] = 'monday'
    result = cross_validate(RECIPE, dataset, LeaveOneGroupOut(), groups=sessions)
    assert result.untested == {'cork': 6}
    assert {one.surface for one in result.pooled} == {'felt', 'wood', 'slate'}
    by_name = {fold.name: fold for fold in result.folds}
    assert not any(name.startswith('cork') for name in by_name['tuesday'].results)
    assert any(name.startswith('cork') for name in by_name['tuesday'].trained_on)
    assert "trained but not tested, as no other slide would train them: 'cork' (6 slides)" in table(result, 'x')


class ByDay:
    """A splitter of a user's own, which leaves a third of the slides of each surface out at a time."""

    def split(self, X: object, y: object, groups: object = None) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield the slides that train and those that test."""
        days = np.arange(24) // len(TONES_HZ) % 3
        for day in range(3):
            yield np.flatnonzero(days != day), np.flatnonzero(days == day)


RANDOM = GroupShuffleSplit(4, test_size=0.5, random_state=0)
OVER_CLUSTERS = 'clusters (surface × what was left out)'


@pytest.mark.parametrize(
    ('splitter', 'groups', 'shift', 'clusters'),
    [
        (LeaveOneGroupOut(), 'speed', 'other speed; bag not given; place not compared', 12),  # 4 surfaces, 3 speeds
        (RANDOM, 'slide', 'bag not given; place not compared', None),
        (ByDay(), 'slide', 'bag not given; place not compared', 12),
        (PredefinedSplit(np.arange(24) // 4 % 3), 'slide', 'bag not given; place not compared', 12),
    ],
)
def test_slides_of_what_was_left_out_are_one_cluster_of_the_interval(
    splitter: object, groups: str, shift: str, clusters: int | None
) -> None:
    result = cross_validate(RECIPE, tones(), splitter, groups=groups)
    figures = result.as_json()
    assert figures['shift'] == shift
    distinct = len({name for fold in result.folds for name in fold.results})  # a slide that is tested twice is one
    assert distinct < figures['n_slides'] or clusters
    assert figures['n_clusters'] == (clusters or distinct)
    assert figures['intervals_over'] == (OVER_CLUSTERS if clusters else 'slides')
    assert figures['slide_accuracy_interval'] == [pytest.approx(0.05 ** (1 / figures['n_clusters'])), 1.0]
    lines = table(result, 'x')
    assert f'surfaces; {shift}' in lines[0]
    assert any(
        line.startswith(f'95 % intervals over {figures["n_clusters"]} {figures["intervals_over"]}: ') for line in lines
    )


@pytest.mark.parametrize(
    ('bags', 'splitter', 'groups', 'shift'),
    [
        (['a'], StratifiedGroupKFold(2), 'slide', 'same bag; place not compared'),
        (['a', 'a', 'b'], StratifiedGroupKFold(2), 'slide', 'same bag; place not compared'),
        (['a', 'b'], LeaveOneGroupOut(), 'session', 'other bag; place not compared'),
        (['a', 'b', 'c'], ByDay(), 'slide', 'other bag; place not compared'),
        (['a', ''], StratifiedGroupKFold(2), 'slide', 'bag not given; place not compared'),
        (['a', 'b', 'b'], LeaveOneGroupOut(), 'speed', 'other speed; same and other bag; place not compared'),
    ],
)
def test_of_the_shift_only_what_is_certain_is_claimed(
    bags: list[str], splitter: object, groups: str, shift: str
) -> None:
    slides = [replace(one, bag=Path(bags[row // 4 % len(bags)])) for row, one in enumerate(tones())]
    assert cross_validate(RECIPE, SlideDataset(tuple(slides)), splitter, groups=groups).shift == shift


def test_a_fold_without_two_surfaces_to_train_on_is_named() -> None:
    dataset = tones().select(labels=['cork', 'felt'])
    sessions = SlideDataset(tuple(replace(slide, bag=Path(slide.surface)) for slide in dataset))
    with pytest.raises(InvalidData, match='tested are cork; if each session holds one surface, set `session`'):
        cross_validate(RECIPE, sessions, LeaveOneGroupOut(), groups='session')
    only = np.array(['x' if label == 'cork' or number < 4 else 'y' for number, label in enumerate(dataset.labels)])
    with pytest.raises(InvalidData, match="fold 'x' cannot be trained: all windows are of 'felt'"):
        cross_validate(RECIPE, dataset, LeaveOneGroupOut(), groups=only)


@pytest.mark.parametrize(
    ('text', 'kind', 'groups'),
    [
        ('stratified:4', StratifiedGroupKFold, 'slide'),
        ('stratified', StratifiedGroupKFold, 'slide'),
        ('leave-one-out:speed', LeaveOneGroupOut, 'speed'),
        ('leave-one-out:session', LeaveOneGroupOut, 'session'),
        ('leave-one-out:sensor', LeaveOneGroupOut, 'sensor'),
        ('leave-one-out:place', LeaveOneGroupOut, 'place'),
        ('chronological:0.6', ChronologicalSplit, 'slide'),
        ('random:10', GroupShuffleSplit, 'slide'),
    ],
)
def test_a_split_is_named_in_a_word(text: str, kind: type, groups: str) -> None:
    split = parse_split(text)
    assert isinstance(split.splitter, kind)
    assert split.groups == groups


@pytest.mark.parametrize(
    'text',
    [
        'stratifed:5',
        'stratified:one',
        'stratified:1',
        'leave-one-out:',
        'leave-one-out:colour',
        'chronological:2',
        '',
        'leave-one-out:place:1',
        'leave-one-out:speed:2',
        'random:0',
    ],
)
def test_a_split_that_makes_no_sense_is_refused_with_what_is_allowed(text: str) -> None:
    with pytest.raises(InvalidParameter, match=r'stratified:FOLDS|leave one of speed|above 0 and below 1'):
        parse_split(text)


@pytest.mark.parametrize('text', ['leave-one-out:place', 'leave-one-out:place:4'])
def test_a_place_is_left_out_in_slides_of_which_no_part_was_trained(text: str) -> None:
    split = parse_split(text)
    dataset = split.cut(tones())
    assert len(set(dataset.condition('place'))) == split.parts  # not every slide reaches the end of the longest
    tested = []
    for train, test in split_slides(dataset, split.splitter, split.groups):
        trained, held = dataset.take(train), dataset.take(test)
        assert len(set(held.condition('place'))) == 1
        assert not set(trained.condition('place')) & set(held.condition('place'))
        assert not {slide.whole_name for slide in trained} & {slide.whole_name for slide in held}
        assert set(trained.labels) == set(held.labels)
        tested += held.names.tolist()
    assert sorted(tested) == sorted(dataset.names)


def test_parts_of_a_slide_stay_on_one_side_of_every_other_split() -> None:
    dataset = tones().in_parts(2)
    for splitter in (StratifiedGroupKFold(2), GroupShuffleSplit(2, random_state=0)):
        for train, test in split_slides(dataset, splitter):
            wholes = [{slide.whole_name for slide in dataset.take(rows)} for rows in (train, test)]
            assert not wholes[0] & wholes[1]


def test_the_interval_of_one_wrong_slide_in_ten_holds_the_share() -> None:
    one, dataset = cross_validate(RECIPE, tones(), ChronologicalSplit()).pooled[0], 9
    wrong = SlideResult('felt', one.window_labels, one.estimates)
    low, high = interval(slide_counts([*[one] * dataset, wrong]))
    assert one.surface == 'cork'
    assert 0.6 <= low <= 0.9 <= high == 1.0


def test_the_table_has_a_row_for_each_fold_and_the_file_all_figures(tmp_path: Path) -> None:
    result = cross_validate(RECIPE, tones(), LeaveOneGroupOut(), groups='speed')
    lines = table(result, 'leave-one-out:speed')
    assert [line.split()[0] for line in lines[2:6]] == ['0.02', '0.04', '0.08', 'all']
    assert sorted(name for fold in result.folds for name in fold.results) == sorted(tones().names)
    write_json(result.as_json(), tmp_path / 'figures.json')
    written = json.loads((tmp_path / 'figures.json').read_text())
    assert written == result.as_json()
    end = result.folds[0].results['cork/1'].end
    assert written['folds'][0]['slides']['cork/1'] == {'label': 'cork', 'rejection': end.rejection.name.lower()}
    assert written['feature_set'] == result.folds[0].model.feature_set
    assert written['version'] == version('texture_evaluation')
    with pytest.raises(InvalidParameter, match='cannot be written'):
        write_json(result.as_json(), tmp_path / 'nowhere' / 'figures.json')


SMALL = """
windows: {length_s: 0.5, hop_s: 0.25}
inputs: {signal: {features: [%s]}}
learner: {sklearn: {estimator: 'sklearn.naive_bayes:GaussianNB'}}
"""


def cross_validation(recipe: str, *folds: list[bool]) -> CrossValidation:
    """Return results in which slide number k of a fold is right or not; its two windows are as the slide."""
    made = []
    for fold, right in enumerate(folds, 1):
        results = {
            f'cork/{number}': SlideResult('cork', [label] * 2, [TextureEstimate(0, 'e', label)])
            for number, one in enumerate(right, 1)
            for label in ['cork' if one else 'felt']
        }
        made.append(FoldResult(str(fold), (), results, None))
    return CrossValidation(recipe, ('cork', 'felt'), tuple(made))


def test_a_comparison_counts_the_slides_that_the_one_alone_recognises() -> None:
    one = compare(
        cross_validation('a', [True] * 2 + [False] * 8), cross_validation('b', [False] + [True] * 8 + [False])
    )
    assert (one.only_first, one.only_second, one.n_slides) == (1, 7, 10)
    assert one.p_value == pytest.approx(18 / 256)
    assert one.slide_difference == one.window_difference == pytest.approx(0.6)
    low, high = one.slide_interval
    assert 0.0 < low < 0.6 < high <= 1.0


def test_the_test_decides_where_the_interval_of_the_bootstrap_is_narrower() -> None:
    """Four slides of twelve are correct by the second recipe only: p = 2 / 2⁴."""
    one = compare(cross_validation('a', [True] * 8 + [False] * 4), cross_validation('b', [True] * 12))
    assert one.slide_interval[0] > 0.0
    assert sentence(one).endswith('p = 0.12 (exact McNemar test, which decides: no difference is shown)')
    clear = compare(cross_validation('a', [False] * 8), cross_validation('b', [True] * 8))
    assert sentence(clear).endswith('p = 0.0078 (exact McNemar test, which decides: a difference is shown)')


def test_folds_with_too_little_training_say_so_and_have_no_figures_of_acceptance() -> None:
    result = cross_validate(RECIPE, tones(), ChronologicalSplit())
    lines = table(result, 'chronological')
    needed = '1 of 1 folds reject every label: too little training: '
    assert lines[-1].startswith(needed)
    assert result.as_json()['too_little_training'] == lines[-1]
    assert lines[2].split()[-2:] == ['–', '–']
    assert 'accepted' not in lines[4]
    assert (result.as_json()['accepted_wrong'], result.as_json()['accepted_wrong_interval']) == (None, None)


def test_progress_counts_the_folds(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    monkeypatch.setattr(
        'texture_evaluation.cross_validation.progress', lambda done, *what: seen.append(what) or list(done)
    )
    result = cross_validate(RECIPE, tones(), LeaveOneGroupOut(), groups='speed')
    assert seen == [(f"cross-validating '{RECIPE.name}', folds", len(result.folds))]


def test_axes_end_at_100_percent_and_lines_that_coincide_are_both_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []
    monkeypatch.setattr(Figure, 'savefig', lambda figure, *_, **__: drawn.append(figure))
    one = cross_validate(RECIPE, tones(), StratifiedGroupKFold(2))
    comparison_chart([one, replace(one, recipe='other')], 'title', 'figure.png')
    accuracies, times = drawn[0].axes
    assert accuracies.get_xlim()[1] == times.get_ylim()[1] == 100.0
    below, above = times.get_lines()
    np.testing.assert_array_equal(below.get_ydata(), above.get_ydata())
    assert below.get_linewidth() >= 2 * above.get_linewidth()


def test_slides_of_one_place_are_one_case_of_the_test() -> None:
    first, second = (cross_validation(name, [right] * 8) for name, right in (('a', False), ('b', True)))
    assert compare(first, second).p_value == pytest.approx(2 / 2**8)
    places = {f'cork/{number}': str(number % 3) for number in range(1, 9)}
    one = compare(*(replace(result, clusters=places) for result in (first, second)))
    assert (one.n_slides, one.n_clusters, one.only_second) == (8, 3, 8)
    assert one.p_value == pytest.approx(2 / 2**3)
    assert 'exact sign test over 3 clusters' in sentence(one)


def test_the_interval_of_the_difference_is_that_of_pairs() -> None:
    """Slides that both recognise, or both do not, carry no information on the difference and widen it little."""
    common = [True, False] * 50
    one = compare(cross_validation('a', common), cross_validation('b', common))
    assert one.slide_interval == (0.0, 0.0)
    assert one.p_value == 1.0


def test_recipes_come_before_bags() -> None:
    assert evaluate.recipes_and_bags(['default', 'bags', 'any-speed']) == (['default'], ['bags', 'any-speed'])
    many = ['default', 'any-speed', 'my/own.yaml']
    assert evaluate.recipes_and_bags([*many, 'one.mcap']) == (many, ['one.mcap'])
    with pytest.raises(InvalidParameter, match='default, any-speed are recipes; name the bags behind them'):
        evaluate.recipes_and_bags(['default', 'any-speed'])


def test_a_csv_of_others_becomes_a_table_a_comparison_and_a_chart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'mapping.yaml').write_text(MAPPING)
    import_tables(load_mapping(tmp_path / 'mapping.yaml'), write_csv(tmp_path / 'in', recordings()), tmp_path / 'bags')
    names = []
    for name, feature in (('bands', 'mean_log_bands'), ('level', 'mean')):
        (tmp_path / f'{name}.yaml').write_text(SMALL % feature)
        names.append(str(tmp_path / f'{name}.yaml'))
    parser = argparse.ArgumentParser()
    evaluate.cross_validate_.configure(parser)
    evaluate.cross_validate_.run(
        parser.parse_args([
            'leave-one-out:session', *names, str(tmp_path / 'bags'),
            '--json', str(tmp_path / 'figures.json'), '--chart', str(tmp_path / 'figures.png'),
        ])
    )  # fmt: skip
    output = capsys.readouterr().out
    assert "recipe 'bands', split leave-one-out:session: 3 surfaces" in output
    assert "'level' against 'bands' on 18 slides" in output
    figures = json.loads((tmp_path / 'figures.json').read_text())
    assert (figures['split'], figures['seed']) == ('leave-one-out:session', 0)
    assert (figures['bags'], figures['slides']) == ([str(tmp_path / 'bags')], 'all')
    assert [recipe['recipe'] for recipe in figures['recipes']] == ['bands', 'level']
    assert figures['recipes'][0]['slide_accuracy'] == 1.0
    assert figures['comparisons'][0]['slide_difference'] < 0
    assert (tmp_path / 'figures.png').stat().st_size > 10_000
    assert np.isfinite(figures['comparisons'][0]['p_value'])
