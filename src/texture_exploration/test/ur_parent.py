# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Slide with a UR arm until killed: python ur_parent.py IP. Prints the number of the worker process once it slides."""

from __future__ import annotations

import sys
import time

from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.ur import UrArm, UrArmParams

arm = UrArm(UrArmParams(ip=sys.argv[1]))
arm.connect()
reported = False
while True:
    arm.command(ArmCommand(tangential_m_s=(0.02, 0.0)))
    if not reported and arm.state().velocity[0] > 0.01:
        reported = True
        print(arm._link.process.pid, flush=True)
    time.sleep(0.02)
