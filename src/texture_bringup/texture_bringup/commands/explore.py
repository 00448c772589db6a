# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sub-commands of `texture` that slide the finger: `explore`, `identify`, `collect` and `check`."""

from __future__ import annotations

import argparse
import fcntl
import json
import logging
import math
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from texture_bringup.feed import roughness_text, texture_text
from texture_bringup.launcher import Child
from texture_bringup.operator import ExplorationResult, Interrupted, Operator, Progress, uninterrupted
from texture_core.cli import USER_ERROR, Command, add_namespace, add_parameters, parameters_from, task
from texture_core.config import find
from texture_core.errors import (
    CollectionError,
    ExplorationError,
    InvalidData,
    InvalidParameter,
    LaunchFailed,
    ModelMismatch,
    MotionAborted,
    MotionRefused,
    TextureError,
    counted,
)
from texture_core.types import ExplorationRequest, ExplorationState, Rejection, TextureEstimate, needed_label
from texture_exploration.motions import MOTIONS
from texture_exploration.presets import load_preset
from texture_exploration.safety import RANGES

if TYPE_CHECKING:
    from texture_evaluation import collection
    from texture_features.feature_set import LabelledFeatures

# What evaluates is imported when it runs: `explore` has to begin at once.
# ruff: noqa: PLC0415

T = TypeVar('T')
# By field of the request: the option that gives it, without the unit.
NUMBERS = {
    field: '--' + field.removesuffix(f'_{unit.replace("/", "_").lower()}').replace('_', '-')
    for field, (_, _, unit, _) in RANGES.items()
}
BAR = 24
TIMEOUT_S = 300.0
EXPLORER_S, SOON_S = 5.0, 1.0  # within which an explorer that runs is discovered, at most and usually


