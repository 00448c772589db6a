"""Turn tables into labelled bags, as a mapping says."""

from __future__ import annotations

import fnmatch
import math
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import AnyArray, Array
from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.exploration import ExplorationState, Phase
from texture_core.labels import checked_label
from texture_core.signal import MAX_HZ, MIN_HZ, NANOSECONDS, TactileSignal
from texture_recordings.bag_writer import BagWriter
from texture_recordings.bags import is_bag
from texture_recordings.tables.mapping import (
    CONDITION_UNITS,
    TIME_UNITS,
    NameTemplate,
    Quantity,
    SlideBorders,
    StreamColumns,
    TableMapping,
)
from texture_recordings.tables.tables import BAG, EXAMPLES, MAPPED, Columns, MalformedRow, Table, TableFiles

SIGNIFICANT = 4  # digits of an estimated rate: the resolution of time stamps allows no more
ROUND_RATE = 1e-3  # a rate that is so near to one of two digits is taken for that one


@dataclass(frozen=True, eq=False)
class GridRows:
    """Samples of one slide on an even grid.

    Parameters
    ----------
    samples : (n, n_channels)
        NaN for bad ones.
    index : (n,)
        Place of each on the grid from 0; it jumps where samples were lost.
    jitter_s : (m,)
        By how much steps of time differ from the sampling interval, gaps left out.
    gaps, lost
        Number of gaps, and of samples lost in them.
    disordered
        Number of rows left out because their time does not come after that of all rows before.

    Examples
    --------
    >>> rows = on_grid(np.zeros((4, 1)), np.array([0.0, 0.01, 0.05, 0.06]), 100.0, gap=1.75, interpolated=False)
    >>> rows.index.tolist(), rows.gaps, rows.lost
    ([0, 1, 5, 6], 1, 3)
    """

    samples: Array
    index: NDArray[np.int64]
    jitter_s: Array
    gaps: int = 0
    lost: int = 0
    disordered: int = 0


def estimated_rate_hz(time_s: Array) -> float:
    """Return the rate of rows in spite of jitter and gaps, of four digits; NaN if no two times follow each other.

    Parameters
    ----------
    time_s : (n,)
        Time of each row, NaN where it is unknown.

    Examples
    --------
    >>> estimated_rate_hz(np.array([0.0, 0.011, 0.019, 0.03, 0.53, 0.54]))
    100.0
    """
    steps = np.diff(_spread(time_s[np.isfinite(time_s)]))
    steps = steps[steps > 0]
    if not len(steps):
        return float('nan')
    usual = steps[steps < 1.75 * np.median(steps)]
    rate_hz = 1.0 / float(usual.mean())
    simple = float(f'{rate_hz:.2g}')
    return simple if abs(rate_hz / simple - 1.0) < ROUND_RATE else float(f'{rate_hz:.{SIGNIFICANT}g}')


def on_grid(samples: Array, time_s: Array | None, rate_hz: float, *, gap: float, interpolated: bool) -> GridRows:
    """Return the rows of one slide on a grid that begins with its first row.

    Parameters
    ----------
    samples : (n, n_channels)
        Rows in their order; NaN for bad values.
    time_s : (n,)
        Time of each row, NaN where it is unknown; None: rows are evenly spaced.
    rate_hz
        Rate of the grid.
    gap
        Steps longer than so many intervals are gaps.
    interpolated
        Whether samples are interpolated at the times of the grid; else they are taken as evenly spaced between gaps.

    Returns
    -------
    GridRows
        Rows whose time comes after that of all before.
    """
    if time_s is None or len(samples) < 2:
        return GridRows(samples, np.arange(len(samples)), np.empty(0))
    times = _known(time_s) if interpolated else _spread(_known(time_s))
    later = np.concatenate(([True], times[1:] > np.maximum.accumulate(times)[:-1]))
    samples, times = samples[later], times[later]
    steps = np.diff(times) * rate_hz
    gaps = steps > gap
    missing = np.where(gaps, np.maximum(np.rint(steps) - 1, 0), 0).astype(np.int64)
    jitter = (steps[~gaps] - 1.0) / rate_hz
    disordered = int((~later).sum())
    if not interpolated:
        index = np.concatenate(([0], np.cumsum(1 + missing)))
        return GridRows(samples, index, jitter, int(gaps.sum()), int(missing.sum()), disordered)
    parts = [
        _interpolated(samples[rows], (times[rows] - times[0]) * rate_hz)
        for rows in np.split(np.arange(len(times)), np.flatnonzero(gaps) + 1)
    ]
    index = np.concatenate([own for own, _ in parts])
    lost = int(index[-1] + 1 - len(index)) if len(index) else 0
    return GridRows(np.concatenate([x for _, x in parts]), index, jitter, int(gaps.sum()), lost, disordered)


