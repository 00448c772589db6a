# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidData, InvalidParameter, TextureError
from texture_core.types import Window
from texture_estimation import search
from texture_estimation.evidence_rules import MajorityVote
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness import Grades, load_roughness_recipe
from texture_estimation.search import (
    UNDECIDED,
    Axis,
    ClassificationTask,
    RecipeSpace,
    RoughnessTask,
    SearchParams,
    SearchSlides,
    decided_by_slide,
    decisions,
    fitness,
    optimise,
    random_halves,
)
from texture_evaluation.cross_validation import dask_backend, workers
from texture_evaluation.optimise import optimise_pairs
from texture_features.windows import CutWindow
from texture_papers.protocol import ArrayStream, SlideArrays

distributed = pytest.importorskip('distributed')

SMALL = SearchParams(population=6, generations=3, halves=4)


def tones(labels: int = 3, count: int = 8, noise: float = 1.0) -> SlideArrays:
    """Return scans of 0.5 s at 1 kHz: each surface another tone, which shifts with the speed, and noise."""
    rng = np.random.default_rng(1)
    speed = np.tile([0.1, 0.15, 0.2, 0.15], labels * count // 4)
    pitch = np.repeat(40.0 + 4.0 * np.arange(labels), count) * speed / 0.15
    phase = 2 * np.pi * (pitch[:, None] * np.arange(500) / 1000.0 + rng.random((len(speed), 1)))
    samples = np.sin(phase) + noise * rng.normal(size=phase.shape)
    names = np.repeat([f'surface_{number}' for number in range(labels)], count)
    return SlideArrays({'signal': ArrayStream(samples[..., None], 1000.0)}, names, speed, np.ones_like(speed))


# -- what is varied


def test_the_variables_and_their_ranges_are_those_of_the_papers() -> None:
    axes = RecipeSpace.load('ets-svm', load_recipe('ets-linear-svm')).axes
    assert {name: (axis.values[0], axis.values[-1]) for name, axis in axes.items()} == {
        'peaks': (2, 15),
        'gap_hz': (5, 50),
        'ranking': ('frequency', 'intensity'),
        'speed': ('unused', 'stretch'),
        'force': ('no', 'yes'),
        'signal_energy': ('no', 'yes'),
        'arc_length': ('no', 'yes'),
        'box_constraint': (0.01, 10.0),
        'kernel_scale': (1e-5, 1e5),
    }
    assert axes['gap_hz'].values == tuple(range(5, 51))
    np.testing.assert_allclose(np.diff(np.log10(axes['box_constraint'].values)), 0.05, atol=2e-3)
    circle = RecipeSpace.load('ets-circular-ann', load_recipe('ets-circular-ann')).axes
    assert circle['parts'].values == ('1', '3', '5', '7', '9')
    assert circle['hidden'].values == tuple(range(5, 51))
    for regressor, own in (('ann5', {'hidden': (5, 50)}), ('svm5', {'kernel_scale': (1e-5, 1e5), 'peaks': (2, 15)})):
        axes = RecipeSpace.load(f'ets-roughness-{regressor}', load_roughness_recipe(f'ets-roughness-{regressor}')).axes
        assert {name: (axes[name].values[0], axes[name].values[-1]) for name in own} == own


@pytest.mark.parametrize(
    ('search', 'recipe'),
    [
        ('ets-svm', 'ets-linear-svm'),
        ('ets-ann', 'ets-linear-ann-vote'),
        ('ets-circular-svm', 'ets-circular-svm'),
        ('ets-fine-ann', 'ets-fine-ann'),
        ('mlp', 'default'),
    ],
)
def test_every_individual_is_a_recipe_and_is_found_again_in_it(search, recipe) -> None:
    space = RecipeSpace.load(search, load_recipe(recipe))
    counts = [len(axis.values) for axis in space.axes.values()]
    for point in np.random.default_rng(0).random((20, len(counts))):
        individual = space.individual(point * counts)
        found = space.recipe(individual)
        assert found.feature_set.inputs
        again = RecipeSpace(found, space.axes)
        assert again.recipe(again.individual(again.of_base())).as_mapping() == found.as_mapping()


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('variables: {a: {kind: intger, low: 1, high: 2, set: windows/hop_s}}', "did you mean 'integer'?"),
        ('variables: {a: {kind: integer, low: 1, high: 1.0e+12, set: windows/hop_s}}', 'at most 100000 values'),
        ('variables: {a: {kind: choice, options: [x, x], set: windows/hop_s}}', 'name each once'),
        ('variables: {a: {kind: integer, low: 1, high: 2, set: learner/mlp/hidden}}', 'the recipe has no'),
        ('variables: {}', 'no variables'),
    ],
)
def test_a_search_space_that_is_wrong_is_refused_with_one_sentence(text, sentence, tmp_path) -> None:
    path = tmp_path / 'space.yaml'
    path.write_text(text)
    with pytest.raises(TextureError, match=sentence.replace('?', r'\?')) as caught:
        RecipeSpace.load(str(path), load_recipe('ets-linear-svm'))
    assert '\n' not in str(caught.value)


