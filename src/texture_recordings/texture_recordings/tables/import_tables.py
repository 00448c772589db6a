"""Turn tables into labelled bags, as a mapping says."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.labels import checked_label
from texture_core.signal import MAX_HZ
from texture_recordings.bags import is_bag
from texture_recordings.tables.borders import SlideRows, spans
from texture_recordings.tables.mapping import CONDITION_UNITS, TableMapping
from texture_recordings.tables.name_template import NameTemplate
from texture_recordings.tables.readers.catalogue import BAG, READERS
from texture_recordings.tables.report import ImportReport, StreamCounts
from texture_recordings.tables.slide_bags import ImportedSlide, SlideBags, StateSpan, StreamSamples
from texture_recordings.tables.table import Columns, Table, TableReader
from texture_recordings.tables.table_columns import TIME_UNITS, Quantity, StreamColumns
from texture_recordings.tables.time_grid import estimated_rate_hz, on_grid, repaired

MAX_FILES = 100_000
STATE_S = 0.1  # a state so often where a condition changes along a slide
SAME_RATE = 1.05  # files of one stream may differ by this factor
LONGEST_GAP_S = 3600.0
SAME_TIME_S = 1e-9


def import_tables(
    mapping: TableMapping, source: str | Path, out: str | Path, readers: Mapping[str, TableReader] = READERS
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
    readers
        Reader by the ending of a file's name.

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
    with SlideBags(out) as bags:
        for path, place, fields in _files(mapping, Path(source), readers, report):
            for table in readers[_kind(path)](path, place, mapping):
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
    mapping: TableMapping, source: Path, readers: Mapping[str, TableReader], report: ImportReport
) -> Iterator[tuple[Path, str, dict[str, str]]]:
    """Yield the files that the mapping means, with their names for sentences and what these hold."""
    template = NameTemplate(mapping.files)
    found = False
    for path in _paths(source, template.depth):
        place = path.name if path == source else path.relative_to(source).as_posix()
        fields = template.match(place)
        if fields is None or _kind(path) not in readers:
            report.ignored_files += 1
            continue
        found = True
        report.files += 1
        yield path, place, fields
    if not found:
        raise InvalidData(
            f"no file in '{source}' has the form '{mapping.files}' and one of the endings {', '.join(readers)}; "
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
        samples = np.stack(columns, axis=1) * params.scale
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
        if not 0.0 < counts.rate_hz <= MAX_HZ:
            raise InvalidData(
                f"'{self._table.place}': the rate of '{name}' is {counts.rate_hz:g} Hz by its times; give a column of "
                f'time that grows and its unit, or `rate_hz`, above 0 and at most {MAX_HZ:g}'
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
