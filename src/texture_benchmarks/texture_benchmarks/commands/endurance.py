"""`texture endurance`: explore on the emulated rig for hours under random fault injection."""

from __future__ import annotations

import argparse
from pathlib import Path

from texture_benchmarks.endurance.report import write
from texture_benchmarks.endurance.requirements import check_requirements
from texture_benchmarks.endurance.run import EndurancePlan, endure
from texture_core.command_options import add_seed
from texture_core.errors import InvalidData


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('--duration', type=float, default=3600.0, metavar='S', help='how long, s (default: an hour)')
    parser.add_argument('--quiet', type=float, default=20.0, metavar='S', help='mean time between two faults, s')
    parser.add_argument('--model', type=Path, help='trained model; one of simulated slides is trained if not given')
    parser.add_argument(
        '--out', type=Path, default=Path('texture-endurance'), metavar='DIR', help='folder for the report'
    )
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Run, report, and return 1 if something did not hold."""
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidData(f"'{options.out}' cannot be used: {error.strerror}; name another with --out") from error
    plan = EndurancePlan(options.duration, options.quiet, options.seed, options.model)
    record = endure(plan, options.out / 'nodes.log', _say)
    results = check_requirements(record)
    for result in results:
        _say(f'{"holds" if result.holds else "FAILS"}: {result.asked}: {result.seen}')
    for path in write(record, options.out):
        _say(f'  {path}')
    return int(not all(result.holds for result in results))


def _say(line: str) -> None:
    print(line, flush=True)
