import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression

from texture_estimation.learners.svm import PairCoupling, fit_coupling, uncalibrated


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
