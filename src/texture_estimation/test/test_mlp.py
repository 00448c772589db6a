"""The multilayer perceptron against what mathematics says of it."""

import numpy as np
import pytest
from sklearn.neural_network import MLPClassifier

from texture_estimation import numerics as log_probabilities
from texture_estimation.learners import mlp
from texture_estimation.learners.mlp import AugmentedExamples, Mlp, _first_weights, _slopes
from texture_estimation.numerics import log_loss, log_softmax
from texture_features.augmentation import Augmentation


def test_slopes_are_the_derivatives_of_the_cross_entropy():
    rng = np.random.default_rng(0)
    weights = [part.astype(np.float64) for part in _first_weights(3, 5, 4, rng)]
    inputs, codes = rng.standard_normal((7, 3)), rng.integers(0, 4, 7)

    def loss():
        active = np.maximum(inputs @ weights[0] + weights[1], 0)
        return log_loss(log_softmax(active @ weights[2] + weights[3]), codes)

    slopes = _slopes(weights, inputs, np.eye(4)[codes])
    for weight, slope in zip(weights, slopes, strict=True):
        place = (0,) * weight.ndim
        weight[place] += 1e-6
        above = loss()
        weight[place] -= 2e-6
        below = loss()
        weight[place] += 1e-6
        assert slope[place] == pytest.approx((above - below) / 2e-6, abs=1e-7)


def test_two_overlapping_clouds_are_reported_apart_as_well_as_can_be_and_no_better_is_claimed():
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


def test_the_same_seed_learns_the_same(examples):
    codes, groups = (np.unique(column, return_inverse=True)[1] for column in (examples.labels, examples.groups))
    first, again = (Mlp(epochs=2).fit(examples.values, codes, groups).parameters for _ in range(2))
    assert all(np.array_equal(first[name], again[name]) for name in first)


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


def test_a_training_in_small_pieces_gives_the_same_network(examples, monkeypatch):
    codes, groups = (np.unique(of, return_inverse=True)[1] for of in (examples.labels, examples.groups))
    whole = Mlp(epochs=2).fit(examples.values, codes, groups)
    monkeypatch.setattr(log_probabilities, 'CHUNK', 40)
    pieces = Mlp(epochs=2).fit(examples.values, codes, groups)
    np.testing.assert_array_equal(pieces.parameters['hidden'], whole.parameters['hidden'])
    np.testing.assert_allclose(pieces.parameters['output'], whole.parameters['output'], rtol=1e-4)  # the temperature
    np.testing.assert_allclose(pieces.held_out, whole.held_out, rtol=1e-4)


def test_a_training_that_would_take_too_long_makes_fewer_steps(examples, monkeypatch):
    codes, groups = (np.unique(of, return_inverse=True)[1] for of in (examples.labels, examples.groups))
    counts = []
    step = mlp._Adam.step
    monkeypatch.setattr(mlp._Adam, 'step', lambda self, *args: (counts.append(1), step(self, *args))[1])
    Mlp(hidden=4, epochs=500).fit(examples.values, codes, groups)
    without_limit = len(counts)
    monkeypatch.setattr(mlp, 'MAX_WORK', 450 * (examples.values.shape[1] + 4))
    Mlp(hidden=4, epochs=500).fit(examples.values, codes, groups)
    assert (without_limit, len(counts) - without_limit) == (
        5 * 500,
        5 * 450,
    )  # four slides of each: four folds, and all


def test_networks_of_the_calibration_make_half_of_the_limited_steps_of_an_augmented_training(examples, monkeypatch):
    codes, groups = (np.unique(of, return_inverse=True)[1] for of in (examples.labels, examples.groups))
    counts = []
    step = mlp._Adam.step
    monkeypatch.setattr(mlp._Adam, 'step', lambda self, *args: (counts.append(1), step(self, *args))[1])
    monkeypatch.setattr(mlp, 'MAX_WORK', 900 * (examples.values.shape[1] + 4))
    none, n_features = np.zeros(0, dtype=np.intp), examples.values.shape[1]
    nothing = np.zeros((0, n_features))
    augmented = AugmentedExamples(
        nothing.astype(np.float32), none, none, none, np.zeros(n_features), nothing, none, Augmentation()
    )
    Mlp(hidden=4, epochs=2000).fit(examples.values, codes, groups, augmented)
    assert len(counts) == 4 * 450 + 900
