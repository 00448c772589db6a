# SPDX-License-Identifier: Apache-2.0
"""`texture collect`: touch a surface at many places of the taught patch, and record labelled slides."""

from __future__ import annotations

import argparse
import sys
from dataclasses import fields
from pathlib import Path

from texture_bringup.nodes.collector import collect_surface, params_from
from texture_bringup.operator import Operator
from texture_core.errors import CollectionError
from texture_evaluation.collection import CollectionParams


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('surface', help='label of the surface under the finger')
    parser.add_argument('folder', type=Path, help='folder of the bags of all surfaces; made if missing')
    for one in fields(CollectionParams):
        unit = one.metadata.get('unit') or ''
        parser.add_argument(
            f'--{one.name.replace("_", "-")}',
            type=type(one.default),
            default=one.default,
            metavar=unit.replace('/', '_').upper() or 'N',
            help='%(default)s by default',
        )
    parser.add_argument('--namespace', default='', help='namespace of the nodes')


def run(options: argparse.Namespace) -> int:
    """Collect, say after a few places how well left-out ones are told; return 0 if the bound is met, else 1."""
    with Operator(options.namespace) as operator:
        operator.wait_for_explorer(10.0)
        end, bag = collect_surface(
            operator,
            options.surface,
            options.folder,
            params_from(options),
            lambda sentence, slides: print(f'{slides} slides: {sentence}', flush=True),
            namespace=options.namespace,
        )
    print(f"{end.message}; {end.slides} slides in '{bag}'", file=sys.stderr if end.error else sys.stdout)
    if end.error is CollectionError.CANCELLED:
        raise KeyboardInterrupt
    return 0 if end.error is CollectionError.NONE else 1
