# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sub-commands of `texture` that are nodes: `record` the running system, `replay` a bag to it."""

from __future__ import annotations

import argparse

from texture_core.cli import Command, add_namespace, add_slides
from texture_core.config import from_mapping
from texture_core.ros import run_node
from texture_recordings.nodes.record import RecordNode
from texture_recordings.nodes.replay import ReplayNode, ReplayParams


def _configure_record(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('out', help='folder of the new bag; nothing may exist there')
    parser.add_argument('--all', action='store_true', help='every topic in the namespace, not only those of the suite')
    parser.add_argument(
        '--signal-topics',
        default='',
        metavar='TOPICS',
        help='those of the fingers, in quotes: other namespaces below are left out',
    )
    add_namespace(parser)


def _record(options: argparse.Namespace) -> int:
    parameters = {'out': options.out, 'all': options.all, 'signal_topics': options.signal_topics}
    nodes: list[RecordNode] = []

    def make() -> RecordNode:
        nodes.append(RecordNode())
        return nodes[0]

    run_node(make, parameters, options.namespace)
    if error := nodes[0].error:  # found at its end
        raise error
    return 0


RUNNING_S = 3.0  # within which nodes that run already are discovered


def _configure_replay(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('bag', help='the bag, or a folder of bags')
    parser.add_argument('--rate', type=float, default=1.0, help='how many times faster than recorded')
    add_slides(parser)
    parser.add_argument('--listeners', default=ReplayParams.listeners, help="nodes to wait for, in quotes; '' for none")
    parser.add_argument('--clock', action='store_true', help='publish the time of the recording on /clock')
    add_namespace(parser)


def _replay(options: argparse.Namespace) -> int:
    from_mapping(ReplayParams, {'rate': options.rate})  # refused in one sentence
    parameters = {name: getattr(options, name) for name in ('bag', 'rate', 'slides', 'listeners', 'clock')}
    run_node(ReplayNode, {**parameters, 'deadline_s': RUNNING_S}, options.namespace)
    return 0


record = Command('record the running system into a bag', _configure_record, _record)
replay = Command('play a bag to the running system', _configure_replay, _replay)
