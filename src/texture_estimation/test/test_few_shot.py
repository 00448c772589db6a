# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_estimation.incremental import adapted
from texture_estimation.model import load_model
from texture_estimation.recipe import Recipe
from texture_estimation.training import train
from texture_features.feature_set import LabelledFeatures, SlideConditions

CLASSES = {'cork': (0.0, 0.0), 'felt': (4.0, 0.0), 'oak': (0.0, 4.0)}
LEARNER = {'sklearn': {'estimator': 'sklearn.naive_bayes:GaussianNB'}}
RECIPE = Recipe.from_mapping({'inputs': {'signal': {'features': ['mean']}}, 'learner': LEARNER}, 'tiny')


def slides(shifts, count, seed):
    """Slides of three surfaces in sessions that shift all of them, (dx, dy) by session."""
    rng = np.random.default_rng(seed)
    values, labels, groups, conditions = [], [], [], {}
    for session, shift in shifts.items():
        for label, centre in CLASSES.items():
            for number in range(count):
                name = f'{label}/{session}{number}'
                slide = np.array(centre) + shift + 0.3 * rng.standard_normal(2)
                values += (slide + 0.3 * rng.standard_normal((8, 2))).tolist()
                labels += [label] * 8
                groups += [name] * 8
                conditions[name] = SlideConditions(session=session)
    return LabelledFeatures(
        np.array(values), np.array(labels), np.array(groups), ('a', 'b'), 'a1', 0.5, 0.1, conditions=conditions
    )


def right(model, features):
    return np.mean(np.array(model.decide(features.values)) == features.labels)


TRAINING = slides({'monday': (0.0, 0.0), 'tuesday': (1.5, -1.0), 'friday': (-1.0, 1.5)}, 8, 0)
TODAY = {'today': (3.5, 3.5)}  # cork today lies where felt and oak lay


@pytest.fixture(scope='module')
def model():
    return train(RECIPE, TRAINING)


def test_one_slide_of_each_surface_moves_the_classes_to_today(model):
    tested = slides(TODAY, 10, 1)
    before, after = right(model, tested), right(adapted(model, TRAINING, slides(TODAY, 1, 2)), tested)
    assert before < 0.7
    assert after > 0.95


def test_a_surface_without_a_slide_of_today_moves_with_the_others(model):
    shots = slides(TODAY, 1, 2)
    some = shots.of_slides([name for name in shots.groups.tolist() if not name.startswith('cork')])
    tested = slides(TODAY, 10, 1)
    cork = tested.of_slides([name for name in tested.groups.tolist() if name.startswith('cork')])
    assert right(model, cork) < 0.2
    assert right(adapted(model, TRAINING, some), cork) > 0.9


def test_an_adapted_model_accepts_no_surface_and_is_saved_and_loaded(model, tmp_path):
    today = adapted(model, TRAINING, slides(TODAY, 1, 2))
    assert (today.name, today.acceptance.distance) == (f'{model.name}-today', None)
    assert 'too little training: 0 slides could be held out' in today.acceptance.reason
    today.save(tmp_path / 'one')
    tested = slides(TODAY, 3, 1)
    assert load_model(tmp_path / 'one').decide(tested.values) == today.decide(tested.values)


def test_one_session_or_a_strange_label_is_refused_with_what_to_do(model):
    monday = slides({'monday': (0.0, 0.0)}, 8, 0)
    with pytest.raises(InvalidData, match=r'one session of each surface.*train on several days'):
        adapted(model, monday, slides(TODAY, 1, 2))
    shots = slides(TODAY, 1, 2)
    with pytest.raises(InvalidData, match="'silk' is not a trained surface; label the slides of today with cork, felt"):
        adapted(model, TRAINING, replace(shots, labels=np.where(shots.labels == 'oak', 'silk', shots.labels)))
