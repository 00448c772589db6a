# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from texture_estimation.learners.svm import PairCoupling, RbfMachines, SvmRbf, fit_coupling


def max_wins(decisions, n_labels):
    """Return the label that wins most pairs, the first of those that tie, as libsvm does."""
    wins = np.zeros((len(decisions), n_labels))
    first, second = np.triu_indices(n_labels, k=1)
    for pair, (one, other) in enumerate(zip(first, second, strict=True)):
        wins[np.arange(len(decisions)), np.where(decisions[:, pair] > 0, one, other)] += 1
    return wins.argmax(axis=1)


@pytest.mark.parametrize('n_labels', [2, 3, 10])
def test_the_array_form_decides_every_window_as_scikit_learn(make_examples, n_labels):
    labels = tuple(f'm{number:02d}' for number in range(n_labels))
    examples = make_examples(labels=labels, spread=2.0)
    codes = np.unique(examples.labels, return_inverse=True)[1]
    groups = np.unique(examples.groups, return_inverse=True)[1]
    machines = RbfMachines(**SvmRbf().fit(examples.values, codes, groups).parameters['machines'])
    # gamma='scale' is 1 / (n_features · variance), of features that are standardised
    theirs = make_pipeline(StandardScaler(), SVC(C=10.0, gamma='scale', decision_function_shape='ovo'))
    theirs.fit(examples.values, codes)
    values = make_examples(seed=5, labels=labels, spread=3.0).values
    expected = theirs.decision_function(values)
    expected = -expected[:, None] if n_labels == 2 else expected
    np.testing.assert_allclose(machines(values), expected, atol=1e-9)
    np.testing.assert_array_equal(max_wins(machines(values), n_labels), theirs.predict(values))


def test_with_a_common_scale_what_hardly_varies_stays_small():
    values = np.random.default_rng(0).normal(size=(40, 2)) * (1.0, 1e-3)
    codes = np.arange(40) % 2
    fitted = SvmRbf(common_scale=True).fit(values, codes, codes)
    assert fitted.parameters['machines']['scale'] == pytest.approx(np.sqrt(values.var(axis=0).mean()))
    constant = SvmRbf(common_scale=True).fit(np.ones((4, 2)), np.arange(4) % 2, np.arange(4))
    assert constant.parameters['machines']['scale'].tolist() == [1.0, 1.0]


def sheared(seed, shear, slides=8, windows=6):
    """Return windows of two textures that differ along feature 0, sheared along 1 and 2, with labels and slides."""
    rng = np.random.default_rng(seed)
    codes = np.repeat([0, 1], slides * windows)
    groups = np.repeat(np.arange(2 * slides), windows)
    values = 0.2 * rng.normal(size=(len(codes), 3)) + np.outer(codes, [1.0, 0.5, 0.0])
    return values + shear * np.array([0.0, 2.0, 1.0]), codes, groups


def test_a_turn_that_only_the_start_of_slides_shows_is_taken_out_by_the_whitening():
    values, codes, groups = sheared(0, shear=1.0)
    turn = np.tile([0.0, 2.0, 1.0], (16, 1)) + 0.05 * np.random.default_rng(1).normal(size=(16, 3))
    turn[3] = np.nan  # a slide without a touch before it
    turned, truth, _ = sheared(2, shear=-1.0)

    def accuracy(learner, differences):
        predictor = learner.predictor(learner.fit(values, codes, groups, differences).parameters)
        return (predictor(turned).argmax(axis=1) == truth).mean()

    learner = SvmRbf(common_scale=True, whitening=0.01)
    assert accuracy(learner, None) < 0.7
    assert accuracy(learner, turn) > 0.95


def test_consistent_pairs_give_back_the_probabilities_they_came_from():
    probabilities = np.array([0.5, 0.3, 0.15, 0.05])
    first, second = np.triu_indices(4, k=1)
    margins = np.log(probabilities[first] / probabilities[second])  # r_ij = p_i / (p_i + p_j)
    coupling = PairCoupling(4, np.ones(6), np.zeros(6), 1.0)
    np.testing.assert_allclose(np.exp(coupling(margins)), probabilities, rtol=1e-12)


def test_fitted_probabilities_are_as_often_right_as_they_say():
    rng = np.random.default_rng(0)
    codes = rng.integers(0, 2, 4000)
    decisions = np.where(codes == 0, 1.0, -1.0)[:, None] + rng.normal(size=(4000, 1)) * 1.2
    probabilities = np.exp(fit_coupling(decisions, codes, 2)(decisions))
    confidence, right = probabilities.max(axis=1), probabilities.argmax(axis=1) == codes
    for low in (0.5, 0.6, 0.7, 0.8, 0.9):
        within = (confidence >= low) & (confidence < low + 0.1)
        assert right[within].mean() == pytest.approx(confidence[within].mean(), abs=0.06)


@pytest.mark.parametrize(
    ('apart', 'scale', 'n_first', 'n_second'), [(1.0, 1.0, 80, 50), (0.2, 30.0, 9, 300), (2.0, 1e-3, 40, 4)]
)
def test_sigmoids_are_those_of_a_logistic_regression_on_softened_labels(apart, scale, n_first, n_second):
    rng = np.random.default_rng(0)
    codes = np.repeat([0, 1], [n_first, n_second])
    decisions = scale * (np.where(codes == 0, apart, -apart) + rng.normal(size=len(codes)))
    coupling = fit_coupling(decisions[:, None], codes, 2)
    # A label that is true to 0.9 is nine tenths of a row with it, and a tenth of one without.
    first = np.where(codes == 0, (n_first + 1) / (n_first + 2), 1 / (n_second + 2))
    regression = LogisticRegression(C=1e12, tol=1e-10, max_iter=1000, solver='newton-cholesky')
    values = np.tile(decisions / scale, 2)[:, None]
    regression.fit(values, np.repeat([1, 0], len(codes)), sample_weight=np.concatenate([first, 1 - first]))
    assert coupling.slopes[0] == pytest.approx(max(regression.coef_[0, 0] / scale, 1e-3), rel=1e-4)
    assert coupling.offsets[0] == pytest.approx(regression.intercept_[0], rel=1e-4, abs=1e-6)
