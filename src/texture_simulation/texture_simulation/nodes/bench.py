"""The node of the emulated bench."""

from __future__ import annotations

import dataclasses
from typing import Any

from rclpy.node import Node

from texture_core.errors import InvalidParameter, UnknownName
from texture_core.ros.diagnostics import Diagnostics
from texture_core.ros.parameters import declare, on_change
from texture_core.ros.run import run
from texture_simulation.bench import Bench, BenchParams

# What an operator of a real bench can do while it runs: swap the sample, pull the plug, spoil the line.
LIVE = ('surface', 'plugged', 'bit_flips')


class BenchNode(Node):
    """Hold the bench, and let its operator swap the sample by setting `surface`, or pull the sensor's plug."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('bench', **kwargs)
        self._params = declare(self, BenchParams, changeable=True)
        self._bench = Bench(self._params)
        self._bench.start()
        on_change(self, BenchParams, self._change)
        self._diagnostics = Diagnostics(self, self._report, hardware_id=self._params.tsf85_link)
        self.get_logger().info(
            f"'{self._params.surface}' lies under the finger; {self._params.sensor} at {self._params.tsf85_link}, "
            f'finger states at UDP port {self._bench.finger_port}'
        )

    def shutdown(self) -> None:
        """Stop the bench and remove its devices."""
        self._bench.stop()

    def _change(self, params: BenchParams) -> None:
        if dataclasses.replace(params, **{name: getattr(self._params, name) for name in LIVE}) != self._params:
            raise InvalidParameter(
                f'only {", ".join(LIVE)} can be changed while the bench runs; start it again for others'
            )
        try:
            self._bench.set_surface(params.surface)
        except UnknownName as error:
            raise InvalidParameter(str(error)) from error
        self._bench.flip_bits(params.bit_flips)
        if params.plugged != self._params.plugged:
            (self._bench.replug if params.plugged else self._bench.unplug)()
        self._params = params

    def _report(self) -> tuple[str, str, dict[str, Any]]:
        if not self._bench.running:
            return 'ERROR', 'the bench has stopped; see its log and start it again', dict(self._bench.counts)
        state = 'streaming' if self._bench.device.streaming else 'waiting for a driver'
        return 'OK', f"{state}; '{self._bench.surface}' lies under the finger", dict(self._bench.counts)


def main() -> None:
    """Run the node."""
    run(BenchNode)
