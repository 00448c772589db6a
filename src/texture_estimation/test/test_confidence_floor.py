import dataclasses
import json

import numpy as np
import pytest

from texture_core.errors import InvalidData, ModelMismatch
from texture_core.types import FeatureVector
from texture_estimation.decisions import FLOOR_WINDOWS as EFFECTIVE_WINDOWS
from texture_estimation.decisions import ConfidenceFloor, fit_confidence_floor
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.model import load_model
from texture_estimation.model_files import AddedSlide
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train

LENGTHS = np.arange(1.0, 12.0)
STRICT = ConfidenceFloor((1.0,), (36.0,))  # no single window of the fixtures is so certain


def slides_with(confidences):
    return [np.full(len(LENGTHS), confidence) for confidence in confidences], [LENGTHS] * len(confidences)


def test_the_given_fraction_of_held_out_slides_lies_below():
    confidences = np.linspace(0.01, 0.99, 99)
    floor = fit_confidence_floor(*slides_with(confidences), rate=0.1)
    for length in EFFECTIVE_WINDOWS:
        below = sum(not floor.reached(confidence + 1e-9, length) for confidence in confidences)
        assert below == 9  # the tenth of 100 is the limit itself


def test_too_few_slides_for_the_fraction_give_no_limit():
    assert fit_confidence_floor(*slides_with([0.5] * 98), rate=0.01) == ConfidenceFloor()
    assert fit_confidence_floor(*slides_with([0.5] * 99), rate=0.01).log_odds == pytest.approx((0.0,) * 6)
    assert fit_confidence_floor(*slides_with([0.5] * 98), rate=0.0) == ConfidenceFloor()


def test_slides_that_are_all_certain_give_a_finite_limit():
    floor = fit_confidence_floor(*slides_with([1.0] * 99), rate=0.1)
    assert np.isfinite(floor.log_odds).all()
    assert floor.reached(1.0, 10.0)
    assert not floor.reached(0.999, 10.0)


def test_the_limit_is_interpolated_and_stays_beyond_its_ends():
    floor = ConfidenceFloor((1.0, 3.0), (0.0, 2.0))
    half = 1.0 / (1.0 + np.exp(-1.0))  # log-odds of 1, half-way
    assert floor.reached(half + 1e-9, 2.0)
    assert not floor.reached(half - 1e-9, 2.0)
    assert floor.reached(0.5, 0.2)
    assert not floor.reached(0.88, 50.0)


@pytest.mark.parametrize(
    ('counts', 'log_odds'), [((1.0,), ()), ((2.0, 1.0), (0.0, 0.0)), ((1.0,), (np.nan,)), ((np.inf,), (0.0,))]
)
def test_a_limit_that_cannot_be_used_is_refused(counts, log_odds):
    with pytest.raises(InvalidData, match='confidence_floor has'):
        ConfidenceFloor(counts, log_odds)


def after_one_window(model, examples, slide='felt/0'):
    evidence = EvidenceAccumulator(model)
    values = examples.values[examples.groups == slide][0]
    evidence.update(FeatureVector(0, 'e1', 0.5, 0.1, examples.names, values, feature_set=examples.feature_set))
    return evidence.update(FeatureVector(10**9, 'e1', 0.0, 0.1, last=True))


def test_a_slide_below_the_limit_is_neither_known_nor_decided_and_keeps_its_label(model, examples):
    assert after_one_window(model, examples).known
    strict = after_one_window(dataclasses.replace(model, confidence_floor=STRICT), examples)
    assert (strict.label, strict.known, strict.decided) == ('felt', False, False)


def test_added_slides_end_the_limit_as_their_labels_make_others_less_probable(model, examples):
    added = AddedSlide('silk', 'silk-1', examples.values[examples.groups == 'felt/0'] + 9.0)
    strict = dataclasses.replace(model, confidence_floor=STRICT).with_added_slides((added,))
    assert strict.active_confidence_floor == ConfidenceFloor()


def test_training_fits_the_limit_that_a_recipe_asks_for(make_examples):
    recipe = load_recipe('default')
    asked = dataclasses.replace(recipe.training, false_rejection_rate=0.1, low_confidence_rejection_rate=0.2)
    many = make_examples(slides=12)
    assert train(dataclasses.replace(recipe, training=asked), many).confidence_floor.log_odds
    none = dataclasses.replace(asked, low_confidence_rejection_rate=0.0)
    assert train(dataclasses.replace(recipe, training=none), many).confidence_floor == ConfidenceFloor()


def test_a_model_file_keeps_the_limit_and_a_card_without_the_entry_is_refused(model, tmp_path):
    limited = dataclasses.replace(model, confidence_floor=ConfidenceFloor((1.0, 10.0), (0.5, 3.0)))
    path = limited.save(tmp_path / 'model').with_suffix('.json')
    assert load_model(path).confidence_floor == limited.confidence_floor
    card = json.loads(path.read_text())
    del card['confidence_floor']
    path.write_text(json.dumps(card))
    with pytest.raises(ModelMismatch, match=r"no entry 'confidence_floor'.*; train it again with 'texture train'"):
        load_model(path)


@pytest.mark.parametrize('entry', [{'log_odds': [1.0]}, {'other': [1.0]}, [1.0], {'log_odds': 3}])
def test_a_card_with_a_damaged_limit_is_refused(model, tmp_path, entry):
    path = model.save(tmp_path / 'model').with_suffix('.json')
    path.write_text(json.dumps({**json.loads(path.read_text()), 'confidence_floor': entry}))
    with pytest.raises(ModelMismatch, match="train it again with 'texture train'"):
        load_model(path)
