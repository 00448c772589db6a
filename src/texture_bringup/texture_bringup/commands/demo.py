# SPDX-License-Identifier: Apache-2.0
"""`texture demo`: the whole thing on an emulator: explore, learn, recognise, report."""

from __future__ import annotations

import argparse
from pathlib import Path

from texture_bringup.demo import DemoPlan, ProgressLog, demonstrate
from texture_core.cli import add_channels, add_seed
from texture_evaluation.commands.train import WITH_SLOW_CHANNELS


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('--out', type=Path, default=Path('texture-demo'), metavar='DIR', help='folder for the results')
    add_channels(parser)
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Run the demonstration; return 1 if a slide was mistaken."""
    recipe = WITH_SLOW_CHANNELS['default'] if options.channels == 'all' else 'default'
    with ProgressLog() as progress:
        progress.line('Everything physical in this demonstration is simulated: surfaces, arm and sensor.')
        all_right = demonstrate(options.out, recipe, options.seed, DemoPlan(), progress)
        if not all_right:
            progress.line('Not every slide was recognised.')
    return 0 if all_right else 1
