# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture benchmark`: run a benchmark; writes figures and a chart."""

from __future__ import annotations

import argparse
import math
import os
import time
from functools import partial
from pathlib import Path

from texture_benchmarks.catalogue import BENCHMARKS, LONG, run_all, run_benchmark
from texture_benchmarks.study import BenchmarkOptions
from texture_core.cli import add_seed, task
from texture_core.errors import InvalidData

ALL = 'all'
NO_DATA = 3  # exit code of a process


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('name', help=f'one of {", ".join(BENCHMARKS)}, or {ALL}')
    parser.add_argument('--out', type=Path, default=Path('docs/charts'), metavar='DIR', help='folder for the results')
    parser.add_argument(
        '--data',
        type=Path,
        default=os.environ.get('TEXTURE_DATA') or None,
        metavar='DIR',
        help='folder of the recorded data sets (DIR/biotac20); default: $TEXTURE_DATA',
    )
    parser.add_argument('--quick', action='store_true', help='few slides, or simulated ones; not for publishing')
    parser.add_argument(
        '--workers', type=int, default=0, metavar='N', help='processes of `generalisation`, `motion`; 0: all cores'
    )
    parser.add_argument(
        '--minutes',
        type=float,
        default=math.inf,
        metavar='MIN',
        help='after which `generalisation` and `motion` end with what they have; the same command resumes them',
    )
    parser.add_argument('--only', default='', metavar='SET', help='data set of `generalisation`, such as `fingersense`')
    parser.add_argument('--long', action='store_true', help=f'with {ALL}: also {", ".join(sorted(LONG))}')
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Run one benchmark, or all for which the data is there: 1 if one of these fails."""
    options.out.mkdir(parents=True, exist_ok=True)  # not only when the figures are there
    benchmark_options = BenchmarkOptions(
        options.out, options.data, options.seed, options.quick, options.workers, 60.0 * options.minutes, options.only
    )
    if options.name != ALL:
        _run_one(options.name, benchmark_options)
        return 0
    began_s = time.monotonic()
    names = [name for name in BENCHMARKS if options.long or name not in LONG]
    codes = run_all(names, partial(_run_to_exit_code, benchmark_options=benchmark_options))
    failed = [name for name, code in codes.items() if code not in (0, NO_DATA)]
    without = [name for name, code in codes.items() if code == NO_DATA]
    print(f'{list(codes.values()).count(0)} benchmarks in {(time.monotonic() - began_s) / 60:.1f} min')
    print(f'left out, for their data is missing: {", ".join(without) or "none"}; failed: {", ".join(failed) or "none"}')
    return int(bool(failed))


def _run_to_exit_code(name: str, benchmark_options: BenchmarkOptions) -> int:
    try:
        _run_one(name, benchmark_options)
    except InvalidData as error:
        print(f'{name}: left out: {error}', flush=True)
        return NO_DATA
    return 0


def _run_one(name: str, benchmark_options: BenchmarkOptions) -> None:
    began_s = time.monotonic()
    with task(name):
        result, path = run_benchmark(name, benchmark_options)
    took = f'{name}, {time.monotonic() - began_s:.0f} s: {(BENCHMARKS[name].__doc__ or name).splitlines()[0]}'
    print('\n  '.join([took, result.data, *map(str, (path, *result.charts))]), flush=True)