def repaired(rows: GridRows, longest: int) -> tuple[GridRows, int]:
    """Return rows whose holes of bad samples, up to `longest` of them, are interpolated, and how many samples that are.

    Holes at the edges of the slide and beside lost samples stay.
    """
    bad = np.logical_or.reduce(np.isnan(rows.samples), axis=1)
    if not longest or not bad.any() or bad.all():
        return rows, 0
    edges = np.flatnonzero(np.diff(np.concatenate(([0], bad, [0])).astype(int))).reshape(-1, 2)
    fill = np.zeros(len(bad), dtype=bool)
    for first, last in edges.tolist():
        inside = first > 0 and last < len(bad)
        if inside and last - first <= longest and rows.index[last] - rows.index[first - 1] == last - first + 1:
            fill[first:last] = True
    samples = rows.samples.copy()
    for channel in samples.T:
        channel[fill] = np.interp(rows.index[fill], rows.index[~bad], channel[~bad])
    return GridRows(samples, rows.index, rows.jitter_s, rows.gaps, rows.lost, rows.disordered), int(fill.sum())


def _known(time_s: Array) -> Array:
    """Return times in which an unknown one lies between its neighbours."""
    known = np.isfinite(time_s)
    if known.all() or not known.any():
        return time_s if known.any() else np.arange(len(time_s), dtype=np.float64)
    rows = np.arange(len(time_s))
    filled: Array = np.interp(rows, rows[known], time_s[known])
    return filled


def _spread(times: Array) -> Array:
    """Return times in which rows of one time are spread to the next: of a coarse clock, or of samples in batches."""
    starts = np.flatnonzero(np.concatenate(([True], times[1:] != times[:-1])))
    if len(starts) == len(times) or len(starts) < 2:
        return times
    counts = np.diff(np.append(starts, len(times)))
    steps = np.diff(times[starts]) / counts[:-1]
    steps = np.append(steps, steps[-1])
    within = np.arange(len(times)) - np.repeat(starts, counts)
    forward = np.where(steps > 0, steps, 0.0)  # a time that goes back tells nothing
    spread: Array = np.repeat(times[starts], counts) + within * np.repeat(forward, counts)
    return spread


def _interpolated(samples: Array, place: Array) -> tuple[AnyArray, Array]:
    grid = np.arange(np.ceil(place[0] - 1e-6), np.floor(place[-1] + 1e-6) + 1)
    values = np.stack([np.interp(grid, place, channel) for channel in samples.T], axis=1)
    return grid.astype(np.int64), values


@dataclass
class StreamCounts:
    """Counts of one stream over all slides."""

    rate_hz: float = 0.0
    samples: int = 0
    gaps: int = 0
    lost: int = 0
    disordered: int = 0
    repaired: int = 0
    steps: int = 0
    jitter_sum_s2: float = 0.0
    jitter_max_s: float = 0.0

    def add(self, rows: GridRows, repaired: int) -> None:
        """Count one slide."""
        self.samples += len(rows.samples)
        self.gaps += rows.gaps
        self.lost += rows.lost
        self.disordered += rows.disordered
        self.repaired += repaired
        self.steps += len(rows.jitter_s)
        self.jitter_sum_s2 += float(np.square(rows.jitter_s).sum())
        self.jitter_max_s = max(self.jitter_max_s, float(np.abs(rows.jitter_s).max(initial=0.0)))

    @property
    def jitter_s(self) -> float:
        """Root mean square of what steps of time differ from the sampling interval."""
        return float(np.sqrt(self.jitter_sum_s2 / self.steps)) if self.steps else 0.0


