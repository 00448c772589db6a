# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The force along the surface, from a force vector and a velocity."""

import math

import numpy as np
import pytest

from texture_core.types import rotation_matrix
from texture_exploration.arms.arm import SLIDING_M_S, ArmState
from texture_exploration.arms.ur import UrArm, UrArmParams, UrReport


def tangential_force_n(force_n, velocity_m_s):
    return ArmState(1, (0.0, 0.0, 0.0), velocity_m_s, force_n[2], along_n=force_n[:2]).tangential_force_n


@pytest.mark.parametrize('turned_rad', [0.0, 0.7, 2.0, math.pi, -1.3])
def test_coulomb_friction_is_its_coefficient_times_the_normal_force_whichever_way_the_finger_goes(turned_rad):
    along = math.cos(turned_rad), math.sin(turned_rad)
    force = (-0.3 * 2.0 * along[0], -0.3 * 2.0 * along[1], 2.0)
    assert tangential_force_n(force, (0.05 * along[0], 0.05 * along[1], 0.01)) == pytest.approx(0.6)


CASES = [
    ((0.0, 1.5, 2.0), 0.05, 0.0),  # across the direction of travel
    ((0.5, 0.0, 2.0), 0.05, -0.5),  # it pushes the finger onwards
    *[((-0.6, 0.0, 2.0), speed_m_s, math.nan) for speed_m_s in (0.0, 0.9 * SLIDING_M_S, math.nan)],  # it does not slide
]


@pytest.mark.parametrize(('force_n', 'speed_m_s', 'expected'), CASES)
def test_a_force_across_is_none_one_onwards_negative_and_that_of_a_resting_finger_unknown(force_n, speed_m_s, expected):
    assert tangential_force_n(force_n, (speed_m_s, 0.0, 0.5)) == pytest.approx(expected, nan_ok=True)


class Link:
    """A worker that said once what the controller measured."""

    def __init__(self, report):
        self.report = report

    def check(self):
        """Live."""


def test_the_ur_arm_reports_it_in_the_frame_of_a_tilted_surface(monkeypatch):
    axes = rotation_matrix((0.2, -0.4, 0.0))
    velocity, force = axes @ np.array([0.03, 0.04, 0.0]), axes @ np.array([-0.36, -0.48, 2.0])  # 0.3 of 2 N
    report = UrReport(1, (0.4, 0.0, 0.1), tuple(velocity), tuple(force), 0.1, 1, True, True)
    arm = UrArm(UrArmParams(surface_rx_rad=0.2, surface_ry_rad=-0.4))
    monkeypatch.setattr(arm, '_link', Link(report))
    state = arm.state()
    assert (state.force_n, state.tangential_force_n) == pytest.approx((2.0, 0.6))
