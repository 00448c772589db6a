"""An emulated LEAP hand in a process of its own; see `texture_benchmarks.endurance.emulated_process`.

| command | what it does |
|---|---|
| `overload MOTOR` | the motor detects an overload and latches it |
| `unplug`, `plug` | the cable of the bus |
| `stiffness N_PER_M` | of fingertip and object; 0: the object is gone |
| `torque` | answers the motors that have torque |
"""

from __future__ import annotations

import sys
from pathlib import Path

from texture_benchmarks.endurance.emulated_process import serve
from texture_simulation.devices.dynamixel import EmulatedDynamixelBus
from texture_simulation.devices.dynamixel_motors import LEAP_FINGERS, OVERLOAD, TORQUE, leap_hand

OBSERVED_FINGER = 'index'
STIFFNESS_N_M = 2000.0


def main() -> None:
    """Answer commands until the standard input ends."""
    link, finger_port = sys.argv[1:]
    finger = LEAP_FINGERS[OBSERVED_FINGER]
    with EmulatedDynamixelBus(Path(link), leap_hand(STIFFNESS_N_M), finger, int(finger_port)) as bus:
        motors = bus.motors
        serve(
            {
                'overload': lambda motor: motors.fail(int(motor), OVERLOAD),
                'unplug': lambda _: bus.unplug(),
                'plug': lambda _: bus.plug(),
                'stiffness': lambda stiffness: setattr(motors, 'stiffness_n_m', float(stiffness)),
                'torque': lambda _: [motor for motor in motors.ids if motors.tables[motor][TORQUE]],
            }
        )


if __name__ == '__main__':
    main()
