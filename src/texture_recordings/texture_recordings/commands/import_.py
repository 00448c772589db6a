"""`texture import`: turn other people's recordings into labelled bags."""

from __future__ import annotations

import argparse

from texture_core.catalogue import find
from texture_core.command_options import add_channels, add_seed, add_slides
from texture_recordings.importers.catalogue import IMPORTS


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('data_set', help=f'one of {", ".join(IMPORTS)}')
    parser.add_argument('source', help='folder that holds the recordings')
    parser.add_argument('out', help='folder for the bags')
    parser.add_argument('--materials', nargs='+', default=(), metavar='NAME', help='only these; all if not given')
    add_slides(parser)
    add_channels(parser)
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Import, and name the bags."""
    importer = find(IMPORTS, options.data_set, 'data set')
    bags = importer(options.source, options.out, options.slides, options.materials, channels=options.channels or 'all')
    for bag in bags:
        print(bag)
    return 0