# -- how it is evaluated


def test_half_of_the_slides_of_each_surface_are_for_training_and_no_slide_is_on_both_sides() -> None:
    codes = np.repeat([0, 0, 0, 0, 1, 1, 1], 3)
    slides = np.repeat(np.arange(7), 3)
    halves = random_halves(codes, slides, 50, np.random.default_rng(0))
    assert (halves[:, codes == 0].sum(axis=1) == 6).all()
    assert (halves[:, codes == 1].sum(axis=1) == 3).all()
    assert (halves.reshape(50, 7, 3).std(axis=2) == 0).all()
    assert len(np.unique(halves, axis=0)) > 10
    with pytest.raises(InvalidData, match='two at least'):
        random_halves(np.array([0, 1]), np.array([0, 1]), 1, np.random.default_rng(0))


def test_a_tie_is_undecided_and_three_of_five_parts_decide_a_slide() -> None:
    assert decisions(np.array([[2.0, 1.0, 0.0], [1.0, 1.0, 1.0]])).tolist() == [0, UNDECIDED]
    wins = np.eye(3)[[0, 0, 0, 1, 2, 0, 0, 1, 1, 2]] * 2.0
    decided, first = decided_by_slide(wins, np.repeat([0, 1], 5), MajorityVote(), 1.0)
    assert decided.tolist() == [0, UNDECIDED]
    assert first.tolist() == [0, 5]


# -- the search


class Known:
    """A task with a known landscape: the score is highest at a C of 1 and 30 peaks."""

    def __init__(self):
        self.tried = 0

    def features(self, recipe):
        return ClassificationTask().features(recipe)

    def score(self, trial, training):
        self.tried += 1
        peaks = trial.recipe.feature_set.inputs[0].features[0][1].feature.peaks
        score = 0.9 - 0.01 * abs(peaks - 30) - 0.02 * abs(np.log10(trial.recipe.learner.box_constraint))
        return score + 0.002 * training[0], score

    def __repr__(self):
        return 'Known()'


@pytest.fixture
def landscape(monkeypatch) -> tuple[RecipeSpace, SearchSlides]:
    monkeypatch.setattr(search.LabelledWindows, 'values', lambda windows, _: np.zeros((len(windows.labels), 1)))
    paths = ('inputs/signal/features/texture_papers.roberge:SpectralPeaks/peaks',
             'learner/texture_papers.roberge:SvmPairs/box_constraint')  # fmt: skip
    values = (tuple(range(1, 51)), tuple(np.geomspace(0.01, 100.0, 81).tolist()))
    axes = {path: Axis(of_path, tuple(path.split('/'))) for path, of_path in zip(paths, values, strict=True)}
    return RecipeSpace(load_recipe('ets-linear-svm'), axes), SearchSlides(tones())


