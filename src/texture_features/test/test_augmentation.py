# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Augmented copies against analytical results."""

import dataclasses
import math

import numpy as np
import pytest

from texture_core.types import ExplorationState, Phase, TactileSignal
from texture_features.augmentation import (
    KINDS,
    NOISE,
    Augmentation,
    Augmenter,
    SlideWindows,
    add_drift,
    amplify,
    at_speed,
    clip,
    hold_lost,
    low_pass,
    smooth_response,
)
from texture_features.feature_set import FeatureSet
from texture_features.windows import cut_recording

RATE_HZ, TONE_HZ = 2000.0, 100.0
FEATURES = FeatureSet.from_mapping(
    {
        'windows': {'length_s': 0.5, 'hop_s': 0.25},
        'inputs': {'signal': {'features': [{'mean_log_bands': {'bands': 8}}, 'moments', 'power_autocorrelation']}},
    }
)


def slide(slide_s=3.0, tone_hz=TONE_HZ):
    """Return the signals and states of a slide with a tone and some noise."""
    rng = np.random.default_rng(5)
    time_s = np.arange(round(slide_s * RATE_HZ)) / RATE_HZ
    samples = (np.sin(2 * np.pi * tone_hz * time_s) + 0.1 * rng.standard_normal(len(time_s)))[:, None]
    state = ExplorationState(0, 'e', 'linear_slide', Phase.SLIDE, steady_s=slide_s, surface='cork')
    return {'signal': [TactileSignal(0, 'x', ('x',), (), RATE_HZ, 0, samples.astype(np.float32))]}, [state]


def cut():
    """Return the windows of the slide and its end."""
    return list(cut_recording(*slide(), FEATURES.windows))


def augmented(**params):
    augmenter = Augmenter(FEATURES, Augmentation(**{'copies': 2, **params}))
    for name in ('cork/1', 'cork/2'):
        augmenter.add(name, cut(), *slide())
    return augmenter.result()


def one_input(samples, vibration=True):
    return SlideWindows(samples, RATE_HZ, np.arange(len(samples)) * 0.25, vibration)


def test_the_gain_response_of_a_log_power_is_two_and_that_of_a_shape_is_none() -> None:
    [vector] = FEATURES.extract_many(cut()[:1])
    of_slides = augmented().gain_response(np.array(['cork/1', 'cork/2']))
    response = dict(zip(vector.names, of_slides, strict=True))
    bands = [value for name, value in response.items() if 'mean_log_bands' in name]
    assert bands == pytest.approx([2.0] * 8, abs=1e-6)
    rhythm = [value for name, value in response.items() if 'power_autocorrelation' in name]
    assert rhythm == pytest.approx([0.0] * len(rhythm), abs=1e-6)


def test_the_gain_response_is_that_of_the_slides_that_train_alone() -> None:
    found = dataclasses.replace(
        augmented(), gain_responses={'a': np.array([1.0]), 'tested': np.array([9.0]), 'b': np.array([2.0])}
    )
    assert found.gain_response(np.array(['b', 'a'])) == pytest.approx([1.5])


def test_a_copy_at_twice_the_speed_has_twice_the_frequency() -> None:
    time_s = np.arange(2400) / RATE_HZ
    windows = one_input(np.sin(2 * np.pi * TONE_HZ * time_s)[None, :, None])
    faster = at_speed(windows, 2.0, 1000)[0, :, 0]
    assert faster.shape == (1000,)
    assert np.abs(np.fft.rfft(faster)).argmax() * RATE_HZ / 1000 == pytest.approx(2 * TONE_HZ)
    np.testing.assert_array_equal(at_speed(windows, 1.0, 1000), windows.samples[:, :1000])


