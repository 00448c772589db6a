# SPDX-License-Identifier: Apache-2.0
import dataclasses

import matplotlib.image
import numpy as np
import pytest
from sklearn.svm import SVC

from texture_core.config import folder
from texture_core.errors import InvalidData, TextureError
from texture_estimation.roughness import (
    REGRESSORS,
    GaussianProcess,
    RoughnessRecipe,
    load_roughness_recipe,
    read_grades,
)
from texture_papers.catalogue import run_experiment
from texture_papers.protocol import Experiment
from texture_papers.rispal import Svm5, mean_of_votes
from texture_papers.rispal_experiment import Answers

SHIPPED = sorted(path.stem for path in folder('texture_estimation', 'config/roughness').glob('*.yaml'))
INPUTS = {'inputs': {'signal': {'features': ['hjorth']}}}
EVERY = pytest.mark.parametrize('name', REGRESSORS)


def graded_windows(n_textures=15, windows=20, spread=0.3, seed=0):
    """Return values, grades and textures: the first feature tells the grade, the second nothing."""
    rng = np.random.default_rng(seed)
    textures = np.repeat(np.arange(n_textures), windows)
    grades = (1.0 + np.arange(n_textures) % 5)[textures]
    values = np.stack([3.0 * grades, np.zeros(len(grades))], axis=1) + spread * rng.normal(size=(len(grades), 2))
    return values, grades, textures


def test_the_grade_is_the_mean_of_those_that_fire_and_none_if_none_does() -> None:
    votes = np.array([[0, 0, 1, 0, 0], [0, 1, 1, 0, 0], [1, 0, 0, 0, 1], [0, 0, 0, 0, 0]], dtype=bool)
    np.testing.assert_array_equal(mean_of_votes(votes), [3.0, 2.5, 3.0, np.nan])
    assert np.isnan(mean_of_votes(votes[3]))


@EVERY
def test_a_head_grades_textures_like_those_it_was_shown(name) -> None:
    regressor = REGRESSORS[name]()
    predictor = regressor.predictor(regressor.fit(*graded_windows()))
    values, grades, _ = graded_windows(seed=1)
    found, std = predictor(values)
    assert np.nanmean(np.abs(found - grades)) < 0.25
    assert np.isnan(found).mean() < 0.05
    assert (std >= 0.0).all()


def test_the_machines_decide_as_those_of_scikit_learn() -> None:
    values, grades, textures = graded_windows(spread=3.0)
    regressor = Svm5(c=2.0, kernel_scale=1.5)
    parameters = regressor.fit(values, grades, textures)
    standard = (values - values.mean(axis=0)) / values.std(axis=0)
    votes = np.stack(
        [SVC(C=2.0, gamma=1.5**-2).fit(standard, grades == grade).predict(standard) for grade in range(1, 6)], axis=1
    )
    np.testing.assert_array_equal(regressor.predictor(parameters)(values)[0], mean_of_votes(votes))


def test_far_from_all_textures_the_process_is_less_sure() -> None:
    regressor = GaussianProcess()
    predictor = regressor.predictor(regressor.fit(*graded_windows()))
    near, far = (float(predictor(np.array(place))[1]) for place in ([9.0, 0.0], [9.0, 30.0]))
    assert far > near + 0.2


def test_more_windows_of_the_same_textures_make_the_process_no_surer() -> None:
    regressor = GaussianProcess()
    opinions = np.random.default_rng(5).normal(scale=0.8, size=15)
    stds = []
    for windows in (20, 400):
        values, grades, textures = graded_windows(windows=windows)
        predictor = regressor.predictor(regressor.fit(values, grades + opinions[textures], textures))
        stds.append(float(predictor(np.array([9.0, 0.0]))[1]))
    assert stds[1] == pytest.approx(stds[0], rel=0.3)
    assert stds[1] > 0.5


def test_a_single_texture_cannot_be_trained_on() -> None:
    with pytest.raises(InvalidData, match='one texture'):
        GaussianProcess().fit(*graded_windows(n_textures=1))


@pytest.mark.parametrize('name', SHIPPED)
def test_shipped_recipes_load_and_are_the_same_when_written_out(name) -> None:
    recipe = load_roughness_recipe(name)
    assert recipe.description
    assert RoughnessRecipe.from_mapping(recipe.as_mapping(), name) == recipe


@pytest.mark.parametrize(
    ('more', 'sentence'),
    [
        ({'learner': 'svm_rbf'}, "no key 'learner'"),
        ({'regressor': 'gaussian_proces'}, "did you mean 'gaussian"),
        ({'regressor': {'texture_papers.rispal:Svm5': {'c': -1}}}, "parameter 'c'"),
        ({'checks': {'least_force_n': -1}}, 'least_force_n'),
        ({'evidence': {'min_narrowing': 1}}, "did you mean 'min_narrowing_grades'"),
    ],
)
def test_a_wrong_recipe_gets_one_sentence_that_says_where(more, sentence) -> None:
    with pytest.raises(TextureError, match=sentence) as caught:
        RoughnessRecipe.from_mapping({**INPUTS, **more}, 'mine')
    assert "roughness recipe 'mine'" in str(caught.value)


def test_grades_are_read_with_their_split(tmp_path) -> None:
    path = tmp_path / 'g.csv'
    path.write_text('# by people\ntexture,grade,split,std\ncork,2.5,train,0.3\nglass,1,test,\nfelt,3,,\n')
    grades = read_grades(path)
    assert grades.grades == {'cork': 2.5, 'glass': 1.0, 'felt': 3.0}
    assert (grades.used_for('train'), grades.used_for('test')) == (('cork',), ('glass',))
    with pytest.raises(TextureError, match="did you mean 'cork'"):
        grades.of('crok')


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('texture,mark\ncork,1\n', 'texture and grade are needed'),
        ('texture,grade\ncork,0\n', "line 2: the grade is '0'"),
        ('texture,grade\ncork,1\ncork,2\n', 'name each once'),
        ('texture,grade\n', 'holds no grade'),
        ('texture,grade,split\ncork,1,both\n', "the split is 'both'"),
    ],
)
def test_a_table_that_cannot_be_used_gets_a_sentence(text, sentence, tmp_path) -> None:
    path = tmp_path / 'g.csv'
    path.write_text(text)
    with pytest.raises(InvalidData, match=sentence):
        read_grades(path)


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
