# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The predicted stability limit against a running controller on a finely integrated spring."""

import numpy as np
import pytest

from texture_benchmarks.motion import simulated_stability_limit_gain, stability_chart
from texture_exploration.force_control import LoopModel, stability_limit_gain


def test_predicted_and_simulated_limits_agree_within_a_tenth():
    chart = stability_chart([100.0, 1e3, 1e4, 1e5], [0.0, 0.003, 0.008, 0.0133, 0.02])
    assert chart['predicted'].shape == (4, 5)
    np.testing.assert_allclose(chart['simulated'], chart['predicted'], rtol=0.1)


def test_a_loop_with_an_integral_part_is_predicted_as_well():
    integral = LoopModel(1000.0, 0.0, 0.01, 0.004, 0.05)
    assert simulated_stability_limit_gain(integral) == pytest.approx(stability_limit_gain(integral), rel=0.1)
