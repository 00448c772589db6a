# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Novelty detection against what is known of the distributions that the slides are drawn from."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import binom

from texture_estimation.decisions import (
    FEATURES,
    FLOOR_WINDOWS,
    HIDDEN,
    NOVELTY_WINDOWS,
    ONSET,
    SCORES,
    ClassDistance,
    ConfidenceFloor,
    ErrorBound,
    NoveltyDetector,
    PredictionSets,
    SlideCourse,
    SlideNovelty,
    StoppingRule,
    fit_confidence_floor,
    fit_prediction_sets,
    fit_stopping_rule,
    slide_scores,
    space_means,
)
from texture_estimation.learners.learner import log_softmax
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train

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


def test_the_distance_is_that_to_the_three_nearest_slides_less_that_to_the_centre(trained):
    distance, centres, _ = trained
    projected = centres[2] @ distance.projection
    squares = ((distance.references[distance.classes == 2] - projected) ** 2).sum(axis=1)
    away = (projected - distance.centre) ** 2
    expected = np.sort(squares)[:3].mean() - away @ distance.weights
    assert distance.score(centres[2], 2) == pytest.approx(expected)


def test_a_class_without_slides_is_infinitely_far_until_slides_are_added(trained):
    distance, _, rng = trained
    new = np.full((1, FEATURE_COUNT), 15.0)
    assert distance.score(new[0], CLASSES) == np.inf
    means, _ = slide_means(new, rng, 3)
    added = distance.with_slides(means, np.full(3, CLASSES))
    assert added.score(new[0], CLASSES) < min(added.score(new[0], code) for code in range(CLASSES))


def detector(held_out, rate=0.1, spaces=(FEATURES,), counted=SCORES):
    distance = ClassDistance.fit(*slide_means(np.zeros((3, FEATURE_COUNT)), np.random.default_rng(1)))
    return NoveltyDetector.fit(dict.fromkeys(spaces, distance), held_out, rate, counted)


def test_about_as_many_new_slides_are_rejected_as_allowed():
    rng = np.random.default_rng(0)
    fitted = detector([rng.exponential(size=(2000, 3)) for _ in NOVELTY_WINDOWS])
    new = rng.exponential(size=(2000, 3)).tolist()
    rejected = np.mean([fitted.novelty_score(scores, 2.4) > fitted.threshold(2.4) for scores in new])
    assert rejected == pytest.approx(0.1, abs=0.03)  # three standard deviations


def test_no_score_makes_up_for_another():
    rng = np.random.default_rng(0)
    fitted = detector([rng.exponential(size=(500, 3)) for _ in NOVELTY_WINDOWS])
    assert fitted.novelty_score([20.0, 0.5, 0.5], 1.0) == fitted.novelty_score([20.0, -1e3, -1e3], 1.0)
    assert fitted.novelty_score([20.0, 0.5, 0.5], 1.0) > fitted.threshold(1.0)
    assert fitted.novelty_score([0.0, 0.0, 0.0], 1.0) == 0.0


def test_an_exponential_tail_counts_its_negative_log_probability():
    scores = -np.log(1.0 - (np.arange(100_000) + 0.5) / 100_000)[:, None]  # exponential, to the last quantile
    fitted = detector([scores] * len(NOVELTY_WINDOWS))
    beyond = np.log(2.0) + np.array([1.0, 2.0, 3.0])  # of which the tail probabilities are 1/2 · e^-1, e^-2, e^-3
    found = [fitted.novelty_score([float(score)], 1.0) for score in beyond]
    assert found == pytest.approx(np.array([1.0, 2.0, 3.0]) / np.log(5.0), rel=1e-3)


def test_between_two_lengths_of_evidence_tails_and_threshold_are_interpolated():
    held_out = [level * np.random.default_rng(0).exponential(size=(500, 2)) for level in NOVELTY_WINDOWS]
    fitted = detector(held_out)
    middle = 0.5 * (fitted.threshold(3.0) + fitted.threshold(5.0))
    assert fitted.threshold(4.0) == pytest.approx(middle)
    assert fitted.threshold(0.1) == fitted.threshold(1.0)
    assert fitted.threshold(50.0) == fitted.threshold(5.0)


def test_with_added_slides_the_distances_alone_count():
    fitted = detector([np.random.default_rng(0).exponential(size=(500, 3)) for _ in NOVELTY_WINDOWS])
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


STOP_WINDOWS = 1.0 + 0.5 * np.arange(9)


def course(confidences, right, novelty_score=0.0, disturbance=''):
    """Return what is said of a slide window by window; single values are said at all times."""
    count = len(STOP_WINDOWS)
    return SlideCourse(
        confidences=np.broadcast_to(confidences, count),
        right=np.broadcast_to(right, count),
        effective_windows=STOP_WINDOWS,
        known=np.ones(count, bool),
        novelty_scores=np.full(count, novelty_score),
        disturbance=disturbance,
    )


