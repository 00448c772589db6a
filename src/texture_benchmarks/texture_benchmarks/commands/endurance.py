"""`texture endurance`: explore on emulated devices for hours while faults are injected at random."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from texture_benchmarks.endurance.endurance_plan import EndurancePlan
from texture_benchmarks.endurance.report import write
from texture_benchmarks.endurance.requirements import RequirementResult, check_requirements
from texture_benchmarks.endurance.robot_report import write_figures, write_robots
from texture_benchmarks.endurance.robot_requirements import check_robots
from texture_benchmarks.endurance.robot_run import RobotPlan, endure_robots
from texture_benchmarks.endurance.run import endure
from texture_core.command_options import add_seed
from texture_core.errors import InvalidData

ROBOT_SHARE = 2 / 3  # of the time of a run of both parts


PART_HELP = (
    'sensor: all nodes with emulated sensor and the simulated arm; robots: the explorer with the emulated UR, '
    'the emulated hand and the simulated arm; all: a third of the time the first, then the second (default)'
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('--duration', type=float, default=3600.0, metavar='S', help='how long, s (default: an hour)')
    parser.add_argument('--part', choices=('all', *PARTS), default='all', help=PART_HELP)
    parser.add_argument('--quiet', type=float, default=20.0, metavar='S', help='mean time between two faults, s')
    parser.add_argument('--model', type=Path, help='trained model; one of simulated slides is trained if not given')
    parser.add_argument(
        '--out', type=Path, default=Path('texture-endurance'), metavar='DIR', help='folder for the report'
    )
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Run, report, and return 1 if something did not hold.

    Raises
    ------
    InvalidData
        If the folder of the report cannot be used.
    """
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidData(f"'{options.out}' cannot be used: {error.strerror}; name another with --out") from error
    parts = tuple(PARTS) if options.part == 'all' else (options.part,)
    results = [result for part in parts for result in PARTS[part](options, len(parts) > 1)]
    return int(not all(result.holds for result in results))


def _run_sensor(options: argparse.Namespace, shared: bool) -> Sequence[RequirementResult]:
    duration_s = options.duration * (1 - ROBOT_SHARE if shared else 1.0)
    plan = EndurancePlan(duration_s, options.quiet, options.seed, options.model)
    record = endure(plan, options.out / 'nodes.log', _say)
    return _report(check_requirements(record), write(record, options.out))


def _run_robots(options: argparse.Namespace, shared: bool) -> Sequence[RequirementResult]:
    plan = RobotPlan(options.duration * (ROBOT_SHARE if shared else 1.0), options.seed)
    keep = partial(write_figures, out=options.out)
    record = endure_robots(plan, options.out / 'explorers.log', _say, keep=keep)
    return _report(check_robots(record), write_robots(record, options.out))


def _report(results: Sequence[RequirementResult], files: Sequence[Path]) -> Sequence[RequirementResult]:
    for result in results:
        _say(f'{"holds" if result.holds else "FAILS"}: {result.asked}: {result.seen}')
    for path in files:
        _say(f'  {path}')
    return results


def _say(line: str) -> None:
    print(line, flush=True)


PARTS: Mapping[str, Callable[[argparse.Namespace, bool], Sequence[RequirementResult]]] = {
    'sensor': _run_sensor,
    'robots': _run_robots,
}
