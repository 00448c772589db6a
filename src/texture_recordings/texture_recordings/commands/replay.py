# SPDX-License-Identifier: Apache-2.0
"""`texture replay`: play a bag to the running system."""

from __future__ import annotations

import argparse

from texture_core.config import check_option
from texture_core.ros import run_node
from texture_recordings.nodes.replay import ReplayNode, ReplayParams


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('bag', help='the bag, or a folder of bags')
    parser.add_argument('--rate', type=float, default=1.0, help='how many times faster than recorded')
    parser.add_argument('--slides', default='', help="which slides of each surface, such as '1-30'; all if not given")
    parser.add_argument('--namespace', default='', help='namespace of the nodes that listen')


def run(options: argparse.Namespace) -> int:
    """Play the bag once.

    Raises
    ------
    InvalidParameter
        If the rate is out of its range.
    """
    check_option(ReplayParams, 'rate', options.rate)
    parameters = {'bag': options.bag, 'rate': options.rate, 'slides': options.slides}
    run_node(ReplayNode, parameters, options.namespace)
    return 0
