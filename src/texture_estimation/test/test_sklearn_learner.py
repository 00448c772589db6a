# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Any classifier of scikit-learn as a learner: what it answers, what is stored, and what is refused."""

import fractions
import sys

import numpy as np
import pytest
import skops.io
from sklearn.ensemble import ExtraTreesClassifier, RandomForestClassifier

from texture_core.errors import InvalidParameter, MissingLibrary, ModelMismatch
from texture_estimation.learners.learner import standardisation
from texture_estimation.learners.sklearn_learner import SklearnPredictor, unpacked
from texture_estimation.model import AddedSlide, load_model
from texture_estimation.recipe import Recipe
from texture_estimation.training import train
from texture_features.feature_set import LabelledFeatures

INPUTS = {'signal': {'features': ['hjorth']}}
TREES = {'estimator': 'sklearn.ensemble:ExtraTreesClassifier', 'n_estimators': 20}
ESTIMATORS = (
    TREES,
    {'estimator': 'sklearn.ensemble:RandomForestClassifier', 'n_estimators': 10, 'max_depth': 5},
    {'estimator': 'sklearn.neighbors:KNeighborsClassifier', 'algorithm': 'brute'},
    {'estimator': 'sklearn.linear_model:LogisticRegression'},
    {'estimator': 'sklearn.linear_model:RidgeClassifier'},  # decision values, no probabilities
    {'estimator': 'sklearn.discriminant_analysis:LinearDiscriminantAnalysis'},
    {'estimator': 'sklearn.neural_network:MLPClassifier', 'hidden_layer_sizes': [8], 'learning_rate_init': 0.05},
    {'estimator': 'sklearn.svm:SVC'},
)


def recipe_of(entry):
    return Recipe.from_mapping({'inputs': INPUTS, 'learner': {'sklearn': entry}}, 'mine')


@pytest.fixture(scope='module')
def trees(examples):
    return train(recipe_of(TREES), examples)


@pytest.mark.parametrize('entry', ESTIMATORS, ids=lambda entry: entry['estimator'].rsplit(':')[1])
@pytest.mark.filterwarnings('ignore::sklearn.exceptions.ConvergenceWarning')
def test_a_named_classifier_recognises_is_stored_and_answers_the_same_again(entry, examples, make_examples, tmp_path):
    model = train(recipe_of(entry), examples)
    other = make_examples(seed=1)
    assert np.mean(np.array(model.decide(other.X)) == other.y) > 0.8
    loaded = load_model(model.save(tmp_path / 'mine'))
    np.testing.assert_array_equal(loaded.predict_log_proba(other.X), model.predict_log_proba(other.X))
    assert loaded.recipe.learner == model.recipe.learner


def test_the_decisions_are_those_of_scikit_learn_itself(trees, examples, make_examples):
    mean, scale = standardisation(examples.X)
    alone = ExtraTreesClassifier(n_estimators=20, random_state=0).fit((examples.X - mean) / scale, examples.y)
    other = make_examples(seed=1)
    expected = alone.predict_proba((other.X - mean) / scale)
    best = expected.max(axis=1)
    clear = np.count_nonzero(expected == best[:, None], axis=1) == 1
    labels = np.array(trees.decide(other.X))[clear]
    assert labels.tolist() == alone.classes_[expected.argmax(axis=1)][clear].tolist()


def test_probabilities_are_calibrated_on_slides_held_out(make_examples):
    examples, other = make_examples(slides=8, spread=2.0), make_examples(seed=1, slides=8, spread=2.0)
    model = train(recipe_of({'estimator': 'sklearn.naive_bayes:GaussianNB'}), examples)
    probabilities = np.exp(model.predict_log_proba(other.X))
    right = np.array(model.decide(other.X)) == other.y
    assert 'held-out slides' in model.training['calibration']
    assert abs(probabilities.max(axis=1).mean() - right.mean()) < 0.08


