# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The motion that gives the largest information gain is chosen, by information that has known values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from texture_core.errors import InvalidData, ModelMismatch
from texture_core.types import FeatureVector, SlideMotion
from texture_estimation.next_motion import NextTouchModel, least_information, slide_values

ACROSS = SlideMotion('linear_slide', 0.0, 0.1, 2.0, 1.0)
ALONG = replace(ACROSS, direction_rad=np.pi / 2)
SHORT = replace(ALONG, duration_s=0.5)
N = 200


def slides(means: dict[SlideMotion, dict[str, float]], n_features: int = 2, count: int = N) -> NextTouchModel:
    """Learn from slides whose first feature has a mean by motion and texture; all features have a variance of 1."""
    rng = np.random.default_rng(0)
    cases = [(motion, texture, mean) for motion, by in means.items() for texture, mean in by.items()]
    values = rng.standard_normal((len(cases), count, n_features))
    values -= values.mean(axis=1, keepdims=True)  # the means are exact, so that equal textures are
    values[..., 0] += np.array([mean for *_, mean in cases])[:, None]
    textures = [texture for _, texture, _ in cases for _ in range(count)]
    motions = [motion for motion, *_ in cases for _ in range(count)]
    return NextTouchModel.fit(values.reshape(-1, n_features), textures, motions)


LIKE = {'a': 0.0, 'b': 0.0}
UNLIKE = {'a': -2.0, 'b': 2.0}


def test_the_only_direction_in_which_two_textures_differ_is_chosen_though_it_is_longer() -> None:
    training = slides({SHORT: LIKE, ACROSS: UNLIKE})
    assert training.best_motion(training.uniform_log_prior, [SHORT, ACROSS]).motion == ACROSS


def test_the_choice_depends_on_the_candidates_that_remain() -> None:
    training = slides({ACROSS: {'a': -9.0, 'b': 9.0, 'c': 9.0}, ALONG: {'a': 0.0, 'b': 0.0, 'c': 3.0}})
    assert training.best_motion(training.uniform_log_prior, [ACROSS, ALONG]).motion == ACROSS
    after = training.update(training.uniform_log_prior, ACROSS, np.array([9.0, 0.0]))
    assert np.exp(after) == pytest.approx([0.0, 0.5, 0.5], abs=1e-3)
    assert training.best_motion(after, [ACROSS, ALONG]).motion == ALONG


def test_a_slide_moves_the_odds_by_the_ratio_of_the_gaussians() -> None:
    training = NextTouchModel(('a', 'b'), np.eye(1), (ACROSS,), np.array([[[-1.0], [1.0]]]))
    odds = np.subtract(*training.update(training.uniform_log_prior, ACROSS, np.array([0.3]))[::-1])
    assert odds == pytest.approx(2.0 * 0.3)


@pytest.mark.parametrize(('delta', 'nats'), [(0.0, 0.0), (2.0, 0.3368), (4.0, 0.6327), (100.0, np.log(2))])
def test_information_of_two_gaussians_is_at_most_that_of_a_channel_with_two_signals(delta: float, nats: float) -> None:
    """Capacity of the binary-input Gaussian channel, by numerical integration."""
    means = np.array([[-delta / 2], [delta / 2]])
    prior = np.log([0.5, 0.5])
    bound = np.log(2) - np.log1p(np.exp(-(delta**2) / 8))
    assert least_information(means, prior) == pytest.approx(bound)
    assert bound <= nats + 1e-9


def test_scaled_doubled_and_constant_features_change_nothing_that_matters() -> None:
    rng = np.random.default_rng(3)
    values = rng.standard_normal((40, 1)) + np.repeat([[0.0], [3.0]], 20, axis=0)
    textures, motions = ['a'] * 20 + ['b'] * 20, [ACROSS] * 40
    plain = NextTouchModel.fit(values, textures, motions)
    for scale in (1e-6, 1.0, 1e6):
        odd = NextTouchModel.fit(np.hstack([values * scale, values, np.full((40, 1), 7.0)]), textures, motions)
        after = odd.update(odd.uniform_log_prior, ACROSS, np.array([3.0 * scale, 3.0, 7.0]))
        assert np.isfinite(after).all()
        assert after.argmax() == plain.update(plain.uniform_log_prior, ACROSS, np.array([3.0])).argmax() == 1


@pytest.mark.parametrize(
    ('values', 'textures', 'motions', 'message'),
    [
        (np.eye(3), ['a', 'a', 'b'], [ACROSS, ACROSS, ALONG], 'no slide over b'),
        (np.eye(2), ['a', 'b'], [ACROSS] * 2, 'how much slides differ'),
        (np.eye(4), ['a', 'b'] * 2, [ACROSS] * 2 + [ALONG] * 2, 'how much slides differ'),
    ],
)
def test_slides_unfit_for_training_are_refused(
    values: np.ndarray, textures: list[str], motions: list[SlideMotion], message: str
) -> None:
    with pytest.raises(InvalidData, match=message):
        NextTouchModel.fit(values, textures, motions)


@pytest.mark.parametrize('seed', range(3))
def test_differences_by_chance_carry_no_information(seed: int) -> None:
    """Three slides of each texture on 40 features: their means are far apart, their distributions the same."""
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((60, 40))
    training = NextTouchModel.fit(values, ['a', 'b'] * 30, [ACROSS] * 6 + [ALONG] * 54)
    assert training.information(training.uniform_log_prior, ACROSS) < 0.35
    after = [training.update(training.uniform_log_prior, ACROSS, slide) for slide in rng.standard_normal((200, 40))]
    assert np.exp(np.max(after, axis=1)).mean() < 0.85


def test_slides_of_an_arm_are_gathered_by_the_motion_that_was_meant() -> None:
    rng = np.random.default_rng(0)
    textures = ['a', 'b'] * 12
    motions = [replace(ACROSS, speed_m_s=0.1 + 0.001 * k, direction_rad=3.0 * (k % 4 < 2)) for k in range(12)] * 2
    values = rng.standard_normal((25, 3))
    training = NextTouchModel.of_slides(values, [*textures, 'a'], [*motions, None])
    assert training is not None
    assert {motion.direction_rad for motion in training.motions} == {0.0, 3.0}
    alone = [replace(ACROSS, speed_m_s=0.3)]
    more = NextTouchModel.of_slides(values, [*textures, 'a'], [*motions, *alone])
    assert more is not None
    assert set(more.motions) == set(training.motions)
    assert NextTouchModel.of_slides(values[:24], textures, [ACROSS] * 24) is None
    assert NextTouchModel.of_slides(values[:0], [], []) is None


def test_a_slide_is_the_mean_of_its_usable_windows() -> None:
    windows = [
        FeatureVector(k, 'id', 0.5, 0.1, ('x',), np.array([value]), feature_set='kind')
        for k, value in enumerate((1.0, np.nan, 4.0))
    ]
    assert slide_values(windows, 'kind') == pytest.approx([2.5])
    with pytest.raises(InvalidData, match='none of the 1 windows'):
        slide_values(windows[1:2], 'kind')
    with pytest.raises(ModelMismatch, match='does not fit'):
        slide_values(windows, 'signal=2200Hz*1')
