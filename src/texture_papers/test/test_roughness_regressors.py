# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import dataclasses

import matplotlib.image
import numpy as np
import pytest
from sklearn.svm import SVC

from texture_core.config import folder
from texture_estimation.roughness import (
    REGRESSORS,
    RoughnessRecipe,
    load_roughness_recipe,
    read_grades,
)
from texture_papers.catalogue import run_experiment
from texture_papers.protocol import Experiment
from texture_papers.rispal import Ann1, Ann5, Svm5, mean_of_votes
from texture_papers.rispal_experiment import Answers

SHIPPED = sorted(path.stem for path in folder('texture_estimation', 'config/roughness').glob('*.yaml'))
HEADS = (*REGRESSORS.values(), Ann1, Ann5, Svm5)


def test_the_grade_is_the_mean_of_those_that_fire_and_none_if_none_does() -> None:
    votes = np.array([[0, 0, 1, 0, 0], [0, 1, 1, 0, 0], [1, 0, 0, 0, 1], [0, 0, 0, 0, 0]], dtype=bool)
    np.testing.assert_array_equal(mean_of_votes(votes), [3.0, 2.5, 3.0, np.nan])
    assert np.isnan(mean_of_votes(votes[3]))


@pytest.mark.parametrize('head', HEADS)
def test_a_head_grades_textures_like_those_it_was_shown(head, graded_windows) -> None:
    regressor = head()
    parameters = regressor.fit(*graded_windows())
    kinds = {value.dtype.kind for value in parameters.values() if isinstance(value, np.ndarray)}
    assert kinds <= {'f', 'i', 'u'}  # what a model file holds
    predictor = regressor.predictor(parameters)
    values, grades, _ = graded_windows(seed=1)
    found, std = predictor(values)
    assert np.nanmean(np.abs(found - grades)) < 0.25
    # A plane does not enclose a grade in the middle: many windows get none of five linear networks.
    assert np.isnan(found).mean() < (0.65 if head is Ann5 else 0.05)
    assert (std >= 0.0).all()


def test_the_machines_decide_as_those_of_scikit_learn(graded_windows) -> None:
    values, grades, textures = graded_windows(spread=3.0)
    regressor = Svm5(c=2.0, kernel_scale=1.5)
    parameters = regressor.fit(values, grades, textures)
    standard = (values - values.mean(axis=0)) / values.std(axis=0)
    votes = np.stack(
        [SVC(C=2.0, gamma=1.5**-2).fit(standard, grades == grade).predict(standard) for grade in range(1, 6)], axis=1
    )
    np.testing.assert_array_equal(regressor.predictor(parameters)(values)[0], mean_of_votes(votes))


@pytest.mark.parametrize('name', SHIPPED)
def test_shipped_recipes_load_and_are_the_same_when_written_out(name) -> None:
    recipe = load_roughness_recipe(name)
    assert recipe.description
    assert RoughnessRecipe.from_mapping(recipe.as_mapping(), name) == recipe


@pytest.fixture(scope='module')
def outcome(tmp_path_factory):
    out = tmp_path_factory.mktemp('roughness')
    return run_experiment('roughness', Experiment(out, quick=True))[0]


@pytest.mark.benchmark
def test_ours_grades_textures_never_measured_better_than_the_papers_heads_and_than_always_three(outcome) -> None:
    numbers = outcome.numbers
    errors = {name: parts['unseen']['error'] for name, parts in numbers['regressors'].items()}
    assert min(errors, key=errors.get) == 'ours'
    assert errors['ours'] <= 0.8
    assert numbers['regressors']['ours']['left_out']['error'] <= 0.8
    assert errors['ours'] < numbers['always_the_middle']['unseen']


@pytest.mark.benchmark
def test_every_texture_has_its_figures_and_the_charts_are_drawn(outcome) -> None:
    left_out = outcome.numbers['regressors']['ours']['left_out']
    assert left_out['by_texture'].keys() == read_grades('ets_roughness').grades.keys()
    assert all(matplotlib.image.imread(chart).std() > 0 for chart in outcome.charts)


@pytest.mark.benchmark
def test_the_search_writes_recipes_that_can_be_trained_and_grades_unseen_textures_by_them(tmp_path) -> None:
    result, _ = run_experiment('roughness', Experiment(tmp_path, quick=True, tune=True))
    assert result.numbers['tuning'].keys() == result.numbers['regressors'].keys() == {'ANN1', 'ANN5', 'SVM5'}
    assert all(0 < parts['unseen']['error_none_as_0'] < 4 for parts in result.numbers['regressors'].values())
    recipe = load_roughness_recipe(str(tmp_path / 'ets-roughness-svm5-tuned-0.yaml'))
    assert 0.01 <= recipe.regressor.c <= 10.0


def test_a_missing_grade_is_counted_separately_and_each_texture_is_one_sample() -> None:
    nan = np.nan
    answers = Answers(
        np.array([1.0, 2.0, nan, 5.0]), np.full(4, 0.5), np.array([1.0, 1.0, 4.0, 4.0]), ['a', 'a', 'b', 'b']
    )
    figures = answers.figures()
    assert figures['error'] == pytest.approx(2.0 / 3.0)
    assert figures['without_grade'] == 0.25
    assert figures['error_none_as_0'] == pytest.approx((0.0 + 1.0 + 4.0 + 1.0) / 4.0)
    assert answers.error_by_texture() == {'a': 0.5, 'b': 1.0}
    assert figures['error_of_the_mean'] == pytest.approx(0.25)
    alone = dataclasses.replace(answers, textures=['a'] * 4)
    assert alone.figures()['error_of_the_mean'] is None
