"""Write slides with several streams into bags, one bag for each session or surface."""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_core.exploration import ExplorationState, Phase
from texture_core.labels import checked_label
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_recordings.bag_writer import BagWriter

START_NS = 1_000_000_000 * NANOSECONDS
PAUSE_NS = NANOSECONDS
DELAY_NS = 100_000  # a batch is logged this long after its last sample
BATCH_S = 0.1
MAX_BAGS = 500
Message = tuple[int, str, TactileSignal | ExplorationState]  # log time, topic, value


@dataclass(frozen=True, eq=False)
class StreamSamples:
    """The samples of one stream during a slide.

    Parameters
    ----------
    sensor, channels, unit, rate_hz
        As in a `TactileSignal`.
    samples : (n, n_channels)
        NaN for bad ones.
    index : (n,)
        Running index of each from 0; a jump is a loss.
    """

    sensor: str
    channels: tuple[str, ...]
    unit: str
    rate_hz: float
    samples: Array
    index: NDArray[np.int64]

    @property
    def duration_s(self) -> float:
        """Time from the first sample to the one after the last."""
        return float(self.index[-1] + 1) / self.rate_hz if len(self.index) else 0.0


@dataclass(frozen=True)
class StateSpan:
    """Speed, force and direction from a time of the slide on, in SI units; NaN if unknown."""

    start_s: float
    speed_m_s: float = math.nan
    force_n: float = math.nan
    direction_rad: float = math.nan


@dataclass(frozen=True, eq=False)
class ImportedSlide:
    """One slide.

    Parameters
    ----------
    surface, exploration_id, motion
        Label, name and motion.
    streams
        By topic.
    spans
        Conditions in the order of time; the first begins at 0.
    """

    surface: str
    exploration_id: str
    motion: str
    streams: Mapping[str, StreamSamples]
    spans: Sequence[StateSpan] = field(default=(StateSpan(0.0),))

    @property
    def duration_s(self) -> float:
        """How long all streams last."""
        return min(stream.duration_s for stream in self.streams.values())


class SlideBags:
    """Bags below a folder, written slide by slide; use it in a `with` block, where an error removes them again.

    Stamps are made up: each slide begins a second after the one before, in whatever bag that is, so slides keep their
    order over all bags.

    Parameters
    ----------
    out
        Folder for the bags; made if missing.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from texture_recordings.slides import find_slides
    >>> stream = StreamSamples('finger', ('x',), 'g', 100.0, np.zeros((200, 1)), np.arange(200))
    >>> slide = ImportedSlide('cork', 'run1', 'linear_slide', {'signal': stream}, (StateSpan(0.0, speed_m_s=0.05),))
    >>> with TemporaryDirectory() as folder:
    ...     with SlideBags(folder) as bags:
    ...         bags.write('monday', slide)
    ...     print([(found.name, found.speed_m_s) for found in find_slides(bags.paths)])
    [('cork/1', 0.05)]
    """

    def __init__(self, out: str | Path) -> None:
        self._out = Path(out)
        self._open = ExitStack()
        self._bags: dict[str, BagWriter] = {}
        self._next: dict[tuple[str, str], int] = {}
        self._now_ns = START_NS

    @property
    def paths(self) -> list[Path]:
        """Paths of the bags in the order in which they were begun."""
        return [bag.path for bag in self._bags.values()]

    def write(self, session: str, slide: ImportedSlide) -> None:
        """Write a slide into the bag of a session.

        Raises
        ------
        InvalidData
            If the bag exists already, cannot be made, or is one too many.
        """
        bag = self._bag(session)
        end_ns = self._now_ns + round(slide.duration_s * NANOSECONDS)
        messages: list[Message] = [*self._states(slide, end_ns)]
        for topic, stream in slide.streams.items():
            messages += self._batches(session, topic, stream)
        for log_ns, topic, value in sorted(messages, key=lambda message: message[0]):
            bag.write(topic, value, log_ns)
        self._now_ns = max(end_ns, *(log_ns for log_ns, _, _ in messages)) + PAUSE_NS

    def _bag(self, session: str) -> BagWriter:
        if session not in self._bags:
            name = checked_label(session)
            if not name or name.startswith('.') or len(self._bags) >= MAX_BAGS:
                raise InvalidData(
                    f"no bag can be named '{name}' as the {len(self._bags) + 1}th; at most {MAX_BAGS} bags with plain "
                    'names are made, choose another `session`'
                )
            self._out.mkdir(parents=True, exist_ok=True)
            self._bags[session] = self._open.enter_context(BagWriter(self._out / name))
        return self._bags[session]

    def _states(self, slide: ImportedSlide, end_ns: int) -> list[Message]:
        edges_s = [*(span.start_s for span in slide.spans), slide.duration_s]
        states: list[Message] = []
        for span, (begin_s, until_s) in zip(slide.spans, pairwise(edges_s), strict=True):
            stamp_ns = self._now_ns + round(begin_s * NANOSECONDS)
            stop_ns = self._now_ns + round(until_s * NANOSECONDS)
            state = ExplorationState(
                stamp_ns, slide.exploration_id, slide.motion, Phase.SLIDE, max(0, stop_ns - stamp_ns) / NANOSECONDS,
                span.speed_m_s, span.force_n, span.direction_rad, begin_s / max(slide.duration_s, 1e-9), slide.surface,
            )  # fmt: skip
            states.append((stamp_ns, 'exploration', state))
        for count, phase in enumerate((Phase.LIFT, Phase.DONE), 1):
            state = ExplorationState(
                end_ns, slide.exploration_id, slide.motion, phase, progress=1.0, surface=slide.surface
            )
            states.append((end_ns + (2 + count) * DELAY_NS, 'exploration', state))
        return states

    def _batches(self, session: str, topic: str, stream: StreamSamples) -> list[Message]:
        first = self._next.get((session, topic), 0)
        step = max(1, round(BATCH_S * stream.rate_hz))
        jumps = np.flatnonzero(np.diff(stream.index) != 1) + 1
        bounds = [0, *jumps.tolist(), len(stream.index)]
        samples = stream.samples.astype(np.float32)
        batches: list[Message] = []
        for begin, end in pairwise(bounds):
            for row in range(begin, end, step):
                part = samples[row : min(row + step, end)]
                place = int(stream.index[row])
                stamp_ns = self._now_ns + round(place / stream.rate_hz * NANOSECONDS)
                batch = TactileSignal(
                    stamp_ns, stream.sensor, stream.channels, (stream.unit,) * len(stream.channels), stream.rate_hz,
                    first + place, part, stream.sensor,
                )  # fmt: skip
                batches.append((batch.end_ns + DELAY_NS, topic, batch))
        if len(stream.index):
            self._next[session, topic] = first + int(stream.index[-1]) + 1
        return batches

    def __enter__(self) -> SlideBags:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.__exit__(kind, error, trace)
        if kind:
            for path in self.paths:
                shutil.rmtree(path, ignore_errors=True)
