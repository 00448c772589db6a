"""The rails of a PVDF finger on a pseudo-terminal."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from texture_core.finger_state import FingerState
from texture_simulation.devices.faults import ByteFaults
from texture_simulation.devices.rails_firmware import RailsFirmware, RailsMachine
from texture_simulation.devices.serial_robot import EmulatedSerialRobot

STEP_S = 0.0025
STATE_STEPS = 4  # a state every 10 ms
MAX_STEPS = 40  # in one go, after the machine was busy


class EmulatedRails(EmulatedSerialRobot):
    """The rails on their line.

    Parameters
    ----------
    link, finger_port
        See `EmulatedSerialRobot`.
    machine
        The mechanics.
    rng
        Randomness of the faults.
    """

    def __init__(
        self,
        link: Path,
        machine: RailsMachine | None = None,
        rng: np.random.Generator | None = None,
        finger_port: int = 0,
    ) -> None:
        super().__init__(link, finger_port)
        self.faults = ByteFaults()
        self.firmware = RailsFirmware(machine or RailsMachine())
        self.silent = False
        self._rng = rng or np.random.default_rng(0)
        self._steps = 0

    def run(self) -> None:
        """Follow the orders that come, and send states."""
        due_s = time.monotonic()
        while not self.closing.wait(STEP_S):
            passed = int((time.monotonic() - due_s) / STEP_S)
            due_s += passed * STEP_S
            with self.port_lock:
                self.firmware.receive(self.port.read())
                for _ in range(min(passed, MAX_STEPS)):
                    self._step()

    def _step(self) -> None:
        self.firmware.advance(STEP_S)
        self._steps += 1
        if self._steps % STATE_STEPS:
            return
        state = self.firmware.state()
        if not self.silent:
            self.port.write(self.faults.apply(state, self._rng))
        x, y, z = self.firmware.position.tolist()
        vx, vy, vz = self.firmware.velocity.tolist()
        height, force = z - self.firmware.surface_m, self.firmware.force_n
        self.emulator.send(FingerState(time.monotonic_ns(), x, y, height, vx, vy, vz, force))


def main() -> None:
    """Run the emulated rails until Ctrl-C, as in `python -m texture_simulation.devices.rails /tmp/texture/rails`."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument('link', type=Path, nargs='?', default=Path('/tmp/texture/rails'), help='device path to make')
    parser.add_argument('--finger-port', type=int, default=0, help='UDP port of the emulator; 0: none')
    options = parser.parse_args()
    EmulatedRails(options.link, finger_port=options.finger_port).serve_forever()


if __name__ == '__main__':
    main()