@pytest.mark.parametrize(
    ('entry', 'sentence'),
    [
        ({'estimator': 'os:system'}, 'a public class of scikit-learn'),
        ({'estimator': 'sklearn.ensemble._forest:ExtraTreesClassifier'}, 'a public class of scikit-learn'),
        ({'estimator': 'sklearn.ensemble:ExtraTrees'}, "there is no 'ExtraTrees'"),
        ({'estimator': 'sklearn.nothing:ExtraTrees'}, "there is no 'ExtraTrees'"),
        ({'estimator': 'sklearn.ensemble:ExtraTreesRegressor'}, 'is not a classifier'),
        ({'estimator': 'sklearn.ensemble:VotingClassifier'}, 'needs other estimators'),
        ({**TREES, 'n_trees': 5}, "no parameter of 'sklearn.ensemble:ExtraTreesClassifier' 'n_trees'"),
        ({**TREES, 'n_estimators': {'a': 1}}, 'a number, a text, true, false, null or a list'),
        ({'estimator': 3}, 'name an estimator'),
        (['x'], 'name an estimator'),
    ],
)
def test_a_recipe_that_names_no_usable_classifier_is_refused(entry, sentence):
    with pytest.raises(InvalidParameter, match=sentence):
        recipe_of(entry)


def test_a_value_that_the_estimator_refuses_is_reported_in_training(examples):
    with pytest.raises(InvalidParameter, match='cannot be trained'):
        train(recipe_of({**TREES, 'n_estimators': -1}), examples)


@pytest.mark.parametrize(
    'entry',
    [
        {'estimator': 'sklearn.neighbors:KNeighborsClassifier', 'algorithm': 'kd_tree'},
        {'estimator': 'sklearn.ensemble:HistGradientBoostingClassifier', 'max_iter': 2},
    ],
)
def test_an_estimator_that_cannot_be_stored_safely_is_refused_at_training(entry, examples):
    with pytest.raises(InvalidParameter, match='cannot be stored as a model: it holds'):
        train(recipe_of(entry), examples)


@pytest.mark.parametrize('made', [fractions.Fraction(1, 2), {'a': np.ufunc}, {'a': fractions.Fraction}])
def test_bytes_of_what_is_no_estimator_are_refused(made):
    with pytest.raises(ModelMismatch, match=r'it holds .*, which no model of this suite holds'):
        unpacked(np.frombuffer(skops.io.dumps(made), np.uint8))


def test_where_skops_is_missing_a_stored_classifier_is_refused_in_one_sentence(trees, tmp_path, monkeypatch):
    path = trees.save(tmp_path / 'mine')
    monkeypatch.setitem(sys.modules, 'skops.io', None)
    with pytest.raises(
        MissingLibrary, match="learners of scikit-learn need the library 'skops', which is not installed"
    ):
        load_model(path)


@pytest.mark.parametrize('child', [10**6, 0])
def test_a_tree_that_points_outside_itself_or_back_is_refused_before_it_is_used(child):
    rng = np.random.default_rng(0)
    values, codes = rng.normal(size=(40, 3)), np.repeat([0, 1], 20)
    forest = RandomForestClassifier(n_estimators=2, random_state=0).fit(values + codes[:, None], codes)
    tree = forest.estimators_[1].tree_
    state = tree.__getstate__()
    state['nodes']['left_child'][0] = child
    tree.__setstate__(state)
    with pytest.raises(ModelMismatch, match='points outside its nodes or features'):
        SklearnPredictor(forest, np.zeros(3), np.ones(3), 2, 1.0)


def test_trees_keep_the_trained_textures_where_one_is_added():
    rng = np.random.default_rng(0)
    centres = 1.2 * rng.normal(size=(5, 8))

    def slides(number, count):
        return [centres[number] + 0.6 * rng.normal(size=8) + rng.normal(size=(12, 8)) for _ in range(count)]

    trained = {f'texture{number}': slides(number, 12) for number in range(4)}
    names = [f'{label}/{number}' for label, of in trained.items() for number in range(len(of))]
    labels = np.repeat([name.partition('/')[0] for name in names], 12)
    values = np.concatenate([slide for of in trained.values() for slide in of])
    features = tuple(f'feature{number}' for number in range(8))
    model = train(recipe_of(TREES), LabelledFeatures(values, labels, np.repeat(names, 12), features, 'a1', 0.5, 0.1))
    added = model.with_added_slides((AddedSlide('silk', 'e1', slides(4, 1)[0]),))
    tests = [(f'texture{number}', slide) for number in range(4) for slide in slides(number, 12)]
    before, after = (
        np.mean([one.labels[one.predict_log_proba(slide).sum(axis=0).argmax()] == label for label, slide in tests])
        for one in (model, added)
    )
    assert before > 0.9
    assert after > before - 0.05
