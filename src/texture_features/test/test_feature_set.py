# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from texture_core.errors import InvalidParameter, TextureError
from texture_core.types import FeatureVector, Window
from texture_features.feature_set import FeatureSet, RunningConditions, SlideConditions
from texture_features.windows import CutWindow, SlideEnd

RECIPE = {
    'windows': {'length_s': 0.5, 'hop_s': 0.25},
    'inputs': {
        'signal': {'features': [{'mean_log_bands': {'bands': 16}}, 'hjorth', 'speed']},
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
    assert vector.names[0] == 'signal/mean_log_bands/1/dynamic'
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


def test_the_fingerprint_depends_on_what_the_values_mean():
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
        ({'inputs': {'signal': {'features': [{'log_variance': {'flor': 1}}]}}}, "did you mean 'floor'"),
        ({'inputs': {'signal': {'features': [{'mean_log_bands': {'bands': 1}}]}}}, '2 to 512'),
        ({'inputs': {'signal': {'features': ['hjorth', 'hjorth']}}}, 'twice'),
        ({'inputs': {'signal': {'features': ['hjorth']}}, 'windows': {'length_s': 0}}, 'at least|0.005 to'),
        ({'inputs': {'a': {'tare': 'maybe', 'features': ['hjorth']}}}, 'tare'),
        ({'inputs': {'a+b': {'features': ['hjorth']}}}, "describes one input; list it under 'a'"),
        ({'inputs': {'a+a': {'features': ['difference_correlation']}}}, 'each once'),
        ({'inputs': {'a+': {'features': ['difference_correlation']}}}, 'each once'),
        (
            {'inputs': {'a+b': {'stretch_to_m_s': 0.1, 'features': ['texture_papers.kaboli:Correlation']}}},
            'cannot be stretched',
        ),
        ({'inputs': {'a': {'stretch_to_m_s': -0.1, 'features': ['hjorth']}}}, 'at least 0'),
        ({'inputs': {'a': {'stretch_to': 0.1, 'features': ['hjorth']}}}, "did you mean 'stretch_to_m_s'"),
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


def test_one_input_is_described_twice_with_separate_features() -> None:
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


@pytest.mark.parametrize(
    ('tare', 'tared', 'words'),
    [
        ('', {'signal_static': True}, []),
        ('raw', {'signal_static': False}, []),
        ('tared', {'signal_static': True}, []),
        ('tared', {}, []),  # nothing has come yet
        ('tared', {'signal_static': False}, ['not subtracted', 'subtract_baseline']),
        ('raw', {'signal_static': True}, ['is subtracted', 'subtract_baseline']),
    ],
)
def test_a_signal_that_is_not_as_the_recipe_states_is_reported_and_no_other(tare, tared, words) -> None:
    plain = {'inputs': {'signal_static': {'features': ['mean']}}}
    feature_set = FeatureSet.from_mapping({'inputs': {'signal_static': {'tare': tare, 'features': ['mean']}}})
    faults = feature_set.tare_faults(tared)
    assert len(faults) == bool(words) and all(word in faults[0] for word in words)
    # The statement is kept in the recipe, and changes no feature.
    assert feature_set.as_mapping()['inputs']['signal_static'].get('tare', '') == tare
    layout = ((100.0, ('a', 'b')),)
    assert feature_set.fingerprint(layout) == FeatureSet.from_mapping(plain).fingerprint(layout)


def window(**known: object) -> FeatureVector:
    return FeatureVector(0, 'e', 0.5, 0.1, **known)


def test_conditions_are_means_over_the_windows_that_know_them() -> None:
    running = RunningConditions()
    for speed, force in ((0.02, 1.0), (0.04, math.nan), (0.06, 2.0)):
        running.update(window(speed_m_s=speed, force_n=force, motion='circular', sensor='tsf85/dynamic'))
    found = running.get()
    assert (found.motion, found.sensor) == ('circular', 'tsf85/dynamic')
    assert (found.speed_m_s, found.force_n) == (pytest.approx(0.04), pytest.approx(1.5))
    assert found.speed_range_m_s == (pytest.approx(0.02), pytest.approx(0.04))  # 0.02, 0.03 and 0.04


def test_what_no_window_knows_stays_unknown() -> None:
    running = RunningConditions()
    running.update(window())
    found = running.get()
    assert (found.motion, found.sensor, found.directions_rad) == ('', '', ())
    assert math.isnan(found.speed_m_s)
    assert all(map(math.isnan, found.force_range_n))
    assert SlideConditions().motion == ''


def test_a_long_slide_has_few_directions() -> None:
    running = RunningConditions()
    for number in range(1000):
        running.update(window(direction_rad=math.pi * (number % 2) + 1e-4 * (number % 7)))
    assert running.get().directions_rad == (0.0, 3.14)


def test_the_level_of_a_channel_is_the_geometric_mean_of_the_rms_of_its_windows() -> None:
    names = ('signal/hjorth/mobility/a', 'signal/moments/signal_log_power/a', 'signal/moments/signal_log_power/b')
    running = RunningConditions()
    for rms in (1.0, 4.0):
        log_power = 2.0 * math.log(rms)
        running.update(window(names=names, values=np.array([7.0, log_power, log_power + 2.0 * math.log(10.0)])))
    first, second = running.get().levels
    assert first == (names[1], pytest.approx(2.0), pytest.approx(1.0), pytest.approx(2.0))
    assert second[:2] == (names[2], pytest.approx(20.0))


def test_the_level_at_rest_is_what_the_features_of_a_power_show_there() -> None:
    features = FeatureSet.from_mapping(
        {
            'windows': {'length_s': 1.0},
            'inputs': {
                'signal': {'features': ['hjorth', 'moments']},
                'signal_static': {'features': [{'log_variance': {'floor': 0.1}}, 'log_difference_variance']},
            },
        }
    )
    fast = np.tile([[3.0], [-3.0]], (50, 1))
    fast = np.concatenate([fast, 1000.0 * fast, fast, fast[:7]])  # a stretch in which the arm sets off, a rest of one
    slow = np.stack([np.zeros(10), np.tile([2.0, -2.0], 5)], axis=1)
    rest = {'signal': (fast, 100.0, ('a',)), 'signal_static': (slow, 10.0, ('still', 'b'))}
    assert features.rest_levels(rest) == {
        'signal/moments/signal_log_power/a': pytest.approx(3.0),
        'signal_static/log_variance/still': pytest.approx(math.sqrt(0.1)),
        'signal_static/log_variance/b': pytest.approx(math.sqrt(4.1)),
    }
    assert features.rest_levels({**rest, 'signal': (fast[:9], 100.0, ('a',))}) == {}  # too few samples


@pytest.mark.parametrize(
    ('inputs', 'unknown'),
    [
        ({'signal': ['moments'], 'signal_static': ['log_variance']}, []),
        ({'signal': ['hjorth'], 'signal#2': ['moments'], 'signal_static': ['mean']}, ['signal_static']),
        ({'signal': ['mean_statistics'], 'signal_static': ['load_level']}, ['signal']),
        (
            {'finger0/signal': ['mean'], 'signal_static': ['log_difference_variance']},
            ['finger0/signal', 'signal_static'],
        ),
    ],
)
def test_topics_of_which_no_feature_is_the_power_are_named(inputs, unknown) -> None:
    features = FeatureSet.from_mapping({'inputs': {topic: {'features': names} for topic, names in inputs.items()}})
    assert features.unknown_levels == unknown
    rest = {topic: (np.ones((20, 1)), 10.0, ('a',)) for topic in features.topics}
    assert bool(features.rest_levels(rest)) is not bool(unknown)
