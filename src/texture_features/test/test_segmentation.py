# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS, Phase, TactileSignal
from texture_features.segmentation import (
    OnsetModel,
    SegmentationParams,
    find_contacts,
    find_sliding,
    segment_recording,
)

RATE_HZ, SLOW_HZ = 1000.0, 60.0
START_NS = 10**15


def speed(times_s, slides):
    """Return the speed, of 1, with ramps of 0.2 s before and after each (start, end)."""
    return sum(np.interp(times_s, [a - 0.2, a, b, b + 0.2], [0, 1, 1, 0]) for a, b in slides)


def recording(slides=((1.0, 2.0),), length_s=3.0, seed=0, loud=50.0):
    """Return how the force changes on a surface, over noise of 1, and the load: it falls from each end in 0.1 s."""
    rng = np.random.default_rng(seed)
    times = np.arange(0, length_s, 1 / RATE_HZ)
    now = speed(times, slides)
    way_s = np.cumsum(now) / RATE_HZ  # at speed
    waves_hz, phases = rng.uniform(20.0, 400.0, 60), rng.uniform(0.0, 2 * np.pi, 60)
    surface = np.sin(2 * np.pi * way_s[:, None] * waves_hz + phases).sum(axis=1) / np.sqrt(30.0)
    fast = rng.normal(size=times.shape) + loud * now * surface
    slow_times = np.arange(0, length_s, 1 / SLOW_HZ)
    load = sum(np.interp(slow_times, [a - 0.5, a - 0.4, b, b + 0.1], [0, 1, 1, 0]) for a, b in slides)
    return fast[:, None], 100.0 * load[:, None] + rng.normal(size=(len(slow_times), 4))


def batches(samples, rate_hz, first_ns=START_NS):
    step = round(0.05 * rate_hz)
    channels = tuple(f'c{number}' for number in range(samples.shape[1]))
    return [
        TactileSignal(
            first_ns + round(first / rate_hz * NANOSECONDS),
            's',
            channels,
            (),
            rate_hz,
            first,
            samples[first : first + step].astype(np.float32),
        )
        for first in range(0, len(samples), step)
    ]


def test_start_and_end_are_found_to_twenty_milliseconds():
    for seed in range(10):
        fast, slow = recording(seed=seed)
        [found] = find_sliding(fast, RATE_HZ, SegmentationParams(), slow=slow, slow_rate_hz=SLOW_HZ)
        assert found.start_s == pytest.approx(1.0, abs=0.02)
        assert found.end_s == pytest.approx(2.0, abs=0.02)
        assert found.motion_start_s == pytest.approx(0.8, abs=0.02)


def test_without_slow_channels_the_end_is_one_ramp_before_rest():
    fast, _ = recording()
    [found] = find_sliding(fast, RATE_HZ, SegmentationParams())
    assert found.end_s == pytest.approx(2.0, abs=0.03)


def test_several_slides_are_reported_apart():
    slides = ((1.0, 2.0), (3.5, 4.5))
    fast, slow = recording(slides, 6.0)
    found = find_sliding(fast, RATE_HZ, SegmentationParams(), slow=slow, slow_rate_hz=SLOW_HZ)
    np.testing.assert_allclose([(item.start_s, item.end_s) for item in found], slides, atol=0.03)


@pytest.mark.parametrize('samples', [np.zeros((1000, 1)), np.full((1000, 2), 7.0), np.zeros((1, 1)), np.zeros((0, 1))])
def test_what_does_not_vibrate_does_not_slide(samples):
    assert find_sliding(samples, RATE_HZ, SegmentationParams()) == []


def test_noise_alone_and_a_knock_are_no_slide():
    fast = np.random.default_rng(0).normal(size=(3000, 1))
    assert find_sliding(fast, RATE_HZ, SegmentationParams()) == []
    fast[1500:1510] += 1000.0
    assert find_sliding(fast, RATE_HZ, SegmentationParams()) == []


def test_a_recording_that_begins_at_speed_and_ends_at_speed_is_one_slide_given_the_noise():
    fast = 50.0 * np.random.default_rng(0).normal(size=(2000, 1))
    [found] = find_sliding(fast, RATE_HZ, SegmentationParams(noise_rms=1.0))
    assert (found.start_s, found.end_s) == (0.0, 2.0)


