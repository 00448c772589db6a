# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_core.types import Window
from texture_features.feature_set import FEATURES, FeatureSet
from texture_features.features.temporal import Stretched, resample
from texture_features.windows import CutWindow, WindowBatch

RATE_HZ = 1000.0
RECIPE = {'inputs': {'signal': {'stretch_to_m_s': 0.1, 'features': ['hjorth', 'friction', 'speed']}}}


def ridges(speed_m_s, pitch_m=2e-3, n_samples=500):
    """Return what ridges give at a speed: a tone of speed / pitch."""
    return np.sin(2 * np.pi * speed_m_s / pitch_m * np.arange(n_samples) / RATE_HZ)[:, None]


@pytest.mark.parametrize('speed_m_s', [0.05, 0.1, 0.137, 0.2])
def test_ridges_give_one_tone_at_any_speed(speed_m_s):
    class Tone:
        per_channel, names = True, ('frequency_hz', 'amplitude')

        def __call__(self, windows):
            spectrum = np.abs(np.fft.rfft(windows.rows * np.hanning(windows.rows.shape[-1]), 8192))
            frequency_hz = spectrum.argmax(axis=-1) * windows.rate_hz / 8192
            return np.stack((frequency_hz, 4.0 * spectrum.max(axis=-1) / windows.rows.shape[-1]), axis=-1)

    frequency_hz, amplitude = Stretched(Tone(), 0.1)(WindowBatch(ridges(speed_m_s), RATE_HZ, np.array(speed_m_s)))[0]
    assert frequency_hz == pytest.approx(50.0, abs=1.0)
    assert amplitude == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize('speed_m_s', [np.nan, 0.0, -0.1])
def test_an_unknown_or_no_speed_leaves_a_window_as_it_is(speed_m_s):
    samples = np.random.default_rng(0).normal(size=(500, 2))
    feature = FEATURES['hjorth']()
    given = WindowBatch(samples, RATE_HZ, np.array(speed_m_s))
    np.testing.assert_array_equal(Stretched(feature, 0.1)(given), feature(WindowBatch(samples, RATE_HZ)))


@pytest.mark.parametrize('length', [50, 333, 499, 500, 501, 1000])
def test_a_line_stays_a_line(length):
    line = 3.0 + 0.5 * np.arange(500.0)[:, None]
    expected = 3.0 + 0.5 * np.arange(length) * 500 / length
    middle = slice(length // 10, length - length // 10)
    np.testing.assert_allclose(resample(line, length)[middle, 0], expected[middle], rtol=0.02)


def test_what_would_lie_above_half_the_rate_is_left_out():
    fast = np.sin(2 * np.pi * 400.0 * np.arange(500) / RATE_HZ)[:, None]
    assert np.abs(resample(fast, 250)[10:-10]).max() < 0.05


def cut(speed_m_s, seed=0):
    window = Window(np.random.default_rng(seed).normal(size=(500, 1)), RATE_HZ, ('c',))
    return CutWindow(seed, 'e', 0.5, 0.1, {'signal': window}, speed_m_s, force_n=2.0, tangential_force_n=1.2)


def test_a_recipe_stretches_an_input_the_same_for_one_window_as_for_many():
    feature_set = FeatureSet.from_mapping(RECIPE)
    events = [cut(speed, seed) for seed, speed in enumerate([0.1, 0.15, np.nan, 0.15, 0.0, 0.2, 0.07])]
    for event, vector in zip(events, feature_set.extract_many(events), strict=True):
        np.testing.assert_array_equal(vector.values, feature_set.extract(event).values)
        # Neither the speed is stretched away nor Coulomb's coefficient changed.
        np.testing.assert_allclose(vector.values[-2:], [0.6, event.speed_m_s])
    plain = FeatureSet.from_mapping({'inputs': {'signal': {'features': RECIPE['inputs']['signal']['features']}}})
    assert plain.extract(events[0]).feature_set != feature_set.extract(events[0]).feature_set
    assert plain.extract(events[0]).names == feature_set.extract(events[0]).names
    np.testing.assert_array_equal(plain.extract(events[0]).values, feature_set.extract(events[0]).values)
