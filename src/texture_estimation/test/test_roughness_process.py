# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_core.errors import InvalidData, TextureError
from texture_estimation.roughness import GaussianProcess, RoughnessRecipe, read_grades

INPUTS = {'inputs': {'signal': {'features': ['hjorth']}}}


def test_far_from_all_textures_the_process_is_less_sure(graded_windows) -> None:
    regressor = GaussianProcess()
    predictor = regressor.predictor(regressor.fit(*graded_windows()))
    near, far = (float(predictor(np.array(place))[1]) for place in ([9.0, 0.0], [9.0, 30.0]))
    assert far > near + 0.2


def test_more_windows_of_the_same_textures_make_the_process_no_surer(graded_windows) -> None:
    regressor = GaussianProcess()
    opinions = np.random.default_rng(5).normal(scale=0.8, size=15)
    stds = []
    for windows in (20, 400):
        values, grades, textures = graded_windows(windows=windows)
        predictor = regressor.predictor(regressor.fit(values, grades + opinions[textures], textures))
        stds.append(float(predictor(np.array([9.0, 0.0]))[1]))
    assert stds[1] == pytest.approx(stds[0], rel=0.3)
    assert stds[1] > 0.5


def test_a_single_texture_cannot_be_trained_on(graded_windows) -> None:
    with pytest.raises(InvalidData, match='one texture'):
        GaussianProcess().fit(*graded_windows(n_textures=1))


@pytest.mark.parametrize(
    ('more', 'sentence'),
    [
        ({'learner': 'mlp'}, "no key 'learner'"),
        ({'regressor': 'gaussian_proces'}, "did you mean 'gaussian"),
        ({'training': {'fold': 5}}, "did you mean 'folds'"),
        ({'training': {'false_rejection_rate': 0.1}}, "no parameter 'false_rejection_rate'"),
    ],
)
def test_a_wrong_recipe_gets_one_sentence_that_states_where(more, sentence) -> None:
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
