import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import BENCHMARKS, run_benchmark
from texture_benchmarks.optimise.cases import CASES, DATA, LINEAR
from texture_benchmarks.optimise.pairs_run import CASES as PAIR_CASES
from texture_benchmarks.optimise.pairs_run import measured, recognised
from texture_benchmarks.optimise.pairs_seeds import counts, over_seeds
from texture_benchmarks.papers.recipe_digest import _decisive
from texture_benchmarks.papers.seeds import mean_over_seeds
from texture_benchmarks.result import BenchmarkOptions
from texture_estimation.learners.learner import of_examples
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.search.feature_cache import FeatureCache
from texture_estimation.search.fitness import decisions
from texture_estimation.search.joined_pairs import joined_recipe

STORED = Path(__file__).parents[3] / 'docs' / 'charts' / 'optimise-pairs.json'


def test_searches_have_the_size_of_the_papers() -> None:
    scans = {name: len(data.speeds_m_s) * len(data.forces_n) * data.count for name, data in DATA.items()}
    assert scans == {'linear': 450, 'fine': 200, 'roughness': 200}  # of each texture
    sizes = {(case.params.population, case.params.generations, case.params.halves) for case in CASES.values()}
    assert sizes == {(20, 30, 20)}


@pytest.mark.benchmark
def test_every_search_ends_with_a_recipe_evaluated_by_its_learner_and_the_charts_are_drawn(tmp_path: Path) -> None:
    result = BENCHMARKS['optimise_large'](BenchmarkOptions(tmp_path, quick=True))
    assert set(result.numbers['searches']) == set(CASES)
    for figures in result.numbers['searches'].values():
        assert figures['evaluations'] == 10
        assert 0.0 < figures['fitness_exact'] <= 1.0
        assert figures['halves_evaluated'] <= figures['halves_of_all']
    whole = result.numbers['searches']['linear, SVM, without racing']
    assert whole['halves_evaluated'] == whole['halves_of_all']
    assert all(chart.is_file() for chart in result.charts)


def test_the_short_bench_searches_the_linear_experiment_alone(tmp_path: Path) -> None:
    result, path = run_benchmark('optimise', BenchmarkOptions(tmp_path, quick=True))
    assert tuple(result.numbers['searches']) == LINEAR
    assert path.name == 'optimise.json'
    assert all(chart.is_file() for chart in result.charts)


@pytest.mark.benchmark
def test_choices_of_all_pairs_are_counted_and_the_pairs_are_tested_together(tmp_path: Path) -> None:
    result, path = run_benchmark('optimise_pairs', BenchmarkOptions(tmp_path, quick=True))
    assert path.name == 'optimise-pairs.json'
    assert set(result.numbers['cases']) == set(PAIR_CASES)
    for case in result.numbers['cases'].values():
        assert sum(case['counts']['ranking'].values()) == len(case['chosen']) == 3
        for shares in case['tested'].values():
            assert 0.0 <= shares['recognised'][0] <= 1.0
        assert case['seeds'] == [0, 1]
        assert sum(case['counts_of_all']['ranking'].values()) == 6
    linear = result.numbers['cases']['linear, SVM']
    assert Recipe.from_mapping(linear['joined'], 'joined').learner_name == 'tuned_pairs'


@pytest.mark.parametrize('kind', ['ANN', 'SVM'])
def test_the_shipped_recipe_of_tuned_pairs_is_the_one_that_the_stored_search_found(kind: str) -> None:
    stored = json.loads(STORED.read_text(encoding='utf-8'))['numbers']['cases'][f'linear, {kind}']
    found = Recipe.from_mapping(stored['joined'], 'joined').as_mapping()
    shipped = load_recipe(f'ets-linear-{kind.lower()}-pairs').as_mapping()
    assert _decisive(shipped) == _decisive(found)  # all but descriptions and rules that end a slide early


def test_stored_searches_have_means_over_their_seeds_and_count_every_pair_of_each() -> None:
    cases = json.loads(STORED.read_text(encoding='utf-8'))['numbers']['cases']
    assert len(cases['linear, SVM']['seeds']) >= 5
    for case in cases.values():
        assert len(case['seeds']) == len(case['by_seed']) >= 2
        assert sum(case['counts_of_all']['ranking'].values()) == len(case['chosen']) * len(case['seeds'])
        tuned = [one['tested']['tuned by pair']['recognised'][0] for one in case['by_seed']]
        assert case['over_seeds']['tuned by pair'] == pytest.approx(mean_over_seeds(tuned).as_json(), abs=2e-4)


def test_counts_are_of_options_and_of_numbers_lowest_median_and_highest() -> None:
    chosen = [{'ranking': 'frequency', 'peaks': peaks} for peaks in (2, 3, 15)]
    assert counts(chosen) == {'ranking': {'frequency': 3}, 'peaks': [2.0, 3.0, 15.0]}


def test_choices_and_shares_of_several_seeds_are_put_together() -> None:
    def case(peaks: int, before: float, after: float) -> dict:
        tested = {'as shipped': {'recognised': [before, 0.0, 1.0]}, 'tuned by pair': {'recognised': [after, 0.0, 1.0]}}
        return {'slides': 10, 'chosen': {'a – b': {'peaks': peaks}}, 'counts': {}, 'tested': tested}

    merged = over_seeds({0: case(2, 0.5, 0.7), 1: case(4, 0.6, 0.9), 2: case(9, 0.7, 0.8)})
    assert merged['seeds'] == [0, 1, 2]
    assert merged['chosen'] == {'a – b': {'peaks': 2}}
    assert merged['counts_of_all'] == {'peaks': [2.0, 4.0, 9.0]}
    value, low, high = merged['over_seeds']['gain']
    assert value == pytest.approx(0.2)
    assert high - value == pytest.approx(value - low) == pytest.approx(4.303 * 0.1 / 3**0.5, rel=1e-3)


def test_all_pairs_together_decide_as_the_one_model_that_joins_them() -> None:
    case = PAIR_CASES['ten textures, SVM']
    slides, trained_on = measured(case, BenchmarkOptions(Path(), quick=True))
    names = np.unique(slides.labels).tolist()
    base = load_recipe(case.recipe)
    recipes = dict.fromkeys(combinations(names, 2), base)
    together = recognised(recipes, slides, trained_on)
    model = joined_recipe(recipes, base)
    windows = slides(model.training_windows)
    values = FeatureCache(slides).values(model.feature_set)
    layout = ((windows.inputs['signal'].rate_hz, ('dynamic',)),)
    learner = of_examples(model.learner, model.feature_set.names(layout), names)
    codes = np.unique(slides.labels, return_inverse=True)[1]
    fitted = learner.fit(values[trained_on], codes[trained_on], np.flatnonzero(trained_on))
    decided = decisions(learner.predictor(fitted.parameters)(values[~trained_on]))
    assert np.mean(decided == codes[~trained_on]) == pytest.approx(together['recognised'][0], abs=1e-4)
