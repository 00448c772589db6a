# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from texture_core.errors import InvalidParameter
from texture_core.types import NANOSECONDS, ExplorationState, Phase, TactileSignal
from texture_features.feature_set import FeatureSet
from texture_features.windows import (
    AxisJoiner,
    CutWindow,
    SlideCoverage,
    SlideEnd,
    WindowCutter,
    WindowParams,
    axis_along,
    cut_recording,
    split_axis,
)

PARAMS = WindowParams(length_s=0.5, hop_s=0.1)
START_NS = 7 * NANOSECONDS
LIMITS = settings(max_examples=40, deadline=None)


def ns(seconds: float) -> int:
    return START_NS + round(seconds * NANOSECONDS)


def state(at_s, phase=Phase.SLIDE, steady_s=0.0, name='e1', **others):
    return ExplorationState(ns(at_s), name, 'linear_slide', phase, steady_s, **others)


def stream(duration_s, rate_hz=1000.0, batch=5, begin_s=0.0, columns=1):
    """Return batches whose samples are their running index."""
    total = round(duration_s * rate_hz)
    rows = np.repeat(np.arange(total, dtype=np.float32)[:, None], columns, axis=1)
    channels = tuple(f'c{column}' for column in range(columns))
    return [
        TactileSignal(ns(begin_s + first / rate_hz), 's', channels, (), rate_hz, first, rows[first : first + batch])
        for first in range(0, total, batch)
    ]


def run(signals, states, params=PARAMS):
    return list(cut_recording(signals, states, params))


def starts(events):
    return [round((event.start_ns - START_NS) / NANOSECONDS, 6) for event in events if isinstance(event, CutWindow)]


def first_samples(events, topic='signal'):
    return [int(event.windows[topic].samples[0, 0]) for event in events if isinstance(event, CutWindow)]


def as_data(events):
    """Return events in a form that compares by value."""
    return [
        (
            event.start_ns,
            event.skipped,
            repr((event.speed_m_s, event.force_n, event.surface)),
            {topic: window.samples.tobytes() for topic, window in event.windows.items()},
        )
        if isinstance(event, CutWindow)
        else event
        for event in events
    ]


def test_windows_cover_the_guaranteed_time_and_no_more():
    events = run({'signal': stream(3.0)}, [state(1.0, steady_s=1.0), state(2.0, Phase.LIFT)])
    assert starts(events) == [1.0, 1.1, 1.2, 1.3, 1.4, 1.5]
    assert first_samples(events) == [1000, 1100, 1200, 1300, 1400, 1500]
    assert events[-1] == SlideEnd(ns(2.0), 'e1', 0.1)


@pytest.mark.parametrize(
    ('lost', 'withdrawn'),
    [
        ({'force_n': 0.0}, True),  # in the air
        ({'force_n': 1.6}, True),
        ({'force_n': 1.4}, False),
        ({'speed_m_s': 0.11}, True),
        ({'speed_m_s': 0.09}, False),
    ],
)
def test_a_state_far_from_the_slide_so_far_withdraws_the_guarantee_up_to_the_next_state(lost, withdrawn):
    usual = {'force_n': 1.0, 'speed_m_s': 0.05}
    sliding = [state(0.02 * number, steady_s=0.1, **usual) for number in range(60)]
    without = [state(at, **usual | lost) for at in (1.2, 1.22, 1.24)]
    states = [*sliding, *without, state(1.26, steady_s=0.6, **usual), state(2.0, Phase.LIFT)]
    begins = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, *([] if withdrawn else [0.8, 0.9, 1.0, 1.1, 1.2]), 1.3]
    assert starts(run({'signal': stream(3.0)}, states)) == begins


def test_a_turn_leaves_a_hole_but_keeps_what_was_guaranteed():
    turning = [state(at, force_n=1.0) for at in (1.0, 1.02, 1.04)]
    states = [state(0.0, steady_s=1.01, force_n=1.0), *turning, state(1.06, steady_s=0.6, force_n=1.0)]
    assert starts(run({'signal': stream(3.0)}, states)) == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 1.1]


@pytest.mark.parametrize(('later_s', 'first'), [(0.5, 0), (0.501, 6)])
def test_two_states_cover_the_time_between_them_up_to_half_a_second(later_s, first):
    states = [state(0.0, steady_s=0.1), state(later_s, steady_s=1.0), state(later_s + 1.0, Phase.LIFT)]
    assert starts(run({'signal': stream(3.0)}, states)) == [number / 10 for number in range(first, 11)]


def test_a_window_comes_with_its_last_sample_and_not_before():
    cutter = WindowCutter(PARAMS, ['signal'])
    cutter.add_state(state(0.0, steady_s=2.0))
    for batch in stream(0.5)[:-1]:
        cutter.add_signal('signal', batch)
        assert cutter.take() == []
    cutter.add_signal('signal', stream(0.5)[-1])
    assert starts(cutter.take()) == [0.0]


