# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math
from dataclasses import replace

import numpy as np
import pytest

from texture_estimation.domain import Domain
from texture_features.correction import Correction
from texture_features.feature_set import SlideConditions


def conditions(speed_m_s=0.05, force_n=1.0, motion='linear_slide', sensor='tsf85', directions_rad=(0.0,)):
    return SlideConditions(motion, sensor, speed_m_s, force_n, directions_rad)


def trained_on(*slides, **margins):
    return replace(Domain.of_slides(slides, ['cork'] * len(slides)), **margins)


TRAINED = trained_on(conditions(0.045, 0.9), conditions(0.055, 1.1))


def test_slides_like_those_of_the_training_are_within_the_domain():
    assert TRAINED.deviation(conditions()) == ''


@pytest.mark.parametrize(
    ('came', 'sentence'),
    [
        (conditions(speed_m_s=0.02), 'speed 0.02 m/s, trained 0.045 to 0.055 m/s'),
        (conditions(speed_m_s=0.1), 'speed 0.1 m/s, trained 0.045 to 0.055 m/s'),
        (conditions(force_n=3.0), 'force 3 N, trained 0.9 to 1.1 N'),
        (conditions(motion='circular'), "motion 'circular', trained 'linear_slide'"),
        (conditions(sensor='biotac'), "sensor 'biotac', trained 'tsf85'"),
        (conditions(directions_rad=(1.57,)), 'direction 90°, trained 0°'),
    ],
)
def test_each_condition_that_was_not_trained_is_named_with_what_was(came, sentence):
    assert TRAINED.deviation(came) == f'outside the training: {sentence}'


@pytest.mark.parametrize(
    ('speed', 'within'), [(0.05 / 1.14, True), (0.05 / 1.16, False), (0.057, True), (0.058, False)]
)
def test_a_range_is_wider_than_its_slides_by_the_margin(speed, within):
    assert (trained_on(conditions(0.05), speed_margin=0.15).deviation(conditions(speed)) == '') is within


@pytest.mark.parametrize('most', [0.065, 0.05 / 1.3])
def test_a_value_at_the_margin_stays_within_it_whatever_the_rounding_of_its_mean(most):
    trained = trained_on(conditions(0.05, 0.05), speed_margin=0.3, force_margin=0.3)
    trained = replace(trained, levels={'signal/moments/signal_log_power/x': (0.025, 0.025)})  # its margin is 1
    level = ('signal/moments/signal_log_power/x', 0.05 if most > 0.05 else 0.0125)
    for rounding in (-1e-9, 0.0, 1e-9):
        near = 1.0 + rounding
        slide = replace(conditions(most * near, most * near), levels=((level[0], level[1] * near),))
        assert trained.deviation(slide) == ''
    beyond = 1.0 + 1e-5 if most > 0.05 else 1.0 - 1e-5
    slide = replace(conditions(most * beyond, most * beyond), levels=((level[0], level[1] * beyond),))
    found = trained.deviation(slide)
    assert [word in found for word in ('speed', 'force', 'level')] == [True] * 3


def test_a_slide_widens_the_range_by_how_its_mean_settles_and_one_odd_slide_of_many_does_not():
    settling = SlideConditions(speed_m_s=0.05, speed_range_m_s=(0.02, 0.06))
    odd = SlideConditions(speed_m_s=0.05, speed_range_m_s=(0.001, 0.5))
    assert Domain.of_slides([settling, conditions()], ['cork'] * 2).speed_m_s == (0.02, 0.06)
    assert Domain.of_slides([odd] + [settling] * 200, ['cork'] * 201).speed_m_s == (0.02, 0.06)


def test_what_is_unknown_in_the_slide_or_in_the_training_is_not_compared():
    nothing = SlideConditions()
    assert TRAINED.deviation(nothing) == ''
    assert trained_on(nothing).deviation(conditions()) == ''
    assert Domain().deviation(conditions()) == ''


@pytest.mark.parametrize(
    ('direction', 'sentence'),
    [
        (0.3, ''),
        (-0.3, ''),
        (0.75, ''),
        (1.2, 'direction 69°, trained 34°'),
        (3.1 - math.tau, ''),
        (2.7, 'direction 155°, trained 178°'),
    ],
)
def test_a_direction_is_trained_if_it_is_near_one_that_was_also_across_the_back(direction, sentence):
    trained = trained_on(conditions(directions_rad=(0.0, 0.6)), conditions(directions_rad=(3.1,)))
    assert trained.deviation(conditions(directions_rad=(direction,))).removeprefix('outside the training: ') == sentence


