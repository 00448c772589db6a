# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import json

import numpy as np
import pytest

from texture_core.errors import InvalidData, ModelMismatch, UnknownName
from texture_core.types import FeatureVector
from texture_estimation.model import load_model
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness import (
    NO_MODEL,
    NORMAL_90,
    SILENT,
    Grades,
    RoughnessAccumulator,
    RoughnessRecipe,
    hold_out,
    load_roughness_model,
    train_grades,
)
from texture_estimation.training import train
from texture_features.feature_set import LabelledFeatures

FINGERPRINT = 'abcd1234 signal=1000Hz*1'
NAMES = ('signal/signal_energy/f', 'signal/arc_length/f', 'signal/peak_to_median_power/f', 'signal/log_variance/f')
INPUTS = {'inputs': {'signal': {'features': ['hjorth', 'peak_to_median_power', 'log_variance']}}}
SPREAD = 0.4  # of people's opinions, in grades


def recipe(**sections):
    return RoughnessRecipe.from_mapping({**INPUTS, **sections}, 'test')


def graded(seed=0, n_textures=15, windows=12, first=0):
    """Return examples whose first feature is the grade but for people's opinions, and the grades."""
    rng = np.random.default_rng(seed)
    values, labels, grades = [], [], {}
    for number in range(first, first + n_textures):
        measured = 1.0 + 4.0 * rng.uniform()
        grades[f't{number}'] = float(np.clip(measured + SPREAD * rng.normal(), 1.0, 5.0))
        rows = rng.normal(size=(windows, 4)) * [0.2, 0.2, 0.1, 0.1] + [measured, 0.0, 0.5, 8.0]
        values.append(rows)
        labels += [f't{number}'] * windows
    examples = LabelledFeatures(
        np.concatenate(values), np.array(labels), np.array(labels), NAMES, FINGERPRINT, window_s=0.5, hop_s=0.5
    )
    return examples, Grades(grades)


@pytest.fixture(scope='module')
def model():
    return train_grades(recipe(), *graded())


def vector(values=(3.0, 0.0, 0.5, 8.0), sequence=0, identity='e1', **more):
    made = {'feature_set': FINGERPRINT, 'force_n': 2.0, **more}
    return FeatureVector(sequence * 100_000_000, identity, 0.5, 0.1, NAMES, np.array(values), **made)


def last(identity='e1'):
    return FeatureVector(10**9, identity, 0.0, 0.1, last=True)


@pytest.fixture
def never_early(monkeypatch):
    """Let no grade be final before the end of a slide."""
    monkeypatch.setattr('texture_estimation.roughness.MIN_NARROWING_GRADES', 0.0)


@pytest.mark.usefixtures('never_early')
def test_the_grade_of_a_slide_is_that_of_its_windows_with_an_interval(model) -> None:
    evidence = RoughnessAccumulator(model)
    first, *_, before_last = [evidence.update(vector(sequence=k)) for k in range(6)]
    final = evidence.update(last())
    assert final.valid
    assert final.grade == pytest.approx(3.0, abs=0.4)
    assert (final.final, before_last.final, final.windows, final.evidence_s) == (True, False, 6, 1.0)
    assert 0.0 < final.grade_std < first.grade_std


@pytest.mark.usefixtures('never_early')
def test_more_sliding_never_makes_surer_than_people_agree(model) -> None:
    evidence = RoughnessAccumulator(model)
    for number in range(500):
        estimate = evidence.update(vector(sequence=number))
    assert estimate.grade_std > 0.7 * SPREAD


def test_a_grade_is_final_once_more_sliding_gains_little_and_nothing_follows(model) -> None:
    evidence = RoughnessAccumulator(model)
    received = [evidence.update(vector(sequence=5 * k)) for k in range(50)] + [evidence.update(last())]
    estimates = [estimate for estimate in received if estimate]
    assert 3 <= len(estimates) < 50
    assert [estimate.final for estimate in estimates] == [False] * (len(estimates) - 1) + [True]
    assert evidence.update(vector(identity='e2')).windows == 1


