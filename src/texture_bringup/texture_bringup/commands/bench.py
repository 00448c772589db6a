"""`texture bench`: run a benchmark; it writes its figures as JSON and a chart."""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

from texture_bringup.commands.options import add_seed
from texture_core.errors import InvalidData
from texture_evaluation.bench import BENCHES, run_bench
from texture_evaluation.benches.result import Bench

ALL = 'all'


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('name', help=f'one of {", ".join(BENCHES)}, or {ALL}')
    parser.add_argument('--out', type=Path, default=Path('docs/charts'), metavar='DIR', help='folder for the results')
    parser.add_argument(
        '--data',
        type=Path,
        default=os.environ.get('TEXTURE_DATA') or None,
        metavar='DIR',
        help='folder of the recorded data sets (DIR/biotac20); default: $TEXTURE_DATA',
    )
    parser.add_argument('--quick', action='store_true', help='fewer repetitions; not for publishing')
    parser.add_argument(
        '--duration', type=float, default=30.0, metavar='S', help='length of the long measurement of `load`, s'
    )
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Run one benchmark, or all for which the data is there."""
    bench = Bench(options.out, options.data, options.seed, options.quick, options.duration)
    if options.name == ALL:
        for name in BENCHES:
            _run_if_possible(name, bench)
    else:
        _run_one(options.name, bench)
    return 0


def _run_if_possible(name: str, bench: Bench) -> None:
    try:
        _run_one(name, bench)
    except InvalidData as error:
        print(f'{name}: left out: {error}')


def _run_one(name: str, bench: Bench) -> None:
    began_s = time.monotonic()
    result, path = run_bench(name, bench)
    print(f'{name}, {time.monotonic() - began_s:.0f} s: {result.measured}')
    for file in (path, *result.charts):
        print(f'  {file}')
