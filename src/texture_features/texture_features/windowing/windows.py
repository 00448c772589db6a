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
from texture_features.windowing.axes import AxisJoiner, split_axis
from texture_features.windowing.sample_buffer import BufferedStream, SampleBuffer
from texture_features.windowing.slide_coverage import CoveredSpan, SlideCoverage

TIMEOUT_S = 0.3
DROPPED_S = 1.0  # an input that is silent for so long while others come is reported
ALL = 1 << 62


@dataclass(frozen=True)
class WindowParams:
    """How the sliding part of a signal is cut.

    Examples
    --------
    >>> params = WindowParams(length_s=0.5, hop_s=0.1)
    >>> 1 + round((2.0 - params.length_s) / params.hop_s)  # windows in 2 s of sliding
    16
    """

    length_s: float = param(
        0.5,
        'Sets the length of a window; longer ones give more certain decisions, later.',
        unit='s',
        low=0.005,
        high=60.0,
    )
    hop_s: float = param(
        0.1,
        'Sets the time between the starts of two windows; a smaller one gives more estimates and costs computing time.',
        unit='s',
        low=0.001,
        high=60.0,
    )
    skip_s: float = param(
        0.0, 'Time at the start of a slide that is excluded from windows.', unit='s', low=0.0, high=60.0
    )


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
    motion: str = ''
    direction_rad: float = math.nan
    tangential_force_n: float = math.nan
    elapsed_s: float = math.inf  # from the start of the slide to that of the window; infinite where nobody says


@dataclass(frozen=True)
class SlideEnd:
    """No further window of this slide follows; `end_ns` is the end of its covered time."""

    end_ns: int
    exploration_id: str
    hop_s: float
    surface: str = ''
    skipped: int = 0


WindowEvent = CutWindow | SlideEnd


class _Missing(enum.Enum):
    """Why a window is not there."""

    LATE = enum.auto()  # samples that have not come yet
    LOST = enum.auto()  # samples that were lost or are not finite


@dataclass
class _Input:
    """A stream and what the cutter waits for in it."""

    stream: BufferedStream
    due: float = -math.inf  # index before whose arrival nothing can happen
    received: bool = False
    received_s: float = math.nan
    anchors: dict[SampleBuffer, tuple[int, int]] = field(default_factory=dict)


