import dataclasses

import numpy as np
import pytest

from texture_core.errors import InvalidParameter, TextureError, UnknownName
from texture_core.types import Window
from texture_features.feature_set import FeatureSet
from texture_features.windows import CutWindow, SlideEnd

RECIPE = {
    'windows': {'length_s': 0.5, 'hop_s': 0.25},
    'inputs': {
        'signal': {'features': [{'log_bands': {'bands': 16}}, 'hjorth', 'speed']},
        'signal_static': {'features': ['mean', 'log_variance']},
    },
}


def cut(seed=0, rate_hz=1000.0, channels=('dynamic',)):
    rng = np.random.default_rng(seed)
    windows = {
        'signal': Window(rng.normal(size=(500, len(channels))), rate_hz, channels),
        'signal_static': Window(rng.normal(size=(30, 2)), 60.0, ('t1', 't2')),
    }
    return CutWindow(seed * 1000, 'e1', 0.5, 0.25, windows, speed_m_s=0.1)


def test_values_have_the_names_of_their_origin():
    vector = FeatureSet.from_mapping(RECIPE).extract(cut())
    assert vector.names[0] == 'signal/log_bands/1/dynamic'
    assert vector.names[16:20] == (
        'signal/hjorth/log_activity/dynamic',
        'signal/hjorth/mobility/dynamic',
        'signal/hjorth/complexity/dynamic',
        'signal/speed',
    )
    assert vector.names[-1] == 'signal_static/log_variance/t2'
    assert dict(zip(vector.names, vector.values, strict=True))['signal/speed'] == 0.1
    assert len(set(vector.names)) == len(vector.names)


def test_many_windows_get_the_very_numbers_of_one():
    feature_set = FeatureSet.from_mapping(RECIPE)
    events = (
        [cut(seed) for seed in range(70)] + [SlideEnd(5, 'e1', 0.25)] + [cut(1, 2200.0), cut(2, channels=('a', 'b'))]
    )
    for event, vector in zip(events, feature_set.extract_many(events), strict=True):
        alone = feature_set.extract(event)
        np.testing.assert_array_equal(vector.values, alone.values)
        assert dataclasses.replace(vector, values=np.empty(0), names=()).__dict__.keys() == alone.__dict__.keys()
        assert (vector.feature_set, vector.names, vector.last) == (alone.feature_set, alone.names, alone.last)


def test_the_levels_of_slow_channels_do_not_change_what_vibration_and_taxels_measures():
    window = cut()
    slow = window.windows['signal_static']
    moved = dataclasses.replace(slow, samples=slow.samples + np.array([300.0, -50.0]))
    drifted = dataclasses.replace(window, windows={**window.windows, 'signal_static': moved})
    features = FeatureSet.load('vibration-and-taxels')
    np.testing.assert_allclose(features.extract(drifted).values, features.extract(window).values, rtol=1e-6)


def test_the_end_of_a_slide_is_an_empty_last_vector():
    vector = FeatureSet.from_mapping(RECIPE).extract(SlideEnd(7, 'e1', 0.25, skipped=3))
    assert (vector.last, vector.names, vector.skipped, vector.window_s) == (True, (), 3, 0.0)


def test_the_fingerprint_says_what_the_values_mean():
    feature_set = FeatureSet.from_mapping(RECIPE)
    fingerprint = feature_set.extract(cut()).feature_set
    assert fingerprint.endswith(' signal=1000Hz*1 signal_static=60Hz*2')
    hopped = FeatureSet.from_mapping({**RECIPE, 'windows': {'length_s': 0.5, 'hop_s': 0.1}})
    longer = FeatureSet.from_mapping({**RECIPE, 'windows': {'length_s': 0.6}})
    assert hopped.extract(cut()).feature_set == fingerprint
    assert longer.extract(cut()).feature_set != fingerprint
    assert feature_set.extract(cut(rate_hz=2200.0)).feature_set != fingerprint


def test_a_feature_set_written_out_is_the_same_again():
    feature_set = FeatureSet.from_mapping(RECIPE)
    assert FeatureSet.from_mapping(feature_set.as_mapping()) == feature_set


def test_recipes_are_found_by_name_and_by_path(tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text('inputs: {signal: {features: [hjorth]}}\n')
    assert FeatureSet.load(str(path)).topics == ('signal',)
    card = tmp_path / 'model.json'
    card.write_text('{"recipe": {"inputs": {"other": {"features": ["mean"]}}}}')
    assert FeatureSet.load(str(card)).topics == ('other',)
    assert FeatureSet.load('default').topics == ('signal',)


@pytest.mark.parametrize(
    ('recipe', 'sentence'),
    [
        ({}, 'name one or more'),
        ({'inputs': {'signal': ['hjorth']}}, "list under 'features'"),
        ({'inputs': {'signal': {'features': [], 'rate': 3}}}, "list under 'features'"),
        ({'inputs': {'signal': {'features': ['hjort']}}}, "did you mean 'hjorth'"),
        ({'inputs': {'signal': {'features': [{'hjorth': {'flor': 1}}]}}}, "did you mean 'floor'"),
        ({'inputs': {'signal': {'features': [{'log_bands': {'bands': 1}}]}}}, '2 to 512'),
        ({'inputs': {'signal': {'features': ['hjorth', 'hjorth']}}}, 'twice'),
        ({'inputs': {'signal': {'features': ['hjorth']}}, 'windows': {'length_s': 0}}, 'at least|0.005 to'),
    ],
)
def test_a_wrong_recipe_gets_one_sentence(recipe, sentence):
    with pytest.raises(TextureError, match=sentence) as caught:
        FeatureSet.from_mapping(recipe)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('text', ['a: [', '- 1', '', '!!python/object:os.system {}', '\x00'])
def test_a_file_that_is_no_recipe_gets_one_sentence(tmp_path, text):
    path = tmp_path / 'bad.yaml'
    path.write_text(text)
    with pytest.raises(InvalidParameter, match=r'bad\.yaml') as caught:
        FeatureSet.load(str(path))
    assert '\n' not in str(caught.value)


def test_an_unknown_recipe_is_answered_with_the_nearest():
    with pytest.raises(UnknownName, match="did you mean 'default'"):
        FeatureSet.load('defalt')


def test_one_input_is_described_twice_with_features_of_their_own() -> None:
    recipe = {
        'inputs': {
            'signal': {'features': ['mean_log_bands']},
            'signal#2': {'stretch_to_m_s': 0.1, 'features': ['hjorth', 'speed']},
        }
    }
    features = FeatureSet.from_mapping(recipe)
    assert features.topics == ('signal',)
    assert FeatureSet.from_mapping(features.as_mapping()).as_mapping() == features.as_mapping()
    tone = Window(np.sin(2 * np.pi * 100.0 * np.arange(1000) / 1000.0)[:, None], 1000.0, ('dynamic',))
    vector = features.extract(CutWindow(0, 'slide', 1.0, 1.0, {'signal': tone}, speed_m_s=0.2))
    found = dict(zip(vector.names, vector.values, strict=True))
    assert found['signal#2/speed'] == 0.2
    assert {name.split('/')[1] for name in found if name.startswith('signal#2')} == {'hjorth', 'speed'}


def test_a_further_description_of_an_input_needs_a_name() -> None:
    with pytest.raises(InvalidParameter, match="has a name after '#', as in 'signal#2'"):
        FeatureSet.from_mapping({'inputs': {'signal#': {'features': ['hjorth']}}})