def test_jitter_of_later_stamps_moves_no_window():
    rng = np.random.default_rng(1)
    batches = stream(2.0)
    jittered = [
        dataclasses.replace(batch, stamp_ns=batch.stamp_ns + int(rng.integers(0, 4_000_000)) * (number > 0))
        for number, batch in enumerate(batches)
    ]
    states = [state(0.0, steady_s=1.5), state(1.5, Phase.LIFT)]
    assert as_data(run({'signal': jittered}, states)) == as_data(run({'signal': batches}, states))


def test_inputs_of_different_rates_are_aligned_by_their_stamps():
    signals = {'signal': stream(2.0, 2200.0, 22), 'signal_static': stream(2.0, 100.0, 1, begin_s=0.004, columns=3)}
    events = run(signals, [state(0.5, steady_s=1.0), state(1.5, Phase.DONE)])
    assert first_samples(events, 'signal') == [1100, 1320, 1540, 1760, 1980, 2200]
    assert first_samples(events, 'signal_static') == [50, 60, 70, 80, 90, 100]
    assert events[0].windows['signal'].samples.shape == (1100, 1)
    assert events[0].windows['signal_static'].samples.shape == (50, 3)


def test_windows_with_samples_that_are_lost_or_not_finite_are_left_out_and_counted():
    batches = [batch for batch in stream(2.0) if not 700 <= batch.first_sample < 710]
    batches[0].samples[3] = np.nan
    batches[-101].samples[0] = np.inf  # at 1.495 s
    events = run({'signal': batches}, [state(0.0, steady_s=1.5), state(1.5, Phase.LIFT)])
    assert starts(events) == [0.1, 0.2, 0.8, 0.9]
    assert events[-1].skipped == 7


def test_a_stream_that_begins_late_or_again_costs_only_its_windows():
    first, second = stream(1.0), stream(1.0, begin_s=1.0)
    events = run({'signal': first + second}, [state(0.2, steady_s=1.8), state(2.0, Phase.LIFT)])
    assert starts(events) == [0.2, 0.3, 0.4, 0.5, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5]
    assert first_samples(events)[4] == 0
    late = run({'signal': stream(1.0, begin_s=0.35)}, [state(0.0, steady_s=1.0), state(1.0, Phase.LIFT)])
    assert starts(late) == [0.4, 0.5]
    assert late[-1].skipped == 4


@pytest.mark.parametrize('missing', [0, 20])  # batches at the end of the first: its slide waits for them
@pytest.mark.parametrize('begin_s', [-3.0, 0.5, 2.2, 3.1])
def test_a_recording_whose_time_goes_back_behind_another_has_the_windows_that_it_has_alone(begin_s, missing):
    def slides(*times_s):
        for at_s in times_s:
            yield state(at_s, name=f'e{at_s}', steady_s=0.8)
            yield state(at_s + 0.8, Phase.DONE, name=f'e{at_s}')

    first = stream(4.0)[: 800 - missing], [*slides(1.0, 3.2)]
    # Numbered from the start, as another sensor, or on, as rows of one table.
    for on in (0, 10_000):
        batches = [
            dataclasses.replace(one, first_sample=one.first_sample + on, samples=one.samples + 10_000)
            for one in stream(3.0, begin_s=begin_s)
        ]
        second = batches, [*slides(begin_s + 0.1, begin_s + 1.5)]
        cutter, events = WindowCutter(PARAMS, ['signal']), []
        for signals, states in (first, second):
            for item in sorted([*signals, *states], key=lambda one: one.stamp_ns):
                (cutter.add_state if isinstance(item, ExplorationState) else partial(cutter.add_signal, 'signal'))(item)
                events += cutter.take()
        alone = [as_data(run({'signal': signals}, states)) for signals, states in (first, second)]
        assert as_data(events + cutter.finish()) == [*alone[0], *alone[1]]


@pytest.mark.parametrize('steady_s', [3600.0, 1e9])  # no guarantee holds for longer than an hour
@pytest.mark.parametrize(('begin_s', 'windows'), [(3599.0, 6), (0.0, 6), (7200.0, 0)])
def test_an_hour_without_samples_is_passed_over_at_once_and_counted(begin_s, windows, steady_s, monkeypatch):
    calls = []
    window = SlideCoverage.window
    monkeypatch.setattr(SlideCoverage, 'window', lambda slide: calls.append(1) or window(slide))
    *cut, end = run({'signal': stream(1.0, begin_s=begin_s)}, [state(0.0, steady_s=steady_s)])
    assert (len(cut), end.skipped) == (windows, 35_996 - windows)
    assert len(calls) < 250  # one for each batch, and few more


