# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from texture_simulation.devices.ur import (
    ContactPlane,
    EmulatedRobot,
    ForceMode,
    LinearMove,
    ServoMove,
    SpeedMove,
    StopMove,
    UrControllerParams,
)

pytestmark = pytest.mark.realtime

STEP_S = 0.002
ORIGIN = np.array([0.4, 0.0, 0.1])
REST = np.zeros(3)


def robot_over(**values):
    return EmulatedRobot(
        UrControllerParams(**{'force_noise_n': 0.0, 'force_offset_n': 0.0, **values}), np.random.default_rng(0)
    )


def run(robot, seconds):
    for _ in range(round(seconds / STEP_S)):
        robot.step(STEP_S)


def pressing(newtons):
    return ForceMode(
        axes=np.eye(3),
        selection=np.array([0, 0, 1, 0, 0, 0]),
        wrench=np.array([0, 0, -newtons, 0, 0, 0.0]),
        limits=np.array([0.1, 0.1, 0.05, 0.3, 0.3, 0.3]),
    )


def place(*in_surface):
    return ORIGIN + np.array(in_surface)


def vector(*values):
    return np.array([*values, *[0.0] * (6 - len(values))])


def test_the_force_is_stiffness_times_depth():
    surface = ContactPlane(UrControllerParams(stiffness_n_m=3000.0))
    assert surface.force_n(place(0, 0, -0.001), REST) == pytest.approx([0, 0, 3.0])
    assert surface.force_n(place(0, 0, 1e-9), REST) == pytest.approx([0, 0, 0])


def test_friction_acts_against_the_movement_with_its_share_of_the_force():
    surface = ContactPlane(UrControllerParams(friction=0.4))
    force = surface.force_n(place(0, 0, -0.001), np.array([0.03, 0.04, 0.0]))
    assert force == pytest.approx([-0.4 * 2.0 * 0.6, -0.4 * 2.0 * 0.8, 2.0])


def test_a_slope_pushes_along_its_normal():
    surface = ContactPlane(UrControllerParams(slope_x=1.0))
    force = surface.force_n(place(0.01, 0.05, 0.009), REST)  # 1 mm below a plane of 45°
    assert force == pytest.approx(2000.0 * 0.001 / np.sqrt(2) * np.array([-1, 0, 1]) / np.sqrt(2))


def test_a_line_takes_the_time_of_its_trapezoid_and_ends_on_the_goal():
    robot = robot_over()
    goal = robot.pose + vector(0.03, 0.04)
    robot.motion = LinearMove(goal, 0.1, 1.0)
    steps = 0
    while not robot.motion.done:
        robot.step(STEP_S)
        steps += 1
    assert steps * STEP_S == pytest.approx(0.05 / 0.1 + 0.1 / 1.0, abs=0.01)
    assert robot.pose == pytest.approx(goal)
    robot.step(STEP_S)
    assert not robot.velocity.any()


def test_a_speed_is_gained_and_lost_with_the_acceleration():
    robot = robot_over()
    robot.motion = SpeedMove(vector(0.1), 0.5)
    run(robot, 0.1)
    assert robot.velocity == pytest.approx(vector(0.05))
    run(robot, 0.2)
    assert robot.velocity == pytest.approx(vector(0.1))
    robot.motion = StopMove(1.0)
    run(robot, 0.05)
    assert robot.velocity == pytest.approx(vector(0.05))
    run(robot, 0.06)
    assert robot.motion.done
    assert not robot.velocity.any()


def test_a_servo_has_gone_63_percent_of_a_jump_after_its_look_ahead_time():
    robot = robot_over()
    start = robot.pose
    robot.motion = ServoMove(start + vector(0.01), 0.1)
    run(robot, 0.1)
    assert robot.pose[0] - start[0] == pytest.approx(0.01 * (1 - np.exp(-1)))


@pytest.mark.parametrize('stiffness', [500.0, 2000.0, 10000.0])
def test_force_control_comes_down_and_reaches_the_wanted_force(stiffness):
    robot = robot_over(stiffness_n_m=stiffness, start_height_m=0.002)
    robot.force_mode = pressing(2.0)
    run(robot, 2.0)
    assert robot.pressing_n == pytest.approx(2.0, rel=0.01)


def test_force_control_acts_along_the_axes_of_its_frame():
    robot = robot_over(start_height_m=0.001)
    mode = pressing(-2.0)
    robot.force_mode = ForceMode(np.diag([1.0, -1.0, -1.0]), mode.selection, mode.wrench, mode.limits)
    run(robot, 2.0)
    assert robot.pressing_n == pytest.approx(2.0, rel=0.01)


def test_force_control_follows_a_slope_while_the_finger_slides():
    robot = robot_over(slope_x=0.1, start_height_m=0.0)
    robot.force_mode = pressing(2.0)
    robot.motion = SpeedMove(vector(0.02), 1.0)
    run(robot, 3.0)
    assert robot.velocity[0] == pytest.approx(0.02)
    assert robot.velocity[2] == pytest.approx(0.1 * 0.02, rel=0.05)
    # A force loop with admittance a lags by v/a behind a surface that rises with v.
    assert robot.force[2] == pytest.approx(2.0 + 0.1 * 0.02 / 0.01, rel=0.05)


def test_a_contact_is_measured_against_its_direction_only():
    robot = robot_over(start_height_m=0.0)
    robot.motion = SpeedMove(vector(0, 0, -0.1), 100.0)
    run(robot, 0.05)
    down, up, any_direction = np.array([0, 0, -1.0]), np.array([0, 0, 1.0]), np.zeros(3)
    assert [robot.touches(direction, 3.0) for direction in (down, up, any_direction)] == [True, False, True]