class WindowCutter:
    """Turn signal batches and exploration states into windows, in whatever order they arrive.

    What is cut depends on the data alone, as long as signals and states arrive at most `keep_s` apart.

    Parameters
    ----------
    params
        Length and hop of the windows.
    inputs
        Topics of which every window needs all samples; batches of other topics are ignored. With an axis, as in
        'signal@x' and 'signal@y', windows along both axes of one exploration are joined (`windowing/axes.py`).
    keep_s
        How long samples are kept at least, s.

    Examples
    --------
    >>> import numpy as np
    >>> cutter = WindowCutter(WindowParams(length_s=0.5, hop_s=0.25), ['signal'])
    >>> cutter.add_state(ExplorationState(0, 'a', 'linear_slide', Phase.SLIDE, steady_s=1.0))
    >>> samples = np.zeros((1000, 1), dtype=np.float32)
    >>> cutter.add_signal('signal', TactileSignal(0, 'finger', ('pac',), (), 1000.0, 0, samples))
    >>> cutter.add_state(ExplorationState(NANOSECONDS, 'a', 'linear_slide', Phase.LIFT))
    >>> for event in cutter.take():
    ...     match event:
    ...         case CutWindow():
    ...             print('window at', event.start_ns / NANOSECONDS, 's,', event.windows['signal'].duration_s, 's long')
    ...         case SlideEnd():
    ...             print('end at', event.end_ns / NANOSECONDS, 's')
    window at 0.0 s, 0.5 s long
    window at 0.25 s, 0.5 s long
    window at 0.5 s, 0.5 s long
    end at 1.0 s
    """

    def __init__(self, params: WindowParams, inputs: Sequence[str], keep_s: float = 10.0) -> None:
        self._params = params
        self._inputs = {topic: _Input(BufferedStream(keep_s)) for topic in dict.fromkeys(map(_topic_of, inputs))}
        self._joiner: AxisJoiner[CutWindow] = AxisJoiner(inputs)
        self._unpaired = 0
        self._slides: deque[SlideCoverage] = deque()
        self._ready = False
        self._windows = 0
        self._skipped = 0
        self._old_states = 0
        self._lost = 1  # windows from the present one on that are lost for the same reason

    def add_signal(self, topic: str, signal: TactileSignal) -> None:
        """Add a batch; batches of one topic come in the order in which they were sampled."""
        source = self._inputs.get(topic)
        if source is None or not len(signal.samples):
            return
        restarted = source.stream.add(signal)
        source.received = True
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
            self._slides.append(SlideCoverage(state, _to_ns(length_s), _to_ns(hop_s), _to_ns(skip_s)))

    def take(self) -> list[WindowEvent]:
        """Return the windows completed since the last call, and the end of each slide that is over."""
        if not self._ready:
            return []
        self._ready = False
        events: list[WindowEvent] = []
        while self._slides and self._cut(self._slides[0], events):
            events.append(self._end_slide())
        return events

    def time_out(self, now_s: float) -> list[WindowEvent]:
        """Return what `take` returns, and the ends of slides that are over whose samples have not come for 0.3 s.

        Call it some times a second with any clock that runs on.
        """
        events = self.take()
        for source in self._inputs.values():
            if source.received or math.isnan(source.received_s):
                source.received, source.received_s = False, now_s
        awaited = [source for source in self._inputs.values() if source.due < math.inf]
        silent = any(now_s - source.received_s >= TIMEOUT_S for source in awaited)
        return events + (self._give_up() if silent else [])

    def finish(self) -> list[WindowEvent]:
        """Return what is left of a recording, and the ends of all its slides, without waiting for more."""
        if self._slides:
            self._slides[-1].ended = True
        self._ready = True
        return self.take() + self._give_up()

    @property
    def waiting_for(self) -> tuple[str, ...]:
        """Inputs of which nothing has come yet."""
        return tuple(topic for topic, source in self._inputs.items() if not source.stream.buffers)

    def dropped(self, now_s: float) -> tuple[str, ...]:
        """Return the inputs that came once and are silent while another still comes, by the clock of `time_out`."""
        ages_s = {
            topic: 0.0 if source.received else now_s - source.received_s
            for topic, source in self._inputs.items()
            if source.stream.buffers
        }
        fresh = any(age_s < DROPPED_S for age_s in ages_s.values())
        return tuple(topic for topic, age_s in ages_s.items() if fresh and age_s >= DROPPED_S)

    @property
    def counts(self) -> dict[str, int]:
        """Running totals: windows cut, skipped, without a partner; lost samples, restarts, states out of order."""
        streams = [source.stream for source in self._inputs.values()]
        return {
            'windows': self._windows,
            'skipped': self._skipped,
            'unpaired': self._unpaired,
            'lost_samples': sum(stream.lost_samples for stream in streams),
            'restarts': sum(stream.restarts for stream in streams),
            'old_states': self._old_states,
        }

    def _cut(self, slide: SlideCoverage, events: list[WindowEvent]) -> bool:
        """Cut what can be cut of a slide; return whether it is used up."""
        for source in self._inputs.values():
            source.due = math.inf
        while span := slide.window():
            found = self._find(slide, span)
            if found is _Missing.LATE:
                return False
            if isinstance(found, _Missing):
                self._skip(slide, self._lost)
                continue
            slide.advance()
            event: CutWindow | None = self._window_event(slide, span, found)
            if self._joiner.joins and event is not None:
                event = self._joiner.add(event)
            if event is not None:
                self._windows += 1
                events.append(event)
        return slide.ended

    def _find(self, slide: SlideCoverage, span: CoveredSpan) -> dict[str, Window] | _Missing:
        self._lost = 1
        windows = {}
        for topic, source in self._inputs.items():
            found = self._find_in(source, slide, span)
            if isinstance(found, _Missing):
                return found
            windows[topic] = found
        return windows

    def _find_in(self, source: _Input, slide: SlideCoverage, span: CoveredSpan) -> Window | _Missing:
        """Look for a window in the runs of a stream; only the newest can still grow."""
        source.due = -math.inf
        state, lost = _Missing.LATE, ALL
        for buffer in source.stream.buffers:
            anchor = source.anchors.get(buffer) or buffer.anchor(slide.start_ns)
            if anchor is None:
                state, source.due = _Missing.LATE, -math.inf
                continue
            source.anchors[buffer] = anchor
            first = buffer.index_at(span.start_ns, anchor)
            count = max(1, round(self._params.length_s * buffer.rate_hz))
            if first >= buffer.first_sample and first + count <= buffer.next_sample:
                source.due = math.inf
                return _finite_window(buffer, first, count, span)
            state = _Missing.LOST if first < buffer.first_sample else _Missing.LATE
            source.due = first + count
            if state is _Missing.LOST:
                # What begins before the first sample is lost: a gap of an hour is passed over at once.
                missing_s = (buffer.first_sample - first - 1) / buffer.rate_hz
                lost = min(lost, int(missing_s / self._params.hop_s))
        if state is _Missing.LOST:
            source.due = math.inf
            self._lost = max(1, lost)
        return state

    def _window_event(self, slide: SlideCoverage, span: CoveredSpan, windows: Mapping[str, Window]) -> CutWindow:
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
            motion=slide.motion,
            direction_rad=span.direction_rad,
            tangential_force_n=span.tangential_force_n,
            elapsed_s=(span.start_ns - slide.start_ns) / NANOSECONDS,
        )

    def _skip(self, slide: SlideCoverage, count: int) -> None:
        skipped = slide.advance(count)
        slide.skipped += skipped
        self._skipped += skipped

    def _end_slide(self) -> SlideEnd:
        slide = self._slides.popleft()
        self._unpaired += self._joiner.end()
        for source in self._inputs.values():
            source.anchors.clear()
        return SlideEnd(slide.covered_ns, slide.exploration_id, self._params.hop_s, slide.surface, slide.skipped)

    def _give_up(self) -> list[WindowEvent]:
        """End the slides that are over without the samples that have not come."""
        events: list[WindowEvent] = []
        while self._slides and self._slides[0].ended:
            while self._slides[0].window():
                self._skip(self._slides[0], ALL)
            events.append(self._end_slide())
            self._ready = True
            events += self.take()
        return events


