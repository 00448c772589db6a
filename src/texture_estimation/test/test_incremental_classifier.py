# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import json

import numpy as np
import pytest

from texture_core.errors import InvalidData, ModelMismatch, TextureError
from texture_core.types import FeatureVector
from texture_estimation.domain import Domain
from texture_estimation.incremental import ChangeRefused, IncrementalClassifier
from texture_estimation.model import load_model
from texture_estimation.recipe import Recipe
from texture_estimation.training import train
from texture_features.feature_set import SlideConditions

TREES = {'sklearn': {'estimator': 'sklearn.ensemble:ExtraTreesClassifier', 'random_state': 0}}


def trained(learner, examples):
    content = {'inputs': {'signal': {'features': ['mean']}}, 'learner': learner}
    return train(Recipe.from_mapping(content, 'other'), examples)


@pytest.fixture
def measured(slide_of):
    """Return a function that lets a classifier observe a slide of these windows."""

    def observe(of, values, identity='e1', **more):
        for vector in slide_of(of.model, values, identity, **more):
            of.observe(vector)

    return observe


@pytest.fixture
def silk():
    """Return windows of a texture that is not trained."""
    rng = np.random.default_rng(7)
    return 4.0 + rng.normal(size=(12, 6))


@pytest.fixture
def stored(model, tmp_path):
    """Return a classifier whose model lies in a file, and the path of that."""
    path = model.save(tmp_path / 'surfaces')
    return IncrementalClassifier(load_model(path), path), path


def test_one_slide_adds_a_texture_and_the_others_stay_known(model, examples, silk, measured):
    classifier = IncrementalClassifier(model)
    measured(classifier, silk)
    assert classifier.add('silk') == 12
    assert classifier.model.labels == (*model.labels, 'silk')
    assert np.mean(np.array(classifier.model.decide(silk + 0.3)) == 'silk') > 0.9
    before, after = (
        np.mean(np.array(one.decide(examples.values)) == examples.labels) for one in (model, classifier.model)
    )
    assert after > before - 0.03
    trained, now = model.predict_log_proba(examples.values), classifier.model.predict_log_proba(examples.values)
    np.testing.assert_allclose(np.diff(now[:, :-1]), np.diff(trained), atol=1e-9)  # which keep their ratios


def test_trees_keep_what_they_were_trained_on_when_a_slide_is_added(make_examples, silk, measured):
    examples = make_examples(slides=12)
    later = make_examples(slides=12, seed=1)
    classifier = IncrementalClassifier(trained(TREES, examples))
    before = classifier.model.decide(later.values)
    measured(classifier, silk)
    classifier.add('silk')
    after = classifier.model.decide(later.values)
    right, kept = (np.mean(np.array(of) == later.labels) for of in (before, after))
    assert kept > right - 0.03


def test_more_examples_of_a_known_texture_add_no_label(model, examples, measured):
    classifier = IncrementalClassifier(model)
    moved = examples.values[examples.labels == 'wood'][:8] + np.array([0, 0, 0, 0, 0, 9.0])
    measured(classifier, moved)
    assert classifier.add(' wood ') == (examples.labels == 'wood').sum() + 8
    assert classifier.model.labels == model.labels
    assert classifier.model.decide(moved) == ['wood'] * 8


def test_what_was_trained_survives_a_restart_and_can_be_undone(model, examples, silk, stored, measured):
    classifier, path = stored
    measured(classifier, silk)
    measured(classifier, examples.values[:8], 'e2')
    classifier.add('silk', 'e1')
    classifier.add('cork')
    again = load_model(path)
    assert again.labels == classifier.model.labels
    np.testing.assert_allclose(
        again.predict_log_proba(examples.values),
        classifier.model.predict_log_proba(examples.values),
        atol=1e-5,
    )
    later = IncrementalClassifier(again, path)
    assert (later.remove_last().exploration_id, later.remove_last().label) == ('e2', 'silk')
    assert later.model.labels == load_model(path).labels == model.labels
    np.testing.assert_array_equal(
        later.model.predict_log_proba(examples.values), model.predict_log_proba(examples.values)
    )
    with pytest.raises(InvalidData, match='no added slides'):
        later.remove_last()


def test_a_model_saved_again_keeps_its_added_slides_but_not_those_of_other_features(model, silk, stored, measured):
    classifier, path = stored
    measured(classifier, silk)
    classifier.add('silk')
    classifier.model.save(path)
    assert load_model(path).labels == (*model.labels, 'silk')
    [added_slide] = (path.parent / 'surfaces.added').iterdir()
    content = json.loads(added_slide.read_text())
    added_slide.write_text(json.dumps({**content, 'feature_set': 'other'}))
    with pytest.raises(ModelMismatch, match='move the folder'):
        load_model(path)
    added_slide.write_text('{')
    with pytest.raises(ModelMismatch, match='add it again'):
        load_model(path)