def slides(rng, count=400):
    """Return random walks to the right decision: Wald's test of two means, the confidence being the true one."""
    steps = rng.normal(0.5, 1.0, size=(count, len(STOP_WINDOWS)))
    odds = 2.0 * 0.5 * np.cumsum(steps, axis=1)  # log-likelihood ratio of mean 0.5 against -0.5
    confidences = 1.0 / (1.0 + np.exp(-np.abs(odds)))
    return [course(*said) for said in zip(confidences, odds > 0, strict=True)]


def outcome(rule, courses):
    ends = [
        next((k for k, said in enumerate(zip(one.confidences, STOP_WINDOWS, strict=True)) if rule.decided(*said)), -1)
        for one in courses
    ]
    wrong = np.mean([not one.right[end] for one, end in zip(courses, ends, strict=True)])
    return wrong, np.mean(STOP_WINDOWS[ends])


def test_the_rule_errs_as_rarely_on_new_slides_and_ends_sooner_if_more_errors_are_allowed():
    rng = np.random.default_rng(0)
    data, new = slides(rng, 2000), slides(rng, 2000)
    rules = {wrong: fit_stopping_rule(data, wrong, by_novelty=False) for wrong in (0.05, 0.1, 0.2)}
    errors, times = zip(*(outcome(rule, new) for rule in rules.values()), strict=True)
    assert errors == pytest.approx(tuple(rules), abs=0.025)
    assert times[0] > times[1] > times[2]


def test_where_no_rule_errs_rarely_enough_the_one_that_errs_least_is_taken():
    courses = [course(0.9, np.arange(9) >= 4)] * 5 + [course(0.4, right=False)]
    rule = fit_stopping_rule(courses, 0.0, by_novelty=False)
    assert not rule.decided(0.9, 2.0)
    assert rule.decided(0.9, 3.0)


def test_at_the_start_of_a_slide_a_smaller_novelty_score_is_needed():
    rule = StoppingRule(confidence=0.9, novelty_score=40.0, early_novelty_score=0.5)
    assert rule.decided(0.95, 1.0, 0.49)
    assert not rule.decided(0.95, 1.0, 0.51)
    assert rule.decided(0.95, 2.0, 2.9)  # six times as much after each further window
    assert not rule.decided(0.95, 2.0, 3.1)
    assert rule.decided(0.95, 3.0, 17.0)
    assert not rule.decided(0.95, 3.0, 19.0)
    assert not rule.decided(0.95, 4.0, 41.0)
    assert not StoppingRule(novelty_score=0.5, early_novelty_score=1.0).decided(0.99, 1.0, 0.8)


def test_the_rule_stops_few_disturbed_slides_wrongly():
    undisturbed = [course(0.99, right=True, novelty_score=0.1)] * 50
    strange = [course(0.99, right=False, novelty_score=8.0, disturbance='gain')] * 5
    harmless = [course(0.99, right=True, novelty_score=0.1, disturbance='gain')] * 95
    strict, lax = (fit_stopping_rule([*undisturbed, *strange, *harmless], 0.02, wrong) for wrong in (0.02, 0.05))
    assert strict.decided(0.99, 1.0, 0.1)
    assert not strict.decided(0.99, 1.0, 8.0)
    assert lax.decided(0.99, 1.0, 8.0)


RECIPE = load_recipe('default')
WORD = 'too few slides for early stopping'
ANY_ERROR_RATE = ErrorBound(0, 1.0)  # allows any, so nothing has to be shown


def with_decisions(model, **changes):
    return dataclasses.replace(model, decisions=dataclasses.replace(model.decisions, **changes))


@pytest.fixture
def estimates(estimates_of):
    """Return a function that gives the true surface and the estimates of each slide."""
    return lambda model, examples: [
        (slide.split('/')[0], estimates_of(model, examples.values[examples.groups == slide]))
        for slide in np.unique(examples.groups).tolist()
    ]


@pytest.mark.parametrize('slides', [1, 12, 149, 600])
def test_a_classifier_that_errs_as_often_as_the_bound_passes_so_many_slides_once_in_twenty(slides):
    error_rate = 1.0 - ErrorBound(slides, 0.02).highest_confidence
    assert binom.pmf(0, slides, error_rate) == pytest.approx(0.05)


@pytest.mark.parametrize(('error_rate', 'needed'), [(0.01, 299), (0.02, 149), (0.05, 59), (0.2, 14), (1.0, 0)])
def test_early_stopping_needs_the_slides_that_show_its_error_rate(error_rate, needed):
    assert ErrorBound(needed, error_rate).shown
    assert ErrorBound(needed, error_rate).reason == ''
    assert not needed or not ErrorBound(needed - 1, error_rate).shown


