import dataclasses
import json
import math

import numpy as np
import pytest

from texture_core.types import FeatureVector
from texture_features.examples import RunningConditions, SlideConditions


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
    assert first == ('signal/a', pytest.approx(2.0), pytest.approx(1.0), pytest.approx(2.0))
    assert (second.channel, second.rms) == ('signal/b', pytest.approx(20.0))


def test_conditions_survive_a_file() -> None:
    running = RunningConditions()
    names = ('signal/moments/signal_log_power/a',)
    running.update(window(names=names, values=np.zeros(1), speed_m_s=0.05, motion='circular', direction_rad=0.5))
    stored = json.loads(json.dumps(dataclasses.asdict(running.get())))
    found = SlideConditions.from_mapping(stored)
    assert repr(found) == repr(running.get())  # NaN is not equal to itself
    assert repr(SlideConditions.from_mapping({})) == repr(SlideConditions())
