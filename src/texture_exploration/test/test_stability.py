# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from texture_exploration.force_control import spectral_radius, stability_limit_gain

LIMITS = [
    (1000.0, 0.0, 0.004, 2.0 / (1000.0 * 0.004)),  # a sampled integrator without delay: 2 / (k·T)
    (500.0, 0.004, 0.004, 1.0 / (500.0 * 0.004)),  # one period: z² − z + g·k·T leaves the unit circle at g·k·T = 1
    (1000.0, 0.1, 0.001, 0.5 * math.pi / (1000.0 * 0.1005)),  # many periods: π/2; the hold adds half a period
]


@pytest.mark.parametrize(('stiffness_n_m', 'delay_s', 'period_s', 'gain_m_s_n'), LIMITS)
def test_the_stability_limit_is_that_of_the_textbook(stiffness_n_m, delay_s, period_s, gain_m_s_n):
    limit = stability_limit_gain(stiffness_n_m, delay_s, period_s)
    assert limit == pytest.approx(gain_m_s_n, rel=1e-3)
    assert spectral_radius(0.5 * limit, stiffness_n_m, delay_s, period_s) < 1.0
