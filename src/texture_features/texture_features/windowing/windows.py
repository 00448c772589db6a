"""Cut windows from the sliding part of tactile streams, as soon as the last sample of each is there."""

from __future__ import annotations

import enum
import heapq
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np

from texture_core.exploration import ExplorationState, Phase
from texture_core.parameters import param
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_core.window import Window
from texture_features.windowing.slide import Slide, Span
from texture_features.windowing.stream import Run, Stream

SILENCE_S = 0.3


@dataclass(frozen=True)
class WindowParams:
    """How the sliding part of a signal is cut."""

    length_s: float = param(0.5, 'Length of one window.', unit='s', low=0.005, high=60.0)
    hop_s: float = param(0.1, 'Distance between window starts.', unit='s', low=0.001, high=60.0)
    skip_s: float = param(0.0, 'Time left out at the start of a slide.', unit='s', low=0.0, high=60.0)


@dataclass(frozen=True, eq=False)
class CutWindow:
    """One window of sliding in every input, complete and finite.

    `skipped` counts the windows of this slide left out so far for lost or non-finite samples.
    """

    start_ns: int
    exploration_id: str
    length_s: float
    hop_s: float
    windows: Mapping[str, Window]
    speed_m_s: float = math.nan
    force_n: float = math.nan
    surface: str = ''
    skipped: int = 0


@dataclass(frozen=True)
class SlideEnd:
    """No further window of this slide follows; `end_ns` is the end of its covered time."""

    end_ns: int
    exploration_id: str
    hop_s: float
    surface: str = ''
    skipped: int = 0


Piece = CutWindow | SlideEnd


class _Absent(enum.Enum):
    """Why a window is not there."""

    LATE = enum.auto()  # samples that have not come yet
    LOST = enum.auto()  # samples that were lost or are not finite


@dataclass
class _Input:
    """A stream and what the cutter waits for in it."""

    stream: Stream
    due: float = -math.inf  # index before whose arrival nothing can happen
    heard: bool = False
    heard_s: float = math.nan
    anchors: dict[Run, tuple[int, int]] = field(default_factory=dict)


