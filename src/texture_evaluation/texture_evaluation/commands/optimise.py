# SPDX-License-Identifier: Apache-2.0
"""`texture optimise`: tune a recipe on labelled bags by a genetic search."""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, field

from texture_core.cli import add_dask, add_seed, add_slides, core_count
from texture_core.config import from_mapping
from texture_estimation.search import Generation, SearchParams
from texture_evaluation.optimise import Wanted, checkpoint_of, optimise_from_bags
from texture_evaluation.workers import workers

BAR = 20  # letters


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
    given = {name: getattr(options, name) for name in ('recipe', 'search', 'slides', 'grades', 'per_pair')}
    wanted = Wanted(bags=tuple(options.bags), **given)
    chosen = {name: getattr(options, name) for name in ('population', 'generations', 'halves', 'seed')}
    if options.all_halves:
        chosen['search_halves'] = options.halves
    params = from_mapping(SearchParams, chosen, 'texture optimise')
    progress = Progress()
    try:
        with workers(options.jobs, options.dask):
            files, lines = optimise_from_bags(wanted, params, options.out, resume=options.resume, tell=progress.tell)
    except KeyboardInterrupt:
        progress.end()
        print(f"scores are kept in '{checkpoint_of(options.out)}': go on with --resume", file=sys.stderr)
        raise
    progress.end()
    print('\n'.join(lines))
    for path in files:
        print(f'  {path}')
    return 0


@dataclass
class Progress:
    """A bar that grows with the generations: on a terminal in place, else a line each."""

    terminal: bool = field(default_factory=lambda: sys.stderr.isatty())  # noqa: PLW0108  # the stream of now
    _began_s: float = field(default_factory=time.monotonic)

    def tell(self, pair: str, generation: Generation) -> None:
        """Show where the search is."""
        text = bar(generation, time.monotonic() - self._began_s, pair)
        ending = '\r' if self.terminal and generation.number < generation.of else '\n'
        print(f'\x1b[2K{text}' if self.terminal else text, end=ending, file=sys.stderr, flush=True)

    def end(self) -> None:
        """Leave the line of the bar."""
        if self.terminal:
            print(file=sys.stderr)


def bar(generation: Generation, taken_s: float, pair: str = '') -> str:
    """Return one line: how far, how good, how many tried, how long.

    Parameters
    ----------
    generation
        What the last generation brought.
    taken_s
        Time since the search began.
    pair
        Names of the pair of surfaces; '' for all.

    Returns
    -------
    str
        Without an end of line.
    """
    done = BAR * generation.number // generation.of
    return (
        f'{pair}{": " if pair else ""}[{"#" * done}{"." * (BAR - done)}] {generation.number}/{generation.of}  '
        f'best {100 * generation.fitness:.2f} %  {generation.tried} tried  {taken_s:.0f} s'
    )
