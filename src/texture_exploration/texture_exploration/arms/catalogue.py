# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""All arms by name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_exploration.arms.arm import Arm
from texture_exploration.arms.in_hand import InHandArm
from texture_exploration.arms.rails import RailsArm
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.simulated import SimulatedArm
from texture_exploration.arms.ur import UrArm

ARMS: Mapping[str, type[Arm]] = {
    'simulated': SimulatedArm,  # kinematic, over an elastic plane; drives the emulator
    'ur': UrArm,  # Universal Robots, through ur-rtde
    'ros_controllers': RosControllersArm,  # any arm that ROS drives: velocities, pose and force over standard topics
    'hand': InHandArm,  # the sliding fingers of a hand, while the others hold
    'rails': RailsArm,  # Hu et al. 2014: two rails and a pressing motor behind a microcontroller
}
