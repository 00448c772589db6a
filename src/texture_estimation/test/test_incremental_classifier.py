import dataclasses
import json

import numpy as np
import pytest

from texture_core.errors import InvalidData, ModelMismatch
from texture_core.features import FeatureVector
from texture_estimation.incremental.incremental_classifier import EXPLORATIONS, Pupil
from texture_estimation.model import load_model


def felt(pupil, values, exploration_id='e1', feature_set=None, last=True):
    names, kind = pupil.model.names, feature_set or pupil.model.feature_set
    for number, row in enumerate(values):
        pupil.remember(FeatureVector(number * 10**8, exploration_id, 0.5, 0.1, names, row, feature_set=kind))
    if last:
        pupil.remember(FeatureVector(10**9, exploration_id, 0.0, 0.1, last=True))


@pytest.fixture
def silk():
    """Return windows of a texture that the model does not know."""
    rng = np.random.default_rng(7)
    return 4.0 + rng.normal(size=(12, 6))


def test_one_slide_teaches_a_texture_and_the_others_stay_known(model, examples, silk):
    pupil = Pupil(model)
    felt(pupil, silk)
    assert pupil.learn('silk') == 12
    assert pupil.model.labels == (*model.labels, 'silk')
    assert np.mean(np.array(pupil.model.decide(silk + 0.3)) == 'silk') > 0.9
    before, after = (np.mean(np.array(one.decide(examples.values)) == examples.labels) for one in (model, pupil.model))
    assert after > before - 0.03


def test_more_examples_of_a_known_texture_add_no_label(model, examples):
    pupil = Pupil(model)
    moved = examples.values[examples.labels == 'wood'][:8] + np.array([0, 0, 0, 0, 0, 9.0])
    felt(pupil, moved)
    assert pupil.learn(' wood ') == (examples.labels == 'wood').sum() + 8
    assert pupil.model.labels == model.labels
    assert pupil.model.decide(moved) == ['wood'] * 8


def test_what_was_taught_survives_a_restart_and_can_be_undone(model, examples, silk, tmp_path):
    path = model.save(tmp_path / 'surfaces')
    pupil = Pupil(load_model(path), path)
    felt(pupil, silk)
    felt(pupil, examples.values[:8], 'e2')
    pupil.learn('silk', 'e1')
    pupil.learn('cork')
    again = load_model(path)
    assert again.labels == pupil.model.labels
    np.testing.assert_allclose(
        again.predict_log_proba(examples.values), pupil.model.predict_log_proba(examples.values), atol=1e-5
    )
    later = Pupil(again, path)
    assert (later.undo().exploration_id, later.undo().label) == ('e2', 'silk')
    assert later.model.labels == load_model(path).labels == model.labels
    np.testing.assert_array_equal(
        later.model.predict_log_proba(examples.values), model.predict_log_proba(examples.values)
    )
    with pytest.raises(InvalidData, match='taught nothing'):
        later.undo()


def test_a_trained_model_that_was_saved_again_keeps_its_lessons_but_other_features_do_not(model, silk, tmp_path):
    path = model.save(tmp_path / 'm')
    pupil = Pupil(load_model(path), path)
    felt(pupil, silk)
    pupil.learn('silk')
    pupil.model.save(path)
    assert load_model(path).labels == (*model.labels, 'silk')
    [lesson] = (tmp_path / 'm.lessons').iterdir()
    content = json.loads(lesson.read_text())
    lesson.write_text(json.dumps({**content, 'feature_set': 'other'}))
    with pytest.raises(ModelMismatch, match='move the folder'):
        load_model(path)
    lesson.write_text('{')
    with pytest.raises(ModelMismatch, match='teach it again'):
        load_model(path)


def test_what_cannot_be_taught_is_refused_with_a_sentence(model, silk):
    pupil = Pupil(model)
    with pytest.raises(InvalidData, match='explore first'):
        pupil.learn('silk')
    felt(pupil, silk, 'foreign', feature_set='other')
    felt(pupil, np.full((3, 6), np.nan), 'broken')
    with pytest.raises(InvalidData, match='Can be taught: none'):
        pupil.learn('silk')
    felt(pupil, silk)
    with pytest.raises(InvalidData, match=r"exploration 'e9'.* Can be taught: e1"):
        pupil.learn('silk', 'e9')
    with pytest.raises(InvalidData, match='no label'):
        pupil.learn('  ')


def test_a_lesson_that_cannot_be_kept_is_not_learnt(model, silk, tmp_path):
    (tmp_path / 'm.lessons').write_text('in the way')
    pupil = Pupil(model, tmp_path / 'm')
    felt(pupil, silk)
    with pytest.raises(OSError):
        pupil.learn('silk')
    assert pupil.model.labels == model.labels


def test_only_the_latest_explorations_are_remembered(model, silk):
    pupil = Pupil(model)
    for number in range(EXPLORATIONS + 3):
        felt(pupil, silk[:2], f'e{number}')
    with pytest.raises(InvalidData, match="exploration 'e2'"):
        pupil.learn('silk', 'e2')
    assert pupil.learn('silk', 'e3') == 2


def test_a_model_without_examples_cannot_be_taught(model):
    with pytest.raises(ModelMismatch, match='train it again'):
        Pupil(dataclasses.replace(model, examples=None))


@pytest.mark.parametrize('label', ['../../etc/x', 'x' * 10_000, 'two\nlines'])
def test_a_label_that_cannot_be_meant_is_refused_and_nothing_is_learnt(model, silk, tmp_path, label):
    path = model.save(tmp_path / 'surfaces')
    pupil = Pupil(load_model(path), path)
    felt(pupil, silk)
    with pytest.raises(InvalidData, match='label'):
        pupil.learn(label)
    assert load_model(path).labels == model.labels


def test_one_exploration_cannot_stand_under_two_labels(model, silk):
    pupil = Pupil(model)
    felt(pupil, silk)
    pupil.learn('silk')
    with pytest.raises(InvalidData, match="'e1' was added as 'silk'; it cannot be 'satin', too"):
        pupil.learn('satin')
    pupil.undo()
    assert pupil.learn('satin') == 12