def test_the_search_finds_the_best_of_a_known_landscape(landscape) -> None:
    task = Known()
    found = optimise(*landscape, SearchParams(), task)
    peaks, c = found.best.individual
    assert abs(peaks - 30) <= 1
    assert abs(np.log10(c)) <= 0.15
    assert len(found.history) == 30
    assert found.history[-1].tried <= 600  # 20 individuals, 30 generations
    assert task.tried == 4 * found.history[-1].tried + 20 * 3  # the best three on all halves


def test_a_search_cut_off_and_resumed_ends_as_one_in_one_go(landscape, tmp_path) -> None:
    path = tmp_path / 'checkpoint.json'
    space, slides = landscape
    whole = optimise(space, slides, SearchParams(generations=8), Known())
    cut = optimise(space, slides, SearchParams(generations=4), Known(), checkpoint=path)
    ended = optimise(space, slides, SearchParams(generations=8), Known(), resume=path)
    assert [(one.individual, one.searched) for one in ended.finalists] == [
        (one.individual, one.searched) for one in whole.finalists
    ]
    assert ended.history[3].evaluated == 0
    assert ended.history[-1].evaluated == whole.history[-1].tried - cut.history[-1].tried
    with pytest.raises(InvalidData, match='another search'):
        optimise(space, replace(slides, seed=1, _known={}), SearchParams(seed=1), Known(), resume=path)
    path.write_text('{"search": "abc"}')
    for none in (path, tmp_path / 'none.json'):
        with pytest.raises(InvalidData, match='cannot be read'):
            optimise(space, slides, SearchParams(), Known(), resume=none)


# -- on slides


def test_the_features_of_an_individual_are_those_of_training() -> None:
    scans = tones()
    space = RecipeSpace.load('ets-ann', load_recipe('ets-linear-ann'))
    counts = [len(axis.values) for axis in space.axes.values()]
    for point in np.random.default_rng(0).random((6, len(counts))):
        features = ClassificationTask().features(space.recipe(space.individual(point * counts)))
        cut = scans(features.windows)
        windows = cut.inputs['signal']
        events = [
            CutWindow(
                0, 'e', 0.5, 0.1,
                {'signal': Window(samples, 1000.0, ('a',), 0, speed, force)}, speed, force,
            )
            for samples, speed, force in zip(windows.samples, windows.speed_m_s, windows.force_n, strict=True)
        ]  # fmt: skip
        expected = [vector.values for vector in features.extract_many(events)]
        np.testing.assert_allclose(cut.values(features), expected, rtol=1e-9)


def test_scans_are_cut_into_parts_that_share_a_slide() -> None:
    scans = tones()
    parameters = scans(replace(load_recipe('ets-linear-svm-vote').training_windows))
    assert parameters.inputs['signal'].samples.shape == (24 * 5, 100, 1)
    assert (np.bincount(parameters.slides) == 5).all()
    np.testing.assert_array_equal(
        parameters.inputs['signal'].samples[:5].reshape(-1), scans.streams['signal'].samples[0].ravel()
    )
    with pytest.raises(InvalidData, match=r'no window of 0\.8 s'):
        scans(load_recipe('ets-fine-svm').training_windows)


@pytest.mark.parametrize(('recipe', 'search_space'), [('ets-linear-svm', 'ets-svm'), ('ets-linear-ann', 'ets-ann')])
def test_what_is_found_is_no_worse_than_where_it_began_and_scored_as_training_would(recipe, search_space) -> None:
    space = RecipeSpace.load(search_space, load_recipe(recipe))
    slides, said = SearchSlides(tones(), SMALL.halves, SMALL.seed), []
    best = optimise(space, slides, SMALL, ClassificationTask(), tell=said.append).best
    start = RecipeSpace(space.base, {'one': Axis(('x',), edits={'x': ()})})
    assert said[-1].fitness >= optimise(start, slides, SMALL, ClassificationTask()).best.fitness
    assert best.fitness == best.searched  # all four halves in the search, too
    examples, halves = slides.split(best.recipe.training_windows)
    values, half = examples.values(ClassificationTask().features(best.recipe)), halves[1]
    learner = best.recipe.learner
    fitted = learner.fit(values[half], examples.codes[half], examples.slides[half])
    right = decisions(learner.predictor(fitted.parameters)(values)) == examples.codes
    assert best.scores[1] == (right[half].mean(), right[~half].mean())


