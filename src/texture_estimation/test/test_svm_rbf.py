import numpy as np
import pytest

from texture_estimation.learners.pair_coupling import uncalibrated
from texture_estimation.learners.svm_predictor import export
from texture_estimation.learners.svm_rbf import SvmRbf


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
