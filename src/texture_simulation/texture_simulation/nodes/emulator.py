# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The node of the emulator."""

from __future__ import annotations

import dataclasses
from typing import Any

from rclpy.node import Node

from texture_core.errors import InvalidParameter, UnknownName
from texture_core.ros import Diagnostics, declare, on_change, run
from texture_simulation.emulator import Emulator, EmulatorParams

# What an operator can do at run time: swap the sample, unplug the sensor, disturb the line.
CHANGEABLE = ('surface', 'plugged', 'unplugged_finger', 'bit_flips')


class EmulatorNode(Node):
    """Run the emulator, and let its operator swap the sample by setting `surface`, or unplug the sensor."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('emulator', **kwargs)
        self._params = declare(self, EmulatorParams, changeable=True)
        self._emulator = Emulator(self._params)
        self._emulator.start()
        on_change(self, EmulatorParams, self._change)
        self._diagnostics = Diagnostics(self, self._report, hardware_id=self._params.sensor_link)
        self.get_logger().info(
            f"'{self._params.surface}' lies under the finger; {self._params.sensor} at {self._params.sensor_link}, "
            f'finger states at {self._params.finger_pipe}'
        )

    def shutdown(self) -> None:
        """Stop the emulator and remove its devices."""
        self._emulator.stop()

    def _change(self, params: EmulatorParams) -> None:
        if dataclasses.replace(params, **{name: getattr(self._params, name) for name in CHANGEABLE}) != self._params:
            raise InvalidParameter(
                f'only {", ".join(CHANGEABLE)} can be changed while the emulator runs; start it again for others'
            )
        try:
            self._emulator.set_surface(params.surface)
        except UnknownName as error:
            raise InvalidParameter(str(error)) from error
        self._emulator.flip_bits(params.bit_flips)
        self._emulator.unplug_finger(params.unplugged_finger)
        if params.plugged != self._params.plugged:
            (self._emulator.replug if params.plugged else self._emulator.unplug)()
        self._params = params

    def _report(self) -> tuple[str, str, dict[str, Any]]:
        if not self._emulator.running:
            return 'ERROR', 'the emulator has stopped; see its log and start it again', dict(self._emulator.counts)
        state = 'streaming' if self._emulator.device.streaming else 'waiting for a driver'
        return 'OK', f"{state}; '{self._emulator.surface}' lies under the finger", dict(self._emulator.counts)


def main() -> None:
    """Run the node."""
    run(EmulatorNode)
