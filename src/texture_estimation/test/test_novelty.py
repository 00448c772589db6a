"""Novelty detection against what is known of the distributions that the slides are drawn from."""

import numpy as np
import pytest

from texture_estimation.decisions import (
    FEATURES,
    HIDDEN,
    LOG_ODDS,
    ONSET,
    SCORES,
    ClassDistance,
    NoveltyDetector,
    SlideNovelty,
    space_means,
    window_count,
)
from texture_estimation.decisions import NOVELTY_WINDOWS as EFFECTIVE_WINDOWS

CLASSES, SLIDES, FEATURE_COUNT = 8, 12, 5


def slide_means(centres, rng, slides=SLIDES):
    """Return means of slides about centres and their classes; the first feature is constant, the second is noise."""
    means = centres[:, None] + 0.3 * rng.normal(size=(len(centres), slides, FEATURE_COUNT))
    means[..., 0] = 7.0
    means[..., 1] = rng.normal(size=means.shape[:-1])
    return means.reshape(-1, FEATURE_COUNT), np.repeat(np.arange(len(centres)), slides)


@pytest.fixture(scope='module')
def trained():
    rng = np.random.default_rng(0)
    centres = 3.0 * rng.normal(size=(CLASSES, FEATURE_COUNT))
    means, classes = slide_means(centres, rng)
    return ClassDistance.fit(means, classes), centres, rng


def test_a_slide_is_nearer_to_its_own_class_than_to_any_other(trained):
    distance, centres, rng = trained
    means, classes = slide_means(centres, rng, 3)
    scores = np.array([[distance.score(mean, code) for code in range(CLASSES)] for mean in means])
    np.testing.assert_array_equal(scores.argmin(axis=1), classes)


def test_the_distance_is_that_to_the_three_nearest_slides_less_that_to_the_centre(trained):
    distance, centres, _ = trained
    projected = centres[2] @ distance.projection
    squares = ((distance.references[distance.classes == 2] - projected) ** 2).sum(axis=1)
    away = (projected - distance.centre) ** 2
    expected = np.sort(squares)[:3].mean() - away @ distance.weights
    assert distance.score(centres[2], 2) == pytest.approx(expected)


def test_scores_kept_between_windows_are_those_of_the_means_so_far(trained):
    distance, centres, rng = trained
    distances, overlap = {FEATURES: distance, ONSET: distance}, 0.2
    novelty, windows = SlideNovelty(distances, CLASSES), centres[3] + 0.3 * rng.normal(size=(30, FEATURE_COUNT))
    for number, values in enumerate(windows):
        novelty.add(values, None, 3, 1.0 + overlap * number)
        means = space_means(windows[: number + 1], None, overlap)
        for label in (3, 4):  # what is kept for one label must not be taken for another
            expected = [distance.score(means[space], label) for space in distances]
            assert novelty.scores(label, 1.0)[:2] == pytest.approx(expected, rel=1e-9)


def test_a_constant_feature_does_not_count_and_units_do_not_matter(trained):
    distance, centres, _ = trained
    moved = centres[1] + 1e6 * np.eye(FEATURE_COUNT)[0]
    assert distance.score(moved, 1) == pytest.approx(distance.score(centres[1], 1))
    rng = np.random.default_rng(0)
    means, classes = slide_means(3.0 * rng.normal(size=(CLASSES, FEATURE_COUNT)), rng)
    in_micro = ClassDistance.fit(1e6 * means, classes)
    assert in_micro.score(1e6 * centres[1], 1) == pytest.approx(distance.score(centres[1], 1))


def test_a_class_without_slides_is_infinitely_far_until_slides_are_added(trained):
    distance, _, rng = trained
    new = np.full((1, FEATURE_COUNT), 15.0)
    assert distance.score(new[0], CLASSES) == np.inf
    means, _ = slide_means(new, rng, 3)
    added = distance.with_slides(means, np.full(3, CLASSES))
    assert added.score(new[0], CLASSES) < min(added.score(new[0], code) for code in range(CLASSES))


def test_slides_that_are_all_the_same_are_at_no_distance_and_others_are_far():
    means, classes = np.repeat(np.eye(3), 3, axis=0), np.repeat(np.arange(3), 3)
    distance = ClassDistance.fit(means, classes)
    scale = abs(distance.score(np.eye(3)[0], 0))
    assert distance.score(np.full(3, 5.0), 1) > distance.score(np.eye(3)[1], 1) + scale


def detector(held_out, rate=0.1, spaces=(FEATURES,), counted=SCORES):
    distance = ClassDistance.fit(*slide_means(np.zeros((3, FEATURE_COUNT)), np.random.default_rng(1)))
    return NoveltyDetector.fit(dict.fromkeys(spaces, distance), held_out, rate, counted)


def test_about_as_many_new_slides_are_rejected_as_allowed():
    rng = np.random.default_rng(0)
    fitted = detector([rng.exponential(size=(2000, 3)) for _ in EFFECTIVE_WINDOWS])
    new = rng.exponential(size=(2000, 3)).tolist()
    rejected = np.mean([fitted.novelty_score(scores, 2.4) > fitted.threshold(2.4) for scores in new])
    assert rejected == pytest.approx(0.1, abs=0.03)  # three standard deviations


