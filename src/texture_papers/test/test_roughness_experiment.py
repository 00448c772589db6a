import dataclasses

import matplotlib.image
import numpy as np
import pytest

from texture_estimation.roughness import load_roughness_recipe
from texture_papers.catalogue import run_experiment
from texture_papers.protocol import Experiment
from texture_papers.rispal_experiment import Answers


@pytest.fixture(scope='module')
def outcome(tmp_path_factory):
    out = tmp_path_factory.mktemp('roughness')
    result, _ = run_experiment('roughness', Experiment(out, quick=True, tune=True))
    return result, out


@pytest.mark.benchmark
def test_ours_grades_textures_never_measured_better_than_the_papers_heads_and_than_always_three(outcome) -> None:
    numbers = outcome[0].numbers
    errors = {name: parts['unseen']['error'] for name, parts in numbers['regressors'].items()}
    assert min(errors, key=errors.get) == 'ours'
    assert errors['ours'] <= numbers['targets']['ours_unseen']
    assert numbers['regressors']['ours']['left_out']['error'] <= numbers['targets']['ours_left_out']
    assert errors['ours'] < numbers['always_the_middle']['unseen']
    other = numbers['other_conditions_unseen']['ours']
    assert max(other[f'{speed} m/s, 2.5 N']['error'] for speed in ('0.10', '0.20')) <= 0.9


@pytest.mark.benchmark
def test_windows_with_skids_are_refused_and_others_are_not(outcome) -> None:
    skids = outcome[0].numbers['skids']
    assert skids['without']['refused'] < 0.02
    assert skids['with']['refused'] > 0.5
    assert skids['with']['error_of_the_others'] < skids['with']['error_of_all']


@pytest.mark.benchmark
def test_the_table_names_every_texture_and_the_charts_are_drawn(outcome) -> None:
    result, _ = outcome
    text = '\n'.join(result.lines)
    assert all(texture in text for texture in result.numbers['by_texture']['ours'])
    assert all(matplotlib.image.imread(chart).std() > 0 for chart in result.charts)


@pytest.mark.benchmark
def test_the_search_writes_recipes_that_can_be_trained(outcome) -> None:
    result, out = outcome
    assert set(result.numbers['tuning']) == {'ANN1', 'ANN5', 'SVM5'}
    recipe = load_roughness_recipe(str(out / 'ets-roughness-svm5.yaml'))
    assert 0.01 <= recipe.regressor.c <= 10.0


def test_a_missing_grade_is_counted_apart_and_each_texture_is_one_opinion() -> None:
    nan = np.nan
    said = Answers(
        np.array([1.0, 2.0, nan, 5.0]), np.full(4, 0.5), np.array([1.0, 1.0, 4.0, 4.0]), ['a', 'a', 'b', 'b']
    )
    figures = said.figures()
    assert figures['error'] == pytest.approx(2.0 / 3.0)
    assert figures['without_grade'] == 0.25
    assert figures['error_none_as_0'] == pytest.approx((0.0 + 1.0 + 4.0 + 1.0) / 4.0)
    assert said.error_by_texture() == {'a': 0.5, 'b': 1.0}
    assert figures['error_of_the_mean'] == pytest.approx(0.25)
    alone = dataclasses.replace(said, textures=['a'] * 4)
    assert alone.figures()['error_of_the_mean'] is None
