# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

import numpy as np
import pytest

from texture_simulation.devices.twist_controller import GRAVITY_M_S2, EmulatedTwistArm, TwistControllerParams

QUIET = TwistControllerParams(jitter_s=0.0, force_noise_n=0.0, lag_s=0.02)
ALONG = np.array([0.1, 0.0, 0.0])
MS = 1_000_000


def test_a_velocity_comes_into_effect_after_the_lag_and_ends_after_the_timeout() -> None:
    arm = EmulatedTwistArm(replace(QUIET, max_acceleration_m_s2=150.0), 0)
    begin = arm.position[0]
    arm.command(0, ALONG)
    arm.advance(19 * MS)
    assert arm.position[0] == begin
    arm.advance(70 * MS)
    assert arm.position[0] - begin == pytest.approx(0.005, abs=2e-4)
    arm.advance(160 * MS)
    assert not arm.velocity.any()


def test_without_a_timeout_the_last_velocity_holds_for_ever() -> None:
    arm = EmulatedTwistArm(replace(QUIET, command_timeout_s=0.0), 0)
    arm.command(0, ALONG)
    for second in range(1, 60):
        arm.advance(second * 100 * MS)
    assert arm.velocity == pytest.approx(ALONG)


def test_speed_and_acceleration_stay_within_their_limits() -> None:
    arm = EmulatedTwistArm(replace(QUIET, max_speed_m_s=0.05, max_acceleration_m_s2=1.0), 0)
    arm.command(0, ALONG)
    arm.advance(45 * MS)
    assert arm.velocity[0] == pytest.approx(0.025, abs=0.002)
    arm.advance(100 * MS)
    assert arm.velocity[0] == pytest.approx(0.05)


def test_the_sensor_shows_force_weight_and_offset_in_the_frame_of_the_tool() -> None:
    arm = EmulatedTwistArm(QUIET, 0)
    arm.position = arm.position - [0.0, 0.0, QUIET.start_height_m + 0.001]  # 2 N at 2 kN/m
    assert arm.finger().force_n == pytest.approx(2.0)
    weight_n = QUIET.tool_mass_kg * GRAVITY_M_S2
    # The tool looks down: what pushes it up pushes against its z axis.
    assert arm.reading_n()[2] == pytest.approx(-(2.0 - weight_n) + QUIET.force_offset_n)


def test_a_controller_that_is_not_active_moves_nothing() -> None:
    arm = EmulatedTwistArm(replace(QUIET, active=False), 0)
    arm.command(0, ALONG)
    arm.advance(90 * MS)
    assert not arm.velocity.any()
