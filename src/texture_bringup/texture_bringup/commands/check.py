# SPDX-License-Identifier: Apache-2.0
"""`texture check`: slide over the reference plate, and say whether the finger is as trained."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from texture_bringup.nodes.collector import recorder
from texture_bringup.operator import Operator
from texture_core.errors import MotionAborted
from texture_core.types import ExplorationRequest
from texture_evaluation.check import adapt_to_today, check_finger
from texture_recordings.dataset import SlideDataset

PLATE = 'reference plate'


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('model', help='path of the model, beside which reference and correction lie')
    parser.add_argument('--store', action='store_true', help='store this slide as that of the finger of the training')
    parser.add_argument('--correct', action='store_true', help='write the correction of gain and response, if needed')
    parser.add_argument('--bag', help='take the last labelled slide of a bag instead of sliding now')
    parser.add_argument('--speed', type=float, default=0.05, help='speed of the slide, m/s (default: %(default)g)')
    parser.add_argument('--force', type=float, default=0.0, help='normal force, N; 0: the default of the motion')
    parser.add_argument('--distance', type=float, default=0.15, help='length of the slide, m (default: %(default)g)')
    parser.add_argument(
        '--today', nargs='+', metavar='BAG', help='bags of today with a labelled slide of each surface; needs --trained'
    )
    parser.add_argument('--trained', nargs='+', metavar='BAG', help='bags of several days on which it was trained')
    parser.add_argument('--namespace', default='', help='namespace of the nodes')


def run(options: argparse.Namespace) -> int:
    """Check, store or adapt; return 1 if the finger is not as trained and was not corrected."""
    if options.today or options.trained:
        print(adapt_to_today(options.model, options.trained or (), options.today or ())[1])
        return 0
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(options.bag) if options.bag else Path(folder) / 'plate'
        if not options.bag:
            _slide(options, bag)
        slide = SlideDataset.from_bags([bag])[-1]
    as_trained, sentence = check_finger(options.model, slide, store=options.store, correct=options.correct)
    print(sentence)
    return 0 if as_trained or options.correct else 1


def _slide(options: argparse.Namespace, bag: Path) -> None:
    request = ExplorationRequest(
        'linear_slide',
        speed_m_s=options.speed,
        force_n=options.force,
        distance_m=options.distance,
        surface=PLATE,
    )
    with Operator(options.namespace) as operator:
        operator.wait_for_explorer(10.0)
        with recorder(operator, bag, options.namespace):
            explored = operator.explore(request)
        if not explored.success:
            raise MotionAborted(f'the slide over the plate failed: {explored.message}')
