# SPDX-License-Identifier: Apache-2.0
"""`texture record`: record the running system into a bag."""

from __future__ import annotations

import argparse

from texture_core.ros import run_node
from texture_recordings.nodes.record import RecordNode


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('out', help='folder of the new bag; nothing may exist there')
    parser.add_argument('--namespace', default='', help='namespace of the nodes')


def run(options: argparse.Namespace) -> int:
    """Record until Ctrl-C."""
    run_node(RecordNode, {'out': options.out}, options.namespace)
    return 0
