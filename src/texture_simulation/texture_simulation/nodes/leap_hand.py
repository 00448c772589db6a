# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The node that runs an emulated LEAP hand, so that a launch file can."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.node import Node

from texture_core.config import param
from texture_core.ros import DiagnosticReport, Diagnostics, declare, run
from texture_core.types import DEVICES
from texture_simulation.devices.dynamixel import LEAP_FINGERS, EmulatedDynamixelBus, leap_hand
from texture_simulation.devices.rails import FingerPipeParams


@dataclass(frozen=True)
class LeapHandParams(FingerPipeParams):
    """Where the motors are reached, what they hold, and which finger senses it."""

    link: str = param(
        f'{DEVICES}/dynamixel', 'Path of the symbolic link to the emulated hand, which is the device path of the arm.'
    )
    finger: str = param('index', 'Finger that carries the tactile sensor.', choices=tuple(LEAP_FINGERS))


class LeapHandNode(Node):
    """Keep the emulated hand for as long as the node lives."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('leap_hand', **kwargs)
        params = declare(self, LeapHandParams)
        link, finger = Path(params.link).expanduser(), LEAP_FINGERS[params.finger]
        self._bus = EmulatedDynamixelBus(link, leap_hand(), finger, params.finger_pipe)
        self._bus.__enter__()
        Diagnostics(self, self._report, hardware_id=params.link)
        self.get_logger().info(f'an emulated LEAP hand is at {params.link}; its {params.finger} finger senses')

    def shutdown(self) -> None:
        """Unplug it."""
        self._bus.__exit__()

    def _report(self) -> DiagnosticReport:
        if not self._bus.running:
            return 'ERROR', 'the emulated hand ended; see the log and start the node again', {}
        return 'OK', 'the emulated hand runs', {}


def main() -> None:
    """Run the node."""
    run(LeapHandNode)
