"""Whatever the features are like, every learner answers with finite log-probabilities."""

import dataclasses

import numpy as np
import pytest

from texture_estimation.learners.catalogue import LEARNERS
from texture_estimation.recipe import Recipe
from texture_estimation.training import train

FASTER = {'svm_linear': {'repeats': 1, 'candidates': 3}}


def nearly_dependent(values):
    """Six features of which any two are the same but for 1e-9: a covariance of rank one for all that can be told."""
    return values[:, :1] + 1e-9 * values


def of_many_units(values):
    """The same features from micro to mega."""
    return values * np.geomspace(1e-6, 1e6, values.shape[1])


DIFFICULT = {
    'scaled by 1e6': lambda values: 1e6 * values,
    'scaled by 1e-6': lambda values: 1e-6 * values,
    'in many units': of_many_units,
    'duplicated': lambda values: np.tile(values, (1, 2)),
    'nearly dependent': nearly_dependent,
    'far from zero': lambda values: 1e6 + values,
}


def learn(name, examples):
    recipe = {'inputs': {'signal': {'features': ['hjorth']}}, 'learner': {name: FASTER.get(name, {})}}
    return train(Recipe.from_mapping(recipe, name), examples)


@pytest.fixture(scope='module', params=LEARNERS)
def name(request):
    return request.param


@pytest.mark.filterwarnings('error::RuntimeWarning')
@pytest.mark.parametrize('slides', [2, 1], ids=['two slides each', 'one slide each'])
@pytest.mark.parametrize('change', DIFFICULT.values(), ids=DIFFICULT)
def test_log_probabilities_are_finite_and_add_up(name, change, slides, make_examples):
    def difficult(examples):
        values = change(examples.values)
        return dataclasses.replace(examples, values=values, names=tuple(map(str, range(values.shape[1]))))

    model = learn(name, difficult(make_examples(slides=slides, windows=4)))
    for values in (difficult(make_examples(seed=1)).values, np.zeros((1, len(model.names)))):
        answers = model.predict_log_proba(values)
        assert np.isfinite(answers).all()
        np.testing.assert_allclose(np.exp(answers).sum(axis=1), 1.0)


def test_one_window_of_each_surface_is_enough_to_answer(name, make_examples):
    examples = make_examples(slides=1, windows=1)
    assert np.isfinite(learn(name, examples).predict_log_proba(examples.values)).all()
