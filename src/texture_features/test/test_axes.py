import math

import numpy as np
import pytest

from texture_core.errors import InvalidParameter
from texture_core.types import NANOSECONDS, ExplorationState, Phase, TactileSignal
from texture_features.feature_set import FeatureSet
from texture_features.windows import (
    MOST_WAITING,
    AxisJoiner,
    CutWindow,
    SlideEnd,
    WindowParams,
    axis_along,
    cut_recording,
    split_axis,
)

RATE_HZ = 100.0
PARAMS = WindowParams(length_s=1.0, hop_s=0.5)
BOTH = ('signal@x', 'signal@y')
Y = 0.5 * math.pi


def signal(seconds):
    """Return a signal whose samples are their time, s."""
    samples = np.arange(round(seconds * RATE_HZ), dtype=np.float32)[:, None] / RATE_HZ
    return TactileSignal(0, 's', ('pac',), (), RATE_HZ, 0, samples)


def leg(start_s, seconds, direction_rad, speed_m_s=0.02):
    """Return the states of steady sliding in one direction, and that nothing is guaranteed after it."""
    end_s = start_s + seconds
    times = np.arange(start_s, end_s - 1e-9, 0.1)
    steady = [(at, min(0.1, end_s - at), direction_rad) for at in times]
    return [
        ExplorationState(
            round(at * NANOSECONDS),
            'a',
            'cross_slide',
            Phase.SLIDE,
            steady_s,
            speed_m_s,
            1.0,
            direction,
            surface='linen',
        )
        for at, steady_s, direction in [*steady, (end_s, 0.0, direction_rad)]
    ]


def cut(*legs, inputs=BOTH, seconds=20.0):
    states = [state for each in legs for state in each]
    end = ExplorationState(states[-1].stamp_ns + NANOSECONDS // 10, 'a', 'cross_slide', Phase.LIFT)
    return list(cut_recording({'signal': [signal(seconds)]}, [*states, end], PARAMS, inputs))


@pytest.mark.parametrize(('first', 'second'), [(0.0, Y), (Y, 0.0), (math.pi, -Y)])
def test_windows_along_x_and_y_are_joined_whichever_comes_first(first, second):
    *windows, end = cut(leg(0.0, 2.0, first), leg(3.0, 2.0, second))
    assert isinstance(end, SlideEnd)
    assert len(windows) == 3
    starts = {name: [event.windows[name].samples[0, 0] for event in windows] for name in BOTH}
    first_name, second_name = BOTH if axis_along(first) == 'x' else BOTH[::-1]
    assert starts[first_name] == pytest.approx([0.0, 0.5, 1.0])
    assert starts[second_name] == pytest.approx([3.0, 3.5, 4.0])
    assert [event.start_ns / NANOSECONDS for event in windows] == pytest.approx([3.0, 3.5, 4.0])
    assert all(math.isnan(event.direction_rad) and event.surface == 'linen' for event in windows)


def test_speed_and_force_are_means_over_both_legs():
    window, *_ = cut(leg(0.0, 1.0, 0.0, speed_m_s=0.02), leg(3.0, 1.0, Y, speed_m_s=0.03))
    assert window.speed_m_s == pytest.approx(0.025)
    assert window.force_n == pytest.approx(1.0)


@pytest.mark.parametrize('directions', [(0.0,), (Y,), (0.0, math.pi), (0.25 * math.pi, 0.75 * math.pi)])
def test_without_both_axes_there_is_no_window(directions):
    events = cut(*(leg(3.0 * number, 2.0, direction) for number, direction in enumerate(directions)))
    assert [type(event) for event in events] == [SlideEnd]


def test_a_window_does_not_wait_for_the_next_exploration():
    joiner = AxisJoiner(BOTH)
    [along_x] = cut(leg(0.0, 1.0, 0.0), inputs=('signal',))[:-1]
    [along_y] = cut(leg(0.0, 1.0, Y), inputs=('signal',))[:-1]
    assert joiner.add(along_x) is None
    assert joiner.end() == 1
    assert joiner.add(along_y) is None
    assert joiner.add(along_x).windows.keys() == set(BOTH)


def test_a_long_slide_along_one_axis_does_not_fill_the_memory():
    joiner = AxisJoiner(BOTH)
    [window] = cut(leg(0.0, 1.0, 0.0), inputs=('signal',))[:-1]
    for _ in range(MOST_WAITING + 5):
        assert joiner.add(window) is None
    assert joiner.end() == MOST_WAITING


def test_a_window_along_one_axis_alone_needs_no_partner():
    *windows, _ = cut(leg(0.0, 1.0, 0.0), leg(3.0, 1.0, Y), inputs=('signal@y',))
    [window] = windows
    assert window.windows['signal@y'].samples[0, 0] == pytest.approx(3.0)
    assert window.direction_rad == pytest.approx(Y)


def test_the_features_of_both_axes_are_one_vector_live_and_offline_alike():
    recipe = {
        'windows': {'length_s': 1.0, 'hop_s': 0.5},
        'inputs': {name: {'features': ['mean']} for name in BOTH},
    }
    feature_set = FeatureSet.from_mapping(recipe)
    assert feature_set.topics == ('signal',)
    *windows, end = cut(leg(0.0, 2.0, 0.0), leg(3.0, 2.0, Y), inputs=feature_set.window_names)
    single = [feature_set.extract(event) for event in windows]
    many = feature_set.extract_many([*windows, end])
    assert single[0].names == ('signal@x/mean/pac', 'signal@y/mean/pac')
    assert np.array([vector.values for vector in single]) == pytest.approx(
        np.array([[0.495, 3.495], [0.995, 3.995], [1.495, 4.495]])
    )
    assert [vector.values.tolist() for vector in many[:-1]] == [vector.values.tolist() for vector in single]
    assert many[-1].last


@pytest.mark.parametrize('name', ['signal@z', '@x', 'signal@'])
def test_another_axis_than_x_or_y_is_refused(name):
    with pytest.raises(InvalidParameter, match='the axes are x and y'):
        split_axis(name)


def test_inputs_with_and_without_an_axis_are_not_mixed():
    inputs = {'signal@x': {'features': ['mean']}, 'signal_static': {'features': ['mean']}}
    with pytest.raises(InvalidParameter, match='some of slides along an axis and some of any direction'):
        FeatureSet.from_mapping({'inputs': inputs})


def test_states_in_which_no_axis_is_known_give_no_window():
    assert [type(event) for event in cut(leg(0.0, 2.0, math.nan))] == [SlideEnd]
    assert isinstance(cut(leg(0.0, 1.0, math.nan), inputs=('signal',))[0], CutWindow)