def test_slides_divided_otherwise_than_the_search_asks_are_refused() -> None:
    space = RecipeSpace.load('svm-pairs', load_recipe('ets-linear-svm'))
    with pytest.raises(InvalidParameter, match='20 half splits with seed 0, the search asks for 4 with seed 0'):
        optimise(space, SearchSlides(tones()), SMALL, ClassificationTask())


def test_cores_and_a_dask_cluster_find_what_one_core_finds(tmp_path) -> None:
    space = RecipeSpace.load('svm-pairs', load_recipe('ets-linear-svm'))
    slides = SearchSlides(tones(), SMALL.halves)

    def found():
        return optimise(space, slides, SMALL, ClassificationTask())

    alone = found()
    with workers(2):
        on_cores = found()
    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None, local_directory=str(tmp_path)
    )
    with cluster, workers(dask=cluster.scheduler_address):
        on_cluster = found()
    assert alone.history == on_cores.history == on_cluster.history
    assert alone.best.recipe == on_cluster.best.recipe


def test_a_cluster_that_is_not_there_is_named(monkeypatch) -> None:
    def refuse(*_, **__):
        raise OSError('Timed out')

    monkeypatch.setattr(distributed, 'Client', refuse)
    with (
        pytest.raises(InvalidParameter, match="no Dask scheduler answers at 'tcp://nowhere:1'"),
        dask_backend('tcp://nowhere:1'),
    ):
        pass


def test_each_pair_has_a_search_and_a_checkpoint_of_its_own(tmp_path: Path) -> None:
    space = RecipeSpace.load('ets-svm', load_recipe('ets-linear-svm'))
    slides = SearchSlides(tones(), SMALL.halves)
    found, scores = optimise_pairs(space, slides, SMALL, checkpoint=tmp_path / 'best.json')
    assert set(found) == {
        ('surface_0', 'surface_1'), ('surface_0', 'surface_2'), ('surface_1', 'surface_2'),
    }  # fmt: skip
    assert len(list(tmp_path.glob('best-surface_?-vs-surface_?.json'))) == 3
    assert len(scores) == SMALL.halves
    assert fitness(scores) > 0.6
    again, same = optimise_pairs(space, slides, SMALL, resume=tmp_path / 'best.json')
    assert same == scores
    assert all(one.history[-1].evaluated == 0 for one in again.values())


@pytest.mark.parametrize('regressor', ['ann1', 'ann5', 'svm5'])
def test_the_recipes_of_the_roughness_paper_are_tuned_and_evaluated_by_their_heads(regressor) -> None:
    grades = Grades({f'surface_{number}': float(number) for number in range(1, 6)})
    levels = np.repeat(1.5 ** np.arange(5), 8)  # the level of a hiss rises with the grade
    samples = levels[:, None, None] * np.random.default_rng(0).normal(size=(len(levels), 500, 1))
    names, same = np.repeat(list(grades.grades), 8), np.ones(len(levels))
    hisses = SlideArrays({'signal': ArrayStream(samples, 1000.0)}, names, 0.15 * same, same)
    space = RecipeSpace.load(f'ets-roughness-{regressor}', load_roughness_recipe(f'ets-roughness-{regressor}'))
    params = SearchParams(population=5, generations=2, halves=3, finalists=1)
    found = optimise(space, SearchSlides(hisses, params.halves), params, RoughnessTask(grades))
    assert found.history[-1].fitness >= found.history[0].fitness
    assert found.best.fitness > 0.7
    # what only the checks need is held out, and yet stays in the recipe
    extracted = RoughnessTask(grades).features(found.best.recipe)
    assert 'peak_to_median_power' not in [name for name, _ in extracted.inputs[0].features]
    assert 'peak_to_median_power' in [name for name, _ in found.best.recipe.feature_set.inputs[0].features]
