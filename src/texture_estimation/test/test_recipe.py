# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from texture_core.config import folder, shipped
from texture_core.errors import TextureError
from texture_core.types import Array
from texture_estimation.evidence_rules import EVIDENCE_RULES
from texture_estimation.recipe import LEARNERS, Recipe, load_recipe
from texture_estimation.roughness import REGRESSORS, load_roughness_recipe
from texture_features.feature_set import FEATURES, InputFeatures
from texture_features.windows import WindowBatch

SHIPPED = sorted(path.stem for path in folder('texture_estimation', 'config/recipes').glob('*.yaml'))
PARTS = {**FEATURES, **LEARNERS, **REGRESSORS, **EVIDENCE_RULES}
INPUTS = {'inputs': {'signal': {'features': ['hjorth']}}}


@pytest.mark.parametrize('name', sorted(PARTS))
def test_a_part_of_a_recipe_shows_in_a_doctest_how_it_is_used(name):
    assert '>>> ' in PARTS[name].__doc__, f'give the docstring of {PARTS[name].__name__} an example, as the others have'


@pytest.mark.parametrize('name', SHIPPED)
def test_shipped_recipes_load_and_are_the_same_when_written_out(name):
    recipe = load_recipe(name)
    assert recipe.description
    assert Recipe.from_mapping(recipe.as_mapping(), name) == recipe


def test_training_windows_have_the_hop_of_the_training():
    recipe = Recipe.from_mapping({**INPUTS, 'training': {'hop_s': 0.4}, 'windows': {'length_s': 0.6}}, 'x')
    assert (recipe.training_windows.length_s, recipe.training_windows.hop_s) == (0.6, 0.4)
    assert recipe.feature_set.windows.hop_s == 0.1


@pytest.mark.parametrize(
    ('more', 'sentence'),
    [
        ({'learnr': 'mlp'}, "did you mean 'learner'"),
        ({'learner': 'mpl'}, "did you mean 'mlp'"),
        ({'learner': {'mlp': {'noise': -1}}}, "parameter 'noise'"),
        ({'learner': ['mlp']}, 'is written'),
        ({'evidence': 'vote'}, 'soft_vote'),
        ({'training': {'hop_s': 'x'}}, 'a number is needed'),
        ({'training': 3}, 'a mapping'),
    ],
)
def test_a_wrong_recipe_gets_one_sentence_that_states_where(more, sentence):
    with pytest.raises(TextureError, match=sentence) as caught:
        Recipe.from_mapping({**INPUTS, **more}, 'mine')
    assert "recipe 'mine'" in str(caught.value)
    assert '\n' not in str(caught.value)


def test_augmentation_is_a_section_of_training_that_only_a_network_takes():
    recipe = load_recipe('default')
    assert recipe.augmentation.copies == 4
    assert Recipe.from_mapping(recipe.as_mapping(), 'default') == recipe
    assert 'augmentation' not in load_recipe('kaboli-svm').as_mapping()['training']
    content = {**INPUTS, 'learner': 'discriminant', 'training': {'augmentation': {'copies': 3}}}
    with pytest.raises(TextureError, match="learner 'discriminant' cannot be trained so; use 'mlp'"):
        Recipe.from_mapping(content, 'mine')
    wrong = {**content, 'learner': 'mlp', 'training': {'augmentation': {'copy': 3}}}
    with pytest.raises(TextureError, match=r"recipe 'mine', training, augmentation: .*'copies'"):
        Recipe.from_mapping(wrong, 'mine')


LOADERS = {'recipes': load_recipe, 'roughness': load_roughness_recipe}
RECIPES = {
    name: load(name).feature_set.inputs
    for kind, load in LOADERS.items()
    for name in sorted(shipped('texture_estimation', f'config/{kind}'))
}
RATE_HZ, SAMPLES = 1000.0, 1000
CHANNELS = ('a', 'b', 'c', 'd')
LEVELS = np.array([1.0, 2.0, 3.0, 4.0])  # multiples that differ from channel to channel, as levels of taxels do


def features_at(item: InputFeatures, level: float) -> list[Array]:
    """Return what each feature of an input gives for the same noise on another level."""
    rng = np.random.default_rng(0)
    windows = [
        WindowBatch(
            rng.normal(size=(SAMPLES, len(CHANNELS))) + level * LEVELS,
            RATE_HZ,
            np.array(0.05),
            np.array(1.0),
            channels=CHANNELS,
            tangential_force_n=np.array(0.3),
        )
        for _ in item.window_names
    ]
    window = windows[0] if len(windows) == 1 else replace(windows[0], joined=tuple(windows[1:]))
    return [np.asarray(feature(window)) for _, feature in item.features]


def sees_level(item: InputFeatures) -> bool:
    """Return whether a feature of an input changes when every channel moves to another level."""
    pairs = zip(features_at(item, 0.5), features_at(item, 50.0), strict=True)
    return not all(np.allclose(low, high, rtol=1e-6, atol=1e-6) for low, high in pairs)


@pytest.mark.parametrize('name', RECIPES)
def test_an_input_states_a_tare_exactly_if_its_features_see_the_level(name: str) -> None:
    assert [bool(item.tare) for item in RECIPES[name]] == [sees_level(item) for item in RECIPES[name]]


def test_features_that_see_the_level_are_found() -> None:
    seen = {name for name, inputs in RECIPES.items() if any(map(sees_level, inputs))}
    assert seen == {'any-speed', 'jamali-amplitude', 'taxels-any-day'}
