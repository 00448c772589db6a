# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Acceptance against what is known of the distributions that slides are drawn from, and that no model is without it."""

import dataclasses
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from texture_core.types import Rejection
from texture_estimation.acceptance import (
    LEAST_SLIDES_A_LABEL,
    LEVELS,
    TRIALS,
    Acceptance,
    HeldOutSlide,
    Rates,
    SlideDistance,
    margin_of,
    slides_needed,
)
from texture_estimation.domain import Domain
from texture_estimation.evidence_rules import SoftVote
from texture_estimation.gaussians import ClassDistance
from texture_estimation.learners.learner import log_softmax
from texture_estimation.model import AddedSlide, load_model
from texture_estimation.recipe import DecisionParams, Recipe, load_recipe
from texture_estimation.training import train

LABELS, COUNTS = 6, np.array(LEVELS)
RATES = Rates(max_accepted_wrong=0.03, false_rejection_rate=0.1)
DISTANCE = ClassDistance.fit(np.random.default_rng(0).normal(size=(12, 2)), np.repeat([0, 1], 6))


def held_out(rng, count, *, separation=3.0, offset=0.0, others=3.0):
    """Return slides whose evidence is Gaussian, and whose distance is larger to labels that are not theirs."""
    slides = []
    for truth in rng.integers(LABELS, size=count).tolist():
        scores = rng.normal(size=(len(COUNTS), LABELS)) + separation * np.eye(LABELS)[truth]
        means = log_softmax(scores)
        distances = rng.exponential(size=LABELS) + offset + others * (np.arange(LABELS) != truth)
        without = np.where(np.arange(LABELS) == truth, -np.inf, means)
        scored, unknown = (_margins_and_distances(rows, distances) for rows in (means, without))
        slides.append(HeldOutSlide(truth, means, COUNTS, scored, unknown))
    return slides


def _margins_and_distances(means, distances):
    ordered = np.sort(means, axis=1)
    margins = [margin_of(first, second) for second, first in ordered[:, -2:]]
    return np.stack([margins, distances[means.argmax(axis=1)]], axis=1)


def fitted(near, far=(), rates=RATES):
    return Acceptance(len(near), rates).fitted(near, far, SoftVote(), 1.0, DISTANCE)


def accepted(acceptance, slides, *, unknown=False):
    """Return whether slides are accepted at each length of evidence, (n_slides, n_levels)."""
    rows = [slide.unknown if unknown else slide.scored for slide in slides]
    return np.array([
        [acceptance.assess(*pair, length)[0] is Rejection.NONE for pair, length in zip(row, LEVELS, strict=True)]
        for row in rows
    ])  # fmt: skip


# --------------------
# The limits.


def test_as_few_new_slides_are_accepted_and_wrong_as_the_recipe_allows():
    rng = np.random.default_rng(0)
    confused = {'separation': 1.5, 'others': 0.5}
    found, new = fitted(held_out(rng, 3000, **confused)), held_out(rng, 3000, **confused)
    wrong = accepted(found, new) & ~np.array([slide.right for slide in new])
    unknown = accepted(found, new, unknown=True)
    assert (0.5 * (wrong.mean(axis=0) + unknown.mean(axis=0))).max() < RATES.max_accepted_wrong + 0.01
    assert wrong.mean(axis=0).max() == pytest.approx(0.5 * RATES.max_accepted_wrong, abs=0.01)


def test_as_many_right_labels_are_rejected_as_allowed_where_none_is_confused():
    rng = np.random.default_rng(0)
    found, new = fitted(held_out(rng, 3000, separation=20.0)), held_out(rng, 3000, separation=20.0)
    rejected = 1.0 - accepted(found, new).mean(axis=0)
    assert rejected == pytest.approx(RATES.false_rejection_rate, abs=0.02)


def test_slides_of_left_out_places_take_no_acceptance_away_from_slides_as_near_as_those_of_the_training():
    rng = np.random.default_rng(0)
    near = held_out(rng, 400)
    alone, with_places = fitted(near), fitted(near, held_out(rng, 400, separation=0.5, offset=4.0))
    new = held_out(rng, 200)
    as_near = np.array(
        [
            [pair[1] <= alone.limits(length).novel for pair, length in zip(one.scored, LEVELS, strict=True)]
            for one in new
        ]
    )
    assert not (accepted(alone, new) & ~accepted(with_places, new) & as_near).any()


