"""`texture learn`: teach what was explored last as a texture, at once; or undo it."""

from __future__ import annotations

import argparse

from texture_bringup.ros.operator import Operator
from texture_core.errors import InvalidParameter


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('label', nargs='?', default='', help='name of the texture; a new name adds one')
    parser.add_argument('exploration', nargs='?', default='', help='id of the exploration to learn; default: the last')
    parser.add_argument('--undo', action='store_true', help='unlearn the last lesson')
    parser.add_argument('--namespace', default='', help='namespace of the nodes')


def run(options: argparse.Namespace) -> int:
    """Teach or unlearn, and say what is known now."""
    if options.undo == bool(options.label):
        raise InvalidParameter('give the name of the texture to learn, or --undo alone')
    with Operator(options.namespace) as operator:
        if options.undo:
            print(operator.undo_learning())
            return 0
        examples, message = operator.learn(options.label, options.exploration)
    print(f'{message}; {examples} examples of it')
    return 0
