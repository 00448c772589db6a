# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Labelled slides from bags, tables or public sets: `SlideDataset`, its conditions, its samples."""

from __future__ import annotations

import logging
import math
import re
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise
from operator import itemgetter
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from texture_core.cli import progress
from texture_core.errors import InvalidData, ModelMismatch
from texture_core.types import (
    NANOSECONDS,
    TURNED_RAD,
    AnyArray,
    Array,
    ExplorationState,
    FeatureVector,
    Phase,
    SlideMotion,
    TactileSignal,
    Window,
    join_batches,
)
from texture_features.feature_set import LabelledFeatures
from texture_features.windows import CutWindow, WindowBatch, WindowEvent, cut_recording
from texture_recordings.bags import find_bags, is_bag, read_bag, short_name, topics_in

if TYPE_CHECKING:
    from texture_features.augmentation import Augmentation
    from texture_features.feature_set import FeatureSet


# --------------------
# One labelled slide in a bag.


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
        """Name of the slide of which this is a part; of a whole slide its own."""
        return f'{self.surface}/{self.number}'

    @property
    def session(self) -> str:
        """Name of the bag without its ending: slides of one bag were recorded in one session."""
        return self.bag.name.removesuffix('.mcap')

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


def _mean(values: Iterable[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return float(np.mean(known)) if known else math.nan


# --------------------
# How a slide was made, as the states of its exploration tell.

STRAIGHT = 'linear_slide'  # of other motions, states do not tell all that is needed to make them again


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
        Where it lies, its surface and number.
    before : (m, n_channels)
        Samples before the slide began, in contact; often none.
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
    >>> slide.surface, slide.windows(count=50).samples.shape
    ('cork', (50, 1))
    """

    slide: LabelledSlide
    before: Array
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

    @property
    def distance_m(self) -> float:
        """How far the finger slid; NaN if the speed is unknown."""
        return len(self.samples) / self.rate_hz * self.speed_m_s

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
        first, last = (round((at - batches[0].stamp_ns) * rate_hz / NANOSECONDS) for at in _covered(states))
        return cls(
            slide, samples[: max(first, 0)], samples[max(first, 0) : last], rate_hz, batches[0].channels,
            slide.speed_m_s, slide.force_n, slide.direction_rad,
        )  # fmt: skip

    def windows(self, start: int = 0, count: int | None = None, speed_m_s: float | None = None) -> WindowBatch:
        """Return a stretch of the slide, all of it by default, to be described; at another speed if one is given.

        Parameters
        ----------
        start
            Number of the first sample.
        count
            Number of samples; None for all from there on.
        speed_m_s
            Speed to which the stretch is resampled; None keeps that of the slide.

        Returns
        -------
        WindowBatch
            One window.
        """
        samples = self.samples[start : None if count is None else start + count]
        speed = self.speed_m_s if speed_m_s is None else speed_m_s
        return WindowBatch(samples, self.rate_hz, np.array(speed), np.array(self.force_n), channels=self.channels)


def _covered(states: Sequence[ExplorationState]) -> tuple[int, int]:
    return states[0].stamp_ns, max(state.stamp_ns + round(state.steady_s * NANOSECONDS) for state in states)


# --------------------
# The labelled explorations in bags, and which of them the user means by `--slides 1-30`.

RANGE = re.compile(r'(\d+)(?:-(\d+))?')
Message = tuple[str, int, Any]
STREAMS, STATES = ('signal', 'signal_static'), 'exploration'


def parse_selection(text: str) -> frozenset[int] | None:
    """Return the numbers in '1-30' or '1,3,5-7'; None, meaning all, for ''."""
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
    bags: Iterable[str | Path], slides: str = '', namespace: str | None = None, topics: Sequence[str] = ()
) -> list[LabelledSlide]:
    """Return the labelled slides in bags, by bag and time, with the signals of topics; each bag is read once.

    Slides are counted for each surface by itself, over all the bags, in the order in which they were recorded.
    """
    wanted = parse_selection(slides)
    paths = find_bags(bags)
    labelled = []
    for path in progress(paths, 'read bags', len(paths)):
        own = _slides_of(path, namespace, topics)
        if not own and len(paths) > 1:
            logging.getLogger(__name__).warning("the bag '%s' has no labelled slide, so nothing is taken from it", path)
        labelled += own
    if not labelled:
        raise InvalidData(
            f"no slide in {_named(paths)} is labelled; give the surface's name with each exploration you record"
        )
    numbered = with_places(number_slides(labelled))
    found = [slide for slide in numbered if wanted is None or slide.number in wanted]
    if not found:
        most = max(slide.number for slide in numbered)
        raise InvalidData(f"no surface in {_named(paths)} has slides '{slides}'; there are 1 to {most}")
    return found


def _slides_of(path: Path, namespace: str | None, topics: Sequence[str]) -> list[LabelledSlide]:
    """Return the labelled slides of one bag, yet without numbers: an exploration lasts until the next one begins."""
    messages = list(read_bag(path, (*topics, STATES), namespace))
    reported = [message for message in messages if message[0] == STATES and message[2].exploration_id]
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
    heard = streams.pop(STATES)
    began = [now.stamp_ns for was, now in pairwise([None, *heard]) if _begins(was, now)]
    # A hundred small batches a second take ten times the memory of their samples, and most of the time of the cutter.
    signals = {topic: join_batches(batches, began) for topic, batches in streams.items()}
    return LabelledSlide(
        path, states[0].exploration_id, surface, 0, start_ns, stop_ns, namespace, motion_made(states), signals, heard
    )


def _begins(was: ExplorationState | None, now: ExplorationState) -> bool:
    return now.phase is Phase.SLIDE and (was is None or was.phase is not Phase.SLIDE)


def number_slides(slides: Sequence[LabelledSlide]) -> list[LabelledSlide]:
    """Return slides numbered for each surface by itself from 1, in the order of their start."""
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
# Labelled slides with their signals: read once from bags, or given as arrays.

HOPS = 4  # windows of the least distance overlap so often
GAP_NS = NANOSECONDS  # between two slides that are given as arrays
# Speeds and forces that differ by less are one condition: an arm does not keep to what it was asked for.
SAME_RATIO, SAME_RAD = 1.05, 0.1


@dataclass(frozen=True, eq=False)
class SlideDataset:
    """Labelled slides: for training, evaluation and cross-validation, and for export.

    All signals are held in memory, as float32: an hour of one channel at 2200 Hz takes 32 MB.

    Parameters
    ----------
    slides
        In the order of the bags and of time.

    Raises
    ------
    InvalidData
        If there is no slide.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> recordings = {'signal': [rng.normal(size=(2000, 1)) for _ in range(4)]}
    >>> dataset = SlideDataset.from_arrays(
    ...     recordings, ['cork', 'cork', 'felt', 'felt'], {'signal': 1000.0}, speed_m_s=[0.02, 0.04, 0.02, 0.04]
    ... )
    >>> [slide.name for slide in dataset]
    ['cork/1', 'cork/2', 'felt/1', 'felt/2']
    >>> len(dataset.select(labels=['felt'])), dataset.condition('speed').tolist()
    (2, [0.02, 0.04, 0.02, 0.04])
    """

    slides: tuple[LabelledSlide, ...]

    def __post_init__(self) -> None:
        if not self.slides:
            raise InvalidData('the data set has no slide; select fewer conditions, or record labelled slides')

    @classmethod
    def from_bags(
        cls,
        bags: Iterable[str | Path],
        slides: str = '',
        namespace: str | None = None,
        topics: Sequence[str] = STREAMS,
    ) -> SlideDataset:
        """Read the labelled slides of bags with their signals; see `find_slides` for the arguments and errors.

        Parameters
        ----------
        bags
            Bags, or folders of bags.
        slides
            Slides of each surface to keep, such as '1-30'; '' keeps all.
        namespace
            Namespace of the finger, if bags hold several.
        topics
            Signals to read.

        Returns
        -------
        SlideDataset
            By bag and time.
        """
        return cls(tuple(find_slides(bags, slides, namespace, topics)))

    @classmethod
    def from_arrays(
        cls,
        signals: Mapping[str, Sequence[AnyArray]],
        labels: Sequence[str],
        rates_hz: Mapping[str, float],
        *,
        speed_m_s: float | Sequence[float] = math.nan,
        force_n: float | Sequence[float] = math.nan,
        direction_rad: float | Sequence[float] = math.nan,
        channels: Mapping[str, Sequence[str]] | None = None,
        motion: str = 'linear_slide',
        sensor: str = '',
        session: str = '',
    ) -> SlideDataset:
        """Build a data set from arrays; the finger slides from the first sample of each to the last.

        Parameters
        ----------
        signals
            By topic, such as 'signal': one array (n_samples, n_channels) for each slide.
        labels : (n_slides,)
            Surface of each slide.
        rates_hz
            Sampling rate of each topic, Hz.
        speed_m_s, force_n, direction_rad
            Conditions of all slides, or of each, (n_slides,).
        channels
            Names of the channels of each topic; 'c0', 'c1', … if not given.
        motion, sensor, session
            Name of the motion, of the sensor and of the recording.

        Returns
        -------
        SlideDataset
            In the order of the arrays.

        Raises
        ------
        InvalidData
            If the numbers of slides or channels contradict each other.
        """
        count = len(labels)
        _check_counts(signals, rates_hz, count)
        numbers = {
            name: _one_each(name, values, count)
            for name, values in (('speed_m_s', speed_m_s), ('force_n', force_n), ('direction_rad', direction_rad))
        }
        slides, start_ns = [], 0
        for index, label in enumerate(labels):
            batches = {
                topic: _batch(arrays[index], (sensor or topic, (channels or {}).get(topic), rates_hz[topic]), start_ns)
                for topic, arrays in signals.items()
            }
            duration_ns = max(batch.end_ns for batch in batches.values()) - start_ns
            state = ExplorationState(
                start_ns,
                f'{session or "array"}/{index}',
                motion,
                Phase.SLIDE,
                duration_ns / NANOSECONDS,
                float(numbers['speed_m_s'][index]),
                float(numbers['force_n'][index]),
                float(numbers['direction_rad'][index]),
                surface=str(label),
            )
            slides.append(
                LabelledSlide(
                    Path(session), state.exploration_id, str(label), 0, start_ns, None,
                    motion=motion_made([state]),
                    signals={topic: (batch,) for topic, batch in batches.items()},
                    states=(state,),
                )
            )  # fmt: skip
            start_ns = max(batch.end_ns for batch in batches.values()) + GAP_NS
        return cls(tuple(number_slides(slides)))

    def __len__(self) -> int:
        return len(self.slides)

    def __iter__(self) -> Iterator[LabelledSlide]:
        return iter(self.slides)

    def __getitem__(self, index: int) -> LabelledSlide:
        return self.slides[index]

    @property
    def labels(self) -> NDArray[np.str_]:
        """Surface of each slide, (n_slides,)."""
        return np.array([slide.surface for slide in self.slides])

    @property
    def names(self) -> NDArray[np.str_]:
        """Name of each slide, such as 'cork/3', (n_slides,)."""
        return np.array([slide.name for slide in self.slides])

    def condition(self, name: str) -> AnyArray:
        """Return a condition of each slide, (n_slides,): what `CONDITIONS` lists, such as 'speed' in m/s.

        Speeds and forces within 5 %, and directions within 0.1 rad, of their neighbour in order count as equal: the
        rounded mean of each group is returned.

        Parameters
        ----------
        name
            One of `CONDITIONS`.

        Returns
        -------
        (n_slides,)
            Numbers in SI units, or names.

        Raises
        ------
        InvalidData
            If there is no such condition, or a slide does not tell it.
        """
        if name not in CONDITIONS:
            raise InvalidData(f"slides have no condition '{name}'; use one of {', '.join(CONDITIONS)}")
        values = np.array([CONDITIONS[name](slide) for slide in self.slides])
        if name == 'place' and not all(values):
            raise InvalidData(
                'the slides are not cut into parts, so all are of one place; cut them by in_parts(2) first'
            )
        if values.dtype.kind != 'f':
            return values
        unknown = np.flatnonzero(np.isnan(values))
        if len(unknown):
            raise InvalidData(
                f"slide '{self.slides[unknown[0]].name}' and {len(unknown) - 1} others do not tell their {name}; "
                f'use slides that were recorded with it, or another condition'
            )
        return _grouped(values, circular=name == 'direction')

    def select(
        self,
        slides: str = '',
        *,
        labels: Iterable[str] | None = None,
        where: Callable[[LabelledSlide], bool] = lambda _: True,
    ) -> SlideDataset:
        """Return some of the slides, which keep their numbers.

        Parameters
        ----------
        slides
            Numbers of the slides of each surface, such as '1-30' or '1,3,5-7'; '' for all.
        labels
            Surfaces; None for all.
        where
            Says of a slide whether to keep it.

        Returns
        -------
        SlideDataset
            In the same order.

        Raises
        ------
        InvalidData
            If no slide is left.
        """
        numbers = parse_selection(slides)
        surfaces = None if labels is None else set(labels)
        return SlideDataset(
            tuple(
                slide
                for slide in self.slides
                if (numbers is None or slide.number in numbers)
                and (surfaces is None or slide.surface in surfaces)
                and where(slide)
            )
        )

    def take(self, indices: AnyArray) -> SlideDataset:
        """Return the slides of a mask or of indices, as a splitter gives them; they keep their numbers.

        Parameters
        ----------
        indices : (n_slides,) bool, or (n_taken,) int
            Which slides are taken.
        """
        return SlideDataset(tuple(self.slides[int(index)] for index in np.arange(len(self))[indices]))

    def in_parts(self, count: int) -> SlideDataset:
        """Return the slides cut into parts at different places of their surface, which keep their numbers.

        The path of each surface is divided into equal lengths: along the longest extent of the reported positions;
        where a slide tells none, by the distance from its start; without speeds, by the time. Slides that run the other
        way are then counted from the other end. No window spans two parts, as each is a slide of its own.

        Slides over one track are one place, however many: only the parts of it show how far a training reaches.

        Parameters
        ----------
        count
            Number of parts, from 2 on.

        Returns
        -------
        SlideDataset
            In the same order, the parts of a slide in the order of time.

        Raises
        ------
        InvalidData
            If `count` is below 2, the slides are cut already, or one has no state while sliding.

        Examples
        --------
        >>> dataset = SlideDataset.from_arrays({'signal': [np.ones((100, 1))]}, ['cork'], {'signal': 100.0})
        >>> dataset.in_parts(2).names.tolist()
        ['cork/1 part 1/2', 'cork/1 part 2/2']
        """
        if count < 2:
            raise InvalidData(f'slides are to be cut into {count} parts; 2 or more are needed')
        if cut := next((slide for slide in self.slides if slide.is_part or not slide.sliding), None):
            why = 'is a part already' if cut.is_part else 'tells no time of sliding'
            raise InvalidData(f"slide '{cut.name}' in '{cut.bag}' {why}; cut whole slides with their states")
        stretches: dict[str, list[Stretch]] = {}
        for surface in dict.fromkeys(slide.surface for slide in self.slides):
            own = [slide for slide in self.slides if slide.surface == surface]
            stretches |= {slide.name: found for slide, found in zip(own, _stretches(own, count), strict=True)}
        return SlideDataset(
            tuple(
                _part(slide, begin_ns, end_ns, f'{cell + 1}/{count}')
                for slide in self.slides
                for cell, begin_ns, end_ns in stretches[slide.name]
            )
        )

    def windows(self, feature_set: FeatureSet) -> Iterator[tuple[LabelledSlide, list[WindowEvent]]]:
        """Yield each slide with its windows and its end, as the feature extractor on the robot cuts them.

        Raises
        ------
        ModelMismatch
            If a slide has nothing of an input.
        """
        for slide in progress(self.slides, 'compute features of slides', len(self)):
            yield slide, cut_slide(slide, feature_set)

    def vectors(self, feature_set: FeatureSet) -> Iterator[tuple[LabelledSlide, list[FeatureVector]]]:
        """Yield each slide with the feature vectors of its windows, (n_windows,), which bear the name of the slide.

        Raises
        ------
        ModelMismatch
            If a slide has nothing of an input.
        """
        for slide, events in self.windows(feature_set):
            yield slide, _described(slide, feature_set, events)

    def features(
        self, feature_set: FeatureSet, augmentation: Augmentation | None = None, distances_m: Sequence[float] = ()
    ) -> LabelledFeatures:
        """Return features `X`, labels `y` and slides `groups` of all windows, with their times.

        Parameters
        ----------
        feature_set
            Windows, inputs and features.
        augmentation
            Changes of copies of the slides, for training; with None or without copies there are none.
        distances_m
            How far the finger slides in further windows, m, which show so much of a surface, or the whole of a shorter
            slide, of slides whose speed is known and that lost no samples; () for none.

        Returns
        -------
        LabelledFeatures
            Of all windows, slide by slide.

        Raises
        ------
        InvalidData
            If no slide has a whole window.
        ModelMismatch
            If a slide lacks an input, or the slides differ in rates or channels.
        """
        augmenter = None
        if augmentation is not None and augmentation.copies:
            from texture_features.augmentation import Augmenter  # noqa: PLC0415  # needs scipy

            augmenter = Augmenter(feature_set, augmentation)
        # One pass over the slides: windows, copies, and windows of other lengths.
        vectors: list[FeatureVector] = []
        resized: list[FeatureVector] = []
        for slide, events in self.windows(feature_set):
            vectors += _described(slide, feature_set, events)
            resized += feature_set.extract_many(_windows_over(slide, feature_set, distances_m))
            if augmenter is not None:
                augmenter.add(slide.name, events, slide.signals, slide.states)
        if not vectors:
            raise no_window(self, feature_set)
        surfaces = {slide.name: slide.surface for slide in self.slides}
        features = LabelledFeatures.from_vectors(vectors, surfaces)
        motions = {slide.name: slide.motion for slide in self.slides if slide.motion}
        slides = {slide.name: slide for slide in self.slides}
        conditions = {
            name: replace(made, session=slides[name].session, place=slides[name].place)
            for name, made in features.conditions.items()
        }
        return replace(
            features,
            motions=motions,
            conditions=conditions,
            augmented=augmenter.result() if augmenter is not None else None,
            resized=LabelledFeatures.from_vectors(resized, surfaces) if resized else None,
        )

    def tare_faults(self, feature_set: FeatureSet) -> list[str]:
        """Return sentences on streams that are tared and should not be, or the other way round, as the node warns.

        Streams whose sensor has no name, as arrays from elsewhere, tell nothing.
        """
        faults: dict[str, None] = {}
        for slide in self.slides:
            batches = {topic: batches[0] for topic, batches in slide.signals.items() if batches}
            tared = {topic: batch.tared for topic, batch in batches.items() if batch.sensor not in ('', topic)}
            faults.update(dict.fromkeys(feature_set.tare_faults(tared)))
        return list(faults)

    def samples(self, topic: str) -> list[SlideSamples]:
        """Return the samples of one topic of each slide without gaps, with speed, force and direction.

        Raises
        ------
        InvalidData
            If a slide has no samples of the topic or lost some.
        """
        return [SlideSamples.of(slide, topic) for slide in self.slides]

    def to_numpy(self, topic: str = 'signal') -> tuple[list[Array], NDArray[np.str_]]:
        """Return the samples of each slide, (n_samples, n_channels) each, and its label, (n_slides,).

        Parameters
        ----------
        topic
            Signal to return.

        Returns
        -------
        list of (n_samples, n_channels)
            In the unit of the signal.
        (n_slides,) of text
            Surface of each.

        Raises
        ------
        InvalidData
            If a slide has no samples of the topic or lost some.
        """
        return [slide.samples for slide in self.samples(topic)], self.labels


def cut_slide(slide: LabelledSlide, feature_set: FeatureSet) -> list[WindowEvent]:
    """Return the windows of a slide and its end, as the feature extractor on the robot cuts them."""
    missing = [topic for topic in feature_set.topics if not slide.signals.get(topic)]
    if missing:
        # The bag may hold streams that the recipe did not ask for.
        in_bag = topics_in(slide.bag, slide.namespace) if is_bag(slide.bag) else slide.signals
        there = sorted(topic for topic in in_bag if topic not in missing and short_name(topic) in STREAMS)
        raise ModelMismatch(
            f"slide '{slide.name}' in '{slide.bag}' has no '{missing[0]}', only {', '.join(there) or 'states'}; "
            f'the windows need {", ".join(feature_set.topics)}: use another recipe or record the missing topic'
        )
    used = {topic: slide.signals[topic] for topic in feature_set.topics}
    return list(cut_recording(used, slide.states, feature_set.windows, feature_set.window_names))


def _windows_over(slide: LabelledSlide, feature_set: FeatureSet, distances_m: Sequence[float]) -> Iterator[CutWindow]:
    """Yield windows of a slide at a known speed without gaps, of each distance; the least one overlaps four times."""
    if not distances_m or not slide.speed_m_s > 0.0:
        return
    try:
        inputs = {topic: SlideSamples.of(slide, topic) for topic in feature_set.topics}
    except InvalidData:
        return
    slid_s = min(len(samples.samples) / samples.rate_hz for samples in inputs.values())
    windows, hop_s = feature_set.windows, distances_m[0] / HOPS / slide.speed_m_s
    for length_s in sorted({min(distance_m / slide.speed_m_s, slid_s) for distance_m in distances_m}):
        for start_s in np.arange(0.0, slid_s - length_s + 1e-9, hop_s).tolist():
            cut = {topic: _stretch(samples, start_s, length_s) for topic, samples in inputs.items()}
            if all(np.isfinite(window.samples).all() for window in cut.values()):
                start_ns = slide.start_ns + round(start_s * NANOSECONDS)
                yield CutWindow(
                    start_ns, slide.name, windows.length_s, windows.hop_s, cut, slide.speed_m_s, slide.force_n
                )


def _stretch(slide: SlideSamples, start_s: float, length_s: float) -> Window:
    first = round(start_s * slide.rate_hz)
    samples = slide.samples[first : first + max(1, round(length_s * slide.rate_hz))]
    return Window(samples, slide.rate_hz, slide.channels)


def _described(slide: LabelledSlide, feature_set: FeatureSet, events: Sequence[WindowEvent]) -> list[FeatureVector]:
    """Return the feature vectors of the windows of a slide under its name; not its end."""
    vectors = (vector for vector in feature_set.extract_many(events) if not vector.last)
    return [replace(vector, exploration_id=slide.name) for vector in vectors]


def no_window(dataset: SlideDataset, feature_set: FeatureSet) -> InvalidData:
    """Return the error for slides of which not one has a usable window."""
    return InvalidData(
        f'none of the {len(dataset)} slides has a whole window of {feature_set.windows.length_s} s; '
        'record longer slides without losses, or use a recipe with shorter windows'
    )


# --------------------
# Slides cut into parts: the place on the surface as a condition.

STEP_NS = 1_000_000  # to which a cut is placed


Stretch = tuple[int, int, int]  # of a slide within one cell of the path: number of the cell, begin and end, ns


def _stretches(slides: Sequence[LabelledSlide], count: int) -> list[list[Stretch]]:
    """Return for each slide of one surface its stretches in equal cells of the path, in the order of time."""
    spans = [_covered(slide.sliding) for slide in slides]
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
    if all(np.isfinite(own).all() for own in points) and len({s.frame_id for x in slides for s in x.sliding}) == 1:
        together = np.concatenate(points)
        axis = np.linalg.svd(together - together.mean(axis=0), full_matrices=False)[2][0]
        ways = [np.interp(grid, at, own @ axis) for grid, at, own in zip(grids, stamps, points, strict=True)]
        return ways, min(map(np.min, ways)), max(map(np.max, ways))
    # Without positions all slides of a surface are taken to run over one track, from one end of it or the other.
    speeds = [np.array([state.speed_m_s for state in slide.sliding]) for slide in slides]
    if not all(np.isfinite(own).all() for own in speeds):
        speeds = [np.ones(len(own)) for own in speeds]
    ways = [
        np.cumsum(np.r_[0.0, np.interp(grid, at, own)[:-1]]) * (STEP_NS / NANOSECONDS)
        for grid, at, own in zip(grids, stamps, speeds, strict=True)
    ]
    length = float(np.median([way[-1] for way in ways]))
    turned = [math.cos(slide.direction_rad - slides[0].direction_rad) < 0.0 for slide in slides]  # NaN is not turned
    return [length - way if back else way for way, back in zip(ways, turned, strict=True)], 0.0, length


def _part(slide: LabelledSlide, begin_ns: int, end_ns: int, place: str) -> LabelledSlide:
    """Return a stretch as a slide; the first one keeps what came before the slide, the last one what came after."""
    start_ns, stop_ns = _covered(slide.sliding)
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


CONDITIONS: Mapping[str, Callable[[LabelledSlide], Any]] = {
    'speed': lambda slide: slide.speed_m_s,  # m/s
    'force': lambda slide: slide.force_n,  # N
    'direction': lambda slide: slide.direction_rad,  # rad
    'motion': lambda slide: slide.motion_name,
    'sensor': lambda slide: slide.sensor,
    'session': lambda slide: slide.session,
    'place': lambda slide: slide.place,
    'number': lambda slide: slide.number,
}


def _grouped(values: Array, *, circular: bool) -> Array:
    """Return the rounded mean of the group of each value, (n,): groups end where neighbours in order differ."""
    order = np.argsort(values, kind='stable')
    ordered = values[order]
    apart = np.diff(ordered) > (SAME_RAD if circular else (SAME_RATIO - 1.0) * np.abs(ordered[:-1]))
    group = np.concatenate(([0], np.cumsum(apart)))
    if circular and group[-1] and ordered[0] + math.tau - ordered[-1] <= SAME_RAD:  # -π is π
        ordered = np.where(group == group[-1], ordered - math.tau, ordered)
        group[group == group[-1]] = 0
    means = np.bincount(group, ordered) / np.bincount(group)
    result = np.empty(len(values))
    result[order] = [float(f'{mean:.3g}') for mean in means[group]]
    return result


def _check_counts(signals: Mapping[str, Sequence[AnyArray]], rates_hz: Mapping[str, float], count: int) -> None:
    for topic, arrays in signals.items():
        if len(arrays) != count or topic not in rates_hz:
            raise InvalidData(
                f"'{topic}' has {len(arrays)} slides and the rate {rates_hz.get(topic)} for {count} labels; "
                'give one array (n_samples, n_channels) for each label, and the rate of each topic in Hz'
            )
    if not signals:
        raise InvalidData("no signal was given; give arrays by topic, such as {'signal': [...]}")


def _one_each(name: str, values: float | Sequence[float], count: int) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (count,)):
        raise InvalidData(f'{name} has the shape {array.shape}; give one number, or one for each of {count} slides')
    return np.broadcast_to(array, (count,))


def _batch(array: AnyArray, template: tuple[str, Sequence[str] | None, float], start_ns: int) -> TactileSignal:
    """Return the samples of a slide as a batch; `template` is the sensor, the names of the channels and the rate."""
    sensor, channels, rate_hz = template
    samples = np.atleast_2d(np.asarray(array, dtype=np.float32).T).T  # one channel may be given without its axis
    names = tuple(channels) if channels else tuple(f'c{number}' for number in range(samples.shape[1]))
    return TactileSignal(start_ns, sensor, names, (), rate_hz, 0, samples)
