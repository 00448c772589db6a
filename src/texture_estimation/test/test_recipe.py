import numpy as np
import pytest

from texture_core.config import folder
from texture_core.errors import InvalidParameter, TextureError
from texture_estimation.recipe import DecisionParams, Recipe, load_recipe
from texture_estimation.roughness import RoughnessRecipe

SHIPPED = sorted(path.stem for path in folder('texture_estimation', 'config/recipes').glob('*.yaml'))
INPUTS = {'inputs': {'signal': {'features': ['hjorth']}}}


@pytest.mark.parametrize('name', SHIPPED)
def test_shipped_recipes_load_and_are_the_same_when_written_out(name):
    recipe = load_recipe(name)
    assert recipe.description
    assert Recipe.from_mapping(recipe.as_mapping(), name) == recipe


def test_the_default_recipe_needs_one_input_only():
    assert load_recipe('default').feature_set.topics == ('signal',)


def test_training_windows_have_the_hop_of_the_training():
    recipe = Recipe.from_mapping({**INPUTS, 'training': {'hop_s': 0.4}, 'windows': {'length_s': 0.6}}, 'x')
    assert (recipe.training_windows.length_s, recipe.training_windows.hop_s) == (0.6, 0.4)
    assert recipe.feature_set.windows.hop_s == 0.1


@pytest.mark.parametrize(
    ('more', 'sentence'),
    [
        ({'learnr': 'svm_rbf'}, "did you mean 'learner'"),
        ({'learner': 'svm_rb'}, "did you mean 'svm_rbf'"),
        ({'learner': {'svm_rbf': {'c': -1}}}, "parameter 'c'"),
        ({'learner': ['svm_rbf']}, 'is written'),
        ({'evidence': 'vote'}, 'soft_vote'),
        ({'training': {'hop_s': 'x'}}, 'a number is needed'),
        ({'training': 3}, 'a mapping'),
    ],
)
def test_a_wrong_recipe_gets_one_sentence_that_says_where(more, sentence):
    with pytest.raises(TextureError, match=sentence) as caught:
        Recipe.from_mapping({**INPUTS, **more}, 'mine')
    assert "recipe 'mine'" in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('scores', 'sentence'), [(['features', 'onsets'], 'novelty_scores'), (['hidden'], "add 'features'")]
)
def test_a_novelty_score_that_does_not_exist_or_no_distance_of_features_is_refused(scores, sentence):
    with pytest.raises(InvalidParameter, match=sentence):
        Recipe.from_mapping({**INPUTS, 'training': {'novelty_scores': scores}}, 'mine')


def test_what_rules_decisions_about_textures_is_no_parameter_of_a_roughness_recipe():
    assert RoughnessRecipe.from_mapping({**INPUTS, 'training': {'folds': 5}}, 'mine').training.folds == 5
    with pytest.raises(InvalidParameter, match='false_rejection_rate'):
        RoughnessRecipe.from_mapping({**INPUTS, 'training': {'false_rejection_rate': 0.1}}, 'mine')


def test_augmentation_is_a_section_of_training_that_only_a_network_takes():
    recipe = load_recipe('default')
    assert recipe.augmentation.copies == 8
    assert Recipe.from_mapping(recipe.as_mapping(), 'default') == recipe
    assert 'augmentation' not in load_recipe('kaboli-svm').as_mapping()['training']
    content = {'inputs': {'signal': {'features': ['hjorth']}}, 'training': {'augmentation': {'copies': 3}}}
    with pytest.raises(TextureError, match="learner 'svm_rbf' cannot be trained so; use 'mlp'"):
        Recipe.from_mapping(content, 'mine')
    wrong = {**content, 'learner': 'mlp', 'training': {'augmentation': {'copy': 3}}}
    with pytest.raises(TextureError, match=r"recipe 'mine', training, augmentation: .*'copies'"):
        Recipe.from_mapping(wrong, 'mine')


def test_distances_of_training_windows_lie_between_those_of_both_speeds():
    training = DecisionParams(slowest_m_s=0.02, fastest_m_s=0.32)
    np.testing.assert_allclose(training.distances_m(0.5), [0.01, 0.02, 0.04, 0.08, 0.16])
    assert DecisionParams().distances_m(0.5) == ()
    for wrong in ({'slowest_m_s': 0.1}, {'fastest_m_s': 0.1}, {'slowest_m_s': 0.2, 'fastest_m_s': 0.1}):
        with pytest.raises(InvalidParameter, match='give both, the lower speed first, or neither'):
            DecisionParams(**wrong)
