"""The network with a discriminant of its own for the first window of a slide."""

import dataclasses

import numpy as np
import pytest

from texture_estimation.learners.discriminant import linear_discriminant
from texture_estimation.learners.mlp import Mlp, OnsetMlp
from texture_estimation.recipe import Recipe
from texture_estimation.training import train
from texture_features.examples import LabelledFeatures

NAMES = ('signal/a', 'signal/b', 'signal/slide_onset')
SLIDES, WINDOWS = 20, 6


def examples_with_onset(seed=0):
    """Return slides of two textures that differ in `a` while they slide, and in `b`, the other way, as they start."""
    rng = np.random.default_rng(seed)
    values, labels, groups = [], [], []
    for number, label in enumerate(('cork', 'felt')):
        for slide in range(SLIDES):
            own = rng.normal(size=(WINDOWS, 3))
            own[1:, 0] += 6.0 * number
            own[0, 0] += 3.0
            own[0, 1] += 8.0 * (1 - number)
            own[:, 2] = np.arange(WINDOWS) == 0
            values.append(own)
            labels += [label] * WINDOWS
            groups += [f'{label}/{slide}'] * WINDOWS
    return LabelledFeatures(np.concatenate(values), np.array(labels), np.array(groups), NAMES, 'a1', 0.5, 0.5)


def model_of(learner, training=None):
    recipe = {'inputs': {'signal': {'features': ['hjorth']}}, 'learner': learner, 'training': training or {}}
    return train(Recipe.from_mapping(recipe, 'mine'), examples_with_onset())


def shares(model):
    """Return the shares of first and of later windows that are right."""
    examples = examples_with_onset(seed=1)
    right, first = np.array(model.decide(examples.values)) == examples.labels, examples.values[:, 2] > 0
    return right[first].mean(), right[~first].mean()


def test_shrunk_to_the_diagonal_a_discriminant_is_that_of_independent_gaussians():
    rng = np.random.default_rng(0)
    X, y = rng.normal(size=(60, 3)) * [1.0, 2.0, 5.0], np.repeat([0, 1, 2], 20)
    weights, offsets = linear_discriminant(X, y, 3, shrinkage=1.0)
    means = np.stack([X[y == code].mean(axis=0) for code in range(3)])
    variance = np.mean((X - means[y]) ** 2, axis=0)
    log_densities = -0.5 * (((X[:, None] - means) ** 2) / variance).sum(axis=-1)
    scores = X @ weights + offsets
    np.testing.assert_allclose(scores - scores[:, :1], log_densities - log_densities[:, :1], atol=1e-8)


def test_constant_features_and_labels_with_one_example_say_nothing():
    X = np.array([[0.0, 7.0], [1.0, 7.0], [5.0, 7.0], [6.0, 7.0]])
    assert not linear_discriminant(X, np.array([0, 0, 1, 1]), 2, 0.3)[0][1].any()
    assert not linear_discriminant(X, np.array([0, 0, 0, 1]), 2, 0.3)[0].any()


def test_first_windows_that_look_different_are_recognised_by_what_first_windows_look_like():
    first, later = shares(model_of({'onset_mlp': {'hidden': 1, 'epochs': 20}}))
    assert first > 0.95
    assert later > 0.95
    assert shares(model_of({'mlp': {'hidden': 1, 'epochs': 20}}))[0] < 0.9


def test_later_windows_are_decided_by_the_network_alone():
    examples = examples_with_onset()
    codes, groups = (np.unique(column, return_inverse=True)[1] for column in (examples.labels, examples.groups))
    blind = examples.values * [1.0, 1.0, 0.0]
    alone = Mlp(epochs=2).fit(blind, codes, groups)
    both = OnsetMlp(epochs=2).of_examples(NAMES, ('cork', 'felt'))
    fitted = both.fit(examples.values, codes, groups)
    later = examples.values[examples.values[:, 2] == 0]
    assert (
        both.predictor(fitted.parameters)(later).argmax(axis=1) == Mlp.predictor(alone.parameters)(later).argmax(axis=1)
    ).all()


def test_when_a_window_was_is_no_novelty():
    model = model_of({'onset_mlp': {'hidden': 4, 'epochs': 20}}, {'false_rejection_rate': 0.05})
    for space in ('features', 'onset'):
        assert not model.novelty_detector.distances[space].projection[2].any()
    assert model.novelty_detector.distances['features'].projection[0].any()


def test_a_first_window_is_estimated_live_by_the_discriminant_too():
    model = model_of({'onset_mlp': {'hidden': 4, 'epochs': 5}})
    first = examples_with_onset(seed=1).values[0]
    assert first[2] == 1.0
    np.testing.assert_allclose(model.predict_with_activations(first)[0], model.predictor(first))


def test_without_the_feature_it_is_the_network():
    examples = dataclasses.replace(examples_with_onset(), names=('signal/a', 'signal/b', 'signal/c'))
    recipe = {'inputs': {'signal': {'features': ['hjorth']}}}
    models = [
        train(Recipe.from_mapping({**recipe, 'learner': {name: {'epochs': 5}}}, 'mine'), examples)
        for name in ('mlp', 'onset_mlp')
    ]
    first, second = (model.predict_log_proba(examples.values) for model in models)
    assert first == pytest.approx(second)
