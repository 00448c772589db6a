# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A surface that is declared upside down: to rise is to press, and the force sensor is not zeroed yet."""

import math

import pytest

from texture_core.errors import MotionAborted
from texture_core.types import ExplorationRequest
from texture_exploration.arms.arm import ArmState
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import LiftStage
from texture_exploration.touch import TouchParams

SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.02, force_n=5.0, distance_m=0.03)


# The whole range is swept by the benchmark of motions.
@pytest.mark.parametrize(
    ('stiffness_n_m', 'gap_m', 'zero_rise_m'),
    [
        (500.0, 0.001, 0.003),
        (500.0, 0.006, 0.01),
        (500.0, 0.012, 0.003),
        (1000.0, 0.003, 0.01),
        (1000.0, 0.008, 0.003),
        (2000.0, 0.001, 0.01),
        (2000.0, 0.006, 0.003),
        (2000.0, 0.012, 0.01),
    ],
)
def test_a_finger_that_rises_into_the_surface_stops_at_a_small_force(make_robot, stiffness_n_m, gap_m, zero_rise_m):
    robot = make_robot(
        {'stiffness_n_m': stiffness_n_m, 'start_height_m': gap_m},
        surface_rx_rad=math.pi,
        max_stiffness_n_m=20000.0,
    )
    robot.arm._tool.zero.air._rise_m = zero_rise_m
    outcome = robot.explore(SLIDE)
    assert not outcome.success
    assert max(robot.pressed_n) < 2.0


@pytest.mark.parametrize('stiffness_n_m', [200.0, 500.0, 2000.0])
def test_a_finger_that_was_left_pressed_is_lifted_however_soft_the_surface(make_robot, stiffness_n_m):
    robot = make_robot({'stiffness_n_m': stiffness_n_m, 'start_height_m': 0.0})
    press(robot, 4.0 / stiffness_n_m)
    outcome = robot.explore(SLIDE)
    assert 'met something' not in outcome.message and 'changed by more' not in outcome.message
    assert outcome.lifted


def press(robot, depth_m):
    """Put the finger below the surface, at rest."""
    robot.machine.position = robot.machine.position - depth_m * robot.machine._axes[:, 2]
    robot.pass_time(0.2)


def test_a_second_rise_counts_the_force_from_the_first(make_robot):
    """Pressed upside down by 2 N, stopped as it rises."""
    robot = make_robot({'stiffness_n_m': 2000.0, 'start_height_m': 0.0}, surface_rx_rad=math.pi)
    press(robot, 0.001)
    robot.explore(SLIDE, lambda state: robot.exploration.stop('enough') if len(robot.phases) > 60 else None)
    assert 3.0 < max(robot.pressed_n) < 10.0


def rise(heights_m, force_n):
    """Lift through heights with a force of each; return the height at which the lift aborts, NaN if it does not."""
    stage = LiftStage((0.0, 0.0, 0.02), 3.0, TouchParams(), SafetyLimits(tangential_floor_n=1.0))
    for number, height_m in enumerate(heights_m):
        arm = ArmState(1 + number * 10_000_000, (0.0, 0.0, height_m), (0.0, 0.0, 0.005), force_n(height_m))
        if not number:
            stage.begin(arm.time_ns, arm)
        try:
            stage.step(arm.time_ns, arm)
        except MotionAborted:
            return height_m
    return math.nan


HEIGHTS_M = [0.0001 * step for step in range(150)]


@pytest.mark.parametrize(
    ('force_n', 'aborts_at_m'),
    [
        (lambda height_m: 2.0 + 1000.0 * height_m, 0.0011),  # beyond 1 N of growth, the floor along the surface
        (
            lambda height_m: 2.0 + 20_000.0 * height_m,
            0.0006,
        ),  # not before half a millimetre: a late arm still comes down
        (lambda height_m: 2.0 + 400.0 * height_m, math.nan),  # 0.8 N in each 2 mm is drift
        (lambda height_m: 2.0 - 1000.0 * height_m if height_m < 0.001 else 9.0, math.nan),  # the fall proved the normal
        (lambda height_m: 1.85 + 1000.0 * height_m if height_m else 2.0, 0.0012),  # 0.05 N less proves nothing
    ],
)
def test_a_lift_ends_where_the_force_has_grown_by_a_newton(force_n, aborts_at_m):
    assert rise(HEIGHTS_M, force_n) == pytest.approx(aborts_at_m, nan_ok=True)


@pytest.mark.parametrize(('force_n', 'free'), [(0.19, True), (0.21, False), (-0.21, False)])
def test_a_finger_is_free_below_the_force_of_contact(force_n, free):
    stage = LiftStage((0.0, 0.0, 0.02), 3.0, TouchParams(contact_force_n=0.2), SafetyLimits())
    stage.see(ArmState(1, (0.0, 0.0, 0.02), (0.0, 0.0, 0.0), force_n))
    assert stage.free is free


def test_a_lift_goes_no_faster_than_5_mm_s_until_the_force_of_a_light_touch_has_fallen():
    stage = LiftStage((0.0, 0.0, 0.02), 0.01, TouchParams(contact_force_n=0.2), SafetyLimits())
    arm = ArmState(1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0)
    stage.begin(1, arm)
    assert stage.step(1, arm).normal_m_s == 0.005
    assert stage.step(2, ArmState(2, (0.0, 0.0, 0.0001), (0.0, 0.0, 0.0), 0.7)).normal_m_s == 0.05
