# SPDX-License-Identifier: Apache-2.0
"""`texture explore`: slide the finger over the surface and say what it is."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from texture_bringup.operator import ExplorationResult, Operator
from texture_core.config import find
from texture_core.errors import MotionRefused
from texture_core.types import ExplorationRequest, ExplorationState, RoughnessEstimate, TextureEstimate
from texture_exploration.motions import MOTIONS

# Option, field of the request, unit or '', meaning.
NUMBERS = (
    ('speed', 'speed_m_s', 'm/s', 'speed along the surface'),
    ('force', 'force_n', 'N', 'force on the surface'),
    ('distance', 'distance_m', 'm', 'length of a linear slide'),
    ('radius', 'radius_m', 'm', 'radius of a circular motion'),
    ('turns', 'turns', '', 'turns of a circular motion'),
    ('duration', 'duration_s', 's', 'duration of an in-hand slide'),
)
UNLIKE = 'it resembles none of the known textures'
BAR = 24
TIMEOUT_S = 300.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('motion', help=f'how to move: {", ".join(MOTIONS)}')
    for option, _, unit, meaning in NUMBERS:
        shown = f'{meaning}, {unit}' if unit else meaning
        parser.add_argument(f'--{option}', type=float, default=0.0, help=f'{shown}; 0: the default of the motion')
    parser.add_argument(
        '--direction',
        type=float,
        nargs='+',
        default=[0.0],
        help='direction of travel, from +x towards +y; of a circular motion, the angle at which the slide begins, rad; '
        'several: one exploration after the other',
    )
    parser.add_argument('--surface', default='', help='true name of the surface, if known; it labels a recording')
    parser.add_argument('--early-stopping', action='store_true', help='end the slide as soon as the texture is certain')
    parser.add_argument(
        '--timeout',
        type=float,
        default=TIMEOUT_S,
        help='longest duration of one exploration, s; then the finger is lifted and the exploration aborted '
        '(default: %(default)g)',
    )
    parser.add_argument('--namespace', default='', help='namespace of the nodes')


def run(options: argparse.Namespace) -> int:
    """Explore once in each direction; return 1 as soon as one was ended early by a fault or a stop."""
    requests = requests_of(options)
    with Operator(options.namespace) as operator:
        operator.wait_for_explorer(deadline_s=10.0)
        succeeded = all(tell(explored(operator, request)) for request in requests)
    return 0 if succeeded else 1


def explored(operator: Operator, request: ExplorationRequest) -> ExplorationResult:
    """Explore with a line of progress; after Ctrl-C print how the exploration ended, which the operator must know."""
    try:
        with progress_line():
            return operator.explore(request, show_progress)
    except KeyboardInterrupt as interrupt:
        print(interrupt, file=sys.stderr)
        raise


@contextmanager
def progress_line() -> Iterator[None]:
    """End the line of the progress, however the exploration ends."""
    try:
        yield
    finally:
        if sys.stderr.isatty():
            print(file=sys.stderr)


def tell(explored: ExplorationResult) -> bool:
    """Print how an exploration ended; return whether it succeeded.

    Raises
    ------
    MotionRefused
        If the explorer refused it.
    """
    if not explored.exploration_id:
        raise MotionRefused(explored.message)
    print(f'{explored.exploration_id}: {explored.message}')
    print(f'texture:   {texture_text(explored.texture)}')
    print(f'roughness: {roughness_text(explored.roughness)}')
    return bool(explored.success)


def requests_of(options: argparse.Namespace) -> list[ExplorationRequest]:
    """Return the requests that the options stand for, one for each direction.

    Raises
    ------
    UnknownName
        If there is no such motion: said before an explorer is waited for.
    InvalidData
        If the surface is no label, or the timeout no number of seconds.
    """
    find(MOTIONS, options.motion, 'motion')
    numbers = {field: getattr(options, option) for option, field, _, _ in NUMBERS}
    request = ExplorationRequest(
        options.motion,
        surface=options.surface,
        early_stopping=options.early_stopping,
        timeout_s=options.timeout,
        **numbers,
    )
    return [replace(request, direction_rad=direction) for direction in options.direction]


def show_progress(state: ExplorationState, texture: TextureEstimate) -> None:
    """Draw how far it is, on one line of a terminal."""
    if not sys.stderr.isatty():
        return
    share = state.progress if state.progress >= 0 else 0.0
    bar = '█' * round(BAR * share)
    print(f'\r{state.phase.value:<9}|{bar:<{BAR}}| {progress_text(texture):<60}', end='', file=sys.stderr, flush=True)


def texture_text(estimate: TextureEstimate) -> str:
    """Return a texture estimate in words, with the reason if it is not known."""
    if not estimate.label or estimate.known:
        return progress_text(estimate)
    return f'{progress_text(estimate)}: {estimate.message or UNLIKE}'


def progress_text(estimate: TextureEstimate) -> str:
    """Return a texture estimate in so few words that they fit the line of the progress."""
    if not estimate.label:
        return estimate.message or 'none yet'
    nearest = f'{estimate.label}, confidence {estimate.confidence:.2f} after {estimate.evidence_s:.1f} s'
    return nearest if estimate.known else f'unknown (nearest: {nearest})'


def roughness_text(estimate: RoughnessEstimate) -> str:
    """Return a roughness estimate in words."""
    if not estimate.valid:
        return estimate.message or 'none'
    return f'{estimate.grade:.1f} ± {estimate.grade_std:.1f} on the scale from 1 (smooth) to 5 (rough)'