def test_lost_samples_count_as_rest():
    fast, slow = recording()
    fast[1500:1520] = np.nan
    [found] = find_sliding(fast, RATE_HZ, SegmentationParams(), slow=slow, slow_rate_hz=SLOW_HZ)
    assert found.end_s == pytest.approx(2.0, abs=0.02)


def test_gain_and_offset_of_the_sensor_do_not_matter():
    fast, slow = recording()
    params = SegmentationParams()
    plain = find_sliding(fast, RATE_HZ, params, slow=slow, slow_rate_hz=SLOW_HZ)
    for gain in (1e-6, 1e6):
        [found] = find_sliding(gain * (fast + 9.0), RATE_HZ, params, slow=gain * slow, slow_rate_hz=SLOW_HZ)
        assert found.start_s == pytest.approx(plain[0].start_s, abs=1e-3)
        assert found.end_s == pytest.approx(plain[0].end_s, abs=1e-3)


@pytest.mark.parametrize('load', [np.zeros((50, 2)), np.ones((1, 3)), np.random.default_rng(0).normal(size=(200, 1))])
def test_channels_without_a_load_report_no_contact(load):
    assert find_contacts(load, SLOW_HZ, np.ones(len(load))) == []


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_contact_is_where_the_finger_vibrates_whatever_the_sign_of_the_load(sign):
    times = np.arange(200) / 100.0
    load = sign * np.interp(times, [0.3, 0.4, 1.5, 1.6], [0, 1, 1, 0])[:, None]
    [touch] = find_contacts(load, 100.0, np.where((times > 0.5) & (times < 1.5), 1.0, 0.0))
    assert touch.press_start_s == pytest.approx(0.3, abs=0.01)
    assert touch.press_end_s == pytest.approx(0.4, abs=0.01)
    assert touch.release_start_s == pytest.approx(1.5, abs=0.01)
    assert touch.release_end_s == pytest.approx(1.6, abs=0.01)


def test_knocks_of_touching_and_letting_go_do_not_report_which_level_is_contact():
    times = np.arange(0, 1.8, 0.01)
    load = np.interp(times, [0.2, 0.3, 1.6, 1.7], [0.0, 1.0, 1.0, 0.0])[:, None]
    knocks = (np.abs(times - 0.25) < 0.11) | (np.abs(times - 1.65) < 0.11)  # most of what is no contact
    vibration = np.where(knocks, 8.0, np.where((times > 0.4) & (times < 1.5), 2.0, 0.0))
    [touch] = find_contacts(load, 100.0, vibration)
    assert (touch.press_start_s, touch.release_end_s) == pytest.approx((0.2, 1.7), abs=0.011)


def test_a_wrong_shape_gets_one_sentence():
    with pytest.raises(InvalidData, match='at a rate above 0'):
        find_sliding(np.zeros(100), RATE_HZ, SegmentationParams())
    with pytest.raises(InvalidData, match='slow channels too'):
        find_sliding(np.zeros((100, 1)), RATE_HZ, SegmentationParams(), slow=np.zeros((10, 2)))


def spans(states):
    """Return (start, end) of each slide that states tell, s from the beginning."""
    begun, ended = {}, {}
    for state in states:
        at_s = (state.stamp_ns - START_NS) / NANOSECONDS
        if state.phase is Phase.SLIDE:
            begun.setdefault(state.exploration_id, at_s)
        else:
            ended[state.exploration_id] = at_s
    return [(begun[name], ended[name]) for name in begun]


def test_slides_of_a_recording_are_told_with_their_starts_and_ends():
    slides = ((1.0, 2.5), (4.0, 5.0))
    fast, slow = recording(slides, 6.5)
    signals = {'signal': batches(fast, RATE_HZ), 'signal_static': batches(slow, SLOW_HZ)}
    states = segment_recording(signals, SegmentationParams())
    np.testing.assert_allclose(spans(states), slides, atol=0.03)
    guaranteed_s = [state.steady_s for state in states if state.phase is Phase.SLIDE]
    np.testing.assert_allclose(guaranteed_s, [end - start for start, end in spans(states)], atol=1e-8)


def test_a_sensor_that_restarts_and_one_that_says_nothing_are_survived():
    assert segment_recording({'signal': []}, SegmentationParams()) == []
    fast, _ = recording()
    again = batches(fast, RATE_HZ, START_NS + 10 * NANOSECONDS)
    states = segment_recording({'signal': [*batches(fast, RATE_HZ), *again]}, SegmentationParams())
    np.testing.assert_allclose(spans(states), [(1.0, 2.0), (11.0, 12.0)], atol=0.03)