def test_few_slides_of_left_out_places_are_accepted_and_wrong():
    rng = np.random.default_rng(0)
    found = fitted(held_out(rng, 1000), held_out(rng, 1000, separation=0.5, offset=4.0))
    new = held_out(rng, 1000, separation=0.5, offset=4.0)
    wrong = accepted(found, new) & ~np.array([slide.right for slide in new])
    assert wrong.mean(axis=0).max() < 0.05


def test_more_margin_and_less_distance_never_turn_acceptance_into_rejection():
    rng = np.random.default_rng(0)
    found = fitted(held_out(rng, 500))
    for length in (0.5, 1.2, 4.0, 40.0):
        for margin, distance in rng.exponential(size=(50, 2)):
            if found.assess(margin, distance, length)[0] is Rejection.NONE:
                assert found.assess(2.0 * margin, distance, length)[0] is Rejection.NONE
                assert found.assess(margin, 0.5 * distance, length)[0] is Rejection.NONE


def test_a_rejected_surface_is_novel_if_it_is_far_and_else_ambiguous():
    found = fitted(held_out(np.random.default_rng(0), 500, others=0.5))
    assert found.assess(5.0, 1e6, 3.0)[0] is Rejection.NOVEL
    assert found.assess(0.0, 0.5, 3.0)[0] is Rejection.AMBIGUOUS


def test_limits_are_linear_between_two_lengths_of_evidence_and_stay_beyond_them():
    found = fitted(held_out(np.random.default_rng(0), 500))
    middle = 0.5 * (np.array(found.limits(3.0)) + np.array(found.limits(5.0)))
    finite = np.isfinite(middle)
    assert np.array(found.limits(4.0))[finite] == pytest.approx(middle[finite])
    assert found.limits(0.2) == found.limits(1.0)
    assert found.limits(99.0) == found.limits(10.0)


def test_early_limits_are_as_strict_as_late_ones():
    rng = np.random.default_rng(0)
    found = fitted(held_out(rng, 500), held_out(rng, 500, separation=0.5, offset=4.0))
    limits = [found.limits(length) for length in LEVELS]
    assert all(early.accepted >= late.accepted for early, late in pairwise(limits))
    assert all(early.accepted_far >= late.accepted_far for early, late in pairwise(limits))


def test_slides_end_early_with_as_few_wrong_labels_as_allowed():
    rng = np.random.default_rng(0)
    # The margin alone tells unknown surfaces from known ones: others are hardly further away.
    found, new = fitted(held_out(rng, 2000, others=0.5)), held_out(rng, 2000, others=0.5)

    def ends_wrong(rows, right):
        decided = [found.assess(*pair, length)[1] for pair, length in zip(rows, LEVELS, strict=True)]
        return any(decided) and not right[decided.index(True)]

    known = np.mean([ends_wrong(slide.scored, slide.right) for slide in new])
    unknown = np.mean([ends_wrong(slide.unknown, np.zeros(len(LEVELS))) for slide in new])
    assert known < 1.5 * RATES.max_error_rate
    assert unknown == pytest.approx(TRIALS * RATES.max_error_rate, abs=0.01)
    assert fitted(held_out(rng, 100)).assess(9.0, 0.0, 3.0) == (Rejection.NONE, False)  # 100 cannot show 2 %


@pytest.mark.parametrize('coverage', [0.8, 0.95])
def test_the_true_label_is_in_the_prediction_set_as_often_as_requested(coverage):
    rng = np.random.default_rng(0)
    found = fitted(held_out(rng, 2000, separation=1.5), rates=dataclasses.replace(RATES, coverage=coverage))
    inside = [
        slide.truth in found.members(np.exp(log_softmax(mean * length)), length)
        for slide in held_out(rng, 2000, separation=1.5)
        for mean, length in zip(slide.means, LEVELS, strict=True)
    ]
    assert np.mean(inside) == pytest.approx(coverage, abs=0.02)
    assert found.members(np.array([0.2, 0.5, 0.3]), 3.0)[0] == 1