def cut_recording(
    signals: Mapping[str, Iterable[TactileSignal]],
    states: Iterable[ExplorationState],
    params: WindowParams,
    inputs: Sequence[str] = (),
) -> Iterator[WindowEvent]:
    """Yield the windows of a recording.

    Parameters
    ----------
    signals
        The batches of each topic, in their order.
    states
        The exploration states, in their order.
    params
        Length and hop of the windows.
    inputs
        What each window holds, as for `WindowCutter`; () for every topic of `signals`.

    Yields
    ------
    CutWindow or SlideEnd
        In the order of time; the end of each slide comes after its windows.
    """
    cutter = WindowCutter(params, inputs or tuple(signals))
    tracks = [_calls(cutter.add_state, states)]
    tracks += [_calls(partial(cutter.add_signal, topic), batches) for topic, batches in signals.items()]
    for _, add, item in heapq.merge(*tracks, key=itemgetter(0)):
        add(item)
        yield from cutter.take()
    yield from cutter.finish()


def _finite_window(buffer: SampleBuffer, first: int, count: int, span: CoveredSpan) -> Window | _Missing:
    samples = buffer.take(first, count)
    if not np.isfinite(samples).all():
        return _Missing.LOST
    return Window(samples, buffer.rate_hz, buffer.channels, span.start_ns, span.speed_m_s, span.force_n, buffer.sensor)


def _calls(add: Callable[[Any], None], items: Iterable[Any]) -> Iterator[tuple[int, Callable[[Any], None], Any]]:
    return ((item.stamp_ns, add, item) for item in items)


def _topic_of(name: str) -> str:
    return split_axis(name)[0]


def _to_ns(seconds: float) -> int:
    return round(seconds * NANOSECONDS)
