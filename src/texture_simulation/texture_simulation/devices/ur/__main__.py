"""Run the emulated controller, as in `python -m texture_simulation.devices.ur --ip 127.0.0.2`."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Sequence

import numpy as np

from texture_core.errors import TextureError
from texture_core.parameters import from_mapping, parameters_of
from texture_simulation.devices.ur.controller import EmulatedController
from texture_simulation.devices.ur.params import UrControllerParams
from texture_simulation.devices.ur.server import Server


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve until SIGINT, SIGTERM or the end of the parent process; 'ready' is printed once the ports are open."""
    signals: list[int] = []
    parent = os.getppid()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _frame: signals.append(number))
    try:
        params = read_params(arguments)
        controller = EmulatedController(params, np.random.default_rng(params.seed))
        server = Server(controller, params.ip, params.finger_port)
    except TextureError as error:
        print(f'emulated UR controller: {error}', file=sys.stderr)
        return 2
    print('ready', flush=True)
    server.run(lambda: bool(signals) or os.getppid() != parent)
    server.close()
    return 0


def read_params(arguments: Sequence[str] | None) -> UrControllerParams:
    """Return the parameters from the command line: each has an option of its own."""
    parser = argparse.ArgumentParser(prog='python -m texture_simulation.devices.ur', description=__doc__)
    for item in parameters_of(UrControllerParams):
        option = '--' + item.name.replace('_', '-')
        text = f'{item.description} {item.range_text} (default {item.default})'.replace('%', '%%')
        parser.add_argument(option, type=item.type, default=item.default, help=text)
    return from_mapping(UrControllerParams, vars(parser.parse_args(arguments)))


if __name__ == '__main__':
    sys.exit(main())
