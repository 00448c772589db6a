# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_core.types import NANOSECONDS, Phase, TactileSignal
from texture_features.segmentation import SegmentationParams, find_sliding, segment_recording

RATE_HZ = 1000.0
START_NS = 10**15


def speed(times_s, slides):
    """Return the speed, of 1, with ramps of 0.2 s before and after each (start, end)."""
    return sum(np.interp(times_s, [a - 0.2, a, b, b + 0.2], [0, 1, 1, 0]) for a, b in slides)


def recording(slides=((1.0, 2.0),), length_s=3.0, seed=0, loud=50.0):
    """Return how the force changes on a surface, over noise of 1, (n, 1)."""
    rng = np.random.default_rng(seed)
    times = np.arange(0, length_s, 1 / RATE_HZ)
    now = speed(times, slides)
    way_s = np.cumsum(now) / RATE_HZ  # at speed
    waves_hz, phases = rng.uniform(20.0, 400.0, 60), rng.uniform(0.0, 2 * np.pi, 60)
    surface = np.sin(2 * np.pi * way_s[:, None] * waves_hz + phases).sum(axis=1) / np.sqrt(30.0)
    return (rng.normal(size=times.shape) + loud * now * surface)[:, None]


def batches(samples, rate_hz, first_ns=START_NS):
    step = round(0.05 * rate_hz)
    channels = tuple(f'c{number}' for number in range(samples.shape[1]))
    parts = [(first, samples[first : first + step].astype(np.float32)) for first in range(0, len(samples), step)]
    return [
        TactileSignal(first_ns + round(first / rate_hz * NANOSECONDS), 's', channels, (), rate_hz, first, part)
        for first, part in parts
    ]


@pytest.mark.parametrize('slides', [((1.0, 2.0),), ((1.0, 2.0), (3.5, 4.5))])
def test_start_and_end_of_each_slide_are_found_without_the_ramps(slides):
    for seed in range(10):
        found = find_sliding(recording(slides, 6.0, seed), RATE_HZ, SegmentationParams())
        np.testing.assert_allclose(found, slides, atol=0.06)


NOISE = np.random.default_rng(0).normal(size=(3000, 1))
KNOCK = NOISE + np.where(np.abs(np.arange(3000) - 1505) < 5, 1000.0, 0.0)[:, None]


@pytest.mark.parametrize(
    'samples', [np.zeros((1000, 1)), np.full((1000, 2), 7.0), np.zeros((1, 1)), np.zeros((0, 1)), NOISE, KNOCK]
)
def test_what_does_not_vibrate_noise_alone_and_a_knock_are_no_slide(samples):
    assert find_sliding(samples, RATE_HZ, SegmentationParams()) == []


def test_a_recording_that_begins_at_speed_and_ends_at_speed_is_one_slide_given_the_noise():
    fast = 50.0 * np.random.default_rng(0).normal(size=(2000, 1))
    assert find_sliding(fast, RATE_HZ, SegmentationParams(noise_rms=1.0)) == [(0.0, 2.0)]


def test_a_few_lost_samples_and_gain_and_offset_of_the_sensor_do_not_matter():
    plain, lost = find_sliding(recording(), RATE_HZ, SegmentationParams()), recording()
    lost[1500:1520] = np.nan
    np.testing.assert_allclose(find_sliding(lost, RATE_HZ, SegmentationParams()), [(1.0, 2.0)], atol=0.06)
    for gain in (1e-6, 1e6):
        found = find_sliding(gain * (recording() + 9.0), RATE_HZ, SegmentationParams())
        np.testing.assert_allclose(found, plain, atol=0.006)


def spans(states):
    """Return (start, end) of each slide by its states, s from the beginning."""
    assert [state.phase for state in states] == [Phase.SLIDE, Phase.LIFT] * (len(states) // 2)
    return np.reshape([(state.stamp_ns - START_NS) / NANOSECONDS for state in states], (-1, 2))


def test_a_sensor_that_restarts_and_one_that_is_silent_are_survived():
    assert segment_recording([], SegmentationParams()) == []
    fast = recording()
    again = batches(fast, RATE_HZ, START_NS + 10 * NANOSECONDS)
    states = segment_recording([*batches(fast, RATE_HZ), *again], SegmentationParams())
    np.testing.assert_allclose(spans(states), [(1.0, 2.0), (11.0, 12.0)], atol=0.06)
