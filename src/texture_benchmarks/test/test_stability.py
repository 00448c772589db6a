# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The predicted stability limit against a running controller on a finely integrated spring."""

import math
from dataclasses import replace

import numpy as np
import pytest

from texture_exploration.force_control import ForceController, LoopModel, lowest_unstable_gain, stability_limit_gain

CYCLES = 60  # number of delays after which a simulated loop is evaluated
SMALL = 0.1
FINE = 20  # simulation steps per period


def simulated_stability_limit_gain(loop: LoopModel) -> float:
    """Return the gain from which a running `ForceController` makes a disturbance grow, m/s/N."""
    return lowest_unstable_gain(loop, lambda gain: _disturbance_decays(replace(loop, gain_m_s_n=gain)), bisections=12)


def _disturbance_decays(loop: LoopModel) -> bool:
    """Run the controller on a spring, finely integrated, after a jolt of 1 N; return whether the swinging shrinks."""
    running = ForceController(loop.gain_m_s_n, loop.integral_s)
    fine_s = loop.period_s / FINE
    late = round(loop.delay_s / fine_s)
    periods = math.ceil(CYCLES * (loop.delay_s + loop.period_s) / loop.period_s)
    error, peaks = 1.0, np.empty(periods)
    velocities = np.zeros(late + FINE * periods)
    for period in range(periods):
        now = FINE * period
        velocities[late + now : late + now + FINE] = running.update(error, loop.period_s)
        error += loop.stiffness_n_m * fine_s * float(velocities[now : now + FINE].sum())
        peaks[period] = abs(error)
        if peaks[period] > 1e6:
            return False
    third = periods // 3
    # The integral part may leave a small slow rest that still rises; a swinging that grows began with 1.
    return bool(peaks[-third:].max() < max(SMALL, peaks[third : 2 * third].max()))


@pytest.mark.parametrize('stiffness_n_m', [100.0, 1e3, 1e4, 1e5])
@pytest.mark.parametrize('delay_s', [0.0, 0.003, 0.008, 0.0133, 0.02])
def test_predicted_and_simulated_limits_agree_within_a_tenth(stiffness_n_m, delay_s):
    loop = LoopModel(stiffness_n_m, 0.0, delay_s, 0.004, 0.5)
    assert simulated_stability_limit_gain(loop) == pytest.approx(stability_limit_gain(loop), rel=0.1)


def test_a_loop_with_an_integral_part_is_predicted_as_well():
    integral = LoopModel(1000.0, 0.0, 0.01, 0.004, 0.05)
    assert simulated_stability_limit_gain(integral) == pytest.approx(stability_limit_gain(integral), rel=0.1)
