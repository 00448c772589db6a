"""The motion that tells most is chosen, by information that has known values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from texture_core.errors import InvalidData, InvalidParameter
from texture_estimation.next_motion import Explorations, Felt, Motion

ACROSS = Motion('linear_slide', 0.0, 0.1, 2.0, 1.0)
ALONG = replace(ACROSS, direction_rad=np.pi / 2)
SHORT = replace(ALONG, duration_s=0.5)
N = 200


def slides(means: dict[Motion, dict[str, float]], n_features: int = 2, count: int = N) -> Explorations:
    """Learn from slides whose first feature has a mean by motion and texture; all features have a variance of 1."""
    rng = np.random.default_rng(0)
    cases = [(motion, texture, mean) for motion, by in means.items() for texture, mean in by.items()]
    values = rng.standard_normal((len(cases), count, n_features))
    values -= values.mean(axis=1, keepdims=True)  # the means are exact, so that equal textures are
    values[..., 0] += np.array([mean for *_, mean in cases])[:, None]
    textures = [texture for _, texture, _ in cases for _ in range(count)]
    motions = [motion for motion, *_ in cases for _ in range(count)]
    return Explorations.learnt(values.reshape(-1, n_features), textures, motions)


LIKE = {'a': 0.0, 'b': 0.0}
UNLIKE = {'a': -2.0, 'b': 2.0}


@pytest.mark.parametrize('seed', [None, 1])
def test_the_only_direction_in_which_two_textures_differ_is_chosen_though_it_is_longer(seed: int | None) -> None:
    learnt = slides({SHORT: LIKE, ACROSS: UNLIKE})
    rng = None if seed is None else np.random.default_rng(seed)
    assert learnt.best(learnt.ignorance, [SHORT, ACROSS], rng).motion == ACROSS


@pytest.mark.parametrize('seed', [None, 1])
def test_equal_textures_tell_nothing_and_the_shortest_motion_is_chosen(seed: int | None) -> None:
    learnt = slides({ACROSS: LIKE, SHORT: LIKE, ALONG: LIKE})
    rng = None if seed is None else np.random.default_rng(seed)
    motion, information = learnt.best(learnt.ignorance, [ACROSS, SHORT, ALONG], rng)
    assert motion == SHORT
    assert information == pytest.approx(0.0, abs=1e-9)


def test_the_choice_depends_on_the_candidates_that_remain() -> None:
    learnt = slides({ACROSS: {'a': -9.0, 'b': 9.0, 'c': 9.0}, ALONG: {'a': 0.0, 'b': 0.0, 'c': 3.0}})
    assert learnt.best(learnt.ignorance, [ACROSS, ALONG]).motion == ACROSS
    after = learnt.update(learnt.ignorance, ACROSS, np.array([9.0, 0.0]))
    assert np.exp(after) == pytest.approx([0.0, 0.5, 0.5], abs=1e-3)
    assert learnt.best(after, [ACROSS, ALONG]).motion == ALONG


def test_one_texture_is_known_before_the_first_slide() -> None:
    learnt = slides({ACROSS: {'a': 0.0}, SHORT: {'a': 1.0}})
    assert learnt.best(learnt.ignorance, [ACROSS, SHORT]) == (SHORT, 0.0)
    assert learnt.update(learnt.ignorance, ACROSS, np.array([5.0, 5.0])) == pytest.approx([0.0])


def test_probabilities_add_up_to_one_after_any_slide_however_strange() -> None:
    learnt = slides({ACROSS: UNLIKE})
    for value in (0.0, 2.0, -1e6, 1e6):
        after = learnt.update(learnt.ignorance, ACROSS, np.array([value, 0.0]))
        assert np.exp(after).sum() == pytest.approx(1.0)


def test_a_slide_moves_the_odds_by_the_ratio_of_the_gaussians() -> None:
    felt = Felt(np.eye(1), np.array([[-1.0], [1.0]]))
    learnt = Explorations(('a', 'b'), {ACROSS: felt})
    odds = np.subtract(*learnt.update(learnt.ignorance, ACROSS, np.array([0.3]))[::-1])
    assert odds == pytest.approx(2.0 * 0.3)


@pytest.mark.parametrize(('apart', 'nats'), [(0.0, 0.0), (2.0, 0.3368), (4.0, 0.6327), (100.0, np.log(2))])
def test_information_of_two_gaussians_is_that_of_a_channel_with_two_signals(apart: float, nats: float) -> None:
    """Capacity of the binary-input Gaussian channel, by numerical integration."""
    felt = Felt(np.eye(1), np.array([[-apart / 2], [apart / 2]]))
    prior = np.log([0.5, 0.5])
    draws = np.random.default_rng(0).standard_normal((40_000, 1))
    assert felt.sampled_information(prior, draws) == pytest.approx(nats, abs=5e-3)
    bound = np.log(2) - np.log1p(np.exp(-(apart**2) / 8))
    assert felt.least_information(prior) == pytest.approx(bound)
    assert bound <= nats + 1e-9


def test_impossible_textures_count_for_nothing() -> None:
    learnt = slides({ACROSS: {'a': -9.0, 'b': 9.0, 'c': 0.0}})
    only = np.array([-np.inf, 0.0, -np.inf])
    assert learnt.information(only, ACROSS) == 0.0
    assert learnt.information(only, ACROSS, np.random.default_rng(0)) == 0.0


def test_scaled_doubled_and_constant_features_change_nothing_that_matters() -> None:
    rng = np.random.default_rng(3)
    values = rng.standard_normal((40, 1)) + np.repeat([[0.0], [3.0]], 20, axis=0)
    textures, motions = ['a'] * 20 + ['b'] * 20, [ACROSS] * 40
    plain = Explorations.learnt(values, textures, motions)
    for scale in (1e-6, 1.0, 1e6):
        odd = Explorations.learnt(np.hstack([values * scale, values, np.full((40, 1), 7.0)]), textures, motions)
        after = odd.update(odd.ignorance, ACROSS, np.array([3.0 * scale, 3.0, 7.0]))
        assert np.isfinite(after).all()
        assert after.argmax() == plain.update(plain.ignorance, ACROSS, np.array([3.0])).argmax() == 1


@pytest.mark.parametrize(
    ('values', 'textures', 'motions', 'said'),
    [
        (np.zeros((2, 1)), ['a'], [ACROSS], 'one row, one texture and one motion'),
        (np.full((2, 1), np.nan), ['a', 'a'], [ACROSS] * 2, 'not finite'),
        (np.eye(3), ['a', 'a', 'b'], [ACROSS, ACROSS, ALONG], 'no slide over b'),
        (np.eye(2), ['a', 'b'], [ACROSS] * 2, 'how much slides differ'),
    ],
)
def test_slides_that_cannot_be_learnt_from_are_refused(
    values: np.ndarray, textures: list[str], motions: list[Motion], said: str
) -> None:
    with pytest.raises(InvalidData, match=said):
        Explorations.learnt(values, textures, motions)


def test_motions_and_values_that_were_not_learnt_are_refused() -> None:
    learnt = slides({ACROSS: UNLIKE})
    with pytest.raises(InvalidParameter, match='was not learnt'):
        learnt.best(learnt.ignorance, [ALONG])
    with pytest.raises(InvalidParameter, match='no motion to choose from'):
        learnt.best(learnt.ignorance, [])
    with pytest.raises(InvalidData, match='2 finite values'):
        learnt.update(learnt.ignorance, ACROSS, np.zeros(3))
    with pytest.raises(InvalidData, match='one for each of the 2 textures'):
        learnt.update(np.zeros(3), ACROSS, np.zeros(2))
