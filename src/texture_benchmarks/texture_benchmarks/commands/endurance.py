# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture endurance`: explore on an emulated robot while faults are injected, each in turn."""

from __future__ import annotations

import argparse
from pathlib import Path

from texture_benchmarks.ros.soak import soak
from texture_core.cli import add_seed
from texture_core.errors import InvalidParameter


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('--duration', type=float, default=3600.0, metavar='S', help='how long, s (default: an hour)')
    parser.add_argument('--out', type=Path, default=Path('texture-endurance'), metavar='DIR', help='for the report')
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Run, report, and return 1 if something did not hold."""
    if not options.duration > 0:
        raise InvalidParameter(f'--duration is {options.duration:g}; it must be above 0')
    options.out.mkdir(parents=True, exist_ok=True)
    result = soak(options.duration, options.seed, lambda line: print(line, flush=True))
    requirements = result.numbers['requirements']
    for requirement, found in requirements.items():
        print(f'{"holds" if found["holds"] else "FAILS"}: {requirement}: {found["seen"]}')
    print(f'  {result.write(options.out, "endurance", soak.__doc__)}')
    return int(not all(found['holds'] for found in requirements.values()))
