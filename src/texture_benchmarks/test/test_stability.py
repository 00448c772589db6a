# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The predicted stability limit against a running controller on a finely integrated spring."""

import math

import numpy as np
import pytest

from texture_exploration.force_control import ForceController, ForceLoopParams, stability_limit_gain

CYCLES = 60  # number of delays after which a simulated loop is evaluated
SMALL = 0.1
FINE = 20  # simulation steps per period
PERIOD_S = 0.004


def disturbance_decays(gain_m_s_n: float, stiffness_n_m: float, delay_s: float, integral_s: float = 0.5) -> bool:
    """Run the controller on a spring, finely integrated, after a jolt of 1 N; return whether the swinging shrinks."""
    running = ForceController(gain_m_s_n, integral_s)
    fine_s = PERIOD_S / FINE
    late = round(delay_s / fine_s)
    periods = math.ceil(CYCLES * (delay_s + PERIOD_S) / PERIOD_S)
    error, peaks = 1.0, np.empty(periods)
    velocities = np.zeros(late + FINE * periods)
    for period in range(periods):
        now = FINE * period
        velocities[late + now : late + now + FINE] = running.update(error, PERIOD_S)
        error += stiffness_n_m * fine_s * float(velocities[now : now + FINE].sum())
        peaks[period] = abs(error)
        if peaks[period] > 1e6:
            return False
    third = periods // 3
    # The integral part may leave a small slow rest that still rises; a swinging that grows began with 1.
    return bool(peaks[-third:].max() < max(SMALL, peaks[third : 2 * third].max()))


@pytest.mark.parametrize('stiffness_n_m', [100.0, 1e3, 1e4, 1e5])
@pytest.mark.parametrize('delay_s', [0.0, 0.003, 0.008, 0.0133, 0.02])
def test_predicted_and_simulated_limits_agree_within_a_tenth(stiffness_n_m, delay_s):
    limit = stability_limit_gain(stiffness_n_m, delay_s, PERIOD_S)
    assert disturbance_decays(0.9 * limit, stiffness_n_m, delay_s)
    assert not disturbance_decays(1.1 * limit, stiffness_n_m, delay_s)


@pytest.mark.parametrize('stiffness_n_m', [100.0, 1e3, 1e4, 1e5])
@pytest.mark.parametrize('delay_s', [0.0, 0.005, 0.02, 0.1])
def test_the_gain_is_stable_with_twice_the_stiffness_or_twice_the_delay_that_was_declared(stiffness_n_m, delay_s):
    params = ForceLoopParams(loop_delay_s=delay_s, max_stiffness_n_m=stiffness_n_m)
    gain, integral_s = params.gain_m_s_n(PERIOD_S), params.integral_s(PERIOD_S)
    assert disturbance_decays(gain, 2 * stiffness_n_m, delay_s, integral_s)
    assert disturbance_decays(gain, stiffness_n_m, 2 * delay_s, integral_s)
