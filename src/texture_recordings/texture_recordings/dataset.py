"""Labelled bags to labelled features, by the very code that runs on the robot."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from texture_core.errors import InvalidData, ModelMismatch
from texture_core.exploration import ExplorationState
from texture_core.features import FeatureVector
from texture_features.feature_set import FeatureSet
from texture_features.labelled_features import LabelledFeatures
from texture_features.windowing.windows import WindowCutter, WindowEvent
from texture_recordings.slides import LabelledSlide, Message, find_slides, read_slides


def extract_features(
    bags: Iterable[str | Path], feature_set: FeatureSet, slides: str = '', namespace: str | None = None
) -> LabelledFeatures:
    """Return the features of all windows of the labelled slides in bags.

    Parameters
    ----------
    bags
        Bags, or folders of bags.
    feature_set
        Windows, inputs and features.
    slides
        Which slides of each surface, such as '1-30'; '' for all.
    namespace
        Of the finger, if bags hold several.

    Raises
    ------
    InvalidData
        If a bag cannot be read or has no usable slide.
    ModelMismatch
        If a slide lacks an input of the feature set, or the slides differ in rates or channels.
    """
    chosen = find_slides(bags, slides, namespace)
    surfaces = {slide.name: slide.surface for slide in chosen}
    vectors = [vector for _, of_slide in extract_slides(chosen, feature_set) for vector in of_slide]
    if not vectors:
        raise no_window(chosen, feature_set)
    motions = {slide.name: slide.motion for slide in chosen if slide.motion}
    return replace(LabelledFeatures.from_vectors(vectors, surfaces), motions=motions)


def extract_slides(
    slides: Sequence[LabelledSlide], feature_set: FeatureSet
) -> Iterator[tuple[LabelledSlide, list[FeatureVector]]]:
    """Yield each slide with the features of its windows, named after the slide; none if no window could be cut."""
    for slide, events in cut_slides(slides, feature_set):
        vectors = feature_set.extract_many(events)
        yield slide, [replace(vector, exploration_id=slide.name) for vector in vectors if not vector.last]


def cut_slides(
    slides: Sequence[LabelledSlide], feature_set: FeatureSet
) -> Iterator[tuple[LabelledSlide, list[WindowEvent]]]:
    """Yield each slide with its windows and its end, as the feature extractor cuts them.

    Raises
    ------
    ModelMismatch
        If a slide has nothing of an input.
    """
    for slide, messages in read_slides(slides, feature_set.topics):
        yield slide, _cut(slide, messages, feature_set)


def _cut(slide: LabelledSlide, messages: Sequence[Message], feature_set: FeatureSet) -> list[WindowEvent]:
    cutter = WindowCutter(feature_set.windows, feature_set.topics)
    events: list[WindowEvent] = []
    for topic, _, value in messages:
        if isinstance(value, ExplorationState):
            cutter.add_state(value)
        else:
            cutter.add_signal(topic, value)
        events += cutter.take()
    if cutter.waiting_for:
        [(_, everything)] = read_slides([slide])
        present = ', '.join(sorted({topic for topic, _, _ in everything} - {'exploration'})) or 'states'
        raise ModelMismatch(
            f"slide '{slide.name}' in '{slide.bag}' has no '{cutter.waiting_for[0]}', only {present}; "
            f'the windows need {", ".join(feature_set.topics)}: use another recipe or record the missing topic'
        )
    return events + cutter.finish()


def no_window(slides: Sequence[LabelledSlide], feature_set: FeatureSet) -> InvalidData:
    """Return the error for slides of which not one has a usable window."""
    return InvalidData(
        f'none of the {len(slides)} slides has a whole window of {feature_set.windows.length_s} s; '
        'record longer slides without losses, or use a recipe with shorter windows'
    )