def test_a_slide_is_added_once_it_has_ended_and_no_earlier_one_in_its_place(model, silk, measured, slide_of):
    classifier = IncrementalClassifier(model)
    measured(classifier, silk, 'first')
    *windows, end = slide_of(model, silk, 'second')
    for vector in windows:
        classifier.observe(vector)
    with pytest.raises(InvalidData, match=r"'second' is still running; wait for its end$"):
        classifier.add('silk')
    classifier.observe(end)
    classifier.add('silk')
    assert [slide.exploration_id for slide in classifier.model.added_slides] == ['second']


def test_what_cannot_be_trained_is_refused_with_a_sentence(model, silk, measured):
    classifier = IncrementalClassifier(model)
    with pytest.raises(InvalidData, match='no exploration was classified with this model; explore first'):
        classifier.add('silk')
    measured(classifier, silk, 'foreign', feature_set='other')
    measured(classifier, np.full((3, 6), np.nan), 'broken')
    for name in ('', 'broken', 'foreign'):
        with pytest.raises(InvalidData, match=f"'{name or 'broken'}' has no usable window: .* Can be added: none"):
            classifier.add('silk', name)
    measured(classifier, silk)
    with pytest.raises(InvalidData, match=r"no exploration 'e9' is among the last 20. Can be added: e1$"):
        classifier.add('silk', 'e9')
    with pytest.raises(InvalidData, match='no label'):
        classifier.add('  ')
    classifier.begin('stopped-early')
    with pytest.raises(
        InvalidData, match=r"'stopped-early' is still running; wait for its end$"
    ):  # it has not slid yet
        classifier.add('silk')
    classifier.end('stopped-early', aborted=False)
    with pytest.raises(InvalidData, match=r"'stopped-early' has no usable window: it ended before its slide .*: e1$"):
        classifier.add('silk')


def test_an_aborted_slide_is_refused_by_name_and_others_can_be_added(model, silk, measured):
    classifier = IncrementalClassifier(model)
    measured(classifier, silk)
    classifier.begin('stopped')
    measured(classifier, silk[:1], 'stopped')
    classifier.end('stopped', aborted=True)
    for name in ('', 'stopped'):
        with pytest.raises(ChangeRefused, match=r"'stopped' was aborted, .*; explore again\. Can be added: e1$"):
            classifier.add('silk', name)
    with pytest.raises(ChangeRefused, match=r'Can be added: e1$'):
        classifier.add('silk', 'e9')
    assert classifier.add('silk', 'e1') == len(silk)


def test_a_example_that_cannot_be_kept_is_not_learnt(model, silk, tmp_path, measured):
    (tmp_path / 'm.added').write_text('in the way')
    classifier = IncrementalClassifier(model, tmp_path / 'm')
    measured(classifier, silk)
    with pytest.raises(OSError):
        classifier.add('silk')
    assert classifier.model.labels == model.labels


def test_the_same_exploration_is_added_once_also_after_a_restart(model, silk, tmp_path, measured):
    path = model.save(tmp_path / 'surfaces')
    for _ in range(2):
        classifier = IncrementalClassifier(load_model(path), path)
        measured(classifier, silk)
        if not classifier.model.added_slides:
            classifier.add('silk')
        for name in ('', 'e1'):
            with pytest.raises(
                InvalidData, match="'e1' was added as 'silk' already; explore again, and add that slide"
            ):
                classifier.add('silk', name)
        assert len(classifier.model.added_slides) == len(load_model(path).added_slides) == 1
    classifier.remove_last()
    assert classifier.add('silk') == 12


def test_an_added_slide_widens_the_domain_until_it_is_removed_also_after_a_restart(model, silk, tmp_path):
    domain = Domain(motions=('linear_slide',), speed_m_s=(0.05, 0.05))
    path = dataclasses.replace(model, acceptance=dataclasses.replace(model.acceptance, domain=domain)).save(
        tmp_path / 'surfaces'
    )
    classifier = IncrementalClassifier(load_model(path), path)
    for row in silk:
        classifier.observe(FeatureVector(0, 'e1', 0.5, 0.1, model.names, row, 0.1, feature_set=model.feature_set))
    classifier.observe(FeatureVector(0, 'e1', 0.0, 0.1, last=True))
    fast = SlideConditions('linear_slide', speed_m_s=0.1)
    assert classifier.model.active_acceptance.domain.deviation(fast)
    classifier.add('silk')
    assert classifier.model.active_acceptance.domain.deviation(fast) == ''
    again = IncrementalClassifier(load_model(path), path)
    assert again.model.active_acceptance.domain.deviation(fast) == ''
    again.remove_last()
    assert again.model.active_acceptance.domain == domain


