"""The labelled explorations in bags, and which of them the user means by `--slides 1-30`."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

from texture_core.errors import InvalidData
from texture_core.exploration import Phase
from texture_core.slide_motion import SlideMotion
from texture_recordings.bags import find_bags, read_bag
from texture_recordings.motion_of_states import motion_made

RANGE = re.compile(r'(\d+)(?:-(\d+))?')
Message = tuple[str, int, Any]
STREAMS = ('signal', 'signal_static')


@dataclass(frozen=True)
class LabelledSlide:
    """One exploration with a slide, as it lies in a bag.

    `number` counts the slides of this surface from 1 in the order recorded; what belongs to the slide was logged
    from `start_ns` to before `stop_ns` (None: the end of the bag). `motion` is None if it is unknown or not straight.
    """

    bag: Path
    exploration_id: str
    surface: str
    number: int
    start_ns: int
    stop_ns: int | None
    namespace: str | None = None
    motion: SlideMotion | None = None

    @property
    def name(self) -> str:
        """Surface and number, such as 'cork/3': unlike exploration ids, unique over all bags."""
        return f'{self.surface}/{self.number}'


def read_slides(
    slides: Sequence[LabelledSlide], streams: Sequence[str] = STREAMS
) -> Iterator[tuple[LabelledSlide, list[Message]]]:
    """Yield each slide with its (topic, log time in ns, data class) of streams and states; each bag is read once.

    Slides of one bag come in the order recorded.
    """
    for bag in dict.fromkeys(slide.bag for slide in slides):
        inside = sorted((slide for slide in slides if slide.bag == bag), key=lambda slide: slide.start_ns)
        first, last = inside[0], inside[-1]
        messages = read_bag(bag, (*streams, 'exploration'), first.namespace, first.start_ns, last.stop_ns)
        yield from _share_out(messages, inside)


def _share_out(
    messages: Iterator[Message], slides: Sequence[LabelledSlide]
) -> Iterator[tuple[LabelledSlide, list[Message]]]:
    following = next(messages, None)
    for slide in slides:
        mine: list[Message] = []
        while following and (slide.stop_ns is None or following[1] < slide.stop_ns):
            if following[1] >= slide.start_ns:
                mine.append(following)
            following = next(messages, None)
        yield slide, mine


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


def find_slides(bags: Iterable[str | Path], slides: str = '', namespace: str | None = None) -> list[LabelledSlide]:
    """Return the labelled slides in bags that `slides` names ('' for all), by bag and time.

    Slides are counted for each surface by itself, over all the bags, in the order in which they were recorded.

    Raises
    ------
    InvalidData
        If a bag cannot be read, no slide is labelled, or none has a number asked for.
    """
    wanted = parse_selection(slides)
    paths = find_bags(bags)
    labelled = [slide for path in paths for slide in _slides_of(path, namespace)]
    if not labelled:
        raise InvalidData(
            f"no slide in {_named(paths)} is labelled; give the surface's name with each exploration you record"
        )
    numbered = _number(labelled)
    found = [slide for slide in numbered if wanted is None or slide.number in wanted]
    if not found:
        most = max(slide.number for slide in numbered)
        raise InvalidData(f"no surface in {_named(paths)} has slides '{slides}'; there are 1 to {most}")
    return found


def _slides_of(path: Path, namespace: str | None) -> list[LabelledSlide]:
    """Return the labelled slides of one bag, yet without numbers: an exploration lasts until the next one begins."""
    reported = (
        (log_ns, state) for _, log_ns, state in read_bag(path, ('exploration',), namespace) if state.exploration_id
    )
    begun: list[tuple[int, LabelledSlide | None]] = []
    for name, group in groupby(reported, key=lambda one: one[1].exploration_id):
        logged, states = zip(*group, strict=True)
        surface = next((state.surface for state in reversed(states) if state.phase is Phase.SLIDE), None)
        slide = (
            LabelledSlide(path, name, surface, 0, logged[0], None, namespace, motion_made(states)) if surface else None
        )
        begun.append((logged[0], slide))
    stops = [*(start_ns for start_ns, _ in begun[1:]), None][: len(begun)]  # a bag may have no exploration at all
    return [replace(slide, stop_ns=stop_ns) for (_, slide), stop_ns in zip(begun, stops, strict=True) if slide]


def _number(slides: Sequence[LabelledSlide]) -> list[LabelledSlide]:
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
