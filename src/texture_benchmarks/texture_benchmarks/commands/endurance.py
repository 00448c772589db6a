# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture endurance`: explore on emulated devices for hours while faults are injected at random."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from texture_benchmarks.ros.soak import SoakPlan, endure, endure_hazards
from texture_benchmarks.soak import check_hazards, check_requirements, write, write_hazards
from texture_core.cli import add_seed
from texture_core.errors import InvalidParameter


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('--duration', type=float, default=3600.0, metavar='S', help='how long, s (default: an hour)')
    parser.add_argument('--quiet', type=float, default=20.0, metavar='S', help='mean time between two faults, s')
    parser.add_argument('--model', type=Path, help='trained model; one of simulated slides is trained if not given')
    parser.add_argument('--out', type=Path, default=Path('texture-endurance'), metavar='DIR', help='for the report')
    parser.add_argument(
        '--hazards', action='store_true', help='of an arm behind ROS controllers, and the force instead'
    )
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Run, report, and return 1 if something did not hold."""
    if not (options.duration > 0 and options.quiet > 0):
        raise InvalidParameter(
            f'--duration is {options.duration:g} and --quiet {options.quiet:g}; both must be above 0'
        )
    options.out.mkdir(parents=True, exist_ok=True)
    plan = SoakPlan(options.duration, options.quiet, options.seed, options.model)
    if options.hazards:
        begin_s = time.monotonic()
        records = endure_hazards(plan, lambda line: print(line, flush=True))
        report = write_hazards(records, options.out, plan.seed, time.monotonic() - begin_s)
        results = check_hazards(records)
    else:
        record = endure(plan, options.out / 'nodes.log', lambda line: print(line, flush=True))
        results, report = check_requirements(record), write(record, options.out)
    for result in results:
        print(f'{"holds" if result.holds else "FAILS"}: {result.asked}: {result.seen}')
    print(f'  {report}')
    return int(not all(result.holds for result in results))
