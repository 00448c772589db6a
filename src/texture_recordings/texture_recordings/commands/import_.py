# SPDX-License-Identifier: Apache-2.0
"""`texture import`: turn other people's recordings into labelled bags."""

from __future__ import annotations

import argparse
from pathlib import Path

from texture_core.cli import add_channels, add_seed, add_slides
from texture_core.config import find
from texture_core.errors import InvalidParameter
from texture_recordings.public_sets import IMPORTS
from texture_recordings.tables import MAPPED, import_tables, load_mapping

USAGE = 'texture import DATA_SET SOURCE OUT, or texture import {table,bag} MAPPING SOURCE OUT'


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.usage = f'{USAGE} [options]'
    parser.add_argument('data_set', help=f'one of {", ".join(IMPORTS)}; or {" or ".join(MAPPED)}, with a mapping')
    parser.add_argument(
        'places', nargs='+', metavar='PLACE', help='the mapping file, if there is one; the source; the folder for bags'
    )
    parser.add_argument('--materials', nargs='+', default=(), metavar='NAME', help='only these; all if not given')
    add_slides(parser)
    add_channels(parser)
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Import, and name the bags.

    Raises
    ------
    InvalidParameter
        If a place is missing or one too many.
    """
    mapped = options.data_set in MAPPED
    if len(options.places) != 2 + mapped:
        raise InvalidParameter(f'{len(options.places)} places were given after {options.data_set}; write {USAGE}')
    for bag in _import_mapped(options) if mapped else _import_known(options):
        print(bag)
    return 0


def source_folder(source: str, data_set: str) -> Path:
    """Return the given folder of a data set, or its subfolder that has the name of the data set."""
    inside = Path(source) / data_set
    return inside if inside.is_dir() else Path(source)


def _import_known(options: argparse.Namespace) -> list[Path]:
    importer = find(IMPORTS, options.data_set, 'data set')
    source, out = options.places
    return importer(
        source_folder(source, options.data_set),
        out,
        options.slides,
        options.materials,
        channels=options.channels or 'all',
    )


def _import_mapped(options: argparse.Namespace) -> list[Path]:
    mapping, source, out = options.places
    report = import_tables(load_mapping(mapping), source, out, MAPPED[options.data_set])
    for line in report.lines():
        print(line)
    return report.bags