def test_a_slide_of_the_training_scores_as_it_does_window_by_window():
    rng = np.random.default_rng(4)
    classes = np.repeat(np.arange(3), 8)
    distance = ClassDistance.fit(rng.normal(size=(24, 5)) + classes[:, None], classes)
    values, counts = rng.normal(size=(14, 5)), 1.0 + 0.5 * np.arange(14)
    means = np.cumsum(rng.normal(size=(14, 3)), axis=0) / np.arange(1, 15)[:, None]
    whole, live = HeldOutSlide.follow(1, means, counts, values, distance), SlideDistance(distance)
    for number, length in enumerate(counts.tolist()):
        live.add(values[number], length)
        second, first = np.sort(means[number])[-2:]
        expected = margin_of(first, second), live.to(int(means[number].argmax()))
        assert whole.scored[number] == pytest.approx(expected)


# --------------------
# What a number of slides can show.


@pytest.mark.parametrize('slides', [1, 12, 149, 600])
def test_a_classifier_that_errs_as_often_as_the_bound_passes_this_many_slides_once_in_twenty(slides):
    error_rate = 1.0 - Acceptance(slides).highest_confidence
    assert binom.pmf(0, slides, error_rate) == pytest.approx(0.05)


@pytest.mark.parametrize(('rate', 'needed'), [(0.01, 299), (0.02, 149), (0.05, 59), (0.2, 14), (1.0, 0)])
def test_a_rate_needs_the_slides_that_show_it(rate, needed):
    assert slides_needed(rate) == needed
    assert Acceptance(needed, Rates(max_error_rate=rate)).decided_reason == ''
    assert not needed or Acceptance(needed - 1, Rates(max_error_rate=rate)).decided_reason


def test_a_limited_confidence_keeps_the_order_of_the_labels_and_the_sum_of_the_probabilities():
    sure = np.array([0.0001, 0.9989, 0.001])
    limited = np.array(Acceptance(12).limited(sure))
    assert limited.max() == pytest.approx(0.05 ** (1 / 12))
    assert limited.sum() == pytest.approx(1.0)
    assert np.argsort(limited).tolist() == np.argsort(sure).tolist()


@pytest.mark.parametrize(
    ('slides', 'of_labels', 'sentence'),
    [
        (44, {}, '44 slides could be held out; to accept a label 45 are needed, and 5 of each surface'),
        (60, {'cork': 56, 'felt': 4}, "60 slides could be held out, and 4 of 'felt'"),
        (45, {'cork': 40, 'felt': 5}, ''),
        (0, {'cork': 40, 'felt': 5}, '0 slides could be held out (none in an adaptation to today, and by recipes'),
    ],
)  # fmt: skip
def test_the_reason_names_the_slides_that_there_are_and_those_that_are_needed(slides, of_labels, sentence):
    found = Acceptance(slides, domain=Domain(slides=of_labels)).reason
    assert sentence in found
    assert bool(sentence) == bool(found)


# --------------------
# No model is without it.

INPUTS = {'inputs': {'signal': {'features': ['mean']}}}
GAUSSIAN = {'sklearn': {'estimator': 'sklearn.naive_bayes:GaussianNB'}}
RECIPES = {
    'default': load_recipe('default'),
    'no training block': Recipe.from_mapping({**INPUTS, 'learner': GAUSSIAN}, 'mine'),
    'no false rejection': Recipe.from_mapping(
        {**INPUTS, 'learner': GAUSSIAN, 'training': {'false_rejection_rate': 0.0, 'max_error_rate': 1.0}}, 'mine'
    ),
    'discriminant': Recipe.from_mapping({**INPUTS, 'learner': 'discriminant'}, 'mine'),
    'majority vote': Recipe.from_mapping({**INPUTS, 'learner': GAUSSIAN, 'evidence': 'majority_vote'}, 'mine'),
}


def of_slides(examples, wanted):
    return [(name.split('/')[0], examples.values[examples.groups == name]) for name in wanted]


