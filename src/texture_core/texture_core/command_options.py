"""Options that several sub-commands share."""

from __future__ import annotations

import argparse


def add_slides(parser: argparse.ArgumentParser) -> None:
    """Add `--slides`."""
    parser.add_argument(
        '--slides',
        default='',
        metavar='N-M',
        help='which slides of each surface, as recorded; all if not given',
    )


def add_channels(parser: argparse.ArgumentParser) -> None:
    """Add `--channels`."""
    parser.add_argument(
        '--channels',
        choices=('fast', 'all'),
        help='fast: the vibration alone; all: the slow channels beside it, too; default: as recorded or trained',
    )


def add_dask(parser: argparse.ArgumentParser) -> None:
    """Add `--dask`."""
    parser.add_argument(
        '--dask', default='', metavar='ADDRESS', help='scheduler of a Dask cluster to use instead, or local:WORKERS'
    )


def add_seed(parser: argparse.ArgumentParser) -> None:
    """Add `--seed`."""
    parser.add_argument('--seed', type=int, default=0, help='seed of whatever is random')
