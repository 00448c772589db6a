# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_core.types import Rejection
from texture_estimation.recipe import Recipe
from texture_estimation.training import adapted, train
from texture_features.feature_set import LabelledFeatures

CLASSES = {'cork': (0.0, 0.0), 'felt': (4.0, 0.0), 'oak': (0.0, 4.0)}
LEARNER = {'sklearn': {'estimator': 'sklearn.naive_bayes:GaussianNB'}}
RECIPE = Recipe.from_mapping({'inputs': {'signal': {'features': ['mean']}}, 'learner': LEARNER}, 'tiny')


def slides(shift, count, seed, classes=CLASSES):
    """Slides of surfaces that all lie shifted by (dx, dy) on one day."""
    rng = np.random.default_rng(seed)
    values, labels, groups = [], [], []
    for label, centre in classes.items():
        for number in range(count):
            slide = np.array(centre) + shift + 0.3 * rng.standard_normal(2)
            values += (slide + 0.3 * rng.standard_normal((8, 2))).tolist()
            labels += [label] * 8
            groups += [f'{label}/{number}'] * 8
    return LabelledFeatures(np.array(values), np.array(labels), np.array(groups), ('a', 'b'), 'a1', 0.5, 0.1)


TRAINED, TODAY = slides((0.0, 0.0), 20, 0), (3.5, 3.5)  # cork today lies where felt and oak lay


def right(model, features):
    return np.mean(np.array(model.decide(features.values)) == features.labels)


@pytest.mark.parametrize('shown', [('cork', 'felt', 'oak'), ('felt', 'oak')])
def test_one_slide_of_some_surfaces_moves_all_to_today_and_none_is_accepted(shown, estimates_of):
    model, tested = train(RECIPE, TRAINED), slides(TODAY, 10, 1)
    today = adapted(model, TRAINED, slides(TODAY, 1, 2, {name: CLASSES[name] for name in shown}))
    assert right(model, tested) < 0.7
    assert right(today, tested) > 0.9
    assert today.name == 'tiny-today'
    assert estimates_of(today, tested.values[:8])[-1].rejection is Rejection.TOO_LITTLE_TRAINING


def test_a_strange_label_is_refused_with_those_that_are_known():
    with pytest.raises(InvalidData, match="'silk' is not a trained surface; label the slides of today with cork, felt"):
        adapted(train(RECIPE, TRAINED), TRAINED, slides(TODAY, 1, 2, {'silk': (1.0, 1.0)}))
