import dataclasses
from pathlib import Path

import numpy as np
import pytest

from texture_estimation.decisions import ErrorBound
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe
from texture_estimation.training import train
from texture_evaluation.commands.train import summary
from texture_features.examples import LabelledFeatures


@pytest.fixture(scope='module')
def model() -> TextureModel:
    recipe = Recipe.from_mapping(
        {
            'inputs': {'signal': {'features': ['mean']}},
            'learner': {'sklearn': {'estimator': 'sklearn.naive_bayes:GaussianNB'}},
        },
        'tiny',
    )
    labels = np.repeat(['cork', 'felt'], 15)
    slides = np.char.add(labels, np.tile(np.repeat(['/1', '/2', '/3'], 5), 2))
    values = (labels == 'felt')[:, None] + 0.1 * np.random.default_rng(0).standard_normal((30, 1))
    return train(recipe, LabelledFeatures(values, labels, slides, ('mean',), 'a1', 0.5, 0.1))


def test_the_training_says_when_its_slides_are_too_few_to_be_certain(model: TextureModel) -> None:
    lines = summary(model, Path('model.skops'))
    assert lines[0] == "recipe 'tiny' trained on 2 surfaces: cork, felt"
    assert 'too few slides for early stopping: at most 2 % wrong decisions need 149 slides or more' in lines[2]
    assert 'with 6 the confidence is 0.61 at most' in lines[2]


def test_the_training_says_nothing_of_it_where_they_are_enough(model: TextureModel) -> None:
    enough = dataclasses.replace(model, error_bound=ErrorBound(149, 0.02))
    assert not any('certain' in line for line in summary(enough, Path('model.skops')))