@pytest.mark.parametrize('recipe', RECIPES.values(), ids=RECIPES)
def test_few_slides_reject_every_surface_and_enough_accept_those_trained_and_hardly_others(
    recipe, make_examples, estimates_of
):
    everything = make_examples(labels=('cork', 'felt', 'wood', 'slate', 'glass', 'paper'), slides=20, features=12)
    trained = everything.take(np.isin(everything.labels, ('cork', 'felt', 'wood', 'slate')))
    number = np.array([int(name.split('/')[1]) for name in trained.groups])
    few, many = (train(recipe, trained.take(number < most)) for most in (3, 14))
    known = of_slides(trained, np.unique(trained.groups[number >= 14]).tolist())
    novel = of_slides(everything, np.unique(everything.groups[np.isin(everything.labels, ('glass', 'paper'))]).tolist())

    ends = [estimates_of(few, values)[-1] for _, values in (*known, *novel)]
    assert {end.rejection for end in ends} == {Rejection.TOO_LITTLE_TRAINING}
    assert all(
        (end.label or recipe.evidence.group) and end.confidence > 0.0 and few.acceptance.reason in end.message
        for end in ends
    )

    ends = [(label, estimates_of(many, values, hop_s=0.5)[-1]) for label, values in known]
    assert np.mean([end.accepted and end.label == label for label, end in ends]) > 0.7
    of_novel = [estimates_of(many, values, hop_s=0.5) for _, values in novel]
    assert np.mean([estimates[-1].accepted for estimates in of_novel]) <= 0.1
    assert np.mean([estimate.accepted for estimates in of_novel for estimate in estimates]) <= 0.2


def test_added_slides_pass_the_same_acceptance_and_fewer_than_needed_none(make_examples, estimates_of):
    labels = ('cork', 'felt', 'wood', 'slate', 'glass', 'paper')
    everything = make_examples(labels=labels, slides=24, features=12)
    trained = everything.take(~np.isin(everything.labels, ('glass', 'paper')))
    number = np.array([int(name.split('/')[1]) for name in trained.groups])
    model = train(load_recipe('default'), trained.take(number < 14))

    def accepted_of(label, added):
        slides = tuple(AddedSlide('glass', f'{n}', everything.values[everything.groups == f'glass/{n}']) for n in added)
        more = model.with_added_slides(slides)
        tested = of_slides(everything, [f'{label}/{n}' for n in range(14, 24)])
        return [estimates_of(more, values, hop_s=0.5)[-1] for _, values in tested]

    few = accepted_of('glass', range(LEAST_SLIDES_A_LABEL - 1))
    assert {end.rejection for end in few if end.label == 'glass'} == {Rejection.TOO_LITTLE_TRAINING}
    assert "too little training: 4 added; to accept 'glass' 5 are needed" in few[-1].message
    enough = accepted_of('glass', range(14))
    assert np.mean([end.accepted and end.label == 'glass' for end in enough]) > 0.5
    assert np.mean([end.accepted for end in accepted_of('paper', range(14))]) <= 0.2
    assert np.mean([end.accepted and end.label == 'cork' for end in accepted_of('cork', range(14))]) > 0.6


def test_code_card_and_page_name_the_same_numbers_of_slides(make_examples, tmp_path):
    needed = math.ceil(slides_needed(DecisionParams().max_accepted_wrong) / TRIALS)
    assert (needed, LEAST_SLIDES_A_LABEL) == (45, 5)
    needed_text = f'to accept a label {needed} are needed, and {LEAST_SLIDES_A_LABEL} of each surface'
    path = train(load_recipe('default'), make_examples(slides=4)).save(tmp_path / 'few')
    assert needed_text in load_model(path).acceptance.reason
    pages = Path(__file__).parents[3] / 'docs'
    documented = f'fewer than {needed} held-out slides, or fewer than {LEAST_SLIDES_A_LABEL} of a surface'
    assert documented in (pages / 'recipes.md').read_text(encoding='utf-8')
    assert needed_text in (pages / 'integrate.md').read_text(encoding='utf-8')
