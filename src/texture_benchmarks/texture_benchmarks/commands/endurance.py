"""`texture endurance`: explore on emulated devices for hours while faults are injected at random."""

from __future__ import annotations

import argparse
from pathlib import Path

from texture_benchmarks.ros.soak import SoakPlan, endure
from texture_benchmarks.soak import check_requirements, write
from texture_core.cli import add_seed
from texture_core.errors import InvalidData


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('--duration', type=float, default=3600.0, metavar='S', help='how long, s (default: an hour)')
    parser.add_argument('--quiet', type=float, default=20.0, metavar='S', help='mean time between two faults, s')
    parser.add_argument('--model', type=Path, help='trained model; one of simulated slides is trained if not given')
    parser.add_argument('--out', type=Path, default=Path('texture-endurance'), metavar='DIR', help='for the report')
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Run, report, and return 1 if something did not hold."""
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidData(f"'{options.out}' cannot be used: {error.strerror}; name another with --out") from error
    plan = SoakPlan(options.duration, options.quiet, options.seed, options.model)
    record = endure(plan, options.out / 'nodes.log', lambda line: print(line, flush=True))
    results = check_requirements(record)
    for result in results:
        print(f'{"holds" if result.holds else "FAILS"}: {result.asked}: {result.seen}')
    print(f'  {write(record, options.out)}')
    return int(not all(result.holds for result in results))
