# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import dataclasses

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_core.types import FeatureVector
from texture_estimation.learners.learner import assign_folds
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train
from texture_features.augmentation import Augmentation
from texture_features.feature_set import AugmentedFeatures, FeatureCopies, LabelledFeatures

RECIPE = load_recipe('default')
ANY_SPEED = load_recipe('any-speed')


def accuracy(model, examples):
    best = model.predict_log_proba(examples.values).argmax(axis=1)
    return (np.array(model.labels)[best] == examples.labels).mean()


def test_the_same_examples_make_the_same_model(model, examples):
    again = train(RECIPE, examples)
    np.testing.assert_array_equal(again.predict_log_proba(examples.values), model.predict_log_proba(examples.values))
    assert again.tempering_exponent == model.tempering_exponent


def test_confidence_is_not_far_from_how_often_it_is_right(make_examples):
    model = train(RECIPE, make_examples(spread=2.5, slides=10))
    fresh = make_examples(seed=3, spread=2.5, slides=10)
    confidence = np.exp(model.predict_log_proba(fresh.values)).max(axis=1).mean()
    assert confidence == pytest.approx(accuracy(model, fresh), abs=0.08)


@pytest.mark.parametrize(
    ('slides', 'windows', 'note'), [(1, 8, 'single slide'), (1, 1, 'single window'), (2, 1, 'slides')]
)
def test_few_examples_make_a_model_whose_card_states_how_it_is_calibrated(make_examples, slides, windows, note):
    examples = make_examples(slides=slides, windows=windows)
    model = train(RECIPE, examples)
    assert note in model.training['calibration']
    assert np.isfinite(model.predict_log_proba(examples.values)).all()


def test_examples_unfit_for_training_get_a_sentence(examples):
    with pytest.raises(InvalidData, match='no windows for training'):
        train(RECIPE, examples.take(slice(0, 0)))
    with pytest.raises(InvalidData, match="all windows are of 'cork'"):
        train(RECIPE, examples.take(examples.labels == 'cork'))
    values = examples.values.copy()
    values[3, 1] = np.nan
    with pytest.raises(InvalidData, match="1 of 384 windows have no finite value of 1 feature, the first 'signal/f1'"):
        train(RECIPE, dataclasses.replace(examples, values=values))
    with pytest.raises(InvalidData, match='shape'):
        dataclasses.replace(examples, names=('a',))


def test_vectors_are_gathered_with_their_surfaces():
    vectors = [
        FeatureVector(k, f'e{k // 2}', 0.5, 0.1, ('a',), np.array([float(k)]), feature_set='x') for k in range(6)
    ] + [FeatureVector(9, 'e0', 0.0, 0.1, last=True)]
    examples = LabelledFeatures.from_vectors(vectors, {'e0': 'cork', 'e2': 'felt', 'e1': ''})
    assert examples.labels.tolist() == ['cork', 'cork', 'felt', 'felt']
    assert examples.groups.tolist() == ['e0', 'e0', 'e2', 'e2']
    assert examples.values.tolist() == [[0.0], [1.0], [4.0], [5.0]]
    with pytest.raises(InvalidData, match='no window of a labelled surface'):
        LabelledFeatures.from_vectors(vectors, {})


def augmented(examples, response, copies=2, shift=0.0):
    """Return the examples with copies of their windows, changed by a shift."""
    groups = np.tile(examples.groups, copies)
    numbers = np.repeat(np.arange(copies), len(examples.groups))
    values = np.tile(examples.values, (copies, 1)) + shift
    nothing = FeatureCopies(values[:0].astype(np.float32), groups[:0], numbers[:0], groups[:0])
    kinds = np.zeros(len(groups), dtype='<U1')
    made = FeatureCopies(values.astype(np.float32), groups, numbers, kinds)
    responses = dict.fromkeys(examples.groups.tolist(), response)
    return dataclasses.replace(examples, augmented=AugmentedFeatures(made, nothing, responses))


def test_a_classifier_trained_with_gains_recognises_what_is_amplified(make_examples):
    examples = make_examples(slides=6, features=6)
    response = np.array([2.0, 2.0, 2.0, 0.0, 0.0, 0.0])
    plain = dataclasses.replace(load_recipe('default'), augmentation=Augmentation())
    params = Augmentation(copies=2, gain_range=5.0, slide_jitter=0.0)
    trained = {
        name: train(dataclasses.replace(plain, augmentation=params_of_model), augmented(examples, response))
        for name, params_of_model in {'plain': Augmentation(), 'augmented': params}.items()
    }
    louder = make_examples(slides=6, features=6, seed=9)
    values = louder.values + np.log(4.0) * response
    right = {name: np.mean(np.array(model.decide(values)) == louder.labels) for name, model in trained.items()}
    assert right['augmented'] > right['plain'] + 0.1


def test_windows_of_other_lengths_train_the_learner_and_decide_nothing_else(make_examples):
    examples, shorter = make_examples(), make_examples(seed=1, labels=('cork', 'felt', 'wood', 'slate'), windows=3)
    moved = dataclasses.replace(shorter, values=shorter.values + 10.0)
    both = dataclasses.replace(examples, resized=moved)
    alone, wider = train(ANY_SPEED, examples), train(ANY_SPEED, both)
    assert accuracy(wider, moved) > 0.9 > accuracy(alone, moved)
    recipe = dataclasses.replace(RECIPE, augmentation=Augmentation(copies=2))
    alone, wider = (train(recipe, augmented(of, np.zeros(6))) for of in (examples, both))
    assert accuracy(wider, moved) > 0.9 > accuracy(alone, moved)
    assert wider.training['windows'] == alone.training['windows'] == len(examples.labels)
    kept = dataclasses.replace(both.of_slides(sorted(set(examples.groups) - {'cork/0'})))
    assert train(ANY_SPEED, kept).training['slides'] == 15  # those of the omitted slide are also omitted


def test_no_slide_is_on_both_sides_and_parts_are_stretches_of_time():
    codes = np.repeat([0, 1], 30)
    groups = np.repeat(np.arange(20), 3)
    parameters, note = assign_folds(codes, groups, 5)
    for group in range(20):
        assert len(set(parameters[groups == group])) == 1
    for code in (0, 1):
        assert (np.diff(parameters[codes == code]) >= 0).all()
        assert set(parameters[codes == code]) == set(range(5))
    assert 'slides' in note


def test_every_label_is_always_trained_on():
    codes = np.repeat([0, 1], [4, 30])
    groups = np.concatenate([[0, 0, 1, 1], np.repeat(np.arange(2, 12), 3)])
    parameters, _ = assign_folds(codes, groups, 5)
    for part in range(5):
        assert set(codes[parameters != part]) == {0, 1}
