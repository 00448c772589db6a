"""All arms by name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_exploration.arms.protocol import ArmClass
from texture_exploration.arms.simulated import SimulatedArm

ARMS: Mapping[str, ArmClass] = {
    'simulated': SimulatedArm,  # kinematic, over an elastic plane; drives the emulated bench
}