@pytest.fixture
def three_added(examples, silk, stored, measured):
    """Return a classifier to which silk, oak, more wood and more silk were added in this order, and its path."""
    classifier, path = stored
    for number, (label, values) in enumerate(
        (('silk', silk), ('oak', -silk), ('wood', examples.values[examples.labels == 'wood'][:4]), ('silk', silk + 0.1))
    ):
        measured(classifier, values, f'e{number}')
        classifier.add(label)
    return classifier, path


def test_a_texture_is_removed_by_its_label_with_all_its_slides_live_and_stored(three_added, model, silk, examples):
    classifier, path = three_added
    removed = classifier.remove('silk')
    assert [(slide.label, slide.exploration_id) for slide in removed] == [('silk', 'e0'), ('silk', 'e3')]
    assert classifier.model.labels == load_model(path).labels == (*model.labels, 'oak')
    assert classifier.model.decide(-silk) == ['oak'] * len(silk)
    np.testing.assert_allclose(
        load_model(path).predict_log_proba(examples.values),
        classifier.model.predict_log_proba(examples.values),
        atol=1e-5,
    )


def test_what_is_added_after_a_removal_replaces_no_stored_slide(three_added, model, silk, measured):
    classifier, path = three_added
    classifier.remove('silk')
    measured(classifier, 2 * silk, 'e9')
    classifier.add('cork')
    again = load_model(path)
    assert [slide.exploration_id for slide in again.added_slides] == ['e1', 'e2', 'e9']
    later = IncrementalClassifier(again, path)
    assert [later.remove_last().exploration_id for _ in range(3)] == ['e9', 'e2', 'e1']
    assert load_model(path).labels == model.labels


@pytest.mark.parametrize(
    ('label', 'sentence'),
    [
        ('sillk', r"no added texture 'sillk'; did you mean 'silk'\? Known: oak, silk, wood"),
        ('cloth', "'cloth' is of the training, .* train the model again without it. Can be removed: oak, silk, wood"),
        (' ', 'no label was given; name the texture to remove. Can be removed: oak, silk, wood'),
    ],
)
def test_a_texture_that_was_not_added_is_not_removed(three_added, model, label, sentence):
    classifier, path = three_added
    before = classifier.model
    label = label if label != 'cloth' else next(name for name in model.labels if name != 'wood')
    with pytest.raises(TextureError, match=sentence.replace('cloth', label) if label.strip() else sentence):
        classifier.remove(label)
    assert classifier.model is before
    assert len(load_model(path).added_slides) == 4


def with_slides(measured, model, values, count):
    """Return the model after this many slides with these windows were added as silk."""
    classifier = IncrementalClassifier(model)
    for number in range(count):
        measured(classifier, values, f'e{number}')
        classifier.add('silk', f'e{number}')
    return classifier.model


@pytest.mark.parametrize('count', [1, 2, 5])
def test_an_added_texture_is_reported_but_no_surer_than_its_slides_can_show(model, silk, count, measured, estimates_of):
    trusting = dataclasses.replace(model, acceptance=dataclasses.replace(model.acceptance, slides=600))
    estimates = estimates_of(with_slides(measured, trusting, silk, count), silk + 0.1)
    assert {estimate.label for estimate in estimates} == {'silk'}
    assert not any(estimate.decided for estimate in estimates)
    highest = max(0.05 ** (1 / count), 1.0 / len(estimates[0].probabilities))
    assert max(estimate.confidence for estimate in estimates) <= highest + 1e-9
    reason = 'too few slides for early stopping' if count >= 5 else f"{count} added; to accept 'silk' 5 are needed"
    assert reason in estimates[-1].message


@pytest.mark.filterwarnings('ignore:overflow', 'ignore:invalid value')
def test_an_added_slide_whose_values_overflow_is_refused_with_a_sentence(three_added):
    _, path = three_added
    [first, *_] = sorted((path.parent / 'surfaces.added').iterdir())
    content = json.loads(first.read_text())
    content['values'][0][0] = 1e300
    first.write_text(json.dumps(content))
    sentence = 'values are too large to be features'
    with pytest.raises(ModelMismatch, match=rf'the added slides of model .* cannot be used: its {sentence}; move them'):
        load_model(path)


@pytest.mark.filterwarnings('ignore:overflow', 'ignore:invalid value')
@pytest.mark.parametrize('learner', ['discriminant', TREES])
def test_windows_whose_values_overflow_are_not_added(learner, examples, silk, measured):
    classifier = IncrementalClassifier(trained(learner, examples))
    measured(classifier, 1e300 * silk)
    with pytest.raises(ChangeRefused, match="the slide 'e1' cannot be added: its values are too large to be features"):
        classifier.add('silk')
    assert not classifier.model.added_slides
