"""Emulated rails in a process of their own; see `texture_benchmarks.endurance.emulated_process`.

| command | what it does |
|---|---|
| `unplug`, `plug` | the cable |
| `silent 1`, `silent 0` | the rails send no states, and go on obeying |
| `block 1`, `block 0` | something is in the way: the encoders do not follow the motors |
| `drop M` | the surface lies so much lower |
"""

from __future__ import annotations

import sys
from pathlib import Path

from texture_benchmarks.endurance.emulated_process import serve
from texture_simulation.devices.rails import EmulatedRails
from texture_simulation.devices.rails_firmware import RailsMachine

FREE, BLOCKED = RailsMachine(), RailsMachine(stalled=True)


def main() -> None:
    """Answer commands until the standard input ends."""
    link, finger_port = sys.argv[1:]
    with EmulatedRails(Path(link), FREE, finger_port=int(finger_port)) as rails:
        firmware = rails.firmware
        serve(
            {
                'unplug': lambda _: rails.unplug(),
                'plug': lambda _: rails.plug(),
                'silent': lambda silent: setattr(rails, 'silent', silent == '1'),
                'block': lambda blocked: setattr(firmware, 'machine', BLOCKED if blocked == '1' else FREE),
                'drop': lambda drop_m: setattr(firmware, 'surface_m', -float(drop_m)),
            }
        )


if __name__ == '__main__':
    main()
