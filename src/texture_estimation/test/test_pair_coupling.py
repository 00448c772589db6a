import numpy as np
import pytest

from texture_estimation.learners.pair_coupling import PairCoupling, fit_coupling, uncalibrated


def test_consistent_pairs_give_back_the_probabilities_they_came_from():
    probabilities = np.array([0.5, 0.3, 0.15, 0.05])
    first, second = np.triu_indices(4, k=1)
    margins = np.log(probabilities[first] / probabilities[second])  # r_ij = p_i / (p_i + p_j)
    coupling = PairCoupling(4, np.ones(6), np.zeros(6), 1.0)
    np.testing.assert_allclose(np.exp(coupling(margins)), probabilities, rtol=1e-12)


def test_two_labels_have_the_sigmoid_itself():
    coupling = PairCoupling(2, np.array([1.5]), np.array([0.2]), 1.0)
    expected = 1 / (1 + np.exp(-(1.5 * 0.7 + 0.2)))
    assert np.exp(coupling(np.array([0.7])))[0] == pytest.approx(expected)


def test_extreme_decisions_stay_finite():
    coupling = uncalibrated(3)
    assert np.isfinite(coupling(np.array([[1e6, -1e6, 1e6], [-1e9, -1e9, 1e9]]))).all()


def test_fitted_probabilities_are_as_often_right_as_they_say():
    rng = np.random.default_rng(0)
    codes = rng.integers(0, 2, 4000)
    decisions = np.where(codes == 0, 1.0, -1.0)[:, None] + rng.normal(size=(4000, 1)) * 1.2
    probabilities = np.exp(fit_coupling(decisions, codes, 2)(decisions))
    confidence, right = probabilities.max(axis=1), probabilities.argmax(axis=1) == codes
    for low in (0.5, 0.6, 0.7, 0.8, 0.9):
        within = (confidence >= low) & (confidence < low + 0.1)
        assert right[within].mean() == pytest.approx(confidence[within].mean(), abs=0.06)


def test_separable_pairs_keep_finite_slopes():
    codes = np.repeat([0, 1, 2], 30)
    decisions = np.stack([codes == 0, codes == 0, codes == 1], axis=1) * 4.0 - 2.0
    coupling = fit_coupling(decisions, codes, 3)
    assert np.isfinite(coupling.slopes).all()
    assert np.isfinite(coupling(decisions)).all()
