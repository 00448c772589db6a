# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The node that runs the emulated UR controller, so that a launch file can."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node

from texture_core.ros import DiagnosticReport, Diagnostics, declare, run
from texture_simulation.devices.ur import ControllerProcess, UrControllerParams


class UrControllerNode(Node):
    """Keep the emulated controller, a separate process, for as long as the node lives."""

    shares_file = True  # of the explorer, which defines where the surface is

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('ur_controller', **kwargs)
        params = declare(self, UrControllerParams)
        self._controller = ControllerProcess(params)
        self._controller.start()
        Diagnostics(self, self._report, hardware_id=params.ip)
        self.get_logger().info(f'an emulated UR controller {params.version} listens on {params.ip}')

    def shutdown(self) -> None:
        """End the process."""
        self._controller.stop()

    def _report(self) -> DiagnosticReport:
        if not self._controller.running:
            return 'ERROR', 'the emulated controller ended; see its log and start the node again', {}
        return 'OK', 'the emulated controller runs', {}


def main() -> None:
    """Run the node."""
    run(UrControllerNode)