def _configure_explore(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('motion', nargs='?', default='', help=f'how to move: {", ".join(MOTIONS)}')
    parser.add_argument('--preset', metavar='NAME', help='make all motions of a preset instead, such as ets-linear')
    parser.add_argument('--repeats', type=int, metavar='N', help='rounds (default: 1, of a preset as it declares)')
    parser.add_argument('--json', action='store_true', help='print each result as one line of JSON')
    for field, (_, _, unit, meaning) in RANGES.items():
        shown = f'{meaning}; 0: the default of the motion'
        parser.add_argument(NUMBERS[field], dest=field, type=float, default=0.0, metavar=unit.upper(), help=shown)
    parser.add_argument(
        '--direction',
        type=float,
        nargs='+',
        default=[0.0],
        metavar='DEG',
        help='direction of travel, degrees from +x towards +y; of a circular motion, the angle at which the slide '
        'begins; several: one exploration after the other',
    )
    parser.add_argument(
        '--start',
        type=float,
        nargs=2,
        metavar=('X', 'Y'),
        help='where to begin on the surface patch, in the surface frame, m; default: where the explorer took '
        'control of the arm',
    )
    parser.add_argument('--surface', default='', help='true name of the surface, if known; it labels a recording')
    parser.add_argument('--early-stopping', action='store_true', help='end the slide as soon as the label is decided')
    parser.add_argument(
        '--timeout',
        type=float,
        default=TIMEOUT_S,
        help='longest duration of one exploration, s; then the finger is lifted and the exploration aborted '
        '(default: %(default)g; 0: none)',
    )
    add_namespace(parser)


def _explore(options: argparse.Namespace) -> int:
    """Explore once in each direction, until one has no success; return that, else the worst end, see `exit_code`."""
    requests, made, code = requests_of(options), 0, 0
    try:
        with Operator(options.namespace) as operator:
            operator.wait_for_explorer(EXPLORER_S, SOON_S)
            explore = partial(operator.explore, stopped=operator.watch_stops())
            for request in requests:
                result = explored(explore, request)
                if options.json:
                    print(json.dumps(as_json(result)), flush=True)
                else:
                    print_result(result)
                if not result.success:
                    return exit_code(result)
                made, code = made + 1, max(code, exit_code(result))
    except MotionAborted as error:  # the explorer does not answer any more: it may have moved
        print(f'texture: {error}', file=sys.stderr)
        return ABORTED
    finally:
        if made < len(requests) > 1:
            print(f'{made} of {len(requests)} slides were made', file=sys.stderr)
    return code


ACCEPTED, REJECTED, ABORTED, NO_MODEL = 0, 3, 4, 5  # 1: fault of the program, 2: invalid input of the user


def exit_code(result: ExplorationResult) -> int:
    """Return what `explore` ends with: a label that may be used, none, an abort, no fitting model, or a refusal."""
    if not result.exploration_id:
        return USER_ERROR
    if not result.success:
        return ABORTED
    if result.texture.rejection is Rejection.NO_MODEL:
        return NO_MODEL
    return ACCEPTED if result.texture.accepted else REJECTED


OUTCOMES = {
    ACCEPTED: 'accepted', REJECTED: 'rejected', ABORTED: 'aborted', NO_MODEL: 'no model', USER_ERROR: 'refused'
}  # fmt: skip


def as_json(result: ExplorationResult) -> dict[str, Any]:
    """Return a result for JSON: unknown numbers are null."""
    values = {'outcome': OUTCOMES[exit_code(result)], **asdict(result), 'error': result.error.name.lower()}
    values['texture'] |= {'rejection': result.texture.rejection.name.lower(), 'labels': values.pop('labels')}
    known: dict[str, Any] = json.loads(json.dumps(values), parse_constant=lambda _: None)
    return known


def explored(explore: Callable[[ExplorationRequest, Progress], T], request: ExplorationRequest) -> T:
    """Explore with a line of progress; after Ctrl-C print how the exploration ended."""
    try:
        try:
            return explore(request, show_progress)
        finally:
            if sys.stderr.isatty():
                print(file=sys.stderr)
    except KeyboardInterrupt as interrupt:
        print(interrupt, file=sys.stderr)
        raise KeyboardInterrupt from None


def print_result(result: ExplorationResult) -> bool:
    """Print how an exploration ended; return whether it succeeded."""
    if not result.exploration_id:
        raise MotionRefused(result.message)
    print(f'{result.exploration_id}: {result.message}')
    print(f'texture:   {texture_text(result.texture)}')
    if result.roughness.valid or result.roughness.message:  # else there is no roughness model
        print(f'roughness: {roughness_text(result.roughness)}')
    return result.success


def requests_of(options: argparse.Namespace) -> list[ExplorationRequest]:
    """Return the requests given by the options, one for each direction."""
    if bool(options.motion) == bool(options.preset):
        came = f"the motion '{options.motion}' and the preset '{options.preset}' came; " * bool(options.preset)
        raise InvalidParameter(f'{came}give either a motion, such as linear_slide, or --preset NAME')
    if options.repeats is not None and options.repeats < 1:
        raise InvalidParameter(f'--repeats is {options.repeats}; 1 or more rounds are needed')
    numbers = {field: getattr(options, field) for field in NUMBERS}
    if options.preset:
        given = [option for field, option in NUMBERS.items() if numbers[field]]
        given += ['--direction'] * (options.direction != [0.0]) + ['--start'] * (options.start is not None)
        if given:
            raise InvalidParameter(
                f'{", ".join(given)} came with --preset, whose motions have their own values; leave that out, or give '
                'a motion instead of the preset'
            )
        made = load_preset(options.preset, options.repeats or 0)
        early, timeout_s = options.early_stopping, options.timeout
        return [
            replace(one, surface=options.surface, early_stopping=early, timeout_s=one.timeout_s or timeout_s)
            for one in made
        ]
    find(MOTIONS, options.motion, 'motion')  # refused before the wait for an explorer
    x_m, y_m = options.start or (0.0, 0.0)
    each = {option: [numbers[field]] for field, option in NUMBERS.items()}
    for option, values in {**each, '--direction': options.direction, '--start': [x_m, y_m]}.items():
        if not all(map(math.isfinite, values)):
            raise InvalidParameter(f'{option} is {" ".join(map(str, values))}; finite numbers are needed')
    request = ExplorationRequest(
        options.motion,
        use_start=options.start is not None,
        start_x_m=x_m,
        start_y_m=y_m,
        surface=options.surface,
        early_stopping=options.early_stopping,
        timeout_s=options.timeout,
        **numbers,
    )
    slides = [replace(request, direction_rad=math.radians(direction)) for direction in options.direction]
    return slides * (options.repeats or 1)


def show_progress(state: ExplorationState, texture: TextureEstimate) -> None:
    """Draw the progress on one line of a terminal."""
    if not sys.stderr.isatty():
        return
    fraction = state.progress if state.progress >= 0 else 0.0
    bar = '█' * round(BAR * fraction)
    print(f'\r{state.phase.value:<9}|{bar:<{BAR}}| {texture_text(texture):<60.60}', end='', file=sys.stderr, flush=True)


# --------------------
# Identify.

SHOWN = 3  # most probable textures that are printed


def _configure_identify(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('model', help='trained on slides of several kinds over every texture')
    parser.add_argument('--sure', type=float, default=0.95, metavar='P', help='end at this probability; default: 0.95')
    parser.add_argument('--most', type=int, default=6, metavar='N', help='most slides that are made; default: 6')
    add_namespace(parser)


def _identify(options: argparse.Namespace) -> int:
    """Slide until the label is decided; return 1 after a slide that a fault or a stop ended."""
    if options.most < 1 or not 0.0 < options.sure <= 1.0:
        raise InvalidParameter(
            f'--most is {options.most} and --sure {options.sure:g}; 1 or more and a probability are needed'
        )
    from texture_estimation.model import load_model
    from texture_estimation.next_motion import slide_values

    model = load_model(options.model)
    known = model.next_touch_model
    if known is None:
        raise InvalidParameter(
            f"model '{model.name}' has no motions to choose from; train it on slides over every texture, two or more "
            'of each kind, in several directions or at several speeds or forces'
        )
    belief, number = known.uniform_log_prior, 0
    with Operator(options.namespace) as operator:
        operator.wait_for_explorer(EXPLORER_S, SOON_S)
        explore = partial(operator.explore_with_features, stopped=operator.watch_stops())
        while number < options.most and np.exp(belief.max()) < options.sure:
            number += 1
            motion, information = known.best_motion(belief, known.motions)
            print(
                f'slide {number}: {motion.motion}, direction {math.degrees(motion.direction_rad):.0f}°, '
                f'{motion.speed_m_s:g} m/s, {motion.force_n:g} N, {motion.duration_s:g} s; '
                f'{information:.2f} nats expected'
            )
            request = ExplorationRequest(
                motion.motion,
                speed_m_s=motion.speed_m_s,
                force_n=motion.force_n,
                distance_m=motion.speed_m_s * motion.duration_s,
                direction_rad=motion.direction_rad,
            )
            result, vectors = explored(explore, request)
            if not result.success:
                return int(not print_result(result))
            belief = known.update(belief, motion, slide_values(vectors, model.feature_set))
            likely = np.argsort(-belief, kind='stable')[:SHOWN]
            print(f'  {", ".join(f"{known.textures[k]} {np.exp(belief[k]):.2f}" for k in likely)}')
    best = int(belief.argmax())
    found = f'{known.textures[best]}, probability {np.exp(belief[best]):.2f} after {counted(number, "slide")}'
    if np.exp(belief[best]) < options.sure:
        found = f'undecided, --sure {options.sure:g} is not reached (nearest: {found})'
    print(f'texture: {found}')
    return 0


# --------------------
# Collect slides of a surface.

RECIPE = 'default'  # whose features distinguish the places
GAPS = 'windows with a gap are left out of features and training; if many are, reduce the load of the computer'
WRITTEN_S = 60.0  # within which a slide is on the disk: the recorder may be behind
RECORDER_S = 60.0  # to start, on a busy machine
PATCH = ('patch_x_low_m', 'patch_x_high_m', 'patch_y_low_m', 'patch_y_high_m')
LEAST_SPEED_M_S = 0.002  # of every explorer
LIMITS = ('min_force_n', 'max_force_n', 'max_speed_m_s')
POLL_S = 0.1
BAGS_LOG = logging.getLogger('texture_recordings.bags')


def collect_surface(
    operator: Operator, surface: str, folder: Path, params: collection.CollectionParams, namespace: str = ''
) -> tuple[collection.CollectionEnd, Path | None]:
    """Collect a surface; return how it ended, and the bag, which is complete however that was, Ctrl-C included.

    A bag without any slide is removed; then None is returned instead.
    """
    from texture_evaluation import collection
    from texture_recordings.bags import is_bag

    low_x, high_x, low_y, high_y, low_n, high_n, high_m_s = operator.parameters('explorer', (*PATCH, *LIMITS))
    if not (low_x < high_x and low_y < high_y):
        raise InvalidData(
            'no surface patch is set: touch the corners of the surface with `texture touch-surface`, or give the '
            f'explorer {", ".join(PATCH)}'
        )
    patch = collection.Patch(low_x, high_x, low_y, high_y)
    plan = collection.PlacePlan(surface, params, patch, (low_n, high_n), (LEAST_SPEED_M_S, high_m_s))
    if before := sorted(filter(is_bag, folder.iterdir())):
        try:
            _features_of(folder)  # what cannot be used is refused before the robot moves
        except TextureError as error:
            raise InvalidData(f"{error}; or move that bag out of '{folder}'") from error
    bag = collection.next_bag(folder, surface)
    made, losses = 0, ''
    end = collection.CollectionEnd(CollectionError.CANCELLED, 'stopped', 0)  # by Ctrl-C while the recorder starts
    try:
        with suppress(KeyboardInterrupt), recorder(operator, bag, namespace) as recording:
            refuse_other_sensor(before, bag, namespace)
            stopped = operator.watch_stops()

            def keep(exploration_id: str) -> None:
                nonlocal made, losses
                with uninterrupted():  # a slide that was made is kept
                    lost = recording.wait_for(exploration_id)
                    made += 1
                if lost != losses:
                    losses = lost
                    _print_progress(losses, made)

            def explore(request: ExplorationRequest) -> tuple[ExplorationError, str]:
                recording.check()
                try:
                    explored = lifted(operator.explore(request, stopped=stopped))
                except MotionRefused as error:
                    return error.error, str(error)
                except Interrupted as stop:
                    if stop.completed:
                        keep(stop.completed)
                    raise
                if explored.success:
                    keep(explored.exploration_id)
                return explored.error, explored.message

            def evaluate() -> collection.PlaceAccuracy:
                return collection.evaluate_places(_features_of(folder), surface)

            end = collection.collect(plan, params, explore, evaluate, _print_progress)
            if recording.end and end.error is not CollectionError.NOT_RECORDED:  # in the last evaluation, say
                end = replace(end, error=CollectionError.NOT_RECORDED, message=f'{recording.end}; {end.message}')
    except (LaunchFailed, ModelMismatch):  # the recorder was not discovered, or another sensor is
        _remove(bag)
        raise
    end = replace(end, message=f'{end.message}; {losses}; {GAPS}' if losses else end.message, slides=made)
    # Where the recorder has ended, the bag there may be another one.
    if made or end.error is CollectionError.NOT_RECORDED:
        return end, bag
    _remove(bag)
    return replace(end, message=f'{end.message}; no slide was made, so no bag is kept'), None


def lifted(explored: ExplorationResult) -> ExplorationResult:
    """Return a result; MotionAborted if the finger moved and is not known to be lifted."""
    if explored.exploration_id and not (explored.success or explored.lifted):
        raise MotionAborted(explored.message)
    return explored


def _remove(bag: Path) -> None:
    """Remove a bag, and its folder if no other surface is in it."""
    shutil.rmtree(bag, ignore_errors=True)
    with suppress(OSError):
        bag.parent.rmdir()


def _print_progress(sentence: str, slides: int) -> None:
    print(f'{counted(slides, "slide")}: {sentence}', flush=True)


def _features_of(folder: Path) -> LabelledFeatures:
    """Return the features of the slides in all bags of a folder."""
    from texture_features.feature_set import FeatureSet
    from texture_recordings.dataset import SlideDataset

    feature_set = FeatureSet.load(RECIPE)
    return SlideDataset.from_bags([folder], topics=feature_set.topics).features(feature_set)


def refuse_other_sensor(bags: Sequence[Path], ours: Path, namespace: str) -> None:
    """Raise ModelMismatch if bags are of another sensor, or rate or channels, than ours, which is being recorded."""
    from texture_recordings.bags import read_bag

    def sensor(bag: Path, within: str | None = None) -> str:
        for _, _, batch in read_bag(bag, ('signal',), within):
            channels = counted(len(batch.channels), 'channel')
            return f"'{batch.sensor}' ({batch.sampling_rate_hz:.6g} Hz, {channels})"
        return ''

    for bag in bags:
        if (there := sensor(bag)) != (came := sensor(ours, namespace)):
            raise ModelMismatch(f"'{bag}' is of the sensor {there}, this one is {came}; name another folder")


class RecorderProcess(Child):
    """Record a bag in a separate process, which reports in its log what is on the disk."""

    called = 'the recorder'

    def __init__(self, bag: Path, namespace: str, log: Path, signal_topics: str = 'signal') -> None:
        given = ['record', str(bag), '--namespace', namespace, '--signal-topics', signal_topics]
        super().__init__(given, os.environ, log)

    def check(self) -> None:
        """Raise InvalidData if it has ended."""
        if self.end:
            raise InvalidData(self.end)

    def wait_for(self, exploration_id: str) -> str:
        """Return what was lost so far, '' if nothing, once an exploration is on the disk; InvalidData if it is not."""
        report = re.compile(rf"'{re.escape(exploration_id)}' is on the disk: \d+ messages recorded, (.*)")
        deadline_s = time.monotonic() + WRITTEN_S
        with task('waiting until the slide is on the disk'):
            while not (found := report.search(self.log.read_text(errors='replace'))):
                self.check()
                if time.monotonic() > deadline_s:
                    raise InvalidData(
                        f"the recorder has not written the slide '{exploration_id}' within {WRITTEN_S:g} s; check the "
                        'disk, or reduce the load of the computer'
                    )
                time.sleep(POLL_S)
        return re.sub(r'nothing lost| \(.*?\)', '', found[1])  # in brackets is what else it means in a replay


@contextmanager
def recorder(operator: Operator, bag: Path, namespace: str) -> Iterator[RecorderProcess]:
    """Record a bag of what the explorer watches, once it holds what the nodes send."""
    [topics] = operator.parameters('explorer', ('signal_topics',))
    ours = f'/{namespace}/'.replace('//', '/')
    wanted = {*(topic.removeprefix(ours) for topic in topics.split()), 'exploration'}
    BAGS_LOG.disabled = True  # a bag that is still recorded has no end, of which reading would warn
    try:
        with (
            tempfile.TemporaryDirectory() as log,
            RecorderProcess(bag, namespace, Path(log) / 'record.log', topics) as recording,
        ):
            operator.wait_until(
                lambda: records(bag, namespace, wanted, recording.check),
                RECORDER_S,
                f'the recorder has not received {" and ".join(sorted(wanted))} yet; look at the output of sensor and '
                'explorer',
            )
            yield recording
    finally:
        BAGS_LOG.disabled = False


def records(bag: Path, namespace: str, wanted: set[str], check: Callable[[], None]) -> bool:
    """Return whether a bag that is being recorded holds all topics: the idle explorer reports once a second."""
    from texture_recordings.bags import topics_in

    check()
    with suppress(InvalidData):  # nothing is written yet
        return wanted <= set(topics_in(bag, namespace))
    return False


# Parameters whose options are shorter; both numbers of a range follow one option.
SHORTER = ('distance_m', 'speed_low_m_s', 'speed_high_m_s', 'force_low_n', 'force_high_n')


def _configure_collect(parser: argparse.ArgumentParser) -> None:
    from texture_evaluation.collection import CollectionParams

    parser.add_argument('surface', help='label of the surface under the finger')
    parser.add_argument('folder', type=Path, help='folder of the bags of all surfaces; made if missing')
    shape: dict[str, Any] = {'type': float, 'nargs': 2, 'default': (0.0, 0.0), 'metavar': ('LOW', 'HIGH')}
    speed = 'lowest and highest speed, m/s (default: 0.02 0.05)'
    force = 'lowest and highest normal force, N (default: 1 2)'
    parser.add_argument('--speed', help=f'{speed}, as far as the explorer allows', **shape)
    parser.add_argument('--force', help=f'{force}, or the lowest that the explorer allows to twice that', **shape)
    add_parameters(parser, CollectionParams, without=SHORTER)
    parser.add_argument(
        '--distance', type=float, default=0.04, metavar='M', help='length of each slide (default: 0.04)'
    )
    add_namespace(parser)


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Lock a folder against a second collection, whose bag would be read before it is complete; a kill unlocks it."""
    lock = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system may have no locks
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InvalidParameter(
                    f"another `texture collect` records into '{folder}' now; wait for its end, or name another folder"
                ) from None
        yield
    finally:
        os.close(lock)


def _collect(options: argparse.Namespace) -> int:
    """Collect, and report how well left-out places are recognised; return 0 if the bound is met, else 1."""
    from texture_evaluation.collection import CollectionParams, next_bag

    needed_label(options.surface)  # refused before the wait for an explorer
    given = dict(zip(SHORTER, (options.distance, *options.speed, *options.force), strict=True))
    params, folder = parameters_from(options, CollectionParams, given), options.folder
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = 'it is a file' if folder.is_file() else error.strerror
        raise InvalidParameter(f"'{folder}' cannot be the folder of the bags: {reason}; name another") from error
    with claimed(folder):
        try:
            with Operator(options.namespace) as operator:
                operator.wait_for_explorer(EXPLORER_S, SOON_S)
                end, bag = collect_surface(operator, options.surface, folder, params, options.namespace)
        finally:
            with suppress(OSError):  # bags are in it
                folder.rmdir()
    kept = f"; {counted(end.slides, 'slide')} in '{bag}'" if bag else ''
    if end.error not in (CollectionError.NONE, CollectionError.BOUND_MISSED):
        # Where nothing could be recorded, the cause says what to do first, which may be to name another folder
        unwritten = end.error is CollectionError.NOT_RECORDED
        into = '' if unwritten else f", into '{next_bag(folder, options.surface)}'"
        kept += f'; {"then " * unwritten}continue at other places with --seed {params.seed + 1}{into}'
    print(f'{end.message}{kept}', file=sys.stderr if end.error else sys.stdout)
    if end.error is CollectionError.CANCELLED:
        raise KeyboardInterrupt
    return 0 if end.error is CollectionError.NONE else 1


# --------------------
# Check the finger on the reference plate.

PLATE = 'reference plate'
# By option: field of the request, unit, meaning, and default where no reference gives one.
PLATE_NUMBERS = {
    'speed': ('speed_m_s', 'm/s', 'speed of the slide', 0.05),
    'force': ('force_n', 'N', 'normal force, 0 for the default of the motion', 0.0),
    'distance': ('distance_m', 'm', 'length of the slide', 0.15),
    'direction': ('direction_rad', 'degrees', 'direction from +x towards +y', 0.0),
}


def _configure_check(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('model', help='path of the model; reference and correction are next to it')
    parser.add_argument(
        '--store',
        action='store_true',
        help='slide twice, and store that as the slide of the finger of the training, if both agree',
    )
    parser.add_argument('--correct', action='store_true', help='write the correction of gain and response, if needed')
    for option, (_, unit, meaning, usual) in PLATE_NUMBERS.items():
        shown = f'{meaning}, {unit}; default: that of the reference, or {usual:g}'
        parser.add_argument(f'--{option}', type=float, help=shown)
    parser.add_argument(
        '--today', nargs='+', metavar='BAG', help='bags of today with a labelled slide of each surface; needs --trained'
    )
    parser.add_argument('--trained', nargs='+', metavar='BAG', help='bags on which it was trained')
    add_namespace(parser)


def _check(options: argparse.Namespace) -> int:
    """Check, store or adapt; return 1 if the finger is not as trained and was not corrected."""
    from texture_features.correction import read_reference

    # Report what is missing before large packages are imported, and before the robot moves.
    compares = not (options.store or options.today or options.trained)
    reference, made = read_reference(options.model) if compares else ({}, {})
    from texture_estimation.model import load_model
    from texture_evaluation.check import adapt_to_today, check_finger, store_reference
    from texture_recordings.dataset import SlideDataset

    if options.today or options.trained:
        if not (options.today and options.trained):
            raise InvalidParameter('--today and --trained need each other: slides of today, and those of the training')
        print(adapt_to_today(options.model, options.trained, options.today))
        return 0
    topics = load_model(options.model).recipe.feature_set.topics
    request = plate_request(options, made)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / 'plate'
        slide_over_plate(bag, request, options.namespace, 2 if options.store else 1)
        slides = SlideDataset.from_bags([bag]).slides
    if options.store:
        print(store_reference(options.model, topics, slides, request))
        return 0
    as_trained, sentence = check_finger(options.model, topics, reference, slides[-1], correct=options.correct)
    print(sentence)
    return 0 if as_trained or options.correct else 1


def plate_request(options: argparse.Namespace, stored: Mapping[str, float]) -> ExplorationRequest:
    """Return the slide over the plate, which is that of the reference: another one shows nothing about the finger."""
    numbers: dict[str, Any] = {}
    for option, (field, unit, _, usual) in PLATE_NUMBERS.items():
        given, in_si = getattr(options, option), math.radians(1.0) if option == 'direction' else 1.0
        numbers[field] = stored.get(field, usual) if given is None else given * in_si
        if not math.isclose(numbers[field], made := stored.get(field, numbers[field]), rel_tol=1e-3):
            raise InvalidParameter(
                f'--{option} is {given:g} {unit}, and the reference was made with {made / in_si:g} {unit}; leave it '
                'out, or store a reference with it by --store'
            )
    return ExplorationRequest('linear_slide', surface=PLATE, **numbers)


def slide_over_plate(bag: Path, request: ExplorationRequest, namespace: str, count: int) -> None:
    """Slide over the reference plate `count` times and record a bag; MotionAborted if a slide fails."""
    with Operator(namespace) as operator:
        operator.wait_for_explorer(EXPLORER_S, SOON_S)
        with recorder(operator, bag, namespace):
            stopped = operator.watch_stops()
            for _ in range(count):
                explored = operator.explore(request, stopped=stopped)
                if not explored.success:
                    raise MotionAborted(f'the slide over the plate failed: {explored.message}')


explore = Command('slide the finger over the surface and print what it is', _configure_explore, _explore)
identify = Command(
    'repeat the slide with the largest information gain until the label is decided', _configure_identify, _identify
)
collect = Command(
    'touch a surface at many places of the surface patch, and record labelled slides', _configure_collect, _collect
)
check = Command('slide over the reference plate, and report whether the finger is as trained', _configure_check, _check)
