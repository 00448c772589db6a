import numpy as np
import pytest

from texture_estimation.learners.svm import SvmRbf, export, uncalibrated


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
    scaler, svc = SvmRbf()._fit_svc(examples.values, codes)
    svc.set_params(decision_function_shape='ovo')
    svm = export(scaler, svc, uncalibrated(n_labels))
    values = make_examples(seed=5, labels=labels, spread=3.0).values
    expected = svc.decision_function(scaler.transform(values))
    expected = -expected[:, None] if n_labels == 2 else expected
    np.testing.assert_allclose(svm.decisions(values), expected, atol=1e-9)
    np.testing.assert_array_equal(max_wins(svm.decisions(values), n_labels), svc.predict(scaler.transform(values)))


@pytest.mark.parametrize('n_labels', [2, 10])
def test_probabilities_of_the_array_form_are_those_of_scikit_learns_decisions(make_examples, n_labels):
    examples = make_examples(labels=tuple(f'm{number:02d}' for number in range(n_labels)), spread=2.0)
    codes = np.unique(examples.labels, return_inverse=True)[1]
    groups = np.unique(examples.groups, return_inverse=True)[1]
    parameters = SvmRbf().fit(examples.values, codes, groups).parameters
    svm = SvmRbf.predictor(parameters)
    parameters['svc'].set_params(decision_function_shape='ovo')
    decisions = parameters['svc'].decision_function(parameters['scaler'].transform(examples.values))
    decisions = -decisions[:, None] if n_labels == 2 else decisions
    np.testing.assert_allclose(svm(examples.values), svm.coupling(decisions), atol=1e-9)


def test_one_window_gets_the_same_numbers_as_in_a_batch(model, examples):
    together = model.predict_log_proba(examples.values)
    for values, expected in zip(examples.values[:20], together, strict=False):
        np.testing.assert_allclose(model.predict_log_proba(values), expected, atol=1e-12)


def test_a_window_far_from_all_examples_has_finite_log_probabilities(model):
    assert np.isfinite(model.predict_log_proba(np.full(6, 1e6))).all()


def test_with_a_common_scale_what_hardly_varies_stays_small():
    values = np.random.default_rng(0).normal(size=(40, 2)) * (1.0, 1e-3)
    codes = np.arange(40) % 2
    scaler, _ = SvmRbf(common_scale=True)._fit_svc(values, codes)
    deviations = scaler.transform(values).std(axis=0)
    assert deviations[1] / deviations[0] == pytest.approx(values[:, 1].std() / values[:, 0].std())
    assert np.mean(deviations**2) == pytest.approx(1.0)
    assert SvmRbf(common_scale=True)._fit_svc(np.ones((4, 2)), np.arange(4) % 2)[0].scale_[0] == 1.0


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


def test_whitened_windows_get_the_same_numbers_alone_as_together():
    values, codes, groups = sheared(0, shear=0.0)
    learner = SvmRbf(whitening=0.1)
    predictor = learner.predictor(learner.fit(values, codes, groups).parameters)
    together = predictor(values)
    for window, expected in zip(values[:10], together, strict=False):
        np.testing.assert_allclose(predictor(window), expected, atol=1e-12)
