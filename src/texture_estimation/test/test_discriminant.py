# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The shrunken discriminant, and sessions that are held out together."""

from dataclasses import replace

import numpy as np
import pytest

from texture_core.config import folder
from texture_estimation.domain import ONE_PLACE
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.evidence_rules import SoftVote, followed
from texture_estimation.learners.discriminant import Discriminant, ForceDiscriminant, linear_discriminant
from texture_estimation.recipe import Recipe
from texture_estimation.training import held_out_parts, in_places, train
from texture_features.feature_set import LabelledFeatures, SlideConditions

RELEASED = sorted(path.stem for path in folder('texture_estimation', 'config/recipes').glob('*.yaml'))
CONTENT = {
    'windows': {'length_s': 0.5, 'hop_s': 0.25},
    'inputs': {'signal': {'features': ['mean']}},
    'learner': 'discriminant',
    'training': {'false_rejection_rate': 0.05},
}
RECIPE = Recipe.from_mapping(CONTENT, 'lines')


def of_days(examples, days=2):
    """Return examples whose slides come from this many days: 'cork/0' from the first, 'cork/1' from the second."""
    slides = np.unique(examples.groups).tolist()
    made = {slide: SlideConditions(session=f'day {int(slide.rpartition("/")[2]) % days}') for slide in slides}
    return replace(examples, conditions=made)


