import numpy as np
import pytest
from scipy.stats import norm

from texture_estimation.gaussians import GaussianClasses


def normal(centre, count, seed):
    return np.asarray(centre) + np.random.default_rng(seed).normal(size=(count, len(centre)))


def fitted(*centres, count=4000):
    samples = np.concatenate([normal(centre, count, seed) for seed, centre in enumerate(centres)])
    return GaussianClasses.fit(samples, np.repeat(np.arange(len(centres)), count), np.full(len(centres), count))


@pytest.mark.parametrize('distance', [1.0, 2.0, 3.0])
def test_two_gaussians_are_confused_as_often_as_their_distance_says(distance):
    classes = fitted([0.0, 0.0], [distance, 0.0])
    wrong = classes.log_probabilities(normal([0.0, 0.0], 40_000, seed=9)).argmax(axis=1).mean()
    assert wrong == pytest.approx(norm.cdf(-distance / 2.0), abs=0.01)


def test_the_scale_of_the_features_does_not_matter():
    samples, classes = normal([0.0, 0.0], 60, seed=1), np.repeat([0, 1, 2], 20)
    scale = np.array([1e6, 1e-6])
    plain, scaled = (GaussianClasses.fit(samples * by, classes, np.full(3, 20)) for by in (1.0, scale))
    np.testing.assert_allclose(plain.log_probabilities(samples), scaled.log_probabilities(samples * scale), atol=1e-6)


def test_a_class_of_few_slides_is_wider_and_as_sharp_as_the_others_with_many():
    classes = fitted([0.0], [10.0])
    at = np.array([20.0])
    for slides in (1, 5, 10_000):
        shares = classes.with_classes(np.array([[22.0]]), np.array([slides])).log_probabilities(at)
        variance = (1.0 + 1.0 / slides) ** classes.uncertainty_exponent
        log_odds = 0.5 * classes.inverse_temperature * (100.0 - 4.0 / variance)
        assert shares[2] - shares[1] == pytest.approx(log_odds, rel=0.1)


def test_classes_of_one_sample_each_have_a_covariance_and_finite_probabilities():
    classes = GaussianClasses.fit(np.array([[0.0, 7.0], [1.0, 7.0]]), np.array([0, 1]), np.array([1, 1]))
    probabilities = np.exp(classes.log_probabilities(np.array([[0.0, 7.0], [1.0, 9.0]])))
    assert probabilities.argmax(axis=1).tolist() == [0, 1]
    np.testing.assert_allclose(probabilities.sum(axis=1), 1.0)


def test_samples_that_are_all_the_same_say_nothing():
    classes = GaussianClasses.fit(np.full((6, 3), 0.1), np.repeat([0, 1], 3), np.array([3, 3]))
    np.testing.assert_allclose(np.exp(classes.log_probabilities(np.array([0.1, 0.2, 5.0]))), 0.5)


def test_of_uncorrelated_features_a_diagonal_covariance_says_the_same(monkeypatch):
    around = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    samples = np.concatenate([around, around + np.array([9.0, 5.0])])
    given = samples, np.repeat([0, 1], 4), np.array([4, 4])
    full = GaussianClasses.fit(*given)
    monkeypatch.setattr('texture_estimation.gaussians.MAX_CORRELATED', 1)
    diagonal = GaussianClasses.fit(*given)
    assert diagonal.projection.shape == (2,)
    np.testing.assert_allclose(diagonal.log_probabilities(samples), full.log_probabilities(samples))


def test_more_features_than_a_covariance_could_hold_still_tell_the_classes():
    n_features = 200_000  # whose covariance would take 320 GB
    samples = np.random.default_rng(0).normal(size=(6, n_features))
    samples[3:] += 1.0
    classes = GaussianClasses.fit(samples, np.repeat([0, 1], 3), np.array([3, 3]))
    third = classes.with_classes(np.full((1, n_features), 3.0), np.array([1]))
    at = np.array([[0.0], [1.0], [3.0]]) + np.zeros(n_features)
    assert third.log_probabilities(at).argmax(axis=1).tolist() == [0, 1, 2]