def test_copies_are_of_the_slides_they_are_named_after_and_repeatable() -> None:
    first, again = augmented(), augmented()
    assert set(first.copies.groups) == {'cork/1', 'cork/2'}
    assert set(first.copies.copies) == {0, 1}
    assert set(first.copies.kinds) <= {'', NOISE}
    assert set(first.disturbed.kinds) <= set(KINDS)
    np.testing.assert_array_equal(first.copies.values, again.copies.values)


def test_copies_without_any_range_are_the_slide_itself() -> None:
    same = augmented(speed_range=0.0, noise_range=0.0, copies=1, disturbed_copies=0)
    values = np.stack([vector.values for vector in FEATURES.extract_many(cut()[:-1])])
    copied = same.copies.values[same.copies.groups == 'cork/1']
    np.testing.assert_allclose(copied, values[: len(copied)], rtol=1e-5, atol=1e-5)
    assert len(copied) >= len(values) - 1
    assert len(same.disturbed.groups) == 0


def test_only_the_vibration_is_amplified_clipped_and_held() -> None:
    rng = np.random.default_rng(0)
    windows = one_input(rng.standard_normal((3, 400, 2)))
    slow = dataclasses.replace(windows, vibration=False)
    np.testing.assert_array_equal(amplify(windows, 0.5, rng), 0.5 * windows.samples)
    assert np.abs(clip(windows, 1.0, rng) - windows.mean).max() == pytest.approx(windows.rms.max())
    held = hold_lost(windows, 0.5, rng)
    assert 0.2 < np.mean(held[:, 1:] == held[:, :-1]) < 0.8
    for disturbance in (amplify, clip, hold_lost):
        np.testing.assert_array_equal(disturbance(slow, 0.5, rng), windows.samples)


def test_drift_grows_over_the_slide_and_not_from_zero_in_each_window() -> None:
    windows = one_input(np.random.default_rng(0).standard_normal((3, 500, 1)))
    offset = add_drift(windows, 2.0, np.random.default_rng(0)) - windows.samples
    assert offset[2, 0, 0] == pytest.approx(2.0 * windows.rms[0] * 0.5)
    assert offset[2, -1, 0] == pytest.approx(2.0 * windows.rms[0] * (0.5 + 499 / RATE_HZ))


def test_the_response_of_another_finger_deviates_by_about_the_strength_in_db() -> None:
    rng = np.random.default_rng(1)
    deviations = [20 * np.log10(smooth_response(500, 3.0, rng)) for _ in range(300)]
    assert np.std(deviations) == pytest.approx(3.0, rel=0.15)
    assert smooth_response(500, 0.0, rng) == pytest.approx(np.ones(500))


def test_noise_raises_the_power_of_the_quiet_bands_as_much_as_it_has_power() -> None:
    loud = augmented(speed_range=0.0, noise_range=10.0, copies=8, disturbed_copies=0).copies
    quiet = augmented(speed_range=0.0, noise_range=0.0, copies=1, disturbed_copies=0).copies
    assert loud.values[:, 7].max() > quiet.values[:, 7].max() + 2 * math.log(3.0)
    undisturbed = loud.values[loud.kinds == '', 7]
    assert len(undisturbed)
    assert undisturbed.max() == pytest.approx(quiet.values[:, 7].max(), abs=0.1)


def test_a_low_pass_halves_the_power_at_its_cut_off_and_keeps_what_is_far_below() -> None:
    time_s = np.arange(4000) / RATE_HZ
    tones = {hz: one_input(np.sin(2 * np.pi * hz * time_s)[None, :, None]) for hz in (5.0, 100.0)}
    passed = {
        hz: (low_pass(tone, 0.05, np.random.default_rng(0)).std() / tone.rms[0]) ** 2 for hz, tone in tones.items()
    }
    assert passed[5.0] == pytest.approx(1.0, abs=0.01)
    assert passed[100.0] == pytest.approx(0.5, abs=0.03)
    slow = dataclasses.replace(tones[100.0], vibration=False)
    np.testing.assert_array_equal(low_pass(slow, 0.05, np.random.default_rng(0)), slow.samples)
