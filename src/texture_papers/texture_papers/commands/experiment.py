# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture experiment`: reproduce a paper's experiment: its figures next to ours."""

from __future__ import annotations

import argparse
from pathlib import Path

from texture_core.cli import add_seed, core_count
from texture_evaluation.charts import REDUCED
from texture_papers.catalogue import EXPERIMENTS, run_experiment
from texture_papers.protocol import Experiment


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('name', help=f'one of {", ".join(EXPERIMENTS)}')
    parser.add_argument('--out', type=Path, default=Path('docs/charts'), metavar='DIR', help='folder for the results')
    parser.add_argument('--quick', action='store_true', help='fewer slides; not for publishing')
    parser.add_argument(
        '--tune', action='store_true', help='search the variables of each pair of textures, or of a regressor, first'
    )
    parser.add_argument(
        '--seeds', type=int, default=1, metavar='N', help='number of seeds from --seed on: mean and interval over them'
    )
    parser.add_argument('--jobs', type=core_count, default=1, metavar='N', help='cores for the searches of --tune')
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Run one experiment, print its table and name the files."""
    experiment = Experiment(options.out, options.seed, options.quick, options.tune, options.jobs)
    result, path = run_experiment(options.name, experiment, options.seeds)
    if options.quick:
        print(REDUCED)
    print(f'{result.name}: {result.measured}')
    print(f'data: {result.data}; split: {result.split}')
    for line in result.lines():
        print(line)
    for file in (path, *result.charts):
        print(f'  {file}')
    return 0
