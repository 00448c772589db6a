"""Where a finger sets off, from waves whose pitch and size follow the speed exactly."""

import numpy as np
import pytest

from texture_features.segmentation import OnsetModel

RATE_HZ, RAMP_S, SETS_OFF_S, LENGTH_S = 1000.0, 0.2, 0.3, 1.2
RANGE_S = (0.1, 0.55)
KNOWN = np.ones(round(LENGTH_S * RATE_HZ), dtype=bool)


def sliding(lines_hz, power_of_speed, rng, noise=0.05, rate_hz=RATE_HZ):
    """Return noise, then waves: at half the speed each has half the pitch, and an amplitude as the speed to a power."""
    times = np.arange(0.0, LENGTH_S, 1.0 / rate_hz)
    speed = np.clip((times - SETS_OFF_S) / RAMP_S, 0.0, 1.0)
    way_s = np.cumsum(speed) / rate_hz
    phases = rng.uniform(0, 2 * np.pi, len(lines_hz))
    waves = np.sin(2 * np.pi * way_s[:, None] * lines_hz + phases).sum(axis=1)
    moves = (speed > 0) * speed**power_of_speed
    return (moves * waves + noise * rng.normal(size=times.shape))[:, None]


def found(fast, quantity, rate_hz=RATE_HZ, noise=0.05):
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
    model = OnsetModel(RATE_HZ, np.array([0.05**2]), RAMP_S, 'force', 0.05)
    assert model.find(knocked, known, fast[600:1100], RANGE_S) == pytest.approx(plain, abs=0.01)


@pytest.mark.parametrize(
    ('known', 'steady'), [(~KNOWN, 500), (KNOWN[:20], 500), (KNOWN, 3), (KNOWN, 0)], ids=['none', 'few', '3', 'empty']
)
def test_where_nothing_is_known_it_is_the_middle_of_the_range(known, steady):
    fast = np.random.default_rng(0).normal(size=(len(known), 1))
    model = OnsetModel(RATE_HZ, np.ones(1), RAMP_S, 'either', 0.05)
    assert model.find(fast, known, np.ones((steady, 1)), RANGE_S) == pytest.approx(np.mean(RANGE_S), abs=0.003)


def test_no_ramp_is_a_step_in_speed():
    rng = np.random.default_rng(0)
    fast = np.concatenate([0.1 * rng.normal(size=(300, 1)), rng.normal(size=(900, 1))])
    model = OnsetModel(RATE_HZ, np.array([0.01]), 0.0, 'force', 0.05)
    assert model.find(fast, KNOWN, fast[600:1100], RANGE_S) == pytest.approx(SETS_OFF_S, abs=0.01)
