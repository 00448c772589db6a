# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The multilayer perceptron against analytical results."""

import numpy as np
import pytest
from sklearn.neural_network import MLPClassifier

from texture_estimation.learners import mlp
from texture_estimation.learners.discriminant import linear_discriminant
from texture_estimation.learners.learner import log_loss, log_softmax
from texture_estimation.learners.mlp import Mlp, MlpTraining


def test_slopes_are_the_derivatives_of_the_cross_entropy():
    rng = np.random.default_rng(0)
    network = MlpTraining(3, 5, 4, rng, np.float64)
    weights = network.weights
    inputs, codes = rng.standard_normal((7, 3)), rng.integers(0, 4, 7)

    def loss():
        active = np.maximum(inputs @ weights[0] + weights[1], 0)
        return log_loss(log_softmax(active @ weights[2] + weights[3]), codes)

    network.find_slopes(inputs, codes)
    for weight, slope in zip(weights, network.slopes, strict=True):
        place = (0,) * weight.ndim
        weight[place] += 1e-6
        above = loss()
        weight[place] -= 2e-6
        below = loss()
        weight[place] += 1e-6
        assert slope[place] == pytest.approx((above - below) / 2e-6, abs=1e-7)


def test_two_overlapping_clouds_are_separated_as_well_as_possible_and_no_better_is_claimed():
    rng = np.random.default_rng(1)
    codes = np.tile([0, 1], 1000)
    values = rng.standard_normal((2000, 2)) + codes[:, None] * [1.0, 0.0]
    fitted = Mlp(hidden=16).fit(values, codes, np.arange(2000))
    right = (fitted.held_out.argmax(axis=1) == codes).mean()
    assert right == pytest.approx(0.691, abs=0.03)  # Φ(1/2)
    assert np.exp(fitted.held_out.max(axis=1)).mean() == pytest.approx(right, abs=0.03)


def test_a_feature_that_was_constant_is_ignored_and_units_do_not_matter(examples):
    codes, groups = (np.unique(column, return_inverse=True)[1] for column in (examples.labels, examples.groups))
    values = np.column_stack([examples.values, np.full(len(codes), 7.0)])
    predict = Mlp.predictor(Mlp(epochs=5).fit(values, codes, groups).parameters)
    assert predict(values + np.eye(values.shape[1])[-1] * 1e9) == pytest.approx(predict(values), abs=1e-6)
    in_micro = Mlp.predictor(Mlp(epochs=5).fit(values * 1e6, codes, groups).parameters)
    assert log_softmax(in_micro(values * 1e6)) == pytest.approx(log_softmax(predict(values)), abs=1e-3)


@pytest.mark.filterwarnings('ignore::sklearn.exceptions.ConvergenceWarning')
def test_the_array_form_decides_every_window_as_scikit_learn_with_the_same_weights(make_examples):
    examples, fresh = make_examples(spread=2.0), make_examples(seed=5, spread=3.0).values
    codes, groups = (np.unique(column, return_inverse=True)[1] for column in (examples.labels, examples.groups))
    parameters = Mlp(hidden=16, epochs=5).fit(examples.values, codes, groups).parameters
    network = MLPClassifier((16,), max_iter=1, random_state=0).fit(examples.values, codes)
    network.coefs_ = [parameters['hidden'], parameters['output']]
    network.intercepts_ = [parameters['hidden_offset'], parameters['output_offset']]
    answers = Mlp.predictor(parameters)(fresh)
    np.testing.assert_array_equal(answers.argmax(axis=1), network.predict(fresh))
    np.testing.assert_allclose(log_softmax(answers), network.predict_log_proba(fresh), atol=1e-9)


def test_a_training_that_would_take_too_long_makes_fewer_steps(make_examples, monkeypatch):
    examples = make_examples()
    codes, groups = (np.unique(of, return_inverse=True)[1] for of in (examples.labels, examples.groups))
    counts = []
    step = MlpTraining.step
    monkeypatch.setattr(MlpTraining, 'step', lambda self, *args: (counts.append(1), step(self, *args))[1])
    Mlp(hidden=4, epochs=500).fit(examples.values, codes, groups)
    without_limit = len(counts)
    monkeypatch.setattr(mlp, 'MAX_WORK', 450 * (examples.values.shape[1] + 4))
    Mlp(hidden=4, epochs=500).fit(examples.values, codes, groups)
    assert (without_limit, len(counts) - without_limit) == (
        5 * 500,
        5 * 450,
    )  # four slides of each: four folds, and all


def test_shrunk_to_the_diagonal_a_discriminant_is_that_of_independent_gaussians():
    rng = np.random.default_rng(0)
    X, y = rng.normal(size=(60, 3)) * [1.0, 2.0, 5.0], np.repeat([0, 1, 2], 20)
    weights, offsets = linear_discriminant(X, y, 3, shrinkage=1.0)
    means = np.stack([X[y == code].mean(axis=0) for code in range(3)])
    variance = np.mean((X - means[y]) ** 2, axis=0)
    log_densities = -0.5 * (((X[:, None] - means) ** 2) / variance).sum(axis=-1)
    scores = X @ weights + offsets
    np.testing.assert_allclose(scores - scores[:, :1], log_densities - log_densities[:, :1], atol=1e-8)
