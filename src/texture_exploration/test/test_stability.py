# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

from texture_exploration.force_control import (
    ForceController,
    LoopModel,
    loop_matrix,
    spectral_radius,
    stability_limit_gain,
)

DELAYS = [0.0, 0.003, 0.008, 0.0133, 0.02]


def test_a_sampled_integrator_without_delay_bears_two_over_stiffness_and_period():
    assert stability_limit_gain(LoopModel(1000.0, 0.0, 0.0, 0.004)) == pytest.approx(2.0 / (1000.0 * 0.004))


def test_a_delay_of_many_periods_bears_half_pi_over_stiffness_and_delay():
    # The hold adds half a period to the delay.
    assert stability_limit_gain(LoopModel(1000.0, 0.0, 0.1, 0.001)) == pytest.approx(
        0.5 * math.pi / (1000.0 * 0.1005), rel=1e-3
    )


def test_a_delay_of_one_period_bears_the_golden_limit():
    # z² − z + g·k·T = 0 leaves the unit circle at g·k·T = 1.
    assert stability_limit_gain(LoopModel(500.0, 0.0, 0.004, 0.004)) == pytest.approx(1.0 / (500.0 * 0.004))


@pytest.mark.parametrize('delay', DELAYS)
def test_the_matrix_predicts_the_running_controller_step_by_step(delay):
    loop = LoopModel(2000.0, 0.01, delay, 0.004, 0.5)
    matrix, running = loop_matrix(loop), ForceController(loop.gain_m_s_n, loop.integral_s)
    state = np.zeros(len(matrix))
    state[:2] = 1.0, loop.period_s
    asked, error, predicted, measured = [0.0] * 10, 1.0, [], []
    for _ in range(20):
        asked.append(running.update(error, loop.period_s))
        fraction, whole = math.modf(round(delay / loop.period_s, 9))
        newer, older = asked[-1 - int(whole)], asked[-2 - int(whole)]
        error += loop.stiffness_n_m * loop.period_s * ((1 - fraction) * newer + fraction * older)
        state = matrix @ state
        measured.append(error)
        predicted.append(state[0])
    assert predicted == pytest.approx(measured, abs=1e-9)


def test_the_integral_part_costs_stability():
    plain, integral = LoopModel(1000.0, 0.0, 0.01, 0.004), LoopModel(1000.0, 0.0, 0.01, 0.004, 0.05)
    assert stability_limit_gain(integral) < stability_limit_gain(plain)


def test_at_half_the_limit_a_disturbance_dies_out_quickly():
    loop = LoopModel(1000.0, 0.0, 0.01, 0.004, 0.5)
    half = LoopModel(1000.0, 0.5 * stability_limit_gain(loop), 0.01, 0.004, 0.5)
    assert spectral_radius(half) < 1.0
