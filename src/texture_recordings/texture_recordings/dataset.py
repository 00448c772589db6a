# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Labelled slides from bags, tables or public sets as a data set: `SlideDataset`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from texture_core.cli import progress
from texture_core.errors import InvalidData, ModelMismatch
from texture_core.types import (
    NANOSECONDS,
    AnyArray,
    Array,
    ExplorationState,
    FeatureVector,
    Phase,
    TactileSignal,
    Window,
    checked_label,
)
from texture_features.feature_set import ONE_RATE, FeatureSet, LabelledFeatures
from texture_features.windows import CutWindow, WindowEvent, cut_recording
from texture_recordings.bags import BagPaths, is_bag, short_name, topics_in
from texture_recordings.mapping import CONDITION_COLUMNS, SlideBorders, plausible
from texture_recordings.slides import (
    STREAMS,
    LabelledSlide,
    SlideSamples,
    Stretch,
    find_slides,
    motion_made,
    number_slides,
    parse_selection,
    part_of,
    stretches,
)

if TYPE_CHECKING:
    from texture_features.augmentation import Augmentation


# --------------------
# Labelled slides with their signals: read once from bags, or given as arrays.

HOPS = 4  # windows of the least distance overlap so often
NO_LABEL = ('None', 'nan', 'NaT', '<NA>')  # as texts of values that are none
GAP_NS = NANOSECONDS  # between two slides that are given as arrays
# Speeds and forces that differ by less are one condition: an arm deviates from its request.
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
        cls, bags: BagPaths, slides: str = '', namespace: str | None = None, topics: Sequence[str] = STREAMS
    ) -> SlideDataset:
        """Read the labelled slides of bags with their signals; see `find_slides` for the arguments and errors.

        Parameters
        ----------
        bags
            A bag, or a folder of bags; or several.
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
            Conditions of all slides, or of each, (n_slides,); NaN if unknown.
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
            If the numbers of slides or channels contradict each other, or an array, a label or a condition is none
            that an import takes.
        """
        if not (isinstance(signals, Mapping) and isinstance(rates_hz, Mapping)):
            raise InvalidData("signals and rates_hz are by topic: {'signal': [...]} and {'signal': 1000.0}")
        given = [labels] if isinstance(labels, str) else labels
        texts = [one if isinstance(one, str) else '' if str(one) in NO_LABEL else str(one) for one in given]
        surfaces = [checked_label(text) for text in texts]
        if not all(surfaces):
            raise InvalidData(f'slide {surfaces.index("") + 1} has an empty label; give the surface of each')
        count = len(surfaces)
        for topic, arrays in signals.items():
            if len(arrays) != count or not isinstance(rates_hz.get(topic), Real):
                raise InvalidData(
                    f"'{topic}' has {len(arrays)} slides for {count} labels, and the rates are {rates_hz}; give one "
                    "array (n_samples, n_channels) for each label, and the rate of each topic, such as {'signal': 2e3}"
                )
        if not signals:
            raise InvalidData("no signal was given; give arrays by topic, such as {'signal': [...]}")
        numbers: dict[str, Array] = {}
        for (name, column), values in zip(CONDITION_COLUMNS.items(), (speed_m_s, force_n, direction_rad), strict=True):
            try:
                array = np.asarray(values, dtype=np.float64)
            except (TypeError, ValueError) as error:
                raise InvalidData(f'{column} is {values!r:.40}; give one number, or one for each slide') from error
            if array.shape not in ((), (count,)):
                raise InvalidData(
                    f'{column} has the shape {array.shape}; give one number, or one for each of {count} slides'
                )
            numbers[column] = np.broadcast_to(array, (count,))
            for value in array[~np.isnan(array)].tolist():
                plausible(name, value)
        slides, start_ns = [], 0
        for index, surface in enumerate(surfaces):
            batches = {}
            for topic, arrays in signals.items():
                samples = _samples_of(arrays[index], rates_hz[topic], f"'{topic}' of slide {index + 1}")
                names = (channels or {}).get(topic) or [f'c{number}' for number in range(samples.shape[1])]
                batches[topic] = TactileSignal(start_ns, sensor or topic, tuple(names), (), rates_hz[topic], 0, samples)
            end_ns = max(batch.end_ns for batch in batches.values())
            known: dict[str, Any] = {column: float(values[index]) for column, values in numbers.items()}
            state = ExplorationState(
                start_ns,
                f'{session or "array"}/{index}',
                motion,
                Phase.SLIDE,
                (end_ns - start_ns) / NANOSECONDS,
                surface=surface,
                **known,
            )
            slides.append(
                LabelledSlide(
                    Path(session), state.exploration_id, surface, 0, start_ns, None,
                    motion=motion_made([state]),
                    signals={topic: (batch,) for topic, batch in batches.items()},
                    states=(state,),
                )
            )  # fmt: skip
            start_ns = end_ns + GAP_NS
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
            If there is no such condition, or a slide does not have it.
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
                f"{len(unknown)} of {len(values)} slides have no {name}, first '{self.slides[unknown[0]].name}'; "
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
            Whether to keep a slide.

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
        where a slide has none, by the distance from its start; without speeds, by the time. Slides that run the other
        way are then counted from the other end. No window spans two parts, as each is a separate slide.

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
            why = 'is a part already' if cut.is_part else 'has no time of sliding'
            raise InvalidData(f"slide '{cut.name}' in '{cut.bag}' {why}; cut whole slides with their states")
        runs: dict[str, list[Stretch]] = {}
        for surface in dict.fromkeys(slide.surface for slide in self.slides):
            of_surface = [slide for slide in self.slides if slide.surface == surface]
            runs |= {slide.name: found for slide, found in zip(of_surface, stretches(of_surface, count), strict=True)}
        return SlideDataset(
            tuple(
                part_of(slide, begin_ns, end_ns, f'{cell + 1}/{count}')
                for slide in self.slides
                for cell, begin_ns, end_ns in runs[slide.name]
            )
        )

    def windows(self, feature_set: FeatureSet) -> Iterator[tuple[LabelledSlide, list[WindowEvent]]]:
        """Yield each slide with its windows and its end, as the feature extractor on the robot cuts them.

        Raises
        ------
        ModelMismatch
            If a slide has nothing of an input.
        """
        _check(feature_set)
        for slide in progress(self.slides, 'computing features of slides', len(self)):
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
        _check(feature_set)
        augmenter = None
        if augmentation is not None and augmentation.copies:
            from texture_features.augmentation import Augmenter  # noqa: PLC0415  # needs scipy

            augmenter = Augmenter(feature_set, augmentation)
        # One kind of signal, before anything is computed.
        first = self.slides[0]
        for topic, slide in itertools.product(feature_set.topics, self.slides):
            here, usual = (
                [
                    f'{topic}={batch.sampling_rate_hz:.6g}Hz*{len(batch.channels)}'
                    for batch in one.signals.get(topic, ())[:1]
                ]
                for one in (slide, first)
            )
            if here and usual and here != usual:
                raise ModelMismatch(
                    f"slide '{slide.name}' in '{slide.bag}' has {here[0]} of the sensor '{slide.sensor}', and those "
                    f"before it {usual[0]} of '{first.sensor}' (rate × channels); use slides of one kind; if "
                    f'only the rates differ, {ONE_RATE}'
                )
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
        conditions = dict(features.conditions)
        for slide in (one for one in self.slides if one.name in conditions):
            before = {topic: (slide.at_rest(topic), slide.signals[topic][0]) for topic in feature_set.topics}
            rest = feature_set.rest_levels(
                {topic: (samples, one.sampling_rate_hz, one.channels) for topic, (samples, one) in before.items()}
            )
            made = replace(conditions[slide.name], session=slide.session, place=slide.place)
            conditions[slide.name] = replace(made, rest=tuple(rest.items()))
        return replace(
            features,
            motions=motions,
            conditions=conditions,
            augmented=augmenter.result() if augmenter is not None else None,
            resized=LabelledFeatures.from_vectors(resized, surfaces) if resized else None,
        )

    def tare_faults(self, feature_set: FeatureSet) -> list[str]:
        """Return sentences on streams that are tared and should not be, or the other way round, as the node warns.

        Streams whose sensor has no name, as arrays from elsewhere, are ignored.
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


def _check(feature_set: object) -> None:
    if not isinstance(feature_set, FeatureSet):
        raise InvalidData(
            f'the feature set is a {type(feature_set).__name__}; give that of a model, model.recipe.feature_set, or '
            "FeatureSet.load('default')"
        )


def cut_slide(slide: LabelledSlide, feature_set: FeatureSet) -> list[WindowEvent]:
    """Return the windows of a slide and its end, as the feature extractor on the robot cuts them."""
    missing = [topic for topic in feature_set.topics if not slide.signals.get(topic)]
    if missing:
        # The bag may hold streams that the recipe does not use.
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
    signals = [batch for slide in dataset for topic in feature_set.topics for batch in slide.signals.get(topic, ())]
    bad = np.concatenate([[False], *(~np.isfinite(batch.samples).all(axis=1) for batch in signals)])
    lost = f' ({100.0 * bad.mean():.0f} % of the samples have NaN or infinity)' if bad.any() else ''
    return InvalidData(
        f'none of the {len(dataset)} slides has a whole window of {feature_set.windows.length_s} s{lost}; '
        'record longer slides without losses, or use a recipe with shorter windows'
    )


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
    starts_group = np.diff(ordered) > (SAME_RAD if circular else (SAME_RATIO - 1.0) * np.abs(ordered[:-1]))
    group = np.concatenate(([0], np.cumsum(starts_group)))
    if circular and group[-1] and ordered[0] + math.tau - ordered[-1] <= SAME_RAD:  # -π is π
        ordered = np.where(group == group[-1], ordered - math.tau, ordered)
        group[group == group[-1]] = 0
    means = np.bincount(group, ordered) / np.bincount(group)
    result = np.empty(len(values))
    result[order] = [float(f'{mean:.3g}') for mean in means[group]]
    return result


def _samples_of(array: AnyArray, rate_hz: float, where: str) -> NDArray[np.float32]:
    """Return the samples of a slide, (n_samples, n_channels); InvalidData if they are none, or lie on their side."""
    given = np.asarray(array)
    samples = given[:, None] if given.ndim == 1 else given  # one channel may be given without its axis
    finite = 0
    if samples.ndim == 2 and samples.dtype.kind in 'biuf':
        finite = int(np.isfinite(samples).all(axis=1).sum())
    # Fewer samples than channels, and than the shortest slide that an import keeps.
    if finite < 2 or len(samples) < min(samples.shape[1], SlideBorders.min_s * rate_hz):
        raise InvalidData(
            f'{where} has the shape {given.shape} of {given.dtype} with {finite} finite samples; real numbers '
            '(n_samples, n_channels) are needed: transpose an array on its side, leave out a slide without any'
        )
    return samples.astype(np.float32)