@dataclass
class ImportReport:
    """Counts of an import.

    Examples
    --------
    >>> report = ImportReport(files=1, rows=10, streams={'signal': StreamCounts(rate_hz=100.0, samples=10)})
    >>> report.note('run.csv', 2, [])
    >>> report.lines()[1]
    'malformed rows: 2 of 10'
    """

    bags: list[Path] = field(default_factory=list)
    files: int = 0
    ignored_files: int = 0
    rows: int = 0
    malformed_rows: int = 0
    examples: list[str] = field(default_factory=list)
    short_slides: int = 0
    slides: Counter[str] = field(default_factory=Counter)
    streams: dict[str, StreamCounts] = field(default_factory=dict)

    def note(self, place: str, count: int, rows: Iterable[MalformedRow]) -> None:
        """Count malformed rows of a table, and keep the first ones.

        Parameters
        ----------
        place
            File, and array in it.
        count
            Number of malformed rows.
        rows
            The first of them.
        """
        self.malformed_rows += count
        if count:
            self.examples += [f"'{place}', {row}" for row in rows][: EXAMPLES - len(self.examples)]

    def lines(self) -> list[str]:
        """Return the counts in lines for people."""
        slides = sum(self.slides.values())
        said = [
            f'{slides} slides over {len(self.slides)} surfaces from {self.files} files'
            + (f'; {self.ignored_files} files have other names' if self.ignored_files else ''),
            f'malformed rows: {self.malformed_rows} of {self.rows}',
            *(f'  {example}' for example in self.examples),
        ]
        for name, stream in self.streams.items():
            said.append(
                f'{name}: {stream.samples} samples at {stream.rate_hz:g} Hz; jitter {1e3 * stream.jitter_s:.2f} ms '
                f'rms, {1e3 * stream.jitter_max_s:.2f} ms at most; {stream.lost} samples lost in {stream.gaps} gaps, '
                f'{stream.disordered} rows out of order left out, {stream.repaired} samples interpolated'
            )
        if self.short_slides:
            said.append(f'slides too short, left out: {self.short_slides}')
        return said


DETECTION_BATCH = 1000  # rows


@dataclass(frozen=True, eq=False)
class SlideRows:
    """The rows of one stream by which slides are cut.

    Parameters
    ----------
    time_s : (n,)
        Time of each row; NaN where it is unknown.
    samples : (n, n_channels)
        Values.
    rate_hz
        Sampling rate.
    keys : (n,)
        Values of the column that changes between slides, if one does.
    place
        File, for sentences.

    Examples
    --------
    >>> time_s = np.array([0.0, 0.1, 0.2, 5.0, 5.1])  # a pause after the third row
    >>> rows = SlideRows(time_s, np.zeros((5, 1)), rate_hz=10.0, keys=None, place='run.csv')
    >>> spans(rows, SlideBorders(by='pause', pause_s=1.0))
    [slice(0, 3, None), slice(3, 5, None)]
    """

    time_s: Array
    samples: Array
    rate_hz: float
    keys: AnyArray | None
    place: str


