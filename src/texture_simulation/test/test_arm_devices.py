# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The firmware of the emulated rails, by the bytes of its protocol."""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np
import pytest

from texture_core.framing import Frame, pack, unpack
from texture_simulation.devices.rails import LOCKED, OVERLOAD, RailsFirmware, RailsMachine
from texture_simulation.devices.twist_controller import (
    GRAVITY_M_S2,
    EmulatedTwistArm,
    TouchedSurfaceParams,
    TwistControllerParams,
    touch_force_n,
)

HOLD, MOVING, PRESS = 0, 1, 2
STEP_S = 0.0025


def move(vx=0.0, vy=0.0, mode=HOLD, value=0):
    return pack(Frame(0xA0, 1, 0, 0, 1, 1, struct.pack('<iiBi', round(vx * 1e6), round(vy * 1e6), mode, value)))


def advance(firmware, seconds, keep=b''):
    for _ in range(round(seconds / STEP_S)):
        firmware.receive(keep)
        firmware.advance(STEP_S)


def state(firmware):
    return struct.unpack('<iiiiBH', unpack(firmware.state()[:-1]).body)


def test_pressing_stops_at_the_force_and_locks():
    firmware = RailsFirmware(RailsMachine(start_height_m=0.002))
    press = move(mode=PRESS, value=1500)
    advance(firmware, 3.0, press)
    assert firmware.force_n == pytest.approx(1.5, rel=0.02)
    assert state(firmware)[4] & LOCKED
    firmware.surface_m = 0.0001  # a locked motor does not give way
    advance(firmware, 0.5, press)
    assert firmware.force_n == pytest.approx(1.7, rel=0.03)
    assert firmware.velocity[2] == 0.0


def test_silence_of_150_ms_stops_everything():
    firmware = RailsFirmware(RailsMachine())
    firmware.receive(move(0.02))
    advance(firmware, 0.14)
    assert firmware.velocity[0] == pytest.approx(0.02)
    advance(firmware, 0.05)
    assert firmware.velocity[0] == 0.0
    assert state(firmware)[5] == 1


def test_the_end_switches_stop_a_rail_and_let_it_back():
    firmware = RailsFirmware(RailsMachine(travel_m=0.01))
    advance(firmware, 1.0, move(0.05, 0.002))
    assert firmware.position[:2] == pytest.approx([0.01, 0.002], abs=1e-4)
    assert state(firmware)[4] & 0b1111 == 0b0010
    advance(firmware, 0.1, move(-0.05))
    assert firmware.position[0] < 0.009
    assert state(firmware)[4] & 0b1111 == 0


def test_an_overload_lifts_the_finger_whatever_is_ordered_until_cleared():
    firmware = RailsFirmware(RailsMachine())
    firmware.surface_m = 0.02
    advance(firmware, 0.1, move(mode=PRESS, value=1000))
    assert state(firmware)[4] & OVERLOAD
    firmware.surface_m = 0.0
    firmware.receive(pack(Frame(0xA2, 1, 0, 0, 1, 1, b'')))
    assert not state(firmware)[4] & OVERLOAD


def test_damaged_orders_are_counted_and_passed_over():
    firmware = RailsFirmware(RailsMachine())
    broken = bytearray(move(0.02))
    broken[5] ^= 0x40  # not to zero, which would make two of one
    firmware.receive(bytes(broken) + move(0.01))
    advance(firmware, 0.1)
    assert firmware.bad_frames == 1
    assert firmware.velocity[0] == pytest.approx(0.01)


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


@pytest.mark.parametrize(
    ('place_m', 'velocity_m_s', 'force_n'),
    [
        ((0.0, 0.0, 1e-9), (0.03, 0.04, 0.0), (0.0, 0.0, 0.0)),
        ((0.0, 0.0, -0.001), (0.0, 0.0, 0.0), (0.0, 0.0, 3.0)),  # stiffness times depth
        ((0.0, 0.0, -0.001), (0.03, 0.04, 0.01), (-0.4 * 3.0 * 0.6, -0.4 * 3.0 * 0.8, 3.0)),  # Coulomb, against the way
        ((0.021, 0.0, 0.01), (0.05, 0.0, 0.0), (-20.0, 0.0, 0.0)),  # 1 mm into a wall of 20 kN/m
    ],
)
def test_plane_friction_and_wall_push_as_their_laws_say(place_m, velocity_m_s, force_n) -> None:
    surface = TouchedSurfaceParams(stiffness_n_m=3000.0, wall_m=0.02)
    turned = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # x to y, y to z, z to x
    for axes in (np.eye(3), turned):
        force = touch_force_n(surface, 0.4, axes, axes @ np.array(place_m), axes @ np.array(velocity_m_s))
        assert axes.T @ force == pytest.approx(force_n, abs=1e-9)
