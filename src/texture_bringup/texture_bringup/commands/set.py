# SPDX-License-Identifier: Apache-2.0
"""`texture set`: set parameters of a running node, such as the surface of the emulator."""

from __future__ import annotations

import argparse

from texture_bringup.launcher import given_arguments
from texture_bringup.operator import Operator


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('node', help='name of the node, such as emulator')
    parser.add_argument('values', nargs='+', metavar='NAME:=VALUE', help='parameters and their values')
    parser.add_argument('--namespace', default='', help='namespace of the nodes')


def run(options: argparse.Namespace) -> int:
    """Set the parameters, and print what was set."""
    values = given_arguments(options.values)
    with Operator(options.namespace) as operator:
        operator.set_from_texts(options.node, values)
    print(f'{options.node}: ' + ', '.join(f'{name} is {text}' for name, text in values.items()))
    return 0
