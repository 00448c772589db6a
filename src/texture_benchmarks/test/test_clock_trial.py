import numpy as np
import pytest

from texture_benchmarks.clock.trial import simulate_clock_errors


@pytest.mark.parametrize('seed', range(3))
def test_stamps_are_right_to_half_a_millisecond_for_ten_minutes_of_jitter_and_drift(seed):
    trial = simulate_clock_errors(np.random.default_rng(seed))
    warm = trial.time_s > 5.0
    assert np.abs(trial.clock_error_s[warm]).max() < 0.5e-3
    assert np.abs(trial.arrival_error_s[warm]).max() > 20e-3
    assert np.abs(trial.nominal_error_s[warm]).max() > 20e-3  # 50 ppm of 600 s are 30 ms, less the first delay