def test_the_reason_names_the_slides_that_are_needed_and_those_that_were_there():
    assert ErrorBound(12, 0.02).reason == (
        'too few slides for early stopping: at most 2 % wrong decisions need 149 slides or more to be held out of the '
        'training; with 12 the confidence is 0.78 at most'
    )
    assert ErrorBound(0, 0.02).reason.endswith('149 slides or more to be held out of the training')
    assert ErrorBound(600, 0.0).reason == 'no early stopping: at most 0 % wrong decisions cannot be shown'


def test_a_limited_confidence_keeps_the_order_of_the_labels_and_the_sum_of_the_probabilities():
    sure = np.array([0.0001, 0.9989, 0.001])
    limited = np.array(ErrorBound(12, 0.02).limited(sure))
    assert limited.max() == pytest.approx(0.05 ** (1 / 12))
    assert limited.sum() == pytest.approx(1.0)
    assert np.argsort(limited).tolist() == np.argsort(sure).tolist()


def test_no_wrong_label_of_a_model_of_three_slides_a_surface_is_certain_or_confident(make_examples, estimates):
    """Its held-out slides are all right, so that the stopping rule alone ends slides at the first windows."""
    model = train(RECIPE, make_examples(slides=3, spread=1.5))
    trusting = with_decisions(model, error_bound=ANY_ERROR_RATE)
    new = make_examples(slides=20, seed=1, spread=1.5)
    wrong = {
        own: [e for surface, course in estimates(own, new) for e in course if e.decided and e.label != surface]
        for own in (model, trusting)
    }
    assert max(estimate.confidence for estimate in wrong[trusting]) > 0.95
    assert wrong[model] == []
    confidences = [estimate.confidence for _, course in estimates(model, new) for estimate in course]
    assert max(confidences) == pytest.approx(0.05 ** (1 / 12))


def test_only_the_final_estimate_says_why_no_slide_of_few_was_certain(make_examples, estimates):
    few = train(RECIPE, make_examples(labels=('cork', 'felt')))
    enough = with_decisions(few, error_bound=ErrorBound(149, RECIPE.training.max_error_rate))
    for model, said in ((few, True), (enough, False)):
        courses = [course for _, course in estimates(model, make_examples(seed=1, slides=2, labels=('cork', 'felt')))]
        assert [WORD in course[-1].message for course in courses] == [said] * 4
        assert not any(WORD in estimate.message for course in courses for estimate in course[:-1])
        assert any(estimate.decided for course in courses for estimate in course) is not said


LENGTHS = np.arange(1.0, 12.0)
STRICT = ConfidenceFloor((1.0,), (36.0,))  # no single window of the fixtures is so certain


def slides_with(confidences, right=True):
    said = np.ones(len(LENGTHS), bool)
    return [
        SlideCourse(np.full(len(LENGTHS), confidence), said & right, LENGTHS, said, np.zeros(len(LENGTHS)))
        for confidence in confidences
    ]


def test_the_given_fraction_of_held_out_slides_lies_below():
    confidences = np.linspace(0.01, 0.99, 99)
    floor = fit_confidence_floor(slides_with(confidences), rate=0.1)
    for length in FLOOR_WINDOWS:
        below = sum(not floor.reached(confidence + 1e-9, length) for confidence in confidences)
        assert below == 9  # the tenth of 100 is the limit itself


def test_too_few_slides_for_the_fraction_give_no_limit():
    assert fit_confidence_floor(slides_with([0.5] * 98), rate=0.01) == ConfidenceFloor()
    assert fit_confidence_floor(slides_with([0.5] * 99), rate=0.01).log_odds == pytest.approx((0.0,) * 6)
    assert fit_confidence_floor(slides_with([0.5] * 98), rate=0.0) == ConfidenceFloor()


def test_the_limit_keeps_all_but_few_wrong_labels_unknown():
    courses = [*slides_with([0.5] * 18), *slides_with([0.9, 0.8], right=False)]
    strict, lax = (fit_confidence_floor(courses, 0.0, most) for most in (0.0, 0.05))
    assert not strict.reached(0.9, effective_windows=3.0)
    assert strict.reached(0.91, effective_windows=3.0)
    assert not lax.reached(0.8, effective_windows=3.0)  # one of twenty may be wrong
    assert lax.reached(0.81, effective_windows=3.0)


def test_the_limit_is_interpolated_and_stays_beyond_its_ends():
    floor = ConfidenceFloor((1.0, 3.0), (0.0, 2.0))
    half = 1.0 / (1.0 + np.exp(-1.0))  # log-odds of 1, half-way
    assert floor.reached(half + 1e-9, 2.0)
    assert not floor.reached(half - 1e-9, 2.0)
    assert floor.reached(0.5, 0.2)
    assert not floor.reached(0.88, 50.0)


