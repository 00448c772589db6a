# SPDX-License-Identifier: Apache-2.0
"""`texture add`: add the slide that was explored last to a texture; or undo it."""

from __future__ import annotations

import argparse

from texture_bringup.operator import Operator
from texture_core.errors import InvalidParameter


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('label', nargs='?', default='', help='label of the texture; a new label adds a class')
    parser.add_argument(
        'exploration', nargs='?', default='', help='id of the exploration to add; default: the last one'
    )
    parser.add_argument('--undo', action='store_true', help='remove the slide that was added last')
    parser.add_argument('--namespace', default='', help='namespace of the nodes')


def run(options: argparse.Namespace) -> int:
    """Add or remove a slide, and print what is known now.

    Raises
    ------
    InvalidParameter
        If there is neither a label nor --undo, or both.
    """
    if options.undo == bool(options.label):
        raise InvalidParameter('give the label of the texture to add, or --undo alone')
    with Operator(options.namespace) as operator:
        if options.undo:
            print(operator.remove_last_added())
            return 0
        examples, message = operator.add(options.label, options.exploration)
    print(f"{message}; '{options.label.strip()}' has {examples} windows now")
    return 0
