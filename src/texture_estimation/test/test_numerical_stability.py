# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whatever signals and features are like, every recipe, learner and head of roughness gives a finite answer."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import lfilter

from texture_core.config import folder
from texture_core.types import Window
from texture_estimation.gaussians import ClassDistance
from texture_estimation.recipe import LEARNERS, Recipe, load_recipe
from texture_estimation.roughness import REGRESSORS, ROUGH, SMOOTH
from texture_estimation.training import train
from texture_features.feature_set import LabelledFeatures
from texture_features.windows import CutWindow

SHIPPED = sorted(path.stem for path in folder('texture_estimation', 'config/recipes').glob('*.yaml'))
# Where nothing distinguishes surfaces, these find all equally probable; votes between pairs go to one of them.
EVEN = frozenset({'mlp'})
FLOORED = frozenset({'any-speed'})
RATES_HZ = {'signal': 1000.0, 'signal_static': 100.0}


def nearly_dependent(values):
    """Six features of which any two are the same but for 1e-9: a covariance of rank one within numerical precision."""
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
    recipe = {'inputs': {'signal': {'features': ['hjorth']}}, 'learner': {name: {}}}
    return train(Recipe.from_mapping(recipe, name), examples)


@pytest.fixture(scope='module', params=LEARNERS)
def name(request):
    return request.param


@pytest.mark.filterwarnings('error::RuntimeWarning')
@pytest.mark.parametrize('change', DIFFICULT.values(), ids=DIFFICULT)
def test_log_probabilities_of_one_slide_each_are_finite_and_add_up(name, change, make_examples):
    def difficult(examples):
        values = change(examples.values)
        return dataclasses.replace(examples, values=values, names=tuple(map(str, range(values.shape[1]))))

    model = learn(name, difficult(make_examples(slides=1, windows=4)))
    for values in (difficult(make_examples(seed=1)).values, np.zeros((1, len(model.names)))):
        answers = model.predict_log_proba(values)
        assert np.isfinite(answers).all()
        np.testing.assert_allclose(np.exp(answers).sum(axis=1), 1.0)


def test_one_window_of_each_surface_is_enough_to_answer(name, make_examples):
    examples = make_examples(slides=1, windows=1)
    assert np.isfinite(learn(name, examples).predict_log_proba(examples.values)).all()


@pytest.mark.filterwarnings('error::RuntimeWarning')
@pytest.mark.parametrize('change', DIFFICULT.values(), ids=DIFFICULT)
def test_what_is_far_from_all_is_further_than_any_slide_of_the_training(change, make_examples):
    examples = make_examples(slides=6)
    codes, groups = (np.unique(column, return_inverse=True)[1] for column in (examples.labels, examples.groups))
    values = change(examples.values)
    means = np.stack([values[groups == group].mean(axis=0) for group in np.unique(groups)])
    classes = codes[np.unique(groups, return_index=True)[1]]
    distance = ClassDistance.fit(means, classes)
    distances = np.array([distance.score(mean, code) for mean, code in zip(means, classes.tolist(), strict=True)])
    far = distance.score(means[0] + 100.0 * np.ptp(values, axis=0), int(classes[0]))
    assert np.isfinite(distances).all()
    assert far > distances.max() + 10.0 * np.ptp(distances)


@pytest.mark.filterwarnings('error::RuntimeWarning')
@pytest.mark.parametrize('regressor', REGRESSORS)
@pytest.mark.parametrize('change', DIFFICULT.values(), ids=DIFFICULT)
def test_grades_are_near_the_scale_or_none_at_all(regressor, change):
    rng = np.random.default_rng(0)
    textures = np.repeat(np.arange(10), 6)
    grades = 1.0 + textures % 5.0
    values = change(grades[:, None] * [3.0, 0.0, 1.0] + 0.3 * rng.normal(size=(60, 3)))
    predictor = REGRESSORS[regressor]().predictor(REGRESSORS[regressor]().fit(values, grades, textures))
    for inputs in (values, np.zeros((1, values.shape[1]))):
        found, std = predictor(inputs)
        assert (((found > SMOOTH - 0.5) & (found < ROUGH + 0.5)) | np.isnan(found)).all()
        assert np.isfinite(std).all()


def windows_of(recipe, factor=1.0, seed=0, slides=3, constant=False):
    """Return the features of slides over three surfaces that differ in strength and colour, times a factor."""
    rng = np.random.default_rng(seed)
    length_s = recipe.feature_set.windows.length_s
    events, surfaces = [], {}
    for number, surface in enumerate(('cork', 'felt', 'slate')):
        for slide in range(slides):
            surfaces[f'{surface}/{slide}'] = surface
            for place in range(4):
                windows = {}
                for topic in recipe.feature_set.window_names:
                    rate_hz = RATES_HZ[topic.partition('@')[0].rpartition('/')[2]]
                    noise = rng.normal(size=(round(length_s * rate_hz), 2))
                    measured = 10.0**number * lfilter([1.0], [1.0, -0.45 * number], noise, axis=0)
                    samples = (factor * (np.full_like(noise, 0.1) if constant else measured)).astype(np.float32)
                    windows[topic] = Window(samples.astype(np.float64), rate_hz, ('a', 'b'), 0, 0.1, 2.0)
                exploration_id = f'{surface}/{slide}'
                events.append(
                    CutWindow(place, exploration_id, length_s, length_s, windows, 0.1, 2.0, tangential_force_n=1.0)
                )
    return LabelledFeatures.from_vectors(recipe.feature_set.extract_many(events), surfaces)


@pytest.fixture(scope='module', params=SHIPPED)
def recipe(request):
    return load_recipe(request.param)


@pytest.fixture(scope='module')
def training(recipe):
    return train(recipe, windows_of(recipe))


@pytest.mark.parametrize('factor', [1e6, 1e-6])
def test_in_other_units_a_recipe_learns_to_report_as_much(recipe, training, factor):
    novel = train(recipe, windows_of(recipe, factor))
    reported = accuracy(novel, windows_of(recipe, factor, seed=1))
    as_much = reported > accuracy(training, windows_of(recipe, seed=1)) - 0.1
    assert as_much != (factor < 1.0 and recipe.name in FLOORED)


@pytest.mark.parametrize('changed', [{'factor': 1e6}, {'factor': 1e-6}, {'constant': True}], ids=str)
def test_a_signal_unlike_the_training_gets_an_answer_in_finite_numbers(recipe, training, changed):
    values = windows_of(recipe, seed=1, **changed).values
    assert np.isfinite(values).all()
    assert np.isfinite(training.predict_log_proba(values)).all()


def test_from_signals_that_stand_still_nothing_is_trained(recipe):
    still = windows_of(recipe, constant=True)
    answers = np.exp(train(recipe, still).predict_log_proba(still.values))
    np.testing.assert_allclose(answers.sum(axis=1), 1.0)
    np.testing.assert_allclose(answers, np.broadcast_to(answers[0], answers.shape))
    if recipe.learner_name in EVEN:
        np.testing.assert_allclose(answers, 1 / 3, atol=0.05)


def accuracy(model, examples):
    return np.mean(np.array(model.decide(examples.values)) == examples.labels)