class WindowCutter:
    """Turn signal batches and exploration states into windows, in whatever order they arrive.

    What is cut depends on the data alone, as long as signals and states arrive at most `keep_s` apart.

    Parameters
    ----------
    params
        Length and hop of the windows.
    inputs
        Topics of which every window needs all samples; batches of other topics are ignored.
    keep_s
        How long samples are kept at least, s.
    """

    def __init__(self, params: WindowParams, inputs: Sequence[str], keep_s: float = 10.0) -> None:
        self._params = params
        self._inputs = {topic: _Input(Stream(keep_s)) for topic in inputs}
        self._slides: deque[Slide] = deque()
        self._ready = False
        self._windows = 0
        self._skipped = 0
        self._old_states = 0

    def add_signal(self, topic: str, signal: TactileSignal) -> None:
        """Add a batch; batches of one topic come in the order in which they were sampled."""
        source = self._inputs.get(topic)
        if source is None or not len(signal.samples):
            return
        restarted = source.stream.add(signal)
        source.heard = True
        if restarted or signal.next_sample >= source.due:
            self._ready = True

    def add_state(self, state: ExplorationState) -> None:
        """Add a state; states come in the order in which they were published."""
        self._ready = True
        slide = self._slides[-1] if self._slides and not self._slides[-1].ended else None
        if state.phase is Phase.SLIDE and slide and slide.exploration_id == state.exploration_id:
            self._old_states += not slide.add(state)
            return
        if slide:
            slide.ended = True
        if state.phase is Phase.SLIDE:
            length_s, hop_s, skip_s = self._params.length_s, self._params.hop_s, self._params.skip_s
            self._slides.append(Slide(state, _to_ns(length_s), _to_ns(hop_s), _to_ns(skip_s)))

    def take(self) -> list[Piece]:
        """Return the windows completed since the last call, and the end of each slide that is over."""
        if not self._ready:
            return []
        self._ready = False
        pieces: list[Piece] = []
        while self._slides and self._cut(self._slides[0], pieces):
            pieces.append(self._end_slide())
        return pieces

    def silence(self, now_s: float) -> list[Piece]:
        """Return what `take` returns, and the ends of slides that are over whose samples have not come for 0.3 s.

        Call it some times a second with any clock that runs on.
        """
        pieces = self.take()
        for source in self._inputs.values():
            if source.heard or math.isnan(source.heard_s):
                source.heard, source.heard_s = False, now_s
        awaited = [source for source in self._inputs.values() if source.due < math.inf]
        silent = any(now_s - source.heard_s >= SILENCE_S for source in awaited)
        return pieces + (self._give_up() if silent else [])

    def finish(self) -> list[Piece]:
        """Return what is left of a recording, and the ends of all its slides, without waiting for more."""
        if self._slides:
            self._slides[-1].ended = True
        self._ready = True
        return self.take() + self._give_up()

    @property
    def waiting_for(self) -> tuple[str, ...]:
        """Inputs of which nothing has come yet."""
        return tuple(topic for topic, source in self._inputs.items() if not source.stream.runs)

    @property
    def counts(self) -> dict[str, int]:
        """Running totals: windows cut and skipped, lost samples, restarted streams, states out of order."""
        streams = [source.stream for source in self._inputs.values()]
        return {
            'windows': self._windows,
            'skipped': self._skipped,
            'lost_samples': sum(stream.lost_samples for stream in streams),
            'restarts': sum(stream.restarts for stream in streams),
            'old_states': self._old_states,
        }

    def _cut(self, slide: Slide, pieces: list[Piece]) -> bool:
        """Cut what can be cut of a slide; return whether it is used up."""
        for source in self._inputs.values():
            source.due = math.inf
        while span := slide.window():
            found = self._find(slide, span)
            if found is _Absent.LATE:
                return False
            if isinstance(found, _Absent):
                self._skip(slide)
                continue
            slide.advance()
            self._windows += 1
            pieces.append(self._piece(slide, span, found))
        return slide.ended

    def _find(self, slide: Slide, span: Span) -> dict[str, Window] | _Absent:
        windows = {}
        for topic, source in self._inputs.items():
            found = self._find_in(source, slide, span)
            if isinstance(found, _Absent):
                return found
            windows[topic] = found
        return windows

    def _find_in(self, source: _Input, slide: Slide, span: Span) -> Window | _Absent:
        """Look for a window in the runs of a stream; only the newest can still grow."""
        source.due = -math.inf
        state = _Absent.LATE
        for run in source.stream.runs:
            anchor = source.anchors.get(run) or run.anchor(slide.start_ns)
            if anchor is None:
                state, source.due = _Absent.LATE, -math.inf
                continue
            source.anchors[run] = anchor
            first = run.index_at(span.start_ns, anchor)
            count = max(1, round(self._params.length_s * run.rate_hz))
            if first >= run.first_sample and first + count <= run.next_sample:
                source.due = math.inf
                return _finite_window(run, first, count, span)
            state = _Absent.LOST if first < run.first_sample else _Absent.LATE
            source.due = first + count
        if state is _Absent.LOST:
            source.due = math.inf
        return state

    def _piece(self, slide: Slide, span: Span, windows: Mapping[str, Window]) -> CutWindow:
        return CutWindow(
            start_ns=span.start_ns,
            exploration_id=slide.exploration_id,
            length_s=self._params.length_s,
            hop_s=self._params.hop_s,
            windows=windows,
            speed_m_s=span.speed_m_s,
            force_n=span.force_n,
            surface=slide.surface,
            skipped=slide.skipped,
        )

    def _skip(self, slide: Slide) -> None:
        slide.advance()
        slide.skipped += 1
        self._skipped += 1

    def _end_slide(self) -> SlideEnd:
        slide = self._slides.popleft()
        for source in self._inputs.values():
            source.anchors.clear()
        return SlideEnd(slide.covered_ns, slide.exploration_id, self._params.hop_s, slide.surface, slide.skipped)

    def _give_up(self) -> list[Piece]:
        """End the slides that are over without the samples that have not come."""
        pieces: list[Piece] = []
        while self._slides and self._slides[0].ended:
            while self._slides[0].window():
                self._skip(self._slides[0])
            pieces.append(self._end_slide())
            self._ready = True
            pieces += self.take()
        return pieces


def cut_recording(
    signals: Mapping[str, Iterable[TactileSignal]], states: Iterable[ExplorationState], params: WindowParams
) -> Iterator[Piece]:
    """Yield the windows of a recording, every topic of `signals` being an input.

    Parameters
    ----------
    signals
        The batches of each topic, in their order.
    states
        The exploration states, in their order.
    """
    cutter = WindowCutter(params, tuple(signals))
    tracks = [_calls(cutter.add_state, states)]
    tracks += [_calls(partial(cutter.add_signal, topic), batches) for topic, batches in signals.items()]
    for _, add, item in heapq.merge(*tracks, key=itemgetter(0)):
        add(item)
        yield from cutter.take()
    yield from cutter.finish()


def _finite_window(run: Run, first: int, count: int, span: Span) -> Window | _Absent:
    samples = run.take(first, count)
    if not np.isfinite(samples).all():
        return _Absent.LOST
    return Window(samples, run.rate_hz, run.channels, span.start_ns, span.speed_m_s, span.force_n)


def _calls(add: Callable[[Any], None], items: Iterable[Any]) -> Iterator[tuple[int, Callable[[Any], None], Any]]:
    return ((item.stamp_ns, add, item) for item in items)


def _to_ns(seconds: float) -> int:
    return round(seconds * NANOSECONDS)
