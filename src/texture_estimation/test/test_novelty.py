import numpy as np
import pytest

from texture_estimation.open_set.novelty import NoveltyDetector

SURFACES, SLIDES, WINDOWS, FEATURES = 8, 12, 6, 5


def windows(centres, rng, slides=SLIDES):
    """Return windows, surfaces and slides about centres; the first feature is constant, the second is noise alone."""
    shift = 0.3 * rng.normal(size=(len(centres), slides, 1, FEATURES))
    values = centres[:, None, None] + shift + 0.3 * rng.normal(size=(len(centres), slides, WINDOWS, FEATURES))
    values[..., 0] = 7.0
    values[..., 1] = rng.normal(size=values.shape[:-1])
    codes = np.repeat(np.arange(len(centres)), slides * WINDOWS)
    return values.reshape(-1, FEATURES), codes, np.repeat(np.arange(len(centres) * slides), WINDOWS)


@pytest.fixture(scope='module')
def training():
    rng = np.random.default_rng(0)
    centres = 3.0 * rng.normal(size=(SURFACES, FEATURES))
    return NoveltyDetector.fit(*windows(centres, rng), overlap=0.5, false_rejection_rate=0.1), centres, rng


def slide_means(centres, rng, slides=20):
    values, _, _ = windows(centres, rng, slides)
    return values.reshape(-1, WINDOWS, FEATURES).mean(axis=1)


def test_about_as_many_slides_over_known_surfaces_are_rejected_as_allowed(training):
    novelty_detector, centres, rng = training
    rejected = np.mean([not novelty_detector.is_known(mean, 3.5) for mean in slide_means(centres, rng, 50)])
    assert 0.02 < rejected < 0.2


def test_surfaces_that_lie_elsewhere_are_unknown(training):
    novelty_detector, _, rng = training
    elsewhere = 3.0 * rng.normal(size=(10, FEATURES)) + 12.0
    assert not any(novelty_detector.is_known(mean, 3.5) for mean in slide_means(elsewhere, rng))


def test_a_surface_that_was_trained_is_known(training):
    novelty_detector, _, rng = training
    new = np.full((1, FEATURES), 15.0)
    trained = novelty_detector.with_slides(list(windows(new, rng, 3)[0].reshape(3, WINDOWS, FEATURES)), 0.5)
    known = [trained.is_known(mean, 3.5) for mean in slide_means(new, rng)]
    assert np.mean(known) > 0.7


def test_its_arrays_say_all(training):
    novelty_detector, centres, _ = training
    again = NoveltyDetector.from_arrays(novelty_detector.as_arrays())
    assert again.novelty_score(centres[0]) == novelty_detector.novelty_score(centres[0])


@pytest.mark.parametrize(('surfaces', 'slides'), [(1, 30), (15, 2), (4, 4)])
def test_one_surface_or_two_slides_of_each_or_less_than_twenty_in_all_are_too_few(surfaces, slides):
    rng = np.random.default_rng(0)
    assert NoveltyDetector.fit(*windows(rng.normal(size=(surfaces, FEATURES)), rng, slides), 0.5, 0.05) is None


def test_slides_that_are_all_the_same_are_known_and_others_are_not():
    values = np.repeat(np.eye(3), 3 * WINDOWS, axis=0)
    codes = np.repeat(np.arange(3), 3 * WINDOWS)
    novelty_detector = NoveltyDetector.fit(values, codes, np.repeat(np.arange(9), WINDOWS), 0.5, 0.1)
    assert novelty_detector.is_known(np.eye(3)[1], 3.0)
    assert not novelty_detector.is_known(np.array([5.0, 5.0, 5.0]), 3.0)