def test_to_and_fro_is_trained_if_both_directions_are():
    both = conditions(directions_rad=(0.0, 3.14))
    assert trained_on(conditions(), conditions(directions_rad=(math.pi,))).deviation(both) == ''
    assert TRAINED.deviation(both) == 'outside the training: direction 180°, trained 0°'


FEATURES = {'pac': 'signal/moments/signal_log_power/pac', 'pdc': 'signal_static/log_variance/pdc'}


def as_loud(rest=None, **levels):
    """Return a slide with a level of each channel and, where the approach was recorded, its level at rest."""
    return SlideConditions(
        levels=tuple((FEATURES[channel], rms, rms, rms) for channel, rms in levels.items()),
        rest=tuple((FEATURES[channel], rms) for channel, rms in (rest or {}).items()),
    )


@pytest.mark.parametrize(('rms', 'within'), [(2.1, True), (1.9, False), (15.9, True), (16.1, False)])
def test_a_signal_far_stronger_or_weaker_than_any_trained_is_outside(rms, within):
    domain = trained_on(as_loud(pac=4.0, pdc=1.0), as_loud(pac=8.0, pdc=1.0))
    sentence = f'outside the training: signal level {rms:.3g} of signal/pac, trained 4 to 8'
    assert domain.deviation(as_loud(pac=rms)) == ('' if within else sentence)
    assert domain.deviation(as_loud(pdc=100.0)) == ''  # of slow channels the level is not compared


def test_a_slide_that_adds_less_power_than_the_sensor_has_at_rest_is_outside_where_that_is_known():
    noise = as_loud(pac=10.0, rest={'pac': 10.0})
    domain = trained_on(noise, as_loud(pac=30.0, rest={'pac': 12.0}))  # 11 at rest, on average
    sentence = (
        'outside the training: as quiet as the sensor at rest, signal/pac 15.5, at rest 11: a finger that feels '
        'nothing shows the same'
    )
    assert domain.deviation(as_loud(pac=15.5)) == sentence  # 15.56 is √2 times as much
    assert domain.deviation(as_loud(pac=15.6)) == ''
    assert trained_on(noise, as_loud(pac=30.0)).deviation(as_loud(pac=14.0))  # by the slides that show it
    assert trained_on(as_loud(pac=10.0)).deviation(as_loud(pac=10.0)) == ''


def test_a_channel_that_is_louder_than_at_rest_or_not_known_may_show_the_touch_also_a_slow_one():
    both = trained_on(as_loud(pac=10.0, pdc=1.0, rest={'pac': 10.0, 'pdc': 1.0}))
    assert 'as quiet as the sensor at rest, signal/pac 10, at rest 10' in both.deviation(as_loud(pac=10.0, pdc=1.4))
    assert both.deviation(as_loud(pac=10.0, pdc=1.5)) == ''
    assert both.deviation(as_loud(pac=10.0)) == ''  # as after a change of the names of the channels
    slow = trained_on(as_loud(pdc=1.0, rest={'pdc': 1.0}))
    assert 'as quiet as the sensor at rest, signal_static/pdc 1, at rest 1' in slow.deviation(as_loud(pdc=1.0))


def test_the_noise_at_rest_of_another_finger_is_compared_as_it_is_corrected():
    half = Correction({'signal': np.array([100.0])}, {'signal': np.array([[20.0 * math.log10(0.5)]])})
    domain = trained_on(as_loud(pac=10.0, pdc=1.0, rest={'pac': 10.0, 'pdc': 1.0})).corrected(half)
    assert domain.rest == {FEATURES['pac']: pytest.approx(20.0), FEATURES['pdc']: 1.0}
    assert 'signal/pac 25, at rest 20' in domain.deviation(as_loud(pac=25.0, pdc=1.0))


def test_added_slides_widen_the_domain():
    added = conditions(0.1, 2.0, 'circular', 'biotac', (1.57,))
    assert TRAINED.deviation(added)
    wider = TRAINED.widened([added], ['oak'])
    assert wider.deviation(added) == ''
    assert wider.deviation(conditions()) == ''
    assert wider.deviation(conditions(0.2)) == 'outside the training: speed 0.2 m/s, trained 0.045 to 0.1 m/s'
    assert wider.slides == {'cork': 2, 'oak': 1}
    louder = trained_on(as_loud(pac=4.0)).widened([as_loud(pac=40.0)], ['oak'])
    assert louder.levels == {FEATURES['pac']: (4.0, 40.0)}
