# SPDX-License-Identifier: Apache-2.0
"""`texture segment`: find the slides in bags that do not tell them."""

from __future__ import annotations

import argparse

from texture_core.config import from_mapping, parameters_of
from texture_features.segmentation import SegmentationParams
from texture_recordings.segment import segment_bags


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('bags', nargs='+', help='bags, or folders of bags')
    parser.add_argument('--out', required=True, metavar='DIR', help='folder for the copies with the states found')
    parser.add_argument('--surface', default='', metavar='NAME', help='label of all slides; else as the bag says')
    parser.add_argument('--namespace', default=None, metavar='NS', help='of the finger, if bags hold several')
    for item in parameters_of(SegmentationParams):
        option = f'--{item.name.replace("_", "-")}'
        known = {'choices': item.choices} if item.choices else {'metavar': 'X'}
        parser.add_argument(option, type=item.type, default=item.default, help=item.description, **known)


def run(options: argparse.Namespace) -> int:
    """Write the copies, and name them with the number of their slides."""
    values = {item.name: getattr(options, item.name) for item in parameters_of(SegmentationParams)}
    params = from_mapping(SegmentationParams, values)
    for path, slides in segment_bags(options.bags, options.out, params, options.surface, options.namespace).items():
        print(f'{path}: {slides} slides')
    return 0