ONSET_RATE_HZ, RAMP_S, SETS_OFF_S, LENGTH_S = 1000.0, 0.2, 0.3, 1.2
RANGE_S = (0.1, 0.55)
KNOWN = np.ones(round(LENGTH_S * ONSET_RATE_HZ), dtype=bool)


def sliding(lines_hz, power_of_speed, rng, noise=0.05, rate_hz=ONSET_RATE_HZ):
    """Return noise, then waves: at half the speed each has half the pitch, and an amplitude as the speed to a power."""
    times = np.arange(0.0, LENGTH_S, 1.0 / rate_hz)
    speed = np.clip((times - SETS_OFF_S) / RAMP_S, 0.0, 1.0)
    way_s = np.cumsum(speed) / rate_hz
    phases = rng.uniform(0, 2 * np.pi, len(lines_hz))
    waves = np.sin(2 * np.pi * way_s[:, None] * lines_hz + phases).sum(axis=1)
    moves = (speed > 0) * speed**power_of_speed
    return (moves * waves + noise * rng.normal(size=times.shape))[:, None]


def found(fast, quantity, rate_hz=ONSET_RATE_HZ, noise=0.05):
    model = OnsetModel(rate_hz, np.array([noise**2]), RAMP_S, quantity, 0.05)
    known = np.ones(len(fast), dtype=bool)
    return model.find(fast, known, fast[round(0.6 * rate_hz) : round(1.1 * rate_hz)], RANGE_S)


@pytest.mark.parametrize(('quantity', 'power'), [('force', 0.0), ('change', 1.0), ('change', 1.5), ('either', 1.0)])
@pytest.mark.parametrize('lines_hz', [[180.0], [90.0, 230.0, 310.0], np.arange(40.0, 400.0, 30.0)])
@pytest.mark.parametrize('rate_hz', [1000.0, 2200.0])
def test_a_rising_pitch_reports_when_the_finger_set_off(quantity, power, lines_hz, rate_hz):
    rng = np.random.default_rng(0)
    errors = [
        found(sliding(np.array(lines_hz), power, rng, rate_hz=rate_hz), quantity, rate_hz) - SETS_OFF_S
        for _ in range(10)
    ]
    assert np.abs(errors).max() < 0.015
    assert abs(np.median(errors)) < 0.008


def test_gain_does_not_matter():
    fast = sliding(np.array([180.0]), 0.0, np.random.default_rng(1))
    assert found(1e6 * fast, 'force', noise=0.05e6) == pytest.approx(found(fast, 'force'), abs=1e-6)


def test_what_is_not_known_is_left_out():
    fast = sliding(np.array([90.0, 230.0, 310.0]), 0.0, np.random.default_rng(2))
    plain = found(fast, 'force')
    knocked, known = fast.copy(), KNOWN.copy()
    knocked[150:200] += 1000.0
    known[140:210] = False
    model = OnsetModel(ONSET_RATE_HZ, np.array([0.05**2]), RAMP_S, 'force', 0.05)
    assert model.find(knocked, known, fast[600:1100], RANGE_S) == pytest.approx(plain, abs=0.01)


@pytest.mark.parametrize(
    ('known', 'steady'), [(~KNOWN, 500), (KNOWN[:20], 500), (KNOWN, 3), (KNOWN, 0)], ids=['none', 'few', '3', 'empty']
)
def test_where_nothing_is_known_it_is_the_middle_of_the_range(known, steady):
    fast = np.random.default_rng(0).normal(size=(len(known), 1))
    model = OnsetModel(ONSET_RATE_HZ, np.ones(1), RAMP_S, 'either', 0.05)
    assert model.find(fast, known, np.ones((steady, 1)), RANGE_S) == pytest.approx(np.mean(RANGE_S), abs=0.003)


def test_no_ramp_is_a_step_in_speed():
    rng = np.random.default_rng(0)
    fast = np.concatenate([0.1 * rng.normal(size=(300, 1)), rng.normal(size=(900, 1))])
    model = OnsetModel(ONSET_RATE_HZ, np.array([0.01]), 0.0, 'force', 0.05)
    assert model.find(fast, KNOWN, fast[600:1100], RANGE_S) == pytest.approx(SETS_OFF_S, abs=0.01)