def test_gaussian_classes_of_known_means_and_variance_get_their_probabilities():
    rng = np.random.default_rng(0)
    codes = np.repeat([0, 1], 4000)
    values = 2.0 * codes[:, None] + rng.standard_normal((8000, 1))
    fitted = Discriminant(shrinkage=0.0).fit(values, codes, np.arange(8000) // 40)
    scores = Discriminant.predictor(fitted.parameters)(np.array([[0.0], [1.0], [2.0]]))
    # log p(1) - log p(0) = 2 x - 2 for means 0 and 2 with variance 1
    assert scores[:, 1] - scores[:, 0] == pytest.approx([-2.0, 0.0, 2.0], abs=0.15)


def test_a_label_without_examples_is_nowhere_the_most_probable_and_changes_no_other():
    rng = np.random.default_rng(1)
    codes = np.repeat([0, 2], 50)
    values = 1.0 * codes[:, None] + rng.standard_normal((100, 3))
    asked = 20.0 * rng.standard_normal((500, 3))
    (two, offsets), (three, lacking) = (
        linear_discriminant(values, y, n, 0.1) for y, n in ((codes // 2, 2), (codes, 3))
    )
    scores = asked @ three + lacking
    assert scores[:, [0, 2]] == pytest.approx(asked @ two + offsets)
    assert (scores.argmax(axis=1) != 1).all()


def day(slide):
    return f'day {int(slide[-1]) % 2}'


@pytest.mark.parametrize(
    ('conditions', 'by_day'),
    [
        ({'session': day}, True),
        ({'session': lambda slide: slide, 'place': day}, True),  # a bag for each slide defines no session
        ({'sensor': day}, True),
        ({'session': lambda slide: slide}, False),
        ({'session': lambda _: 'day 0'}, False),
        ({}, False),
    ],
)
def test_slides_of_one_day_place_or_finger_are_held_out_together_and_else_by_themselves(conditions, by_day, examples):
    slides = np.unique(examples.groups).tolist()
    made = {slide: SlideConditions(**{name: of(slide) for name, of in conditions.items()}) for slide in slides}
    parts = held_out_parts(replace(examples, conditions=made))
    assert parts is None if not by_day else parts.tolist() == [int(slide[-1]) % 2 for slide in slides]


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
    examples = of_days(make_examples(slides=12))
    days = np.array([int(group[-1]) % 2 for group in examples.groups.tolist()])
    shift = 3.0 * np.random.default_rng(3).standard_normal((4, 2, 6))
    codes = np.unique(examples.labels, return_inverse=True)[1]
    shifted = replace(examples, values=examples.values + shift[codes, days])
    separated, together = (train(RECIPE, of) for of in (shifted, replace(shifted, conditions={})))
    assert 'sessions held out in turn, 2 parts' in separated.training['calibration']
    assert separated.training['held_out_window_accuracy'] < together.training['held_out_window_accuracy'] - 0.1


def test_a_model_of_one_place_reports_it_where_it_rejects(make_examples):
    examples = make_examples(slides=8)
    model = train(RECIPE, examples)
    assert model.acceptance.domain.places == 1
    strange = replace(examples, values=examples.values + 50.0)
    evidence = EvidenceAccumulator(model)
    final = [evidence.update(vector) for vector in strange.vectors('cork/0')][-1]
    assert not final.accepted
    assert ONE_PLACE in final.message
    of_two = train(RECIPE, of_days(examples))
    assert of_two.acceptance.domain.places == 2
    assert of_two.acceptance.domain.reach_reason == ''


def test_the_load_is_no_part_of_the_discriminant_and_a_load_never_seen_is_outside(make_examples):
    examples = make_examples(slides=8)
    load = np.log(np.square(300.0) * np.ones((len(examples.values), 1)))
    examples = replace(
        examples, values=np.hstack([examples.values, load]), names=(*examples.names, 'signal_static/load_level')
    )
    vectors = {slide: examples.vectors(slide)[:-1] for slide in np.unique(examples.groups).tolist()}
    surfaces = {slide: slide.split('/')[0] for slide in vectors}
    examples = type(examples).from_vectors([vector for each in vectors.values() for vector in each], surfaces)
    model = train(RECIPE, examples)
    assert not model.parameters['weights'][-1].any()
    light = replace(examples, values=examples.values - np.append(np.zeros(6), np.log(225.0)))  # 300 / 15
    evidence = EvidenceAccumulator(model)
    final = [evidence.update(vector) for vector in light.vectors('cork/0')][-1]
    assert final.label == 'cork'
    assert not final.accepted
    assert 'signal level 20 of signal_static, trained 300' in final.message


def of_forces(rng, slides=8, windows=12):
    """Return windows whose one feature distinguishes cork from felt by its sign, inverted above 2 N."""
    forces = np.tile(np.where(np.arange(windows) < windows // 2, 1.0, 4.0), 2 * slides)
    forces = forces * np.exp(0.02 * rng.standard_normal(len(forces)))
    codes = np.repeat([0, 1], slides * windows)
    sign = np.where(codes == 0, 1.0, -1.0) * np.where(forces > 2.0, -1.0, 1.0)
    values = np.stack([3.0 * sign + rng.standard_normal(len(codes)), forces], axis=1)
    return values, codes, np.arange(len(codes)) // windows


def test_what_turns_with_the_force_is_judged_by_what_was_trained_near_it():
    names, labels = ('signal/mean/pac', 'signal/force'), ('cork', 'felt')
    values, codes, groups = of_forces(np.random.default_rng(0))
    learner = ForceDiscriminant().of_examples(names, labels)
    scores = learner.predictor(learner.fit(values, codes, groups).parameters)(values)
    assert (scores.argmax(axis=1) == codes).mean() > 0.98  # Φ(3) = 0.9987
    alone = Discriminant().fit(values, codes, groups)  # both signs for both labels
    assert (Discriminant.predictor(alone.parameters)(values).argmax(axis=1) == codes).mean() < 0.6


def test_a_window_far_from_all_trained_forces_counts_little():
    values, codes, groups = of_forces(np.random.default_rng(0))
    learner = ForceDiscriminant().of_examples(('signal/mean/pac', 'signal/force'), ('cork', 'felt'))
    predictor = learner.predictor(learner.fit(values, codes, groups).parameters)
    within, above = predictor.trust(np.array([[3.0, 1.0], [3.0, 40.0]]))
    assert within > 0.5
    assert above < 1e-6
    assert np.argmax(predictor(np.array([-3.0, 40.0]))) == np.argmax(predictor(np.array([-3.0, 4.0])))  # the nearest


def force_examples():
    values, codes, groups = of_forces(np.random.default_rng(0))
    return LabelledFeatures(
        values=values,
        labels=np.array(['cork', 'felt'])[codes],
        groups=np.array([f'slide/{number}' for number in groups]),
        names=('signal/mean/pac', 'signal/force'),
        feature_set='abcd1234 signal=1000Hz*1',
        window_s=0.5,
        hop_s=0.25,
    )


def probabilities_after(estimates_of, model, forces):
    values = np.array([[3.0 if force < 2.0 else -3.0, force] for force in forces])
    return [estimate.probabilities[0] for estimate in estimates_of(model, values, hop_s=0.25)[:-1]]


def test_evidence_from_far_outside_the_trained_forces_neither_adds_nor_dilutes(estimates_of):
    examples = force_examples()
    model = train(Recipe.from_mapping({**CONTENT, 'learner': 'force_discriminant'}, 'forces'), examples)
    model = replace(model, tempering_exponent=0.0)  # so that length alone adds nothing
    near = probabilities_after(estimates_of, model, [1.0, 1.0, 1.0])
    further = probabilities_after(estimates_of, model, [1.0, 1.0, 1.0, 40.0, 40.0])
    assert near[-1] > 0.8  # 16 slides show no more than 0.83
    assert further[-1] == pytest.approx(near[-1], abs=1e-6)
    assert probabilities_after(estimates_of, model, [40.0, 40.0, 40.0])[-1] == pytest.approx(0.5, abs=1e-3)


def test_held_out_slides_are_followed_as_the_classifier_follows_them(estimates_of):
    examples = force_examples()
    rule = SoftVote(late_weight=0.25)
    evidence, trusted = np.log([[0.9, 0.1], [0.2, 0.8], [0.6, 0.4]]), np.array([0.25, 0.5, 0.5])
    means, _ = followed(rule, evidence, 0.5, trusted)
    assert means[0] == pytest.approx(0.25 * evidence[0])  # a quarter of a window is trusted
    assert means[1] == pytest.approx(0.5 * (0.25 * evidence[0] + 0.5 * evidence[1]) / 0.75)
    model = train(Recipe.from_mapping({**CONTENT, 'learner': 'force_discriminant'}, 'forces'), examples)
    forces = [1.0, 4.5, 40.0, 1.0]
    values = np.array([[3.0 if force < 2.0 else -3.0, force] for force in forces])
    trusted = model.predictor.trust(values)
    means, effective = followed(model.recipe.evidence, model.predict_log_proba(values), 0.5, trusted)
    expected = np.exp(model.recipe.evidence.log_posterior(means, effective[:, None], model.tempering_exponent))
    found = probabilities_after(estimates_of, model, forces)
    assert found == pytest.approx([model.acceptance.limited(row)[0] for row in expected])


def test_the_force_is_no_part_of_the_discriminants_and_without_it_there_is_one():
    values, codes, groups = of_forces(np.random.default_rng(0))
    fitted = ForceDiscriminant().of_examples(('signal/mean/pac', 'signal/force'), ('cork', 'felt'))
    assert not fitted.fit(values, codes, groups).parameters['weights'][:, 1].any()
    plain = codes[:, None] + np.random.default_rng(1).standard_normal((len(codes), 1))
    blind = ForceDiscriminant(stretch_weight=0.0).of_examples(('signal/mean/pac',), ('cork', 'felt'))
    scores = blind.predictor(blind.fit(plain, codes, groups).parameters)(plain)
    alone = Discriminant().fit(plain, codes, groups)
    assert scores == pytest.approx(Discriminant.predictor(alone.parameters)(plain))


def test_a_difference_between_places_counts_less_the_more_weight_its_covariance_has():
    noise = np.random.default_rng(2).standard_normal((1000, 2))
    codes, stretches = np.repeat([0, 1], 4000), np.tile(np.repeat([0, 1], 2000), 2)
    X = np.tile(np.concatenate([noise, -noise]), (4, 1)) + np.stack(
        [codes, codes + 3.0 * stretches], axis=1
    )  # the second one drifts
    ratios = []
    for weight in (0.0, 10.0):
        layer, _ = linear_discriminant(X, codes, 2, 0.0, stretches=stretches, stretch_weight=weight)
        ratios.append(layer[1, 1] / layer[0, 1])
    # of class means 1 apart, variance 1 and 1 + 2.25 (1 + weight): the ratio of the weights is that of the variances
    assert ratios == pytest.approx([1 / 3.25, 1 / 25.75], rel=0.15)


def test_one_track_is_cut_into_parts_that_are_held_out_as_places(make_examples):
    examples = make_examples(slides=8, windows=12)
    cut = in_places(examples, 3)
    names = np.unique(cut.groups).tolist()
    assert names[:3] == ['cork/0 part 1/3', 'cork/0 part 2/3', 'cork/0 part 3/3']
    # windows of 0.5 s every 0.25 s: the last one of a part reaches into the next
    assert [int((cut.groups == name).sum()) for name in names[:3]] == [3, 3, 4]
    assert held_out_parts(cut).tolist() == [int(name[-3]) - 1 for name in names]
    assert in_places(of_days(examples), 3).groups.tolist() == of_days(examples).groups.tolist()


def test_a_training_over_one_track_stays_one_in_the_card(make_examples):
    examples = make_examples(slides=8, windows=12)
    parts = train(replace(RECIPE, training=replace(RECIPE.training, held_out_places=3)), examples)
    assert parts.acceptance.domain.places == 1
    assert parts.acceptance.domain.slides['cork'] == 8
    assert parts.training['slides'] == parts.acceptance.slides == 32