@pytest.mark.parametrize(
    ('window', 'sentence'),
    [
        (vector(force_n=0.01), 'no contact: the force is 0.01 N'),
        (vector((3.0, 0.0, 0.5, 2.0)), 'weaker than on the smoothest training surface'),
        (vector((3.0, 0.0, 4.0, 8.0)), 'stick-slip'),
        (vector((np.nan, 0.0, 0.5, 8.0)), "'signal/signal_energy/f' is not finite"),
        (vector((3.0, 0.0, 0.5, np.inf)), "'signal/log_variance/f' is not finite"),
        (vector(feature_set='abcd1234 signal=2000Hz*1'), 'the sampling rate'),
    ],
)
def test_unusable_input_gives_no_grade_and_a_reason(model, window, sentence) -> None:
    evidence = RoughnessAccumulator(model)
    for estimate in (evidence.update(window), evidence.update(last())):
        assert not estimate.valid
        assert np.isnan(estimate.grade)
        assert sentence in estimate.message
    assert estimate.final
    assert evidence.unusable + evidence.refused == 1


def test_a_slide_too_short_and_a_missing_model_are_reported() -> None:
    assert RoughnessAccumulator(None).update(last()).message == NO_MODEL
    model = train_grades(recipe(), *graded())
    assert 'shorter than the 0.5 s of a window' in RoughnessAccumulator(model).update(last()).message


def test_where_no_head_fires_there_is_no_grade() -> None:
    model = train_grades(recipe(regressor={'texture_papers.rispal:Svm5': {'kernel_scale': 0.3}}), *graded())
    evidence = RoughnessAccumulator(model)
    evidence.update(vector((300.0, 0.0, 0.5, 8.0)))
    estimate = evidence.update(last())
    assert (estimate.valid, estimate.message, evidence.silent) == (False, SILENT, 1)


def test_intervals_hold_as_often_as_they_claim_on_textures_never_measured() -> None:
    inside = []
    for seed in range(12):
        model = train_grades(recipe(), *graded(seed))
        examples, grades = graded(1000 + seed, n_textures=25, windows=4)
        found, std = model.grade(examples.values)
        true = np.array([grades.of(label) for label in examples.labels])
        inside.append((np.abs(found - true) <= NORMAL_90 * model.calibration.window_std(std)).mean())
    assert 0.85 <= np.mean(inside) <= 0.97


def test_held_out_textures_are_not_trained_on() -> None:
    class Spy:
        def __init__(self):
            self.training_sets = []

        def fit(self, values, grades, textures):
            self.training_sets.append(set(textures.tolist()))
            return {}

        @staticmethod
        def predictor(parameters):
            return lambda values: (np.full(len(values), 3.0), np.zeros(len(values)))

    spy = Spy()
    textures = np.repeat(np.arange(7), 3)
    hold_out(spy, np.zeros((21, 1)), textures % 5 + 1.0, textures, folds=3)
    assert len(spy.training_sets) == 3
    held = [set(range(7)) - training_sets for training_sets in spy.training_sets]
    assert set().union(*held) == set(range(7))
    assert sum(map(len, held)) == 7


def test_a_saved_model_grades_alike_and_holds_no_code(model, tmp_path) -> None:
    loaded = load_roughness_model(model.save(tmp_path / 'm', {'data': 'x'}))
    values = graded(7)[0].values
    for came, expected in zip(loaded.grade(values), model.grade(values), strict=True):
        np.testing.assert_array_equal(came, expected)
    assert loaded.calibration == model.calibration
    card = json.loads((tmp_path / 'm.json').read_text())
    assert card['training']['held_out_error'] < 1.0
    assert card['grades'].keys() == model.grades.keys()


def test_models_of_the_other_kind_are_reported_separately(model, examples, tmp_path) -> None:
    model.save(tmp_path / 'rough')
    train(load_recipe('default'), examples).save(tmp_path / 'names')
    with pytest.raises(ModelMismatch, match='load it in the roughness_estimator'):
        load_model(tmp_path / 'rough')
    with pytest.raises(ModelMismatch, match='load it in the classifier'):
        load_roughness_model(tmp_path / 'names')


def test_examples_unfit_for_training_get_a_sentence() -> None:
    examples, grades = graded()
    with pytest.raises(UnknownName, match="grade for the texture 't3'"):
        train_grades(recipe(), examples, Grades({k: v for k, v in grades.grades.items() if k != 't3'}))
    values = examples.values.copy()
    values[0, 0] = np.nan
    with pytest.raises(InvalidData, match='1 of 180 windows have no finite value of 1 feature'):
        train_grades(recipe(), dataclasses.replace(examples, values=values), grades)
