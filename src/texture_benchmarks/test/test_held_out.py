import numpy as np

from texture_benchmarks.robustness.speed_resampling import at_other_speed
from texture_benchmarks.speed_force.held_out import Mask, one_out, recognised, run_chosen
from texture_benchmarks.speed_force.nuisance_projection import NuisanceProjection
from texture_estimation.learners.svm_rbf import SvmRbf

SPEEDS = np.repeat([20.0, 40.0, 60.0], 4)
RATE_HZ = 200.0


def test_each_condition_is_left_out_once_and_never_trained() -> None:
    parts = one_out(SPEEDS, SPEEDS < 60.0)
    assert list(parts) == ['20', '40']
    for name, (train, test) in parts.items():
        assert not (train & test).any()
        assert set(SPEEDS[test]) == {float(name)}
        assert SPEEDS[train | test].max() == 40.0


def test_what_is_chosen_never_sees_the_slides_that_are_tested() -> None:
    outer = {'60': (SPEEDS < 60.0, SPEEDS == 60.0)}
    tested = []

    def good_in_training(train: Mask, test: Mask) -> Mask:
        tested.append(set(SPEEDS[test]))
        assert not (train & test).any()
        return np.full(test.sum(), SPEEDS[test][0] < 60.0)

    def good_in_the_test(train: Mask, test: Mask) -> Mask:
        return np.full(test.sum(), SPEEDS[test][0] == 60.0)

    outcome = run_chosen({'first': good_in_training, 'second': good_in_the_test}, outer, [SPEEDS])
    assert tested == [{20.0}, {40.0}, {60.0}]
    assert outcome.chosen == {'60': 'first'}
    assert outcome.accuracy == 0.0


def test_a_rehearsal_is_evaluated_in_the_training_and_the_candidate_is_tested() -> None:
    def wrong(train: Mask, test: Mask) -> Mask:
        return np.zeros(test.sum(), dtype=bool)

    def right(train: Mask, test: Mask) -> Mask:
        return np.ones(test.sum(), dtype=bool)

    inner_trials = {'first': wrong, 'second': right}
    outcome = run_chosen({'first': right, 'second': wrong}, one_out(SPEEDS), [SPEEDS], inner_trials)
    assert set(outcome.chosen.values()) == {'second'}
    assert outcome.pooled == 0.0


def test_what_lies_apart_is_recognised() -> None:
    rng = np.random.default_rng(0)
    surfaces = np.tile(['rough', 'smooth', 'wavy'], 8)
    values = rng.normal(size=(24, 2)) + 20.0 * np.unique(surfaces, return_inverse=True)[1][:, None]
    train = np.arange(24) < 18
    right = recognised(
        SvmRbf(), (values[train], surfaces[train], np.arange(18)), (values[~train], np.r_[surfaces[18:23], ['other']])
    )
    np.testing.assert_array_equal(right, [True] * 5 + [False])


def test_a_slide_at_twice_the_speed_is_half_as_long_and_its_waves_twice_as_fast() -> None:
    seconds = np.arange(400) / RATE_HZ
    wave = np.sin(2 * np.pi * 5.0 * seconds)[:, None]
    np.testing.assert_allclose(
        at_other_speed(wave, 0.02, 0.04)[20:-20, 0], np.sin(2 * np.pi * 10.0 * seconds[:200])[20:-20], atol=0.01
    )
    assert len(at_other_speed(wave, 0.04, 0.02)) == 800


def test_what_a_turn_does_to_the_load_is_taken_out_and_the_rest_stays() -> None:
    rng = np.random.default_rng(0)
    turn, texture = np.eye(4)[0], np.eye(4)[1]
    starts = rng.normal(size=(30, 1)) * texture
    steady = starts + rng.uniform(0.5, 1.0, (30, 1)) * turn
    free = NuisanceProjection.fit(starts, steady)
    np.testing.assert_allclose(free(steady), starts, atol=1e-12)
    np.testing.assert_array_equal(NuisanceProjection.fit(starts, steady, energy=0.0)(steady), steady)
