# SPDX-License-Identifier: Apache-2.0
import dataclasses
import hashlib
import json

import numpy as np
import pytest
import skops.io

from texture_core.errors import ModelMismatch
from texture_core.types import SlideMotion
from texture_estimation.model import load_model
from texture_estimation.next_motion import NextTouchModel
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train


@pytest.fixture
def saved(model, tmp_path):
    return model.save(tmp_path / 'surfaces', facts={'accuracy': 0.98})


@pytest.mark.parametrize('ending', ['', '.skops', '.json'])
def test_a_model_predicts_the_same_after_it_was_saved(saved, model, examples, ending):
    loaded = load_model(saved.with_suffix(ending))
    np.testing.assert_array_equal(loaded.predict_log_proba(examples.values), model.predict_log_proba(examples.values))
    assert loaded.card == model.card


def test_the_card_holds_recipe_labels_and_facts(saved):
    card = json.loads(saved.with_suffix('.json').read_text())
    assert card['labels'] == ['cork', 'felt', 'slate', 'wood']
    assert card['recipe']['learner']['mlp']['hidden'] == 192
    assert card['accuracy'] == 0.98


def refused(path, match):
    with pytest.raises(ModelMismatch, match=match) as caught:
        load_model(path)
    assert '\n' not in str(caught.value)


def test_missing_files_are_refused(saved):
    refused(saved.parent / 'none.skops', 'cannot be read')
    saved.unlink()
    refused(saved, 'belongs beside its card')


@pytest.mark.parametrize('keep', [0, 10, 1000])
def test_truncated_files_are_refused(saved, keep):
    content = saved.read_bytes()
    saved.write_bytes(content[:keep])
    refused(saved, 'damaged or of another card')
    saved.write_bytes(content)
    card = saved.with_suffix('.json')
    card.write_text(card.read_text()[:keep])
    refused(saved, 'cannot be read')


@pytest.mark.parametrize('text', ['[]', '{}', '3', '{"format": 99}'])
def test_foreign_cards_are_refused(saved, text):
    saved.with_suffix('.json').write_text(text)
    refused(saved, 'not the card of a model')


def rewrite(saved, content, **changes):
    """Put other parts into the file, with a card that vouches for them."""
    saved.write_bytes(content)
    card = json.loads(saved.with_suffix('.json').read_text())
    card |= {'sha256': hashlib.sha256(content).hexdigest(), **changes}
    saved.with_suffix('.json').write_text(json.dumps(card))


def test_a_file_with_types_no_model_holds_is_refused_before_it_is_built(saved, model):
    rewrite(saved, skops.io.dumps({**model.parameters, 'extra': np.ufunc}))
    refused(saved, 'which no model of this suite holds')


@pytest.mark.parametrize('content', [b'', b'PK\x03\x04', b'not a zip'])
def test_a_file_that_is_no_skops_file_is_refused(saved, content):
    rewrite(saved, content)
    refused(saved, 'train it again')


def test_parts_that_do_not_fit_the_card_are_refused(saved, model):
    content = saved.read_bytes()
    rewrite(saved, content, labels=['cork'])
    refused(saved, 'its card names 1')
    rewrite(saved, content, features=['one'])
    refused(saved, 'train it again')
    rewrite(saved, skops.io.dumps({'svc': 3}))
    refused(saved, 'train it again')


def test_a_model_of_slides_of_several_kinds_knows_them_after_it_was_saved(examples, tmp_path):
    motions = [SlideMotion('linear_slide', 0.0, 0.1, 2.0, 1.0), SlideMotion('linear_slide', 1.5, 0.1, 2.0, 1.0)]
    made = {slide: motions[int(slide[-1]) % 2] for slide in examples.groups.tolist()}
    model = train(load_recipe('default'), dataclasses.replace(examples, motions=made))
    loaded = load_model(model.save(tmp_path / 'choosing'))
    assert list(loaded.next_touch_model.gaussians) == motions
    assert [motion['direction_rad'] for motion in loaded.card['motions']] == [0.0, 1.5]
    slide = examples.values[examples.groups == 'felt/1'].mean(axis=0)
    known = model.next_touch_model
    belief = known.update(known.uniform_log_prior, motions[1], slide)
    np.testing.assert_array_equal(loaded.next_touch_model.update(known.uniform_log_prior, motions[1], slide), belief)
    assert known.textures[belief.argmax()] == 'felt'


@pytest.mark.parametrize('part', ['means', 'projection'])
def test_a_model_whose_motions_are_no_numbers_is_refused(part, model, tmp_path):
    parameters = {
        'textures': ['a', 'b'],
        'motions': [dataclasses.asdict(SlideMotion('linear_slide', 0.0, 0.1, 2.0, 1.0))],
    }
    numbers = {'means': np.zeros((1, 2, 3)), 'projection': np.zeros((len(model.names), 3))}
    whole = NextTouchModel.from_arrays({**parameters, **numbers})
    numbers[part] = numbers[part] * np.nan
    broken = NextTouchModel.from_arrays({**parameters, **numbers})
    assert load_model(dataclasses.replace(model, next_touch_model=whole).save(tmp_path / 'whole')).next_touch_model
    refused(dataclasses.replace(model, next_touch_model=broken).save(tmp_path / 'broken'), 'not finite')


ENTRY = {'slides': 12, 'max_error_rate': 0.02}


def with_entry(saved, entry):
    """Store another entry of the held-out slides in the card; None removes it."""
    path = saved.with_suffix('.json')
    card = {name: value for name, value in json.loads(path.read_text()).items() if name != 'error_bound'}
    path.write_text(json.dumps(card if entry is None else {**card, 'error_bound': entry}))
    return saved


def test_a_model_of_an_earlier_version_without_its_held_out_slides_is_refused(saved):
    refused(
        with_entry(saved, None),
        "no entry 'error_bound'; .* a whole number from 0 to 1000000, and max_error_rate, a number from 0 to 1; "
        "train it again with 'texture train'",
    )


@pytest.mark.parametrize(
    'entry',
    [
        'none',
        {**ENTRY, 'more': 1},
        {'slide': 12, 'max_error_rate': 0.02},
        {**ENTRY, 'slides': -1},
        {**ENTRY, 'slides': 12.5},
        {**ENTRY, 'slides': '12'},
        {**ENTRY, 'slides': True},
        {**ENTRY, 'slides': 10**300},
        {**ENTRY, 'max_error_rate': -0.1},
        {**ENTRY, 'max_error_rate': 1.1},
        {**ENTRY, 'max_error_rate': float('nan')},
        {**ENTRY, 'max_error_rate': '0.02'},
    ],
    ids=lambda entry: repr(entry)[:60],
)
def test_held_out_slides_that_are_no_such_numbers_are_refused_in_one_sentence(saved, entry):
    refused(with_entry(saved, entry), "error_bound.*, a number from 0 to 1; train it again with 'texture train'")


@pytest.mark.parametrize('entry', [None, [], 'any'])
def test_a_model_without_the_conditions_of_its_training_is_refused(saved, entry):
    path = saved.with_suffix('.json')
    path.write_text(json.dumps({**json.loads(path.read_text()), 'domain': entry}))
    refused(saved, "no entry 'domain', the conditions of the training; train it again with 'texture train'")
