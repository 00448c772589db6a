# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture benchmark`: run a benchmark; writes figures and a chart."""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

from texture_benchmarks.catalogue import BENCHMARKS, run_benchmark
from texture_benchmarks.study import BenchmarkOptions
from texture_core.cli import add_seed, task
from texture_evaluation.charts import REDUCED


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('name', help=f'one of {", ".join(BENCHMARKS)}')
    parser.add_argument('--out', type=Path, default=Path('docs/charts'), metavar='DIR', help='folder for the results')
    parser.add_argument(
        '--data',
        type=Path,
        default=os.environ.get('TEXTURE_DATA') or None,
        metavar='DIR',
        help='folder of the recorded data sets (DIR/biotac20); default: $TEXTURE_DATA',
    )
    parser.add_argument('--quick', action='store_true', help='few slides, or simulated ones; not for publishing')
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Run one benchmark."""
    benchmark_options = BenchmarkOptions(options.out, options.data, options.seed, options.quick)
    began_s = time.monotonic()
    with task(options.name):
        result, path = run_benchmark(options.name, benchmark_options)
    what = (BENCHMARKS[options.name].__doc__ or '').splitlines()[0]
    took = f'{options.name}, {time.monotonic() - began_s:.0f} s: {what}'
    if options.quick:
        print(REDUCED)
    print('\n  '.join([took, result.data, *map(str, (path, *result.charts))]), flush=True)
    return 0