def test_speed_and_force_are_means_over_the_window():
    states = [
        state(0.0, speed_m_s=0.1, force_n=math.nan, tangential_force_n=0.4),
        state(0.25, speed_m_s=0.2, force_n=2.0, tangential_force_n=1.0),
        state(0.5, speed_m_s=9.0, force_n=9.0, tangential_force_n=9.0),
        state(0.6, Phase.LIFT),
    ]
    window = run({'signal': stream(1.0)}, states)[0]
    assert (window.speed_m_s, window.force_n, window.tangential_force_n) == pytest.approx((0.15, 2.0, 0.7))
    assert math.isnan(run({'signal': stream(1.0)}, [state(0.0, steady_s=0.6)])[0].tangential_force_n)


def test_the_next_exploration_ends_one_that_was_never_ended():
    states = [state(0.0, steady_s=0.5), state(1.0, steady_s=0.5, name='e2'), state(1.5, Phase.DONE, name='e2')]
    events = run({'signal': stream(2.0)}, states)
    assert [event.exploration_id for event in events] == ['e1', 'e1', 'e2', 'e2']


def test_a_slide_whose_streams_died_ends_after_a_silence():
    cutter = WindowCutter(PARAMS, ['signal', 'signal_static'])
    cutter.add_state(state(0.0, steady_s=1.0))
    for batch in stream(0.7):
        cutter.add_signal('signal', batch)
    cutter.add_state(state(1.0, Phase.LIFT))
    assert cutter.time_out(100.0) == []
    assert cutter.time_out(100.2) == []
    [end] = cutter.time_out(100.4)
    assert isinstance(end, SlideEnd)
    assert end.skipped == 6


def test_a_stream_that_goes_on_is_no_silence():
    cutter = WindowCutter(PARAMS, ['signal'])
    cutter.add_state(state(0.0, steady_s=1.0))
    cutter.add_state(state(1.0, Phase.LIFT))
    events = []
    for number, batch in enumerate(stream(1.0)):
        cutter.add_signal('signal', batch)
        events += cutter.time_out(0.2 * number)
    assert len(starts(events)) == 6
    assert isinstance(events[-1], SlideEnd)


def recording(rng):
    """Return two streams with losses, bad samples, restarts and jitter, and states of two explorations."""
    signals = {}
    for topic, rate, batch in (('signal', 1000.0, 20), ('signal_static', 100.0, 3)):
        batches = stream(4.0, rate, batch, begin_s=float(rng.uniform(-0.2, 0.3)))
        batches = [
            dataclasses.replace(item, stamp_ns=item.stamp_ns + int(rng.integers(0, 3_000_000))) for item in batches
        ]
        if rng.random() < 0.5:
            batches[int(rng.integers(len(batches)))].samples[0] = np.nan
        if rng.random() < 0.5:
            del batches[int(rng.integers(len(batches)))]
        if rng.random() < 0.3:
            cut = int(rng.integers(1, len(batches)))
            origin = batches[cut].first_sample
            batches[cut:] = [dataclasses.replace(b, first_sample=b.first_sample - origin) for b in batches[cut:]]
        signals[topic] = batches
    states = []
    for name, begin in (('e1', 0.3), ('e2', 2.2)):
        times = begin + np.cumsum(rng.choice([0.05, 0.2, 0.45, 0.7], size=5))
        states += [
            state(at, name=name, steady_s=float(rng.choice([0.0, 0.1, 0.8])), speed_m_s=float(rng.uniform(0.1, 0.2)))
            for at in times
        ]
        states.append(state(float(times[-1]) + 0.05, Phase.LIFT, name=name))
    return signals, sorted(states, key=lambda item: item.stamp_ns)


@LIMITS
@given(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1))
def test_what_is_cut_does_not_depend_on_the_order_of_arrival(content, order):
    signals, states = recording(np.random.default_rng(content))
    random = np.random.default_rng(order)
    expected = as_data(run(signals, states))
    cutter, events = WindowCutter(PARAMS, tuple(signals)), []
    queues = {'': list(states), **{topic: list(batches) for topic, batches in signals.items()}}
    while any(queues.values()):
        topic = str(random.choice([name for name, queue in queues.items() if queue]))
        for _ in range(min(int(random.choice([1, 3, 40])), len(queues[topic]))):
            item = queues[topic].pop(0)
            add = partial(cutter.add_signal, topic) if topic else cutter.add_state
            add(item)
            events += cutter.take() if random.random() < 0.5 else []
    assert as_data(events + cutter.finish()) == expected