def test_a_slide_below_the_limit_is_neither_known_nor_decided_and_keeps_its_label(model, examples, estimates_of):
    values = examples.values[examples.groups == 'felt/0'][:1] * 0.85  # towards the middle of the textures
    assert estimates_of(model, values)[-1].known
    strict = estimates_of(with_decisions(model, confidence_floor=STRICT), values)[-1]
    assert (strict.label, strict.known, strict.decided) == ('felt', False, False)


def test_training_fits_the_limit_that_a_recipe_asks_for(make_examples):
    recipe = load_recipe('default')
    asked = dataclasses.replace(recipe.training, false_rejection_rate=0.1, low_confidence_rejection_rate=0.2)
    many = make_examples(slides=12)
    assert train(dataclasses.replace(recipe, training=asked), many).decisions.confidence_floor.log_odds
    none = dataclasses.replace(asked, low_confidence_rejection_rate=0.0, max_known_error_rate_on_track=1.0)
    assert train(dataclasses.replace(recipe, training=none), many).decisions.confidence_floor == ConfidenceFloor()


SET_WINDOWS = np.array([1.0, 2.0, 4.0])


def slides_of_prediction_sets(rng, count, labels=6):
    truths = rng.integers(labels, size=count)
    scores = rng.normal(size=(count, 3, labels)) + 2.0 * np.eye(labels)[truths][:, None]
    return (
        list(log_softmax(scores * np.sqrt(SET_WINDOWS)[:, None])),
        truths.tolist(),
        [SET_WINDOWS] * count,
    )


@pytest.mark.parametrize('coverage', [0.8, 0.95])
def test_the_true_texture_is_in_the_set_as_often_as_asked(coverage):
    rng = np.random.default_rng(0)
    prediction_sets = fit_prediction_sets(*slides_of_prediction_sets(rng, 2000), coverage)
    posteriors, truths, _ = slides_of_prediction_sets(rng, 2000)
    found = [
        truth in prediction_sets.members(np.exp(posterior[place]), SET_WINDOWS[place])
        for posterior, truth in zip(posteriors, truths, strict=True)
        for place in range(3)
    ]
    assert np.mean(found) == pytest.approx(coverage, abs=0.02)


@pytest.mark.parametrize(('count', 'coverage', 'needed'), [(9, 0.95, 19), (18, 0.95, 19), (3, 0.8, 4)])
def test_with_too_few_slides_for_the_coverage_there_is_no_set_but_a_reason(count, coverage, needed):
    prediction_sets = fit_prediction_sets(*slides_of_prediction_sets(np.random.default_rng(0), count), coverage)
    assert prediction_sets.members(np.array([0.7, 0.0, 0.3]), 1.0) == []
    assert f'a coverage of {100 * coverage:g} % needs {needed} slides' in prediction_sets.reason


def test_the_most_probable_texture_is_always_in_the_set():
    assert PredictionSets(0.9, (1.0,), (0.99,)).members(np.array([0.2, 0.5, 0.3]), 3.0) == [1]


def test_the_scores_of_a_whole_slide_are_those_of_its_windows_one_by_one():
    rng = np.random.default_rng(4)
    classes = np.repeat(np.arange(3), 8)
    values, hidden = rng.standard_normal((14, 5)), rng.standard_normal((14, 7))
    distances = {
        space: ClassDistance.fit(rng.standard_normal((24, count)) + classes[:, None], classes)
        for space, count in ((FEATURES, 5), (HIDDEN, 7), (ONSET, 5))
    }
    evidence = rng.standard_normal((14, 3))
    means = np.cumsum(evidence, axis=0) / np.arange(1, 15)[:, None]
    effective_windows = 1.0 + 0.5 * np.arange(14)
    one_by_one, novelty = [], SlideNovelty(distances, 3)
    for number, length in enumerate(effective_windows.tolist()):
        novelty.add(values[number], hidden[number], int(evidence[number].argmax()), length)
        second, first = np.sort(means[number])[-2:]
        one_by_one.append(novelty.scores(int(means[number].argmax()), first - second))
    whole = slide_scores(distances, values, hidden, evidence, means=means, effective_windows=effective_windows)
    np.testing.assert_allclose(whole, one_by_one, rtol=1e-9)
    detector = NoveltyDetector.fit(distances, [whole] * len(NOVELTY_WINDOWS), 0.1)
    steps = [
        detector.score_and_threshold(*step) for step in zip(whole.tolist(), effective_windows.tolist(), strict=True)
    ]
    np.testing.assert_allclose(np.transpose(detector.scores_and_thresholds(whole, effective_windows)), steps)
