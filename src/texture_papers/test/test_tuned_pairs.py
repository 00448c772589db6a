# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""One model in which each pair of textures has separate features and a separate learner."""

import dataclasses
from itertools import combinations

import numpy as np
import pytest

from texture_core.errors import InvalidParameter, ModelMismatch, UnknownName
from texture_estimation.learners.learner import is_tied
from texture_estimation.model import load_model
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.training import train
from texture_papers.roberge import AnnPairs, SvmPairs, TunedPairs
from texture_papers.search import joined_recipe

LABELS = ('cork', 'felt', 'slate', 'wood')
NAMES = ('signal#1/a', 'signal#1/b', 'signal#2/a', 'signal#2/b', 'signal#2/c', 'signal#3/a')
ENTRIES = [
    {
        'pair': ['felt', 'cork'],
        'inputs': ['signal#1'],
        'learner': {'texture_papers.roberge:SvmPairs': {'kernel_scale': 2.0}},
    },
    {
        'pair': ['cork', 'slate'],
        'inputs': ['signal#2', 'signal#3'],
        'learner': {'texture_papers.roberge:AnnPairs': {'hidden': 5}},
    },
    {'pair': ['slate', 'wood'], 'inputs': ['signal#2'], 'learner': {'texture_papers.roberge:AnnPairs': {'hidden': 3}}},
]
COLUMNS = {('cork', 'felt'): [0, 1], ('cork', 'slate'): [2, 3, 4, 5], ('slate', 'wood'): [2, 3, 4]}
LEARNERS = {
    ('cork', 'felt'): SvmPairs(kernel_scale=2.0),
    ('cork', 'slate'): AnnPairs(hidden=5),
    ('slate', 'wood'): AnnPairs(hidden=3),
}


@pytest.fixture
def tuned() -> TunedPairs:
    return TunedPairs.from_recipe({'pairs': ENTRIES}, 'recipe').of_examples(NAMES, LABELS)


@pytest.fixture
def numbers(examples):
    return tuple(np.unique(column, return_inverse=True)[1] for column in (examples.labels, examples.groups))


def test_each_pair_is_decided_by_its_learner_on_its_features_alone(tuned, examples, numbers, make_examples):
    codes, groups = numbers
    fresh = make_examples(seed=3).values
    decisions = tuned.predictor(tuned.fit(examples.values, codes, groups).parameters).decisions(fresh)
    for number, pair in enumerate(combinations(LABELS, 2)):
        rows = np.isin(examples.labels, pair)
        columns = COLUMNS.get(pair, list(range(6)))
        learner = LEARNERS.get(pair, SvmPairs())
        alone = learner.fit(examples.values[rows][:, columns], (examples.labels[rows] == pair[1]) * 1, groups[rows])
        expected = learner.predictor(alone.parameters)(fresh[:, columns]).argmax(axis=1)
        np.testing.assert_array_equal(decisions[:, number] <= 0, expected == 1)


def test_the_pairs_won_decide_and_a_tie_is_unclassified(tuned, examples, numbers):
    predictor = tuned.predictor(tuned.fit(examples.values, *numbers).parameters)
    wins = np.zeros((len(examples.values), 4))
    decisions = predictor.decisions(examples.values)
    for number, (first, second) in enumerate(combinations(range(4), 2)):
        wins[:, first] += decisions[:, number] > 0
        wins[:, second] += decisions[:, number] <= 0
    answers = predictor(examples.values)
    np.testing.assert_array_equal(is_tied(answers), is_tied(wins))
    np.testing.assert_array_equal(answers.argmax(axis=1), wins.argmax(axis=1))


@pytest.fixture
def recipe() -> Recipe:
    section = {'features': ['hjorth']}
    content = {
        'inputs': {f'signal#{number}': section for number in (1, 2, 3)},
        'learner': {'texture_papers.roberge:TunedPairs': {}},
    }
    content['learner']['texture_papers.roberge:TunedPairs']['pairs'] = ENTRIES
    return Recipe.from_mapping(content, 'mine')


def test_a_model_of_pairs_is_stored_and_loads_with_all_its_variables(recipe, examples, tmp_path):
    named = dataclasses.replace(examples, names=NAMES)
    model = train(recipe, named)
    loaded = load_model(model.save(tmp_path / 'm'))
    np.testing.assert_array_equal(loaded.predict_log_proba(named.values), model.predict_log_proba(named.values))
    assert loaded.recipe.as_mapping() == recipe.as_mapping()
    assert '3 of 6 pairs have separate variables' in loaded.training['calibration']
    broken = {**model.parameters, 'n_pairs': 10}
    with pytest.raises(ModelMismatch, match='10 pairs are decided by 6 learners'):
        TunedPairs.predictor(broken)


@pytest.mark.parametrize(
    ('values', 'error', 'sentence'),
    [
        ({'pair': []}, InvalidParameter, "did you mean 'pairs'"),
        ({'learner': 'mlp'}, UnknownName, "no learner of pairs 'mlp'"),
        ({'pairs': [{'pair': ['cork']}]}, InvalidParameter, 'the labels of two textures are needed'),
        ({'pairs': [{'pair': ['a', 'b'], 'input': []}]}, InvalidParameter, "did you mean 'inputs'"),
        ({'pairs': ['cork']}, InvalidParameter, "pair 1: came 'cork'; a mapping with pair and learner is needed"),
        ({'pairs': [{'pair': 'ab'}]}, InvalidParameter, "pair is 'ab'; a list of names is needed"),
        ({'pairs': [{'pair': ['a', 'b']}, {'pair': ['b', 'a']}]}, InvalidParameter, 'is listed twice'),
        ([1], InvalidParameter, 'a mapping with a list of pairs is needed'),
    ],
)
def test_mistakes_in_a_recipe_are_named(values, error, sentence):
    content = {'inputs': {'signal': {'features': ['hjorth']}}, 'learner': {'texture_papers.roberge:TunedPairs': values}}
    with pytest.raises(error, match=sentence):
        Recipe.from_mapping(content, 'mine')


def test_the_recipes_of_pairs_become_one_with_equal_inputs_shared():
    base = load_recipe('ets-linear-svm')
    other = base.as_mapping()
    other['inputs']['signal']['features'][0]['texture_papers.roberge:SpectralPeaks']['peaks'] = 3
    changed = Recipe.from_mapping(other, 'other')
    joined = joined_recipe({('a', 'b'): base, ('a', 'c'): changed, ('b', 'c'): base}, base)
    assert [item.topic for item in joined.feature_set.inputs] == ['signal#1', 'signal#2']
    assert [pair.inputs for pair in joined.learner.pairs] == [('signal#1',), ('signal#2',), ('signal#1',)]
    assert joined.feature_set.windows == base.feature_set.windows
    assert Recipe.from_mapping(joined.as_mapping(), joined.name).as_mapping() == joined.as_mapping()