def test_a_finger_that_drops_out_next_to_another_is_named_and_two_silent_ones_are_not() -> None:
    fingers = ('finger0/signal', 'finger1/signal')
    cutter = WindowCutter(PARAMS, fingers)
    batches = stream(2.0, batch=500)
    for topic in fingers:
        cutter.add_signal(topic, batches[0])
    cutter.time_out(100.0)
    assert cutter.dropped(100.0) == ()
    for number, batch in enumerate(batches[1:], 1):
        cutter.add_signal('finger0/signal', batch)
        cutter.time_out(100.0 + 0.5 * number)
    assert cutter.dropped(101.5) == ('finger1/signal',)
    assert cutter.dropped(103.0) == ()  # nothing comes at all: the sensor itself reports that


BOTH, Y = ('signal@x', 'signal@y'), 0.5 * math.pi


def leg(start_s, seconds, direction_rad):
    """Return the states of steady sliding in one direction, and that nothing is guaranteed after it."""
    more = {'direction_rad': direction_rad, 'surface': 'linen'}
    return [state(start_s, steady_s=seconds, **more), state(start_s + seconds, **more)]


def cut(*legs, inputs=BOTH):
    states = [state for each in legs for state in each]
    end = state((states[-1].stamp_ns - START_NS) / NANOSECONDS + 0.1, Phase.LIFT)
    return list(cut_recording({'signal': stream(20.0, 100.0, 2000)}, [*states, end], WindowParams(1.0, 0.5), inputs))


@pytest.mark.parametrize(('first', 'second'), [(0.0, Y), (Y, 0.0), (math.pi, -Y)])
def test_windows_along_x_and_y_are_joined_whichever_comes_first(first, second):
    *windows, end = cut(leg(0.0, 2.0, first), leg(3.0, 2.0, second))
    assert isinstance(end, SlideEnd)
    first_name, second_name = BOTH if axis_along(first) == 'x' else BOTH[::-1]
    assert first_samples(windows, first_name) == [0, 50, 100]
    assert first_samples(windows, second_name) == [300, 350, 400]
    assert starts(windows) == [3.0, 3.5, 4.0]
    assert all(math.isnan(event.direction_rad) and event.surface == 'linen' for event in windows)


@pytest.mark.parametrize('directions', [(0.0,), (Y,), (0.0, math.pi), (0.25 * math.pi, 0.75 * math.pi)])
def test_without_both_axes_there_is_no_window(directions):
    events = cut(*(leg(3.0 * number, 2.0, direction) for number, direction in enumerate(directions)))
    assert [type(event) for event in events] == [SlideEnd]


def test_a_window_does_not_wait_for_the_next_exploration():
    joiner = AxisJoiner(BOTH)
    along_x, along_y = (cut(leg(0.0, 1.0, direction), inputs=('signal',))[0] for direction in (0.0, Y))
    assert joiner.add(along_x) is None
    assert joiner.end() == 1
    assert joiner.add(along_y) is None
    assert joiner.add(along_x).windows.keys() == set(BOTH)


def test_a_window_along_one_axis_alone_needs_no_partner():
    [window, _] = cut(leg(0.0, 1.0, 0.0), leg(3.0, 1.0, Y), inputs=('signal@y',))
    assert first_samples([window], 'signal@y') == [300]
    assert window.direction_rad == pytest.approx(Y)


def test_the_features_of_both_axes_are_one_vector_live_and_offline_alike():
    inputs = {name: {'features': ['mean']} for name in BOTH}
    feature_set = FeatureSet.from_mapping({'windows': {'length_s': 1.0, 'hop_s': 0.5}, 'inputs': inputs})
    assert feature_set.topics == ('signal',)
    *windows, end = cut(leg(0.0, 2.0, 0.0), leg(3.0, 2.0, Y), inputs=feature_set.window_names)
    single, (*many, last) = [feature_set.extract(event) for event in windows], feature_set.extract_many([*windows, end])
    assert single[0].names == ('signal@x/mean/c0', 'signal@y/mean/c0')
    assert [vector.values.tolist() for vector in single] == [[49.5, 349.5], [99.5, 399.5], [149.5, 449.5]]
    assert [vector.values.tolist() for vector in many] == [vector.values.tolist() for vector in single]
    assert last.last


@pytest.mark.parametrize('name', ['signal@z', '@x', 'signal@'])
def test_another_axis_than_x_or_y_is_refused(name):
    with pytest.raises(InvalidParameter, match='the axes are x and y'):
        split_axis(name)


def test_inputs_with_and_without_an_axis_are_not_mixed():
    inputs = {'signal@x': {'features': ['mean']}, 'signal_static': {'features': ['mean']}}
    with pytest.raises(InvalidParameter, match='some of slides along an axis and some of any direction'):
        FeatureSet.from_mapping({'inputs': inputs})
