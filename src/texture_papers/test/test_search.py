from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from sklearn.metrics.pairwise import rbf_kernel

from texture_core.errors import InvalidData, InvalidParameter, TextureError
from texture_core.types import Window
from texture_estimation.evidence_rules import MajorityVote
from texture_estimation.recipe import load_recipe
from texture_estimation.search import (
    UNDECIDED,
    ArrayStream,
    ClassificationTask,
    FeatureCache,
    HalfScores,
    Integer,
    LogReal,
    RecipeSpace,
    ScoreCache,
    SearchParams,
    SearchSlides,
    SearchSpace,
    SlideArrays,
    dask_map,
    decided_by_slide,
    decisions,
    exact,
    fitness,
    is_clearly_worse,
    optimise,
    optimise_pairs,
    raced_fitness,
    random_halves,
    search,
    serial_map,
    threaded_map,
)
from texture_features.windows import CutWindow
from texture_papers.roberge import AnnPairs, SvmPairs, ann_pairs_surrogate, kernel_of, svm_pairs_surrogate

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


def points(count: int = 60, labels: int = 4) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values, codes and slides of overlapping clouds."""
    rng = np.random.default_rng(0)
    codes = np.repeat(np.arange(labels), count)
    values = rng.normal(size=(len(codes), 6)) + 2.0 * rng.normal(size=(labels, 6))[codes]
    return values, codes, np.arange(len(codes))


# -- what is varied


def test_the_variables_and_their_ranges_are_those_of_the_papers() -> None:
    table = {
        name: (kind, span) for name, kind, span in RecipeSpace.load('ets-svm', load_recipe('ets-linear-svm')).table()
    }
    assert table == {
        'peaks': ('whole number', '2 to 15'),
        'gap_hz': ('whole number', '5 to 50'),
        'ranking': ('choice', 'frequency, intensity'),
        'speed': ('choice', 'unused, input, stretch'),
        'force': ('choice', 'no, yes'),
        'signal_energy': ('choice', 'no, yes'),
        'arc_length': ('choice', 'no, yes'),
        'box_constraint': ('logarithmic', '0.01 to 10'),
        'kernel_scale': ('logarithmic', '1e-05 to 100000'),
    }
    circle = RecipeSpace.load('ets-circular-ann', load_recipe('ets-circular-ann'))
    assert circle.axes['parts'].variable.options == ('1', '3', '5', '7', '9')
    assert ('hidden', 'whole number', '5 to 50') in circle.table()


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
def test_every_individual_is_a_recipe_and_comes_back_from_its_point(search, recipe) -> None:
    space = RecipeSpace.load(search, load_recipe(recipe))
    variables = space.variables
    for point in np.random.default_rng(0).random((20, len(variables.names))):
        individual = variables.decode(point)
        assert variables.decode(variables.encode(individual)) == individual
        assert space.recipe(individual).feature_set.inputs


def test_a_recipe_lies_in_its_own_space() -> None:
    recipe = load_recipe('ets-linear-svm')
    space = RecipeSpace.load('ets-svm', recipe)
    found = space.recipe(space.of_base())
    assert found.feature_set.as_mapping() == recipe.feature_set.as_mapping()
    assert found.learner.box_constraint == recipe.learner.box_constraint


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('variables: {a: {kind: integer, low: 3, high: 2, set: windows/hop_s}}', 'the first must be the smaller'),
        ('variables: {a: {kind: intger, low: 1, high: 2, set: windows/hop_s}}', "did you mean 'integer'?"),
        ('variables: {a: {kind: integer, low: 1, high: 2, set: learner/mlp/hidden}}', 'the recipe has no'),
        ('varables: {}', "did you mean 'variables'?"),
        ('variables: {}', 'no variables'),
    ],
)
def test_a_search_space_that_is_wrong_is_refused_with_one_sentence(text, sentence, tmp_path) -> None:
    path = tmp_path / 'space.yaml'
    path.write_text(text)
    with pytest.raises(TextureError, match=sentence.replace('?', r'\?')) as caught:
        RecipeSpace.load(str(path), load_recipe('ets-linear-svm')).variables  # noqa: B018
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


def test_fitness_is_the_mean_of_learning_and_test_accuracy() -> None:
    assert fitness([1.0, 0.8], [0.6, 0.4]) == pytest.approx(0.7)


def test_a_tie_is_undecided_and_three_of_five_parts_decide_a_slide() -> None:
    assert decisions(np.array([[2.0, 1.0, 0.0], [1.0, 1.0, 1.0]])).tolist() == [0, UNDECIDED]
    wins = np.eye(3)[[0, 0, 0, 1, 2, 0, 0, 1, 1, 2]] * 2.0
    decided, first = decided_by_slide(wins, np.repeat([0, 1], 5), MajorityVote(), 1.0)
    assert decided.tolist() == [0, UNDECIDED]
    assert first.tolist() == [0, 5]


def test_the_kernel_is_the_one_of_scikit_learn() -> None:
    values, _, _ = points()
    standard = (values - values.mean(axis=0)) / values.std(axis=0)
    np.testing.assert_allclose(kernel_of(values, 2.0), rbf_kernel(standard, gamma=0.25), atol=1e-6)


@pytest.mark.parametrize('labels', [2, 4])
@pytest.mark.parametrize(
    ('learner', 'quick', 'least'),
    [(SvmPairs(), svm_pairs_surrogate, 0.98), (AnnPairs(hidden=5), ann_pairs_surrogate, 0.85)],
)
def test_a_quick_predictor_decides_as_the_learner_does(learner, quick, least, labels) -> None:
    values, codes, slides = points(labels=labels)
    training = random_halves(codes, slides, 1, np.random.default_rng(0))[0]
    decided = [decisions(surrogate(learner, values, codes, slides)(training)) for surrogate in (quick, exact)]
    assert (decided[0] == decided[1]).mean() >= least


def test_whoever_is_clearly_worse_is_given_up_and_ranked_by_what_it_lacks() -> None:
    rng = np.random.default_rng(0)
    incumbent = 0.9 + 0.01 * rng.normal(size=20)
    assert is_clearly_worse(incumbent[:4] - 0.1 + 0.001 * rng.normal(size=4), incumbent[:4])
    assert not is_clearly_worse(incumbent[:4] + 0.01, incumbent[:4])
    assert not is_clearly_worse(incumbent[:2], incumbent[:2])
    worse = HalfScores(incumbent[:2] - 0.1, incumbent[:2] - 0.1)
    assert raced_fitness(worse, incumbent, 20) == (pytest.approx(incumbent.mean() - 0.1), 2)
    assert raced_fitness(HalfScores(incumbent, incumbent), None, 20) == (pytest.approx(incumbent.mean()), 20)


# -- the search


@dataclass(frozen=True)
class Known:
    """A trial with a known score: highest at 30, and better with a small second variable."""

    individual: tuple[int, float]

    def start(self):
        score = 0.9 - 0.01 * abs(self.individual[0] - 30) - 0.02 * abs(np.log10(self.individual[1]))
        noise = np.random.default_rng([int(self.individual[0]), 7]).normal(size=50) * 0.002
        return lambda number: (score + noise[number], score)


SPACE = SearchSpace({'a': Integer(1, 50), 'b': LogReal(0.01, 100.0)})


def known(individuals):
    return [Known(one) for one in individuals]


@pytest.mark.parametrize('race', [True, False])
def test_the_search_finds_the_best_of_a_known_landscape(race) -> None:
    found = search(SPACE, known, SearchParams(race=race), ScoreCache({}))
    best = found.ranked[0].individual
    assert abs(best[0] - 30) <= 1
    assert abs(np.log10(best[1])) <= 0.15
    assert len(found.history) == 30
    halves = found.history[-1].halves
    assert halves == 20 * found.history[-1].evaluated if not race else halves < 10 * found.history[-1].evaluated
    assert found.history[-1].cache_hits > 0


def test_two_objectives_give_a_front_from_cheap_to_good() -> None:
    found = search(SPACE, known, SearchParams(objective='front'), ScoreCache({}), cost=lambda one: float(one[0]))
    costs = [one.cost for one in found.front]
    assert len(costs) > 5
    assert costs == sorted(costs)
    assert costs[0] == 1.0
    assert max(costs) <= 31.0  # what costs more than the best is beaten by it
    assert [one.fitness for one in found.front] == sorted(one.fitness for one in found.front)


def test_the_same_seed_gives_the_same_search_and_another_seed_another() -> None:
    first, again, other = (search(SPACE, known, SearchParams(seed=seed), ScoreCache({})) for seed in (3, 3, 4))
    assert first == again
    assert first.ranked != other.ranked


def test_a_search_cut_off_and_resumed_ends_as_one_in_one_go(tmp_path) -> None:
    path = tmp_path / 'checkpoint.json'
    whole = search(SPACE, known, SearchParams(seed=1), ScoreCache({'data': 'x'}))
    cut = ScoreCache({'data': 'x'})
    search(SPACE, known, SearchParams(seed=1, generations=12), cut)
    cut.save(path)
    resumed = ScoreCache({'data': 'x'})
    resumed.load(path)
    tried: list[object] = []
    ended = search(SPACE, lambda new: known(tried.extend(new) or new), SearchParams(seed=1), resumed)
    assert ended.ranked == whole.ranked
    assert not set(tried) & set(cut.records)
    with pytest.raises(InvalidData, match='another search'):
        ScoreCache({'data': 'y'}).load(path)


def test_a_checkpoint_that_is_none_is_refused(tmp_path) -> None:
    (tmp_path / 'x.json').write_text('{"format": 1}')
    for name in ('x.json', 'none.json'):
        with pytest.raises(InvalidData, match='cannot be read'):
            ScoreCache({}).load(tmp_path / name)


# -- on slides


def test_cached_features_are_those_of_the_feature_set() -> None:
    scans = tones()
    space = RecipeSpace.load('ets-ann', load_recipe('ets-linear-ann'))
    cache = FeatureCache(scans)
    rng = np.random.default_rng(0)
    recipes = [space.recipe(space.variables.decode(rng.random(len(space.axes)))) for _ in range(12)]
    prediction_sets = [ClassificationTask().feature_set_of(recipe) for recipe in recipes]
    for plan, values in zip(prediction_sets, cache.many(prediction_sets), strict=True):
        windows = scans(plan.windows).inputs['signal']
        events = [
            CutWindow(
                0, 'e', 0.5, 0.1,
                {'signal': Window(samples, 1000.0, ('a',), 0, speed, force)}, speed, force,
            )
            for samples, speed, force in zip(windows.samples, windows.speed_m_s, windows.force_n, strict=True)
        ]  # fmt: skip
        np.testing.assert_allclose(values, [vector.values for vector in plan.extract_many(events)], rtol=1e-9)
    missed = cache.misses
    cache.many(prediction_sets)
    assert cache.misses == missed < sum(len(plan.inputs[0].features) for plan in prediction_sets)


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


@pytest.mark.parametrize(
    ('recipe', 'search_space'),
    [('ets-linear-svm', 'ets-svm'), ('ets-linear-svm-vote', 'ets-svm'), ('ets-linear-ann', 'ets-ann')],
)
def test_what_is_found_is_evaluated_by_the_learner_itself_and_no_worse_than_where_it_began(
    recipe, search_space
) -> None:
    space = RecipeSpace.load(search_space, load_recipe(recipe))
    search_slides = SearchSlides(tones(), SMALL.halves, SMALL.seed)
    found = optimise(space, search_slides, SMALL, ClassificationTask())
    began = found.score_cache.records[space.of_base()]
    assert found.best.searched.fitness >= began.means.mean()
    assert found.best.record.halves == SMALL.halves
    task, chosen = ClassificationTask(), found.best.recipe
    values = FeatureCache(search_slides.cut).values(task.feature_set_of(chosen))
    windows = chosen.training_windows
    again = task.fitness_function(
        chosen, values, search_slides.examples(windows), search_slides.halves(windows), quick=False
    ).start()
    assert [again(number) for number in range(4)] == list(
        zip(found.best.record.learning, found.best.record.test, strict=True)
    )


def test_slides_divided_otherwise_than_the_search_asks_are_refused() -> None:
    space = RecipeSpace.load('svm-pairs', load_recipe('ets-linear-svm'))
    with pytest.raises(InvalidParameter, match='20 half splits with seed 0, the search asks for 4 with seed 0'):
        optimise(space, SearchSlides(tones()), SMALL, ClassificationTask())


def test_cores_and_a_dask_cluster_find_what_one_core_finds(tmp_path) -> None:
    space = RecipeSpace.load('svm-pairs', load_recipe('ets-linear-svm'))
    search_slides = SearchSlides(tones(), SMALL.halves)

    def found(parallel_map):
        return optimise(space, search_slides, SMALL, ClassificationTask(), parallel_map=parallel_map)

    alone = found(serial_map)
    with threaded_map(2) as parallel_map:
        on_cores = found(parallel_map)
    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None, local_directory=str(tmp_path)
    )
    with cluster, dask_map(cluster.scheduler_address) as parallel_map:
        on_cluster = found(parallel_map)
    assert alone.found == on_cores.found == on_cluster.found
    assert alone.best.recipe == on_cluster.best.recipe


@pytest.mark.parametrize('name', ['ets-linear-svm', 'ets-linear-ann'])
@pytest.mark.parametrize('quick', [True, False])
def test_a_trial_travels_to_another_machine_and_predicts_the_same_there(name, quick) -> None:
    recipe = load_recipe(name)
    scans = tones(count=4)
    search_slides, task = SearchSlides(scans, 2), ClassificationTask()
    examples, halves = search_slides.examples(recipe.training_windows), search_slides.halves(recipe.training_windows)
    values = FeatureCache(scans).values(task.feature_set_of(recipe))
    fitness_function = task.fitness_function(recipe, values, examples, halves, quick=quick)
    there = distributed.protocol.deserialize(*distributed.protocol.serialize(fitness_function, on_error='raise'))
    assert there.start()(1) == fitness_function.start()(1)


def test_a_cluster_that_is_not_there_is_named(monkeypatch) -> None:
    def refuse(*_, **__):
        raise OSError('Timed out')

    monkeypatch.setattr(distributed, 'Client', refuse)
    with (
        pytest.raises(InvalidParameter, match="no Dask scheduler answers at 'tcp://nowhere:1'"),
        dask_map('tcp://nowhere:1'),
    ):
        pass


def test_each_pair_has_a_search_and_a_checkpoint_of_its_own(tmp_path: Path) -> None:
    space = RecipeSpace.load('ets-svm', load_recipe('ets-linear-svm'))
    search_slides = SearchSlides(tones(), SMALL.halves)
    found = optimise_pairs(space, search_slides, SMALL, checkpoint=tmp_path / 'best.json')
    assert set(found.by_pair) == {
        ('surface_0', 'surface_1'), ('surface_0', 'surface_2'), ('surface_1', 'surface_2'),
    }  # fmt: skip
    assert len(list(tmp_path.glob('best-surface_?-vs-surface_?.json'))) == 3
    assert found.record.halves == SMALL.halves
    assert found.fitness > 0.6
    again = optimise_pairs(space, search_slides, SMALL, resume=tmp_path / 'best.json')
    assert again.record.test.tolist() == found.record.test.tolist()
    assert all(one.found.history[-1].halves == 0 for one in again.by_pair.values())
