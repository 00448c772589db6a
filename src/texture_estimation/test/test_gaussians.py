# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from scipy.stats import norm

from texture_estimation.gaussians import LENGTHS, ClassDistance, GaussianClasses, SlideGaussians, SlideMoments

WINDOWS, SLIDES = 12, 8


def slide(centre, seed, spread=1.0):
    rng = np.random.default_rng(seed)
    return np.asarray(centre) + 0.3 * rng.normal(size=3) + spread * rng.normal(size=(WINDOWS, 3))


def trained(centres=((0.0, 0.0, 0.0), (6.0, 0.0, 0.0)), spread=1.0):
    values = np.concatenate(
        [slide(centre, 100 * code + number, spread) for code, centre in enumerate(centres) for number in range(SLIDES)]
    )
    slides = np.repeat(np.arange(SLIDES * len(centres)), WINDOWS)
    return SlideGaussians.fit(values, slides // SLIDES, slides, hop_ratio=1.0)


def best(gaussians, values, effective_windows=float(WINDOWS)):
    log_proba = gaussians.log_proba(values.mean(axis=0), values.var(axis=0), effective_windows)
    return int(gaussians.combined(np.full(gaussians.n_trained, 1.0 / gaussians.n_trained), log_proba).argmax())


@pytest.mark.parametrize('length', LENGTHS)
def test_a_texture_of_one_slide_is_recognised_at_every_length_and_the_trained_ones_stay(length):
    gaussians = trained().with_added([slide([0.0, 8.0, 0.0], 1)], np.array([2]))
    part = slice(0, round(length))
    assert best(gaussians, slide([0.0, 8.0, 0.0], 2)[part], length) == 2
    assert best(gaussians, slide([0.0, 0.0, 0.0], 3)[part], length) != 2
    assert best(gaussians, slide([6.0, 0.0, 0.0], 4)[part], length) != 2


def test_textures_that_differ_in_their_variation_alone_are_distinguished_in_a_long_slide():
    gaussians = trained(spread=0.5).with_added([slide([0.0, 0.0, 0.0], 1, spread=3.0)], np.array([2]))
    still, varied = slide([0.0, 0.0, 0.0], 2, spread=0.5), slide([0.0, 0.0, 0.0], 3, spread=3.0)
    assert best(gaussians, varied) == 2
    assert best(gaussians, still) != 2


def test_trained_textures_share_what_they_have_together_as_they_were():
    gaussians = trained().with_added([slide([0.0, 8.0, 0.0], 1)], np.array([2]))
    values = slide([0.0, 3.0, 0.0], 2)
    log_proba = gaussians.log_proba(values.mean(axis=0), values.var(axis=0), float(WINDOWS))
    probabilities = gaussians.combined(np.array([0.9, 0.1]), log_proba)
    assert probabilities.sum() == pytest.approx(1.0)
    assert probabilities[0] / probabilities[1] == pytest.approx(9.0)


def test_added_slides_take_the_place_of_those_added_before_and_none_is_left_of_them():
    first, second = slide([0.0, 8.0, 0.0], 1), slide([0.0, 0.0, 8.0], 2)
    again = trained().with_added([first], np.array([2])).with_added([second], np.array([2]))
    direct = trained().with_added([second], np.array([2]))
    x = slide([1.0, 2.0, 3.0], 3)
    np.testing.assert_array_equal(*(one.log_proba(x.mean(axis=0), x.var(axis=0), 3.0) for one in (again, direct)))


def normal(centre, count, seed):
    return np.asarray(centre) + np.random.default_rng(seed).normal(size=(count, len(centre)))


def fitted(*centres, count=4000):
    samples = np.concatenate([normal(centre, count, seed) for seed, centre in enumerate(centres)])
    return GaussianClasses.fit(samples, np.repeat(np.arange(len(centres)), count), np.full(len(centres), count))


@pytest.mark.parametrize('distance', [1.0, 2.0, 3.0])
def test_two_gaussians_are_confused_as_often_as_their_distance_predicts(distance):
    classes = fitted([0.0, 0.0], [distance, 0.0])
    wrong = classes.log_probabilities(normal([0.0, 0.0], 40_000, seed=9)).argmax(axis=1).mean()
    assert wrong == pytest.approx(norm.cdf(-distance / 2.0), abs=0.01)


def test_a_class_of_few_slides_is_wider_and_as_sharp_as_the_others_with_many():
    classes = fitted([0.0], [10.0])
    at = np.array([20.0])
    for slides in (1, 5, 10_000):
        log_proba = classes.with_classes(np.array([[22.0]]), np.array([slides])).log_probabilities(at)
        variance = (1.0 + 1.0 / slides) ** classes.uncertainty_exponent
        log_odds = 0.5 * classes.inverse_temperature * (100.0 - 4.0 / variance)
        assert log_proba[2] - log_proba[1] == pytest.approx(log_odds, rel=0.1)


def test_more_features_than_a_covariance_could_hold_still_tell_the_classes():
    n_features = 200_000  # whose covariance would take 320 GB
    samples = np.random.default_rng(0).normal(size=(6, n_features))
    samples[3:] += 1.0
    classes = GaussianClasses.fit(samples, np.repeat([0, 1], 3), np.array([3, 3]))
    third = classes.with_classes(np.full((1, n_features), 3.0), np.array([1]))
    at = np.array([[0.0], [1.0], [3.0]]) + np.zeros(n_features)
    assert third.log_probabilities(at).argmax(axis=1).tolist() == [0, 1, 2]


def test_running_moments_equal_those_of_all_windows_also_far_from_zero():
    windows = 1e6 + np.random.default_rng(0).normal(size=(500, 3))
    moments = SlideMoments(n_features=3)
    for count, window in enumerate(windows, start=1):
        moments.add(window)
        np.testing.assert_allclose(moments.mean, windows[:count].mean(axis=0), rtol=1e-12)
        np.testing.assert_allclose(moments.variance, windows[:count].var(axis=0), atol=1e-6)


CLASSES, SLIDES_OF_ONE, FEATURE_COUNT = 8, 12, 5


def slide_means(centres, rng, slides=SLIDES_OF_ONE):
    """Return means of slides about centres and their classes; the first feature is constant, the second is noise."""
    means = centres[:, None] + 0.3 * rng.normal(size=(len(centres), slides, FEATURE_COUNT))
    means[..., 0] = 7.0
    means[..., 1] = rng.normal(size=means.shape[:-1])
    return means.reshape(-1, FEATURE_COUNT), np.repeat(np.arange(len(centres)), slides)


@pytest.fixture(scope='module')
def distance_of_slides():
    rng = np.random.default_rng(0)
    centres = 3.0 * rng.normal(size=(CLASSES, FEATURE_COUNT))
    means, classes = slide_means(centres, rng)
    return ClassDistance.fit(means, classes), centres, rng


def test_the_distance_is_that_to_the_three_nearest_slides_less_that_to_the_centre(distance_of_slides):
    distance, centres, _ = distance_of_slides
    projected = centres[2] @ distance.projection
    squares = ((distance.references[distance.classes == 2] - projected) ** 2).sum(axis=1)
    squared = (projected - distance.centre) ** 2
    expected = np.sort(squares)[:3].mean() - squared @ distance.weights
    assert distance.score(centres[2], 2) == pytest.approx(expected)


def test_a_class_without_slides_is_infinitely_far_until_slides_are_added(distance_of_slides):
    distance, _, rng = distance_of_slides
    new = np.full((1, FEATURE_COUNT), 15.0)
    assert distance.score(new[0], CLASSES) == np.inf
    means, _ = slide_means(new, rng, 3)
    added = distance.with_slides(means, np.full(3, CLASSES))
    assert added.score(new[0], CLASSES) < min(added.score(new[0], code) for code in range(CLASSES))
