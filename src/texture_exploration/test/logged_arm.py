# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""An arm behind emulated topics, for an explorer in a separate process: `arm:=logged_arm:LoggedArm`.

When it is released, the height of the finger, and whether rest was commanded last, are written to the file LOGGED_ARM.
"""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np

from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.tool_state import ForceSample, PoseSample, RosControllersParams
from texture_simulation.devices.twist_controller import TOOL_DOWN, EmulatedTwistArm, TwistControllerParams


class LoggedTopics:
    """Topics of an emulated arm."""

    def __init__(self, _params: RosControllersParams) -> None:
        self._arm = EmulatedTwistArm(TwistControllerParams(start_height_m=0.003), time.monotonic_ns())
        self._log = Path(os.environ['LOGGED_ARM'])
        self._velocity = (0.0, 0.0, 0.0)

    def newest_pose(self):
        now_ns = time.monotonic_ns()
        self._arm.advance(now_ns)
        return PoseSample(now_ns, 'base', tuple(self._arm.position.tolist()), TOOL_DOWN)

    def newest_force(self):
        return ForceSample(time.monotonic_ns(), 'tool0_controller', tuple(self._arm.reading_n().tolist()))

    def unsafe(self):
        return ''

    def beat(self, *, moving):
        pass

    def listeners(self):
        return 1

    def send_velocity(self, velocity_m_s):
        self._velocity = velocity_m_s
        self._arm.command(time.monotonic_ns(), np.array(velocity_m_s))

    def close(self):
        end = {'at_rest': not any(self._velocity), 'height_m': self._arm.finger().z_m}
        self._log.write_text(json.dumps(end))


class LoggedArm(RosControllersArm):
    """See the module."""

    def __init__(self, params: RosControllersParams) -> None:
        super().__init__(params, open_topics=LoggedTopics)
