import heapq

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS, Phase, TactileSignal
from texture_features.segmentation import (
    SegmentationParams,
    SlideSegmenter,
    cell_power,
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


def test_a_channel_at_the_end_of_its_range_has_no_power_there():
    clipped = np.minimum(np.random.default_rng(0).normal(size=(1000, 1)), 3.0 - np.linspace(0, 8, 1000)[:, None])
    clipped[:300] = 9.0
    _, power = cell_power(clipped, RATE_HZ, 0.005)
    assert np.isnan(power[:60]).all()
    assert np.isfinite(power[60:]).all()


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


def live(signals, segmenter):
    """Feed batches in the order of arrival; return the states with the time at which each was told."""
    tracks = [[(batch.end_ns, topic, batch) for batch in track] for topic, track in signals.items()]
    reported = [
        (end_ns, state)
        for end_ns, topic, batch in heapq.merge(*tracks, key=lambda item: item[0])
        for state in segmenter.add_signal(topic, batch)
    ]
    return reported, segmenter.finish()


def test_states_of_a_recording_and_states_reported_live_agree():
    slides = ((1.0, 2.5), (4.0, 5.0))
    fast, slow = recording(slides, 6.5)
    signals = {'signal': batches(fast, RATE_HZ), 'signal_static': batches(slow, SLOW_HZ)}
    np.testing.assert_allclose(spans(segment_recording(signals, SegmentationParams())), slides, atol=0.03)
    reported, rest = live(signals, SlideSegmenter(SegmentationParams()))
    np.testing.assert_allclose(spans([state for _, state in reported] + rest), slides, atol=0.04)
    assert not rest  # all was told while the recording went on


def test_live_states_come_soon_and_guarantee_only_what_was_measured():
    fast, slow = recording(((1.0, 3.0),), 4.0)
    signals = {'signal': batches(fast, RATE_HZ), 'signal_static': batches(slow, SLOW_HZ)}
    reported, _ = live(signals, SlideSegmenter(SegmentationParams()))
    sliding = [(at_ns, state) for at_ns, state in reported if state.phase is Phase.SLIDE]
    assert (sliding[0][0] - START_NS) / NANOSECONDS < 1.7
    for at_ns, state in sliding:
        assert state.stamp_ns + state.steady_s * NANOSECONDS <= at_ns
    ends = [round(state.stamp_ns + state.steady_s * NANOSECONDS) for _, state in sliding]
    starts = [state.stamp_ns for _, state in sliding]
    np.testing.assert_allclose(starts[1:], ends[:-1], atol=2)  # what is covered has no gaps


def test_a_sensor_that_restarts_and_one_that_says_nothing_are_survived():
    segmenter = SlideSegmenter(SegmentationParams())
    assert segmenter.finish() == []
    fast, _ = recording()
    first = batches(fast, RATE_HZ)
    again = batches(fast, RATE_HZ, START_NS + 10 * NANOSECONDS)
    states = [state for batch in (*first, *again) for state in segmenter.add_signal('signal', batch)]
    assert len(spans(states + segmenter.finish())) == 2
