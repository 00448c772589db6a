# SPDX-License-Identifier: Apache-2.0
"""The shrunken discriminant, and sessions that are held out together."""

from dataclasses import replace

import numpy as np
import pytest

from texture_core.config import folder
from texture_estimation.decisions import ONE_PLACE
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.learners.discriminant import Discriminant
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.training import held_out_parts, train
from texture_features.examples import SlideConditions

RELEASED = sorted(path.stem for path in folder('texture_estimation', 'config/recipes').glob('*.yaml'))
CONTENT = {
    'windows': {'length_s': 0.5, 'hop_s': 0.25},
    'inputs': {'signal': {'features': ['mean']}},
    'learner': 'discriminant',
    'training': {'false_rejection_rate': 0.05},
}
RECIPE = Recipe.from_mapping(CONTENT, 'lines')


def of_days(examples, days=2):
    """Return examples whose slides come from so many days: 'cork/0' from the first, 'cork/1' from the second."""
    slides = np.unique(examples.groups).tolist()
    made = {slide: SlideConditions(session=f'day {int(slide.rpartition("/")[2]) % days}') for slide in slides}
    return replace(examples, conditions=made)


@pytest.mark.parametrize('name', RELEASED)
def test_a_released_recipe_has_a_novelty_detector_or_calls_nothing_known(name):
    training = load_recipe(name).training
    assert training.false_rejection_rate > 0.0 or not training.known


def test_a_recipe_of_the_mounting_neither_knows_nor_decides_and_says_why(make_examples):
    examples = make_examples(slides=40)
    model = train(replace(RECIPE, training=replace(RECIPE.training, known=False)), examples)
    estimates = [
        estimate
        for slide in ('cork/0', 'felt/3')
        for evidence in [EvidenceAccumulator(model)]
        for estimate in map(evidence.update, examples.vectors(slide))
    ]
    assert {estimate.label for estimate in estimates} == {'cork', 'felt'}
    assert not any(estimate.known or estimate.decided for estimate in estimates)
    assert "recipe 'lines' calls nothing known or decided" in estimates[-1].message


def test_gaussian_classes_of_known_means_and_variance_get_their_probabilities():
    rng = np.random.default_rng(0)
    codes = np.repeat([0, 1], 4000)
    values = 2.0 * codes[:, None] + rng.standard_normal((8000, 1))
    fitted = Discriminant(shrinkage=0.0).fit(values, codes, np.arange(8000) // 40)
    scores = Discriminant.predictor(fitted.parameters)(np.array([[0.0], [1.0], [2.0]]))
    # log p(1) - log p(0) = 2 x - 2 for means 0 and 2 with variance 1
    assert scores[:, 1] - scores[:, 0] == pytest.approx([-2.0, 0.0, 2.0], abs=0.15)


def test_slides_of_one_day_are_held_out_together(examples):
    parts = held_out_parts(of_days(examples))
    slides = np.unique(examples.groups)
    assert [part == int(slide[-1]) % 2 for part, slide in zip(parts.tolist(), slides.tolist(), strict=True)] == [
        True
    ] * len(slides)


def test_without_days_slides_are_held_out_by_themselves(examples):
    assert held_out_parts(examples) is None
    assert held_out_parts(of_days(examples, days=1)) is None
    by_slide = {slide: SlideConditions(session=slide) for slide in np.unique(examples.groups).tolist()}
    assert held_out_parts(replace(examples, conditions=by_slide)) is None


def test_places_are_held_out_in_turn_where_each_slide_has_a_bag_of_its_own(examples):
    slides = np.unique(examples.groups).tolist()
    made = {slide: SlideConditions(session=slide, place=str(int(slide[-1]) % 2)) for slide in slides}
    parts = held_out_parts(replace(examples, conditions=made))
    assert parts.tolist() == [int(slide[-1]) % 2 for slide in slides]


def test_a_label_of_one_day_is_held_out_slide_by_slide(examples):
    made = of_days(examples)
    of_one = {
        slide: SlideConditions(session='day 0') if slide.startswith('felt') else one
        for slide, one in made.conditions.items()
    }
    made = replace(made, conditions=of_one)
    parts, labels = held_out_parts(made), np.array([slide.split('/')[0] for slide in np.unique(made.groups).tolist()])
    assert all(len(set(parts[labels == label].tolist())) == 2 for label in np.unique(labels))


def test_confidence_falls_where_days_differ(make_examples):
    examples = of_days(make_examples(slides=8))
    days = np.array([int(group[-1]) % 2 for group in examples.groups.tolist()])
    shift = 3.0 * np.random.default_rng(3).standard_normal((4, 2, 6))
    codes = np.unique(examples.labels, return_inverse=True)[1]
    shifted = replace(examples, values=examples.values + shift[codes, days])
    apart, together = (train(RECIPE, of) for of in (shifted, replace(shifted, conditions={})))
    assert 'sessions held out in turn, 2 parts' in apart.training['calibration']
    assert apart.training['held_out_window_accuracy'] < together.training['held_out_window_accuracy'] - 0.1


def test_a_model_of_one_place_says_so_where_it_rejects(make_examples):
    examples = make_examples(slides=8)
    model = train(RECIPE, examples)
    assert model.domain.reach['cork'] == {'sessions': 1, 'places': 1, 'fingers': 1}
    strange = replace(examples, values=examples.values + 50.0)
    evidence = EvidenceAccumulator(model)
    final = [evidence.update(vector) for vector in strange.vectors('cork/0')][-1]
    assert not final.known
    assert ONE_PLACE in final.message
    of_two = train(RECIPE, of_days(examples))
    assert of_two.domain.reach['cork'] == {'sessions': 2, 'places': 1, 'fingers': 1}
    assert of_two.domain.reach_reason == ''


def test_the_load_is_no_part_of_the_discriminant_and_a_load_never_seen_is_outside(make_examples):
    examples = make_examples(slides=8)
    load = np.log(np.square(300.0) * np.ones((len(examples.values), 1)))
    examples = replace(
        examples, values=np.hstack([examples.values, load]), names=(*examples.names, 'signal_static/load_level')
    )
    vectors = {slide: examples.vectors(slide)[:-1] for slide in np.unique(examples.groups).tolist()}
    surfaces = {slide: slide.split('/')[0] for slide in vectors}
    examples = type(examples).from_vectors([vector for own in vectors.values() for vector in own], surfaces)
    model = train(RECIPE, examples)
    assert not model.parameters['weights'][-1].any()
    light = replace(examples, values=examples.values - np.append(np.zeros(6), np.log(225.0)))  # 300 / 15
    evidence = EvidenceAccumulator(model)
    final = [evidence.update(vector) for vector in light.vectors('cork/0')][-1]
    assert final.label == 'cork'
    assert not final.known
    assert 'signal level 20 of signal_static, trained 300' in final.message
