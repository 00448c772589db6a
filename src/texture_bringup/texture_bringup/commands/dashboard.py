# SPDX-License-Identifier: Apache-2.0
"""`texture dashboard`: show a web page of the live estimates, with buttons to explore and stop."""

from __future__ import annotations

import argparse

from texture_bringup.dashboard import TOKEN_VARIABLE
from texture_bringup.nodes.dashboard import DashboardNode, DashboardParams
from texture_core.ros import run_node


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    default = DashboardParams()
    parser.add_argument(
        '--host',
        default=default.host,
        help=f'address to listen on (default {default.host}); beyond loopback the page needs the token that is '
        f'printed, or the one in {TOKEN_VARIABLE}',
    )
    parser.add_argument(
        '--port', type=int, default=default.port, help=f'port (default {default.port}); 0: any that is free'
    )
    parser.add_argument('--recordings', default=default.recordings, help='folder for new bags')
    parser.add_argument('--namespace', default='', help='namespace of the nodes')


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    parameters = {'host': options.host, 'port': options.port, 'recordings': options.recordings}
    run_node(DashboardNode, parameters, options.namespace)
    return 0
