# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""One labelled slide: its label and conditions, its samples, its parts, and how slides are found in bags."""

from __future__ import annotations

import logging
import math
import re
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise
from operator import itemgetter
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from texture_core.cli import progress
from texture_core.errors import ExplorationError, InvalidData
from texture_core.types import (
    NANOSECONDS,
    TURNED_RAD,
    AnyArray,
    Array,
    ExplorationState,
    Phase,
    SlideMotion,
    TactileSignal,
    join_batches,
)
from texture_recordings.bags import EXPLORATION, BagPaths, find_bags, read_bag

# --------------------
# One labelled slide in a bag.

BY_USER = (ExplorationError.STOPPED, ExplorationError.CANCELLED, ExplorationError.TIMEOUT)
TOUCH_NS = 200_000_000  # the skin feels a touch before the arm does; of a shorter approach, half


@dataclass(frozen=True)
class LabelledSlide:
    """One exploration with a slide: its label, its conditions, and its signals if they were read."""

    bag: Path
    exploration_id: str
    surface: str
    number: int
    start_ns: int
    stop_ns: int | None
    namespace: str | None = None
    motion: SlideMotion | None = None
    signals: Mapping[str, Sequence[TactileSignal]] = field(default_factory=dict, compare=False, repr=False)
    states: Sequence[ExplorationState] = field(default=(), compare=False, repr=False)
    place: str = ''

    @property
    def name(self) -> str:
        """Surface and number, such as 'cork/3', and the part if it is one: unique over all bags."""
        return f'{self.whole_name} part {self.place}' if self.is_part else self.whole_name

    @property
    def is_part(self) -> bool:
        """Whether it is a part of a slide."""
        return '/' in self.place

    @property
    def whole_name(self) -> str:
        """Name of the slide of which this is a part; of a whole slide its name."""
        return f'{self.surface}/{self.number}'

    @property
    def session(self) -> str:
        """Name of the bag without its ending: slides of one bag were recorded in one session."""
        return self.bag.name.removesuffix('.mcap')

    @property
    def was_faulty(self) -> bool:
        """Whether its exploration was aborted, also by a fault found after the slide; not if the user has ended it."""
        return any(state.phase is Phase.ABORTED and state.error_code not in BY_USER for state in self.states)

    @property
    def sliding(self) -> Sequence[ExplorationState]:
        """States while sliding."""
        return [state for state in self.states if state.phase is Phase.SLIDE]

    @property
    def speed_m_s(self) -> float:
        """Mean speed over the states while sliding; NaN if unknown."""
        return _mean(state.speed_m_s for state in self.sliding)

    @property
    def force_n(self) -> float:
        """Mean normal force over the states while sliding; NaN if unknown."""
        return _mean(state.force_n for state in self.sliding)

    @property
    def direction_rad(self) -> float:
        """Direction at the start of the slide; NaN if unknown."""
        return next((state.direction_rad for state in self.sliding), math.nan)

    @property
    def motion_name(self) -> str:
        """Name of the motion in the catalogue of motions; '' if unknown."""
        return next((state.motion for state in self.sliding), '')

    @property
    def sensor(self) -> str:
        """Name of the sensor of the first topic; '' if no signal was read."""
        return next((batches[0].sensor for batches in self.signals.values() if batches), '')

    def at_rest(self, topic: str) -> Array:
        """Return the samples before the touch, (n, n_channels); none where the approach was not recorded."""
        approaching = [one.stamp_ns for one in self.states if one.phase is Phase.APPROACH]
        touched = [one.stamp_ns for one in self.states if one.phase is not Phase.APPROACH]
        # The rest ends where the approach does; without an approach the rest is unknown.
        end_ns = min([at for at in touched if approaching and at > approaching[0]], default=0)
        until_ns = end_ns - min(TOUCH_NS, (end_ns - approaching[0]) // 2) if end_ns else 0
        # By sample, not by batch: the batches of a slide are joined, so one holds the rest and the touch.
        batches = self.signals[topic]
        counts = [max(0, int((until_ns - one.stamp_ns) * 1e-9 * one.sampling_rate_hz)) for one in batches]
        return np.concatenate([one.samples[:count] for one, count in zip(batches, counts, strict=True)]).astype(float)


def _mean(values: Iterable[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return float(np.mean(known)) if known else math.nan


# --------------------
# How a slide was made, according to the states of its exploration.

STRAIGHT = 'linear_slide'  # of other motions, states do not hold all that is needed to repeat them


def motion_made(states: Sequence[ExplorationState]) -> SlideMotion | None:
    """Return how a slide was made; None if it was not straight, or its speed, force or direction are unknown."""
    sliding = [state for state in states if state.phase is Phase.SLIDE and state.motion == STRAIGHT]
    if not sliding:
        return None
    first, last = sliding[0], sliding[-1]
    turned = (math.remainder(state.direction_rad - first.direction_rad, math.tau) for state in sliding)
    speed, force = (median(numbers) for numbers in zip(*((s.speed_m_s, s.force_n) for s in sliding), strict=True))
    if not all(abs(angle) <= TURNED_RAD for angle in turned) or not (0.0 < speed < math.inf and 0.0 < force < math.inf):
        return None
    over_ns = [state.stamp_ns for state in states if state.stamp_ns > last.stamp_ns]
    end_ns = over_ns[0] if over_ns else last.stamp_ns + round(last.steady_s * NANOSECONDS)
    if end_ns <= first.stamp_ns:
        return None
    return SlideMotion(STRAIGHT, first.direction_rad, speed, force, (end_ns - first.stamp_ns) / NANOSECONDS)


# --------------------
# Labelled slides as arrays: all samples of one topic, and what the finger did.


@dataclass(frozen=True, eq=False)
class SlideSamples:
    """One slide.

    Parameters
    ----------
    slide
        Its bag, surface and number.
    samples : (n, n_channels)
        Samples of the covered time, evenly spaced.
    rate_hz, channels
        Of the samples.
    speed_m_s, force_n, direction_rad
        Means over the states of the slide (the first direction); NaN if unknown.

    Examples
    --------
    >>> from texture_recordings.dataset import SlideDataset
    >>> dataset = SlideDataset.from_arrays({'signal': [np.ones((100, 1))]}, ['cork'], {'signal': 100.0}, speed_m_s=0.05)
    >>> [slide] = dataset.samples('signal')
    >>> slide.surface, slide.samples.shape
    ('cork', (100, 1))
    """

    slide: LabelledSlide
    samples: Array
    rate_hz: float
    channels: tuple[str, ...]
    speed_m_s: float
    force_n: float
    direction_rad: float

    @property
    def surface(self) -> str:
        """The label."""
        return self.slide.surface

    @classmethod
    def of(cls, slide: LabelledSlide, topic: str) -> SlideSamples:
        """Return the samples of one topic of a slide.

        Raises
        ------
        InvalidData
            If it has no samples of the topic or lost some.
        """
        batches, states = slide.signals.get(topic, ()), slide.sliding
        where = f"slide '{slide.name}' in '{slide.bag}'"
        if not batches or not states:
            raise InvalidData(f"{where} has no '{topic}' while sliding; name another topic")
        if any(after.first_sample != before.next_sample for before, after in pairwise(batches)):
            raise InvalidData(f'{where} has lost samples; use windows of it instead')
        rate_hz = batches[0].sampling_rate_hz
        samples = np.concatenate([batch.samples for batch in batches]).astype(np.float64)
        first, last = (round((at - batches[0].stamp_ns) * rate_hz / NANOSECONDS) for at in covered(states))
        return cls(
            slide, samples[max(first, 0) : last], rate_hz, batches[0].channels,
            slide.speed_m_s, slide.force_n, slide.direction_rad,
        )  # fmt: skip


def covered(states: Sequence[ExplorationState]) -> tuple[int, int]:
    """Return when the time that states cover begins and ends, ns."""
    return states[0].stamp_ns, max(state.stamp_ns + round(state.steady_s * NANOSECONDS) for state in states)


# --------------------
# The labelled explorations in bags, and which of them the user means by `--slides 1-30`.

RANGE = re.compile(r'(\d+)(?:-(\d+))?')
Message = tuple[str, int, Any]
STREAMS = ('signal', 'signal_static')


def parse_selection(text: str) -> frozenset[int] | None:
    """Return the numbers in '1-30' or '1,3,5-7'; None, meaning all, for ''."""
    if not isinstance(text, str):
        raise InvalidData(f"slides are {text!r}; a text is needed, such as '1-30' or '1,3,5-7'")
    if not text.strip():
        return None
    numbers: set[int] = set()
    for part in text.split(','):
        match = RANGE.fullmatch(part.strip())
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, 0)
        if not 1 <= first <= last:
            raise InvalidData(f"slides are '{text}'; numbers from 1 and ranges are needed, such as '1-30' or '1,3,5-7'")
        numbers.update(range(first, last + 1))
    return frozenset(numbers)


def find_slides(
    bags: BagPaths, slides: str = '', namespace: str | None = None, topics: Sequence[str] = ()
) -> list[LabelledSlide]:
    """Return the labelled slides in bags, by bag and time, with the signals of topics; each bag is read once.

    Slides are counted separately for each surface, over all the bags, in the order in which they were recorded.
    """
    wanted = parse_selection(slides)
    paths = find_bags(bags)
    labelled = []
    for path in progress(paths, 'reading bags', len(paths)):
        slides_of_bag = _slides_of(path, namespace, topics)
        if not slides_of_bag and len(paths) > 1:
            logging.getLogger(__name__).warning("the bag '%s' has no labelled slide, so nothing is taken from it", path)
        labelled += slides_of_bag
    if not labelled:
        states = [state for path in paths for _, _, state in read_bag(path, (EXPLORATION,), namespace)]
        phases = {state.phase for state in states if state.exploration_id}
        if not phases:
            raise InvalidData(
                f'nothing was explored in {_named(paths)}; explore while it is recorded, or have `texture segment` '
                'find its slides'
            )
        if Phase.SLIDE not in phases:
            raise InvalidData(
                f'no exploration in {_named(paths)} came to its slide: each was refused or aborted before; record '
                "again, and keep what ends with 'the motion was completed'"
            )
        raise InvalidData(
            f'no slide in {_named(paths)} is labelled; label them by `texture segment --surface NAME`, and give the '
            'surface with each exploration that you record'
        )
    numbered = with_places(number_slides(labelled))
    if faulty := [slide for slide in numbered if slide.was_faulty]:
        names = ', '.join(slide.name for slide in faulty)
        logging.getLogger(__name__).warning('aborted slides that were left out, %d: %s', len(faulty), names)
        numbered = [slide for slide in numbered if not slide.was_faulty]
        if not numbered:
            raise InvalidData(f'all slides of {_named(paths)} were aborted; record again')
    found = [slide for slide in numbered if wanted is None or slide.number in wanted]
    if not found:
        most = max(slide.number for slide in numbered)
        raise InvalidData(f"no surface in {_named(paths)} has slides '{slides}'; there are 1 to {most}")
    return found


def _slides_of(path: Path, namespace: str | None, topics: Sequence[str]) -> list[LabelledSlide]:
    """Return the labelled slides of one bag, yet without numbers: an exploration lasts until the next one begins."""
    messages = list(read_bag(path, (*topics, EXPLORATION), namespace))
    reported = [message for message in messages if message[0] == EXPLORATION and message[2].exploration_id]
    groups = [list(group) for _, group in groupby(reported, key=lambda message: message[2].exploration_id)]
    starts: list[int | None] = [group[0][1] for group in groups]
    return [
        slide
        for group, stop_ns in zip(groups, [*starts[1:], None][: len(groups)], strict=True)
        if (slide := _slide(path, namespace, group, stop_ns, messages))
    ]


def _slide(
    path: Path, namespace: str | None, reported: Sequence[Message], stop_ns: int | None, messages: Sequence[Message]
) -> LabelledSlide | None:
    """Return the slide of one exploration with its messages; None if it has no label."""
    states = [state for _, _, state in reported]
    surface = next((state.surface for state in reversed(states) if state.phase is Phase.SLIDE), None)
    if not surface:
        return None
    start_ns = reported[0][1]
    first = bisect_left(messages, start_ns, key=itemgetter(1))
    last = len(messages) if stop_ns is None else bisect_left(messages, stop_ns, key=itemgetter(1))
    streams: defaultdict[str, list[Any]] = defaultdict(list)
    for topic, _, value in messages[first:last]:
        streams[topic].append(value)
    heard = streams.pop(EXPLORATION)
    phases = [None, *(state.phase for state in heard)]
    began = [now.stamp_ns for was, now in zip(phases, heard, strict=False) if now.phase is Phase.SLIDE is not was]
    # A hundred small batches a second take ten times the memory of their samples, and most of the time of the cutter.
    signals = {topic: join_batches(batches, began) for topic, batches in streams.items()}
    return LabelledSlide(
        path, states[0].exploration_id, surface, 0, start_ns, stop_ns, namespace, motion_made(states), signals, heard
    )


def number_slides(slides: Sequence[LabelledSlide]) -> list[LabelledSlide]:
    """Return slides numbered separately for each surface from 1, in the order of their start."""
    by_surface: defaultdict[str, list[LabelledSlide]] = defaultdict(list)
    for slide in slides:
        by_surface[slide.surface].append(slide)
    numbers = {
        id(slide): number
        for group in by_surface.values()
        for number, slide in enumerate(sorted(group, key=lambda slide: slide.start_ns), 1)
    }
    return [replace(slide, number=numbers[id(slide)]) for slide in slides]


PLACE_M = 0.005  # touches that are nearer count as one place: arms and surfaces are not exact
TOUCHING = (Phase.CONTACT, Phase.SLIDE)


def with_places(slides: Sequence[LabelledSlide]) -> list[LabelledSlide]:
    """Return slides with the place of their touch, where slides of one surface touched at several."""
    touched: dict[str, list[tuple[float, float]]] = defaultdict(list)
    found: list[tuple[float, float] | None] = []
    for slide in slides:
        touch = next(((s.x_m, s.y_m) for s in slide.states if s.phase in TOUCHING), (math.nan, math.nan))
        if math.isnan(touch[0] + touch[1]):
            found.append(None)
            continue
        places = touched[slide.surface]
        near = next((place for place in places if math.dist(place, touch) < PLACE_M), None)
        places += [touch] if near is None else []
        found.append(near or touch)
    return [
        replace(slide, place=f'at {1e3 * place[0]:.0f},{1e3 * place[1]:.0f} mm')
        if place is not None and len(touched[slide.surface]) > 1
        else slide
        for slide, place in zip(slides, found, strict=True)
    ]


def _named(paths: Sequence[Path]) -> str:
    return f"'{paths[0]}'" if len(paths) == 1 else f"the {len(paths)} bags from '{paths[0]}' on"


# --------------------
# Slides cut into parts: the place on the surface as a condition.

STEP_NS = 1_000_000  # to which a cut is placed


Stretch = tuple[int, int, int]  # of a slide within one cell of the path: number of the cell, begin and end, ns


def stretches(slides: Sequence[LabelledSlide], count: int) -> list[list[Stretch]]:
    """Return for each slide of one surface its stretches in equal cells of the path, in the order of time."""
    spans = [covered(slide.sliding) for slide in slides]
    grids = [np.arange(start_ns, end_ns, STEP_NS) for start_ns, end_ns in spans]
    ways, low, high = _ways(slides, grids)
    found = []
    for (_, end_ns), grid, way in zip(spans, grids, ways, strict=True):
        cells = np.clip(np.floor((way - low) / max(high - low, 1e-12) * count), 0, count - 1).astype(int)
        edges = [0, *(np.flatnonzero(np.diff(cells)) + 1).tolist(), len(grid)]
        times = [*grid[edges[:-1]].tolist(), end_ns]
        runs = [(int(cells[edge]), *span) for edge, span in zip(edges[:-1], pairwise(times), strict=True)]
        # Of a path that comes back to a cell, the longest stretch is kept.
        longest = {run[0]: run for run in sorted(runs, key=lambda run: run[2] - run[1])}
        found.append([run for run in runs if longest[run[0]] is run])
    return found


def _ways(slides: Sequence[LabelledSlide], grids: Sequence[AnyArray]) -> tuple[list[Array], float, float]:
    """Return how far along the path of their surface slides were at the times of grids, and where the path lies."""
    stamps = [np.array([state.stamp_ns for state in slide.sliding]) for slide in slides]
    points = [np.array([(state.x_m, state.y_m) for state in slide.sliding]) for slide in slides]
    if all(np.isfinite(xyz).all() for xyz in points) and len({s.frame_id for x in slides for s in x.sliding}) == 1:
        together = np.concatenate(points)
        axis = np.linalg.svd(together - together.mean(axis=0), full_matrices=False)[2][0]
        ways = [np.interp(grid, at, xyz @ axis) for grid, at, xyz in zip(grids, stamps, points, strict=True)]
        return ways, min(map(np.min, ways)), max(map(np.max, ways))
    # Without positions all slides of a surface are taken to run over one track, from one end of it or the other.
    speeds = [np.array([state.speed_m_s for state in slide.sliding]) for slide in slides]
    if not all(np.isfinite(speed).all() for speed in speeds):
        speeds = [np.ones(len(speed)) for speed in speeds]
    ways = [
        np.cumsum(np.r_[0.0, np.interp(grid, at, speed)[:-1]]) * (STEP_NS / NANOSECONDS)
        for grid, at, speed in zip(grids, stamps, speeds, strict=True)
    ]
    length = float(np.median([way[-1] for way in ways]))
    turned = [math.cos(slide.direction_rad - slides[0].direction_rad) < 0.0 for slide in slides]  # NaN is not turned
    return [length - way if back else way for way, back in zip(ways, turned, strict=True)], 0.0, length


def part_of(slide: LabelledSlide, begin_ns: int, end_ns: int, place: str) -> LabelledSlide:
    """Return a stretch as a slide; the first one keeps what came before the slide, the last one what came after."""
    start_ns, stop_ns = covered(slide.sliding)
    first, last = begin_ns <= start_ns, end_ns >= stop_ns
    sliding = slide.sliding
    states = [state for state in slide.states if first and state.stamp_ns < begin_ns]
    for state, after in zip(sliding, [*sliding[1:], None], strict=True):
        if state.stamp_ns < end_ns and (after is None or after.stamp_ns > begin_ns):
            since_ns = max(state.stamp_ns, begin_ns)
            until_ns = min(state.stamp_ns + round(state.steady_s * NANOSECONDS), end_ns)
            states.append(replace(state, stamp_ns=since_ns, steady_s=max(0, until_ns - since_ns) / NANOSECONDS))
    if last:
        states += [state for state in slide.states if state.stamp_ns > sliding[-1].stamp_ns]
    else:
        states.append(replace(states[-1], stamp_ns=end_ns, phase=Phase.LIFT, steady_s=0.0))
    since, until = (None if first else begin_ns), (None if last else end_ns)
    signals = {
        topic: tuple(cut for batch in batches if (cut := _between(batch, since, until)))
        for topic, batches in slide.signals.items()
    }
    return replace(slide, place=place, motion=motion_made(states), signals=signals, states=states)


def _between(batch: TactileSignal, begin_ns: int | None, end_ns: int | None) -> TactileSignal | None:
    """Return the samples of a batch from a time to before another; None without any."""
    per_ns, count = batch.sampling_rate_hz / NANOSECONDS, len(batch.samples)
    first, last = (
        default if at is None else min(count, max(0, math.ceil((at - batch.stamp_ns) * per_ns - 1e-6)))
        for at, default in ((begin_ns, 0), (end_ns, count))
    )
    if first >= last:
        return None
    stamp_ns = batch.stamp_ns + round(first / per_ns)
    return replace(batch, stamp_ns=stamp_ns, first_sample=batch.first_sample + first, samples=batch.samples[first:last])