def test_no_score_makes_up_for_another():
    rng = np.random.default_rng(0)
    fitted = detector([rng.exponential(size=(500, 3)) for _ in EFFECTIVE_WINDOWS])
    assert fitted.novelty_score([20.0, 0.5, 0.5], 1.0) == fitted.novelty_score([20.0, -1e3, -1e3], 1.0)
    assert fitted.novelty_score([20.0, 0.5, 0.5], 1.0) > fitted.threshold(1.0)
    assert fitted.novelty_score([0.0, 0.0, 0.0], 1.0) == 0.0


@pytest.mark.parametrize('effective_windows', [1.0, 2.4, 50.0])
def test_a_score_that_is_left_out_changes_neither_the_novelty_score_nor_the_threshold(effective_windows):
    rng = np.random.default_rng(0)
    held_out = [rng.exponential(size=(500, 3)) for _ in EFFECTIVE_WINDOWS]
    fitted = detector(held_out, counted=(FEATURES, LOG_ODDS))
    alone = detector([scores[:, :2] for scores in held_out])
    for agreement in (-1e3, 0.0, 1e3):
        found = fitted.novelty_score([4.0, 3.0, agreement], effective_windows)
        assert found == pytest.approx(alone.novelty_score([4.0, 3.0], effective_windows))
    assert fitted.threshold(effective_windows) == pytest.approx(alone.threshold(effective_windows))
    assert fitted.threshold(effective_windows) < detector(held_out).threshold(effective_windows)


def test_an_exponential_tail_counts_its_negative_log_probability():
    scores = -np.log(1.0 - (np.arange(100_000) + 0.5) / 100_000)[:, None]  # exponential, to the last quantile
    fitted = detector([scores] * len(EFFECTIVE_WINDOWS))
    beyond = np.log(2.0) + np.array([1.0, 2.0, 3.0])  # of which the tail probabilities are 1/2 · e^-1, e^-2, e^-3
    found = [fitted.novelty_score([float(score)], 1.0) for score in beyond]
    assert found == pytest.approx(np.array([1.0, 2.0, 3.0]) / np.log(5.0), rel=1e-3)


def test_between_two_lengths_of_evidence_tails_and_threshold_are_interpolated():
    held_out = [level * np.random.default_rng(0).exponential(size=(500, 2)) for level in EFFECTIVE_WINDOWS]
    fitted = detector(held_out)
    middle = 0.5 * (fitted.threshold(3.0) + fitted.threshold(5.0))
    assert fitted.threshold(4.0) == pytest.approx(middle)
    assert fitted.threshold(0.1) == fitted.threshold(1.0)
    assert fitted.threshold(50.0) == fitted.threshold(5.0)


def test_its_arrays_say_all():
    held_out = [np.random.default_rng(0).exponential(size=(500, 4)) for _ in EFFECTIVE_WINDOWS]
    fitted = detector(held_out, spaces=(FEATURES, ONSET))
    again = NoveltyDetector.from_arrays(fitted.as_arrays())
    assert list(again.distances) == [FEATURES, ONSET]
    assert again.novelty_score([3.0, 2.0, 1.0, 9.0], 2.2) == fitted.novelty_score([3.0, 2.0, 1.0, 9.0], 2.2)
    assert again.threshold(2.2) == fitted.threshold(2.2)
    assert again.distances[ONSET].score(np.ones(FEATURE_COUNT), 1) == fitted.distances[ONSET].score(
        np.ones(FEATURE_COUNT), 1
    )


def test_with_added_slides_the_distances_alone_count():
    fitted = detector([np.random.default_rng(0).exponential(size=(500, 3)) for _ in EFFECTIVE_WINDOWS])
    added = fitted.with_slides([{FEATURES: np.zeros(FEATURE_COUNT)}], np.array([3]))
    assert added.novelty_score([0.0, 1e6, 1e6], 1.0) == 0.0
    assert added.threshold(1.0) < fitted.threshold(1.0)


def test_scores_of_a_growing_slide_are_those_of_its_mean_as_far_as_slides_are_compared(trained):
    distance, centres, rng = trained
    novelty = SlideNovelty({FEATURES: distance, ONSET: distance}, CLASSES)
    windows = centres[3] + 0.1 * rng.normal(size=(13, FEATURE_COUNT))
    for number, window in enumerate(windows):
        novelty.add(window, None, 3 if number % 4 else 2, 1.0 + 0.5 * number)
    features, onset, odds, agreement = novelty.scores(3, 2.5)
    assert features == pytest.approx(distance.score(windows[:9].mean(axis=0), 3))
    assert onset == pytest.approx(distance.score(windows[:2].mean(axis=0), 3))
    assert (odds, agreement) == (-2.5, pytest.approx(-9 / 13))
    means = space_means(windows, None, 0.5)
    assert means[FEATURES] == pytest.approx(windows[:9].mean(axis=0))
    assert HIDDEN not in means


def test_windows_count_by_the_sliding_time_they_cover():
    assert [window_count(length, 0.5) for length in EFFECTIVE_WINDOWS] == [1, 2, 3, 5, 9]
