# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture optimise`: tune a recipe on labelled bags by a genetic search."""

from __future__ import annotations

import argparse
import sys

from texture_core.cli import add_dask, add_seed, add_slides, core_count
from texture_core.config import from_mapping
from texture_estimation.search import Generation, SearchParams
from texture_evaluation.cross_validation import workers
from texture_evaluation.optimise import checkpoint_of, optimise_from_bags


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    usual = SearchParams()
    parser.add_argument('recipe', help='name of a shipped recipe, such as ets-linear-svm, or path of your own')
    parser.add_argument('bags', nargs='+', help='labelled bags, or folders of bags')
    parser.add_argument('-o', '--out', required=True, metavar='FILE', help='recipe that is written, such as best.yaml')
    parser.add_argument('--search', default='', metavar='NAME', help='search space: a shipped one, or a YAML file')
    parser.add_argument('--grades', default='', metavar='FILE', help='CSV file texture,grade: tune a roughness recipe')
    parser.add_argument('--per-pair', action='store_true', help='a set of variables for each pair of surfaces')
    parser.add_argument('--population', type=int, default=usual.population, metavar='N', help='of a generation')
    parser.add_argument('--generations', type=int, default=usual.generations, metavar='N', help='the first included')
    parser.add_argument('--halves', type=int, default=usual.halves, metavar='N', help='random splits evaluated on')
    parser.add_argument('--all-halves', action='store_true', help='evaluate every individual on all, not only the best')
    parser.add_argument('--jobs', type=core_count, default=-1, metavar='N', help='cores to use; -1: all')
    add_dask(parser)
    parser.add_argument('--resume', action='store_true', help='continue from the checkpoint next to FILE')
    add_slides(parser)
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Search, write the recipe, and say how good it is."""
    chosen = {name: getattr(options, name) for name in ('population', 'generations', 'halves', 'seed')}
    if options.all_halves:
        chosen['search_halves'] = options.halves
    params = from_mapping(SearchParams, chosen, 'texture optimise')
    try:
        with workers(options.jobs, options.dask):
            files, lines = optimise_from_bags(
                options.recipe, options.bags, params, options.out, search_space=options.search, slides=options.slides,
                grades=options.grades, per_pair=options.per_pair, resume=options.resume, tell=_tell,
            )  # fmt: skip
    except KeyboardInterrupt:
        print(f"scores are kept in '{checkpoint_of(options.out)}': go on with --resume", file=sys.stderr)
        raise
    print('\n'.join(lines))
    for path in files:
        print(f'  {path}')
    return 0


def _tell(pair: str, generation: Generation) -> None:
    of_pair = f'{pair}, ' if pair else ''
    far = f'generation {generation.number} of {generation.of}'
    said = f'{of_pair}{far}: best {100 * generation.fitness:.2f} %, {generation.tried} tried'
    print(said, file=sys.stderr, flush=True)
