# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The node that runs the emulated rails, so that a launch file can."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.node import Node

from texture_core.config import param
from texture_core.ros import DiagnosticReport, Diagnostics, declare, run
from texture_core.types import DEVICES
from texture_simulation.devices.rails import EmulatedRails, FingerPipeParams, RailsMachine


@dataclass(frozen=True)
class RailsLinkParams(FingerPipeParams):
    """The device path of the rails, and the receiver of the finger state."""

    link: str = param(
        f'{DEVICES}/rails', 'Path of the symbolic link to the emulated rails, which is the device path of the arm.'
    )


class RailsNode(Node):
    """Keep the emulated rails for as long as the node lives."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('rails', **kwargs)
        params = declare(self, RailsLinkParams)
        machine = declare(self, RailsMachine)
        self._rails = EmulatedRails(Path(params.link).expanduser(), machine, finger_pipe=params.finger_pipe)
        self._rails.__enter__()
        Diagnostics(self, self._report, hardware_id=params.link)
        self.get_logger().info(f'emulated rails are at {params.link}')

    def shutdown(self) -> None:
        """Unplug them."""
        self._rails.__exit__()

    def _report(self) -> DiagnosticReport:
        firmware = self._rails.firmware
        numbers = {'watchdog stops': firmware.watchdog_stops, 'bad frames': firmware.bad_frames}
        if not self._rails.running:
            return 'ERROR', 'the emulated rails ended; see the log and start the node again', numbers
        return 'OK', 'the emulated rails run', numbers


def main() -> None:
    """Run the node."""
    run(RailsNode)
