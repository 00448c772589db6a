# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""All arms by name; `texture list arms` shows the first sentence of each."""

from __future__ import annotations

from collections.abc import Mapping

from texture_exploration.arms.arm import Arm
from texture_exploration.arms.in_hand import InHandArm
from texture_exploration.arms.rails import RailsArm
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.simulated import SimulatedArm
from texture_exploration.arms.ur import UrArm

ARMS: Mapping[str, type[Arm]] = {
    'simulated': SimulatedArm,
    'ur': UrArm,
    'ros_controllers': RosControllersArm,
    'hand': InHandArm,
    'rails': RailsArm,
}
