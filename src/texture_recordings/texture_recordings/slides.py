"""The labelled explorations in bags, and which of them the user means by `--slides 1-30`."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

from texture_core.errors import InvalidData
from texture_core.exploration import Phase
from texture_core.files import FileRefused
from texture_recordings.bag_limits import check_duration
from texture_recordings.bags import find_bags, read_bag
from texture_recordings.labelled_slide import LabelledSlide
from texture_recordings.motion_of_states import motion_made

RANGE = re.compile(r'(\d+)(?:-(\d+))?')
Message = tuple[str, int, Any]
STREAMS, STATES = ('signal', 'signal_static'), 'exploration'


def parse_selection(text: str) -> frozenset[int] | None:
    """Return the numbers in '1-30' or '1,3,5-7'; None, meaning all, for ''.

    Raises
    ------
    InvalidData
        If the text is no such list.
    """
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

    Parameters
    ----------
    bags
        Bags, or folders of bags.
    slides
        Slides of each surface to keep, such as '1-30', counted from 1 in the order recorded; '' keeps all.
    namespace
        Namespace of the finger, if bags hold several.
    topics
        Signals to read; none by default.

    Returns
    -------
    list of LabelledSlide
        Counted for each surface.

    Raises
    ------
    InvalidData
        If a bag cannot be read, no slide is labelled, or none has a number asked for.
    """
    wanted = parse_selection(slides)
    paths = find_bags(bags)
    labelled = [slide for path in paths for slide in _slides_of(path, namespace, topics)]
    if not labelled:
        raise InvalidData(
            f"no slide in {_named(paths)} is labelled; give the surface's name with each exploration you record"
        )
    numbered = number_slides(labelled)
    found = [slide for slide in numbered if wanted is None or slide.number in wanted]
    if not found:
        most = max(slide.number for slide in numbered)
        raise InvalidData(f"no surface in {_named(paths)} has slides '{slides}'; there are 1 to {most}")
    return found


def _slides_of(path: Path, namespace: str | None, topics: Sequence[str]) -> list[LabelledSlide]:
    """Return the labelled slides of one bag, yet without numbers: an exploration lasts until the next one begins."""
    messages = list(read_bag(path, (*topics, STATES), namespace))
    try:
        check_duration(path, (value for topic, _, value in messages if topic in topics))
    except FileRefused as error:
        raise InvalidData(f"the bag '{path}' cannot be used: {error}") from error
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
    return LabelledSlide(
        path, states[0].exploration_id, surface, 0, start_ns, stop_ns, namespace, motion_made(states), dict(streams),
        heard,
    )  # fmt: skip


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


def _named(paths: Sequence[Path]) -> str:
    return f"'{paths[0]}'" if len(paths) == 1 else f"the {len(paths)} bags from '{paths[0]}' on"