def spans(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    """Return the rows of each slide in their order, the ends that are left out already taken away."""
    found = RULES[borders.by](rows, borders)
    skip, drop = (round(seconds * rows.rate_hz) for seconds in (borders.start_s, borders.end_s))
    return [slice(span.start + skip, max(span.start + skip, span.stop - drop)) for span in found]


def _by_file(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    return [slice(0, len(rows.time_s))]


def _by_column(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    if rows.keys is None:
        return _by_file(rows, borders)  # a field of the file's name: it holds for the whole file
    edges = [0, *(np.flatnonzero(rows.keys[1:] != rows.keys[:-1]) + 1).tolist(), len(rows.keys)]
    chosen = [
        slice(first, last) for first, last in pairwise(edges) if _slides_at(str(rows.keys[first]), borders.values)
    ]
    if not chosen:
        raise InvalidData(
            f"'{rows.place}': column '{borders.column}' has none of the values "
            f'{", ".join(borders.values) or "but empty"}; it has {", ".join(np.unique(rows.keys)[:5].tolist())}'
        )
    return chosen


def _slides_at(value: str, wanted: Sequence[str]) -> bool:
    """Return whether the finger slides at a value of the column: one of those wanted, or any that is not empty."""
    return any(fnmatch.fnmatchcase(value, one) or value == one for one in wanted) if wanted else value != ''


def _by_pause(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    known = np.flatnonzero(np.isfinite(rows.time_s))
    steps = np.diff(rows.time_s[known])
    edges = [0, *known[1:][(steps >= borders.pause_s) | (steps < 0)].tolist(), len(rows.time_s)]
    return [slice(first, last) for first, last in pairwise(edges)]


def _by_time(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    since = rows.time_s - np.nanmin(rows.time_s)
    number = np.floor(np.maximum.accumulate(np.nan_to_num(since, nan=0.0)) / borders.length_s + 1e-9)
    edges = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(number)]
    whole = (1.0 - 1e-6) * borders.length_s * rows.rate_hz - 1.0
    return [slice(a, b) for a, b in pairwise(edges) if b - a >= whole]


def _by_detection(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    # These need scipy, which reading and writing of bags does without.
    from texture_features.segmentation.segments import SegmentationParams  # noqa: PLC0415
    from texture_features.segmentation.slide_segmenter import segment_recording  # noqa: PLC0415

    params = SegmentationParams(on=borders.on, off=borders.off, min_duration_s=max(borders.min_s, 0.05))
    channels = tuple(str(number) for number in range(rows.samples.shape[1]))
    samples = rows.samples.astype(np.float32)
    batches = [
        TactileSignal(
            round(first / rows.rate_hz * NANOSECONDS), '', channels, (), rows.rate_hz, first,
            samples[first : first + DETECTION_BATCH],
        )
        for first in range(0, len(samples), DETECTION_BATCH)
    ]  # fmt: skip
    states = segment_recording({'signal': batches}, params)
    return [
        slice(*(round(at * rows.rate_hz / NANOSECONDS) for at in (s.stamp_ns, s.stamp_ns + s.steady_s * NANOSECONDS)))
        for s in states
        if s.phase.value == 'slide'
    ]


RULES: Mapping[str, Callable[[SlideRows, SlideBorders], list[slice]]] = {
    'file': _by_file,
    'column': _by_column,
    'pause': _by_pause,
    'time': _by_time,
    'detection': _by_detection,
}


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


MAX_FILES = 100_000
STATE_S = 0.1  # a state so often where a condition changes along a slide
SAME_RATE = 1.05  # files of one stream may differ by this factor
LONGEST_GAP_S = 3600.0
SAME_TIME_S = 1e-9


def import_tables(
    mapping: TableMapping, source: str | Path, out: str | Path, kinds: Sequence[str] = MAPPED['table']
) -> ImportReport:
    """Write bags of the slides in the tables below a folder, and return what was found.

    Parameters
    ----------
    mapping
        What becomes of the columns; see `load_mapping`.
    source
        Folder of the files, or one file.
    out
        Folder for the bags; made if missing.
    kinds
        Endings of the files that are read, of `MAPPED`.

    Returns
    -------
    ImportReport
        The bags, and what was counted.

    Raises
    ------
    InvalidData
        If no file matches, a file lacks a column or has too many malformed rows, or a bag exists already.
    """
    report = ImportReport()
    with SlideBags(out) as bags, TableFiles() as files:
        for path, place, fields in _files(mapping, Path(source), kinds, report):
            for table in files.tables(_kind(path), path, place, mapping):
                for session, slide in _TableSlides(mapping, table, fields, report).slides():
                    bags.write(session, slide)
                    report.slides[slide.surface] += 1
        if not report.slides:
            raise InvalidData(
                f"no slide of {mapping.slides.min_s:g} s or more in '{source}': {report.short_slides} are shorter; "
                'look at `slides` in the mapping'
            )
    report.bags = bags.paths
    return report


def _files(
    mapping: TableMapping, source: Path, kinds: Sequence[str], report: ImportReport
) -> Iterator[tuple[Path, str, dict[str, str]]]:
    """Yield the files that the mapping means, with their names for sentences and what these hold."""
    template = NameTemplate(mapping.files)
    found = False
    for path in _paths(source, template.depth):
        place = path.name if path == source else path.relative_to(source).as_posix()
        fields = template.match(place)
        if fields is None or _kind(path) not in kinds:
            report.ignored_files += 1
            continue
        found = True
        report.files += 1
        yield path, place, fields
    if not found:
        raise InvalidData(
            f"no file in '{source}' has the form '{mapping.files}' and one of the endings {', '.join(kinds)}; "
            'give the folder that holds them, or correct `files` in the mapping'
        )


def _paths(source: Path, depth: int) -> list[Path]:
    """Return the files at a depth below a folder, in the order of their names with numbers counted as such."""
    if not source.exists():
        raise InvalidData(f"there is no '{source}'; give the folder that holds the files")
    if source.is_file() or is_bag(source):
        return [source]
    paths: list[Path] = []
    for folder, folders, names in os.walk(source):
        level = len(Path(folder).relative_to(source).parts)
        if level + 1 == depth:
            paths += [Path(folder) / name for name in folders if is_bag(Path(folder) / name)]
        if level + 1 >= depth:
            folders.clear()
        if level + 1 == depth:
            paths += [Path(folder) / name for name in names]
        if len(paths) > MAX_FILES:
            raise InvalidData(f"'{source}' holds more than {MAX_FILES} files; give a smaller folder")
    return sorted(paths)


def _kind(path: Path) -> str:
    return BAG if is_bag(path) else path.suffix.lower()


@dataclass(frozen=True, eq=False)
class _Stream:
    """One stream of a table before it is cut."""

    params: StreamColumns
    channels: tuple[str, ...]
    samples: Array
    time_s: Array
    timed: bool  # whether times were recorded
    rate_hz: float
    clock: str  # column of time that the file states for it


class _TableSlides:
    """The slides of one table."""

    def __init__(self, mapping: TableMapping, table: Table, fields: Mapping[str, str], report: ImportReport) -> None:
        self._mapping, self._table, self._report = mapping, table, report
        self._fields = {**table.fields, **fields}
        self._chosen = {name: table.chosen(stream.columns) for name, stream in mapping.streams.items()}
        self._columns = self._read()
        self._check_rows()
        self._streams = {name: self._stream(name, params) for name, params in mapping.streams.items()}

    def slides(self) -> Iterator[tuple[str, ImportedSlide]]:
        """Yield session and slide."""
        borders = self._mapping.slides
        reference, found = self._spans()
        for number, span in enumerate(found, 1):
            if (span.stop - span.start) / reference.rate_hz < max(borders.min_s, 2.0 / reference.rate_hz):
                self._report.short_slides += 1
                continue
            yield self._slide(reference, span, number)

    def _spans(self) -> tuple[_Stream, list[slice]]:
        """Return the stream by which slides are cut, and its rows of each slide."""
        borders, place = self._mapping.slides, self._table.place
        reference = next(iter(self._streams.values()))
        keys = self._text(borders.column) if borders.by == 'column' else None
        if keys is None:
            rows = SlideRows(reference.time_s, reference.samples, reference.rate_hz, None, place)
            return reference, spans(rows, borders)
        clock = self._table.clocks.get(borders.column, '')
        same = [one for one in self._streams.values() if len(one.samples) == len(keys) and one.clock == clock]
        if same:
            return same[0], spans(SlideRows(same[0].time_s, same[0].samples, same[0].rate_hz, keys, place), borders)
        times = self._times_of(borders.column, len(keys))
        rows = SlideRows(times, keys[:, None], estimated_rate_hz(times), keys, place)
        return reference, [_rows_between(reference.time_s, *_ends(times, span)) for span in spans(rows, borders)]

    def _slide(self, reference: _Stream, span: slice, number: int) -> tuple[str, ImportedSlide]:
        times = reference.time_s[span]
        begin_s, end_s = float(np.nanmin(times)), float(np.nanmax(times)) + 1.0 / reference.rate_hz
        cut = _Cut(len(reference.samples), reference.clock, span, begin_s, end_s)
        surface = self._label(cut)
        session = self._value(self._mapping.session, cut, 'session') if self._mapping.session else surface
        slide = ImportedSlide(
            surface,
            f'{self._table.place}/{number}',
            self._mapping.motion,
            {name: self._samples(name, stream, cut) for name, stream in self._streams.items()},
            self._conditions(cut),
        )
        return session, slide

    def _samples(self, name: str, stream: _Stream, cut: _Cut) -> StreamSamples:
        rows = cut.rows(len(stream.samples), stream.clock, stream.time_s)
        samples, times = stream.samples[rows], stream.time_s[rows]
        if not len(samples):
            raise InvalidData(
                f"'{self._table.place}' has no samples of '{name}' from {cut.begin_s:g} to {cut.end_s:g} s of a slide; "
                'look at the times of the streams'
            )
        self._refuse_jumps(name, times if stream.timed else None, rows)
        time = stream.params.time
        grid = on_grid(
            samples, times if stream.timed else None, stream.rate_hz,
            gap=time.gap, interpolated=time.spacing == 'interpolated',
        )  # fmt: skip
        grid, count = repaired(grid, round(stream.params.repair_s * stream.rate_hz))
        self._report.streams[name].add(grid, count)
        params = stream.params
        return StreamSamples(
            self._mapping.sensor, stream.channels, params.unit, stream.rate_hz, grid.samples, grid.index
        )

    def _refuse_jumps(self, name: str, times: Array | None, rows: slice) -> None:
        steps = np.diff(times[np.isfinite(times)]) if times is not None else np.empty(0)
        if steps.max(initial=0.0) > LONGEST_GAP_S:
            row = self._columns.row(rows.start + int(steps.argmax()) + 1)
            raise InvalidData(
                f"'{self._table.place}', row {row}, column '{self._mapping.streams[name].time.column}': time jumps by "
                f'{steps.max():g} s within a slide; look at the unit of time and at `slides` in the mapping'
            )

    def _stream(self, name: str, params: StreamColumns) -> _Stream:
        names = self._chosen[name]
        columns = [self._columns.numbers[column] for column in names]
        if len({len(column) for column in columns}) > 1:
            raise InvalidData(
                f"'{self._table.place}': the columns of '{name}' have {sorted({len(c) for c in columns})} rows; put "
                'columns of different rates into two streams'
            )
        if params.channels and len(params.channels) != len(names):
            raise InvalidData(
                f"'{self._table.place}': the stream '{name}' has {len(names)} columns and {len(params.channels)} names "
                'of channels; give one for each'
            )
        samples = np.stack(columns, axis=1)
        samples *= params.scale
        time_column = self._time_column(name)
        rate_hz = self._rate_hz(name, params, time_column)
        if time_column:
            time_s = self._columns.numbers[time_column] * TIME_UNITS[self._time_unit(name)]
            if len(time_s) != len(samples):
                raise InvalidData(
                    f"'{self._table.place}': column '{time_column}' has {len(time_s)} rows, '{name}' {len(samples)}"
                )
        else:
            time_s = np.arange(len(samples)) / rate_hz
        channels = tuple(params.channels) or tuple(names)
        return _Stream(
            params, channels, samples, time_s, bool(time_column), rate_hz, self._table.clocks.get(names[0], '')
        )

    def _rate_hz(self, name: str, params: StreamColumns, time_column: str) -> float:
        """Return the rate of a stream: as stated, else that of the first file, from which later ones differ little."""
        counts = self._report.streams.setdefault(name, StreamCounts(rate_hz=params.rate_hz))
        own = self._table.rate_hz
        if time_column:
            own = estimated_rate_hz(self._columns.numbers[time_column] * TIME_UNITS[self._time_unit(name)])
        counts.rate_hz = counts.rate_hz or own
        if not MIN_HZ <= counts.rate_hz <= MAX_HZ:
            raise InvalidData(
                f"'{self._table.place}': the rate of '{name}' is {counts.rate_hz:g} Hz by its times; give a column of "
                f'time that grows and its unit, or `rate_hz`, from {MIN_HZ:g} to {MAX_HZ:g}'
            )
        if own and not 1 / SAME_RATE <= own / counts.rate_hz <= SAME_RATE:
            raise InvalidData(
                f"'{self._table.place}': '{name}' has {own:g} Hz by its times, {counts.rate_hz:g} Hz are expected; "
                f"look at the unit of column '{time_column}' and at `rate_hz` in the mapping"
            )
        return counts.rate_hz

    def _time_column(self, name: str) -> str:
        return self._mapping.streams[name].time.column or self._table.clocks.get(self._chosen[name][0], '')

    def _time_unit(self, name: str) -> str:
        stated = self._mapping.streams[name].time
        return stated.unit if stated.column else 's'

    def _read(self) -> Columns:
        mapping = self._mapping
        wanted = [column for columns in self._chosen.values() for column in columns]
        wanted += [self._time_column(name) for name in mapping.streams]
        wanted += [self._quantity(name).column for name in CONDITION_UNITS]
        texts = [mapping.label.column, mapping.session]
        texts += [mapping.slides.column] if mapping.slides.by == 'column' else []
        for name in filter(None, (*wanted, *texts)):
            if name not in self._fields and name not in self._table.names:
                known = (*self._table.names, *self._fields)
                raise InvalidData(f"'{self._table.place}': {unknown_name(name, known, 'column')}")
        clocks = [self._table.clocks.get(name, '') for name in (*wanted, *texts)]
        return self._table.read(self._of_table((*wanted, *clocks)), self._of_table(texts))

    def _of_table(self, names: Sequence[str]) -> list[str]:
        return [name for name in dict.fromkeys(names) if name and name not in self._fields]

    def _check_rows(self) -> None:
        """Count the rows with a bad number; InvalidData if they are too many."""
        by_length: dict[int, AnyArray] = {}
        for values in self._columns.numbers.values():
            bad = by_length.setdefault(len(values), np.zeros(len(values), dtype=bool))
            bad |= np.isnan(values)
        for rows, bad in by_length.items():
            count = int(bad.sum())
            self._report.rows += rows
            self._report.note(self._table.place, count, self._columns.malformed)
            if not rows or count > self._mapping.max_malformed * rows:
                raise InvalidData(self._malformed_sentence(count, rows))

    def _malformed_sentence(self, count: int, rows: int) -> str:
        first = str(next(iter(self._columns.malformed), 'no row at all'))
        return (
            f"'{self._table.place}' has {count} malformed rows of {rows}, first {first}; "
            f'at most {100 * self._mapping.max_malformed:g} % are taken (`max_malformed`); look at the columns '
            'and at `format` in the mapping'
        )

    def _text(self, name: str) -> AnyArray | None:
        return None if name in self._fields else self._columns.texts[name]

    def _label(self, cut: _Cut) -> str:
        label = self._mapping.label
        code = label.value or self._value(label.column, cut, 'label')
        surface = checked_label(label.names.get(code, code))
        if not surface:
            raise InvalidData(f"'{self._table.place}': a slide has an empty label; name another column under `label`")
        return surface

    def _value(self, name: str, cut: _Cut, kind: str) -> str:
        """Return the one value that a column has during a slide."""
        texts = self._text(name)
        if texts is None:
            return self._fields[name]
        rows = cut.rows(len(texts), self._table.clocks.get(name, ''), self._times_of(name, len(texts)))
        own = texts[rows]
        if not len(own):
            raise InvalidData(f"'{self._table.place}': column '{name}' has no value during a slide; name another")
        other = np.flatnonzero(own != own[0])
        if len(other):
            place = f"'{self._table.place}', row {self._columns.row(rows.start + int(other[0]))}, column '{name}'"
            change = f"the {kind} changes from '{own[0]}' to '{own[other[0]]}' within a slide"
            raise InvalidData(f"{place}: {change}; let slides end where '{name}' changes (`slides: {{by: column}}`)")
        return str(own[0])

    def _times_of(self, name: str, length: int) -> Array:
        """Return the times of a column: of its own clock, or of the stream with as many rows."""
        clock = self._table.clocks.get(name)
        if clock:
            return self._columns.numbers[clock]
        for stream in self._streams.values():
            if len(stream.samples) == length:
                return stream.time_s
        raise InvalidData(
            f"'{self._table.place}': column '{name}' has {length} rows, as no stream has; name one of the same length"
        )

    def _quantity(self, name: str) -> Quantity:
        quantity: Quantity = getattr(self._mapping.conditions, name)
        return quantity

    def _conditions(self, cut: _Cut) -> list[StateSpan]:
        """Return what holds from 0 on, and every 0.1 s after if a condition changes along the slide."""
        tracks = {name: self._track(name, cut) for name in CONDITION_UNITS}
        changing = any(len(values) > 1 and np.ptp(values[np.isfinite(values)]) > 0 for _, values in tracks.values()
                       if np.isfinite(values).any())  # fmt: skip
        count = max(1, round((cut.end_s - cut.begin_s) / STATE_S)) if changing else 1
        edges = cut.begin_s + STATE_S * np.arange(count + 1) if changing else np.array([cut.begin_s, math.inf])
        edges[-1] = math.inf
        means = [[_mean(*tracks[name], a, b) for name in CONDITION_UNITS] for a, b in pairwise(edges)]
        return [StateSpan(float(start - cut.begin_s), *mean) for start, mean in zip(edges, means, strict=False)]

    def _track(self, name: str, cut: _Cut) -> tuple[Array, Array]:
        """Return times and values of a condition in SI units, (n,) each."""
        quantity = self._quantity(name)
        factor = CONDITION_UNITS[name].get(quantity.unit, 1.0)
        if quantity.column in self._fields or not quantity.column:
            text = self._fields[quantity.column] if quantity.column else quantity.value or 'nan'
            return np.array([cut.begin_s]), np.array([_number(text, self._table.place, quantity.column)]) * factor
        values = self._columns.numbers[quantity.column]
        times = self._times_of(quantity.column, len(values))
        rows = cut.rows(len(values), self._table.clocks.get(quantity.column, ''), times)
        return times[rows], values[rows] * factor


@dataclass(frozen=True)
class _Cut:
    """A slide: rows of the stream by which it was cut, and its time."""

    length: int
    clock: str
    span: slice
    begin_s: float
    end_s: float

    def rows(self, length: int, clock: str, time_s: Array) -> slice:
        """Return the rows of a column: the same ones if it has the same clock, else those of the time of the slide."""
        if length == self.length and clock == self.clock:
            return self.span
        return _rows_between(time_s, self.begin_s, self.end_s)


def _rows_between(time_s: Array, begin_s: float, end_s: float) -> slice:
    inside = np.flatnonzero((time_s >= begin_s - SAME_TIME_S) & (time_s < end_s - SAME_TIME_S))
    return slice(int(inside[0]), int(inside[-1]) + 1) if len(inside) else slice(0, 0)


def _ends(time_s: Array, span: slice) -> tuple[float, float]:
    """Return the time of the first row, and of the row after the last."""
    if span.stop <= span.start:
        return 0.0, 0.0
    after = time_s[span.stop] if span.stop < len(time_s) else 2 * time_s[-1] - time_s[max(0, len(time_s) - 2)]
    return float(time_s[span.start]), float(after)


def _mean(times: Array, values: Array, begin_s: float, end_s: float) -> float:
    if len(values) == 1:
        return float(values[0])
    inside = values[(times >= begin_s) & (times < end_s) & np.isfinite(values)]
    return float(inside.mean()) if len(inside) else math.nan


def _number(text: str, place: str, column: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InvalidParameter(f"'{place}': '{column}' is '{text}' in its name; a number is needed there") from error
