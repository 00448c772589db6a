"""An emulated LEAP hand as a process of its own, with switches for its faults.

Run as `python -m texture_benchmarks.endurance.emulated_hand LINK FINGER_PORT`. Each line on its standard input is a
command, each answer a line of JSON:

| command | what it does |
|---|---|
| `overload MOTOR` | the motor detects an overload and latches it |
| `unplug`, `plug` | the cable of the bus |
| `stiffness N_PER_M` | of fingertip and object; 0: the object is gone |
| `torque` | answers the motors that have torque |

It ends with its standard input.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from texture_core.errors import DeviceError
from texture_simulation.devices.dynamixel import EmulatedDynamixelBus
from texture_simulation.devices.dynamixel_motors import LEAP_FINGERS, OVERLOAD, TORQUE, leap_hand

OBSERVED_FINGER = 'index'
STIFFNESS_N_M = 2000.0


class EmulatedHandProcess:
    """The hand from `with` to the end of the block; `ask` sends a command and returns the answer."""

    def __init__(self, link: Path, finger_port: int) -> None:
        self.link = link
        self._command = [sys.executable, '-m', __name__, str(link), str(finger_port)]
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> EmulatedHandProcess:
        self._process = subprocess.Popen(self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._answer()
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()

    def ask(self, command: str) -> Any:
        """Send a command and return the answer."""
        assert self._process is not None and self._process.stdin is not None
        self._process.stdin.write(command + '\n')
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> Any:
        assert self._process is not None and self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise DeviceError('the emulated hand ended; its output tells why')
        return json.loads(line)


def _obey(bus: EmulatedDynamixelBus, command: str, argument: str) -> Any:
    """Do what a command says and return the answer."""
    motors = bus.motors

    def set_stiffness() -> None:
        motors.stiffness_n_m = float(argument)

    actions: Mapping[str, Callable[[], Any]] = {
        'overload': lambda: motors.fail(int(argument), OVERLOAD),
        'unplug': bus.unplug,
        'plug': bus.plug,
        'stiffness': set_stiffness,
        'torque': lambda: [motor for motor in motors.ids if motors.tables[motor][TORQUE]],
    }
    return actions[command]()


def main() -> None:
    """Answer commands until the standard input ends."""
    link, finger_port = sys.argv[1:]
    finger = LEAP_FINGERS[OBSERVED_FINGER]
    with EmulatedDynamixelBus(Path(link), leap_hand(STIFFNESS_N_M), finger, int(finger_port)) as bus:
        print(json.dumps('ready'), flush=True)
        for line in sys.stdin:
            command, _, argument = line.strip().partition(' ')
            print(json.dumps(_obey(bus, command, argument)), flush=True)


if __name__ == '__main__':
    main()
