# SPDX-License-Identifier: Apache-2.0
"""`texture remove`: remove a texture that was added since the training."""

from __future__ import annotations

import argparse

from texture_bringup.operator import Operator


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('label', help='label of the texture; one of the training stays as it was trained')
    parser.add_argument('--namespace', default='', help='namespace of the nodes')


def run(options: argparse.Namespace) -> int:
    """Remove all slides that were added as a texture, and print what is known now."""
    with Operator(options.namespace) as operator:
        print(operator.remove(options.label))
    return 0
