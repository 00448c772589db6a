# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Import foreign tables: a frame gives clock, streams, labels, slides and conditions by a mapping, or is refused."""

from __future__ import annotations

import fnmatch
import math
import re
import shutil
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.cli import progress
from texture_core.config import unknown_name
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import (
    MAX_HZ,
    MIN_HZ,
    NANOSECONDS,
    AnyArray,
    Array,
    ExplorationState,
    Phase,
    TactileSignal,
    checked_label,
)
from texture_recordings.bags import DELAY_NS, PAUSE_NS, START_NS, BagWriter, is_bag, is_cut_off, slide_batches
from texture_recordings.clock import (
    MAX_LEFT_OUT,
    SAME_RATE,
    TIMES,
    ClockFault,
    burst_step_s,
    estimated_rate_hz,
    on_grid,
    unwrapped,
    with_places,
)
from texture_recordings.mapping import (
    CONDITION_UNITS,
    TIME_UNITS,
    Quantity,
    SlideBorders,
    StreamColumns,
    TableMapping,
    template_fields,
)
from texture_recordings.readers import (
    EXAMPLES,
    MAPPED,
    OTHER_KINDS,
    TRIAL,
    Columns,
    TableFrame,
    frames,
    kind_of,
    number_of,
)

PLAUSIBLE_HZ, LIKELY_HZ = (5.0, 200_000.0), (20.0, 20_000.0)
LONGEST_SLIDE_S = 1800.0
STATE_S = 0.1  # a state so often where a condition changes along a slide
SAME_TIME_S = 1e-9
MAX_NUMBERED = 3  # columns name_1 … name_n beyond this may be samples: the mapping has to tell
MAX_SLIDES = 20_000  # of one file
COPIED_ROWS = 3
MAX_ALTERNATING = 100  # sensors of which one row each follows the other
PEEKED_COLUMNS, PEEKED_ROWS = 40, 2000  # in which they are looked for
# Lowest and highest mean of a slide that a tactile finger reaches, in SI units.
PLAUSIBLE: Mapping[str, tuple[float, float]] = {
    'speed': (5e-5, 2.0), 'force': (1e-3, 100.0), 'direction': (-6.3, 6.3),
}  # fmt: skip


@dataclass
class ImportReport:
    """What an import found, and all that it left out."""

    bags: list[Path] = field(default_factory=list)
    files: int = 0
    rows: int = 0
    slides: Counter[str] = field(default_factory=Counter)
    streams: dict[tuple[str, str], Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    channels: dict[str, Sequence[str]] = field(default_factory=dict)
    rates_hz: dict[str, float] = field(default_factory=dict)
    conditions: dict[tuple[str, str], list[float]] = field(default_factory=lambda: defaultdict(list))
    left_out: Counter[str] = field(default_factory=Counter)  # by reason
    examples: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    named: set[str] = field(default_factory=set)  # surfaces that the mapping names

    def leave_out(self, reason: str, count: int, *examples: str) -> None:
        """Count what is left out, with the first places."""
        if count:
            self.left_out[reason] += count
            self.examples[reason] += examples[: EXAMPLES - len(self.examples[reason])]

    def refuse_like_labels(self) -> None:
        """Refuse labels that differ in nothing that a person would tell apart, and that `names` does not name."""
        like: dict[str, str] = {}
        for label in sorted(self.slides):
            other = like.setdefault(_plain(label), label)
            if other != label and not {label, other} <= self.named:
                raise InvalidData(
                    f"the labels '{other}' and '{label}' differ only in case, blanks, signs or digits behind the "
                    f"point; write both under `label`, such as names: {{'{other}': '{label}', '{label}': '{label}'}}"
                )

    def lines(self) -> list[str]:
        """Return the table that a person checks, and below it what was left out and why."""
        units = {'speed': 'm/s', 'force': 'N', 'direction': 'rad'}
        named = [name for name in units if any(key[1] == name for key in self.conditions)]
        table = [['surface', 'stream', 'slides', 'seconds', 'rate', 'channels', 'lost',
                  *(f'{name} ({units[name]})' for name in named)]]  # fmt: skip
        for (surface, stream), counts in sorted(self.streams.items()):
            names, rate_hz = self.channels[stream], self.rates_hz[stream]
            shown = names[0] if len(names) == 1 else f'{len(names)}: {names[0]} … {names[-1]}'
            spread = [_range(self.conditions.get((surface, name), ())) for name in named]
            seconds = f'{counts["samples"] / rate_hz:.1f}'
            table.append([surface, stream, str(self.slides[surface]), seconds, f'{rate_hz:g} Hz', shown,
                          str(counts['lost']), *spread])  # fmt: skip
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines = ['  '.join(map(str.ljust, row, widths)).rstrip() for row in table]
        slides = sum(self.slides.values())
        lines.append(f'{slides} slides over {len(self.slides)} surfaces from {self.files} files of {self.rows} rows')
        lines.append('left out: nothing' if not self.left_out else 'left out:')
        for reason, count in self.left_out.items():
            lines += [f'  {count} {reason}', *(f'    {example}' for example in self.examples[reason])]
        return lines


def _plain(label: str) -> str:
    """Return a label as a person reads it: without case, kinds of blanks, signs between words and zeros."""
    text = re.sub(r'[\s_-]+', ' ', unicodedata.normalize('NFKC', label).casefold()).strip()
    return f'{float(text):g}' if re.fullmatch(r'\d{1,15}(\.\d*)?', text) else text


def _range(values: Sequence[float]) -> str:
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return 'unknown'
    low, high = f'{min(known):.3g}', f'{max(known):.3g}'
    return low if low == high else f'{low} to {high}'


def import_tables(
    mapping: TableMapping, source: str | Path, out: str | Path | None, kinds: Sequence[str] = MAPPED['table']
) -> ImportReport:
    """Write bags of the slides in the tables below a folder, none if `out` is None, and return what was found.

    InvalidData if no file matches, one lacks a column or contradicts itself, more than a tenth of its rows would be
    left out, or a bag exists already.
    """
    report = ImportReport()
    with SlideBags(mapping, out) as bags:
        for path, place, fields in progress(_files(mapping, Path(source), kinds, report), 'import files'):
            for frame in frames(path, place, mapping):
                for slide in FrameSlides(mapping, frame, fields, report).slides():
                    bags.write(*slide)
            if path.is_dir() or path.suffix == '.mcap':
                cut = is_cut_off(path)
                report.leave_out('bags were cut off, and end with their last whole part', int(cut), f"'{place}'; see "
                                 'mcap recover')  # fmt: skip
        report.refuse_like_labels()
        if not report.slides:
            short = report.left_out['slides are too short']
            raise InvalidData(
                f"no slide of {mapping.slides.min_s:g} s or more in '{source}': {short} are shorter; "
                'look at `slides` in the mapping'
            )
    report.bags = bags.paths
    return report


def _files(
    mapping: TableMapping, source: Path, kinds: Sequence[str], report: ImportReport
) -> Iterator[tuple[Path, str, dict[str, str]]]:
    """Yield the files that the mapping means, in the order of their names, with these and what they hold."""
    if not source.exists():
        raise InvalidData(f"there is no '{source}'; give the folder that holds the files")
    paths = [source]
    if source.is_dir() and not is_bag(source):
        found = sorted(source.glob('/'.join('*' * (mapping.files.count('/') + 1))))
        paths = [path for path in found if is_bag(path) or not path.is_dir()]
        for folder in sorted({*found} - {*paths}):
            _refuse_as_file(folder, source, mapping, kinds)
    for path in paths:
        place = path.name if path == source else path.relative_to(source).as_posix()
        fields = template_fields(mapping.files, place)
        if fields is None or kind_of(path) not in (*kinds, *OTHER_KINDS):
            report.leave_out('files have other names or endings', 1, f"'{place}'")
            continue
        report.files += 1
        yield path, place, fields
    if not report.files:
        raise InvalidData(
            f"no file in '{source}' has the form '{mapping.files}' and one of the endings {', '.join(kinds)}; "
            'give the folder that holds them, or correct `files` in the mapping'
        )


def _refuse_as_file(folder: Path, source: Path, mapping: TableMapping, kinds: Sequence[str]) -> None:
    """Refuse a folder with the name of a file that is wanted, or with the parts of a bag that cannot be read."""
    place = folder.relative_to(source).as_posix()
    parts = sorted(one.name for one in folder.iterdir() if 'bag' in kinds and one.suffix in ('.mcap', '.db3'))
    if template_fields(mapping.files, place) is None:
        return
    if parts:
        raise InvalidData(
            f"'{place}' holds {', '.join(parts[:3])} without metadata.yaml; write it anew: ros2 bag reindex"
        )
    if folder.suffix.lower() in kinds:
        raise InvalidData(f"'{place}' is a folder and no file; move it elsewhere, or correct `files` in the mapping")


@dataclass(frozen=True, eq=False)
class Stream:
    """One stream of a frame: its rows, (n, n_values), which of the frame these are, and their times, s, if any."""

    name: str
    params: StreamColumns
    channels: tuple[str, ...]
    samples: AnyArray
    rows: AnyArray
    time_s: Array | None
    group: tuple[str, int]  # clock and number of rows of the columns: rows correspond where both are equal
    per_row: int
    rate_hz: float = 0.0  # of rows
    burst_s: float = 0.0

    def at_s(self) -> Array:
        """Return the times of rows as recorded, or by the rate."""
        return self.rows / self.rate_hz if self.time_s is None else self.time_s


# By topic: a stream, and of one slide its samples and their places on the grid.
SlideStreams = Mapping[str, tuple[Stream, AnyArray, AnyArray]]
# What holds from a time since the start of a slide on, in SI units, NaN if unknown: time, speed, force, direction.
Conditions = Sequence[tuple[float, float, float, float]]


class FrameSlides:
    """The slides of one frame."""

    def __init__(
        self, mapping: TableMapping, frame: TableFrame, fields: Mapping[str, str], report: ImportReport
    ) -> None:
        self._mapping, self._frame, self._report, self._place = mapping, frame, report, frame.place
        self._fields = {**frame.fields, **fields}
        self._chosen = {name: frame.chosen(stream.columns) for name, stream in mapping.streams.items()}
        self._columns = self._read()
        self._refuse_alternating()
        self._check_rows()
        self._streams = [self._rated(self._stream(name, params)) for name, params in mapping.streams.items()]
        # Slides are cut by the rows of the stream that corresponds to the column at which they end.
        by = mapping.slides.column
        same = [one for one in self._streams if by and by not in self._fields and one.group == self._group(by)]
        self._reference = max(same or self._streams[:1], key=lambda one: len(one.rows))
        self._check_shared_rows()
        untimed = any(one.time_s is None for one in self._streams)
        if TRIAL in frame.names and mapping.slides.by != 'column' and untimed:
            raise InvalidData(f"'{self._place}' has trials; write slides: {{by: column, column: {TRIAL}}}")

    def slides(self) -> Iterator[tuple[str, ExplorationState, SlideStreams, Conditions]]:
        """Yield what `SlideBags.write` takes."""
        params, short, inside = self._mapping.slides, 0, 0
        reference, times = self._reference, self._reference.at_s()
        for number, span in enumerate(self._cut(), 1):
            rows = span.stop - span.start
            count, inside = rows * reference.per_row, inside + rows
            if count < 2 or rows / reference.rate_hz < params.min_s - 1e-9:
                short += rows
                self._report.leave_out(
                    'slides are too short', 1, f"'{self._place}', row {self._line(span.start)}: {count} samples"
                )
                continue
            if number > MAX_SLIDES:
                raise InvalidData(f"'{self._place}' has more than {MAX_SLIDES} slides; split it")
            yield self._slide(times, span, number)
        if short > MAX_LEFT_OUT * inside and short < inside and params.min_s == SlideBorders().min_s:
            raise InvalidData(
                f"'{self._place}': {short} of {inside} rows lie in slides that are shorter than {params.min_s:g} s; "
                'look at `slides` in the mapping, or set another `min_s` there'
            )

    def _read(self) -> Columns:
        """Return the columns that the mapping uses, of the rows that it wants."""
        frame, fields, texts = self._frame, self._fields, self._mapping.texts()
        wanted = [column for columns in self._chosen.values() for column in columns] + self._mapping.numbers()
        for name in (*wanted, *texts):
            if name not in fields and name not in frame.names:
                raise InvalidData(f"'{self._place}': {unknown_name(name, (*frame.names, *fields), 'column')}")
        clocks = [frame.clocks[name] for name in (*wanted, *texts) if name in frame.clocks]
        read = frame.read(*(
            list(dict.fromkeys(name for name in names if name not in fields)) for names in ((*wanted, *clocks), texts)
        ))  # fmt: skip
        for name, value in self._mapping.rows.items():
            if name in fields:
                raise InvalidData(f"'{self._place}': '{name}' under `rows` holds for the whole file; name a column")
            mask = np.array([fnmatch.fnmatchcase(text, value) or text == value for text in read.texts[name]])
            if not mask.any():
                has = ', '.join(np.unique(read.texts[name])[:5].tolist())
                raise InvalidData(f"'{self._place}': column '{name}' has no row '{value}'; it has {has}")
            self._report.leave_out('rows are not those under `rows`', int((~mask).sum()))

            def cut(array: AnyArray | None, mask: AnyArray = mask) -> Any:
                return array if array is None or len(array) != len(mask) else array[mask]

            read = replace(
                read, lines=cut(np.arange(len(mask)) if read.lines is None else read.lines), junk=cut(read.junk),
                numbers={key: cut(array) for key, array in read.numbers.items()},
                texts={key: cut(array) for key, array in read.texts.items()},
            )  # fmt: skip
        return read

    def _refuse_alternating(self) -> None:
        """Refuse rows of several sensors: an unused column, as of their names, changes in turn or at one time."""
        used = {*self._columns.numbers, *self._columns.texts}
        unused = [name for name in self._frame.names if name not in used][:PEEKED_COLUMNS]
        clocks = [one.time.column for one in self._mapping.streams.values() if one.time.column in self._frame.names]
        peeked = self._frame.read([], list({*unused, *clocks}), PEEKED_ROWS).texts if unused else {}
        for name in unused:
            values, codes = np.unique(peeked[name], return_inverse=True)
            count = len(values)
            enough = 2 <= count <= MAX_ALTERNATING and len(codes) >= 10 * count
            if not enough or (codes[1:] != codes[:-1]).mean() < 0.5:
                continue
            in_turn = (codes[count:] == codes[:-count]).mean() > 0.9
            for clock in clocks:
                times, at = np.unique(peeked[clock], return_inverse=True)
                pairs = np.unique(at * count + codes) if len(at) == len(codes) else []
                in_turn |= len(times) < 0.9 * len(at) and len(pairs) == len(codes)
            if in_turn:
                raise InvalidData(
                    f"'{self._place}': the rows have one value of '{name}' after the other "
                    f'({", ".join(values[:5].tolist())}), so the signals of several sensors may alternate; choose one '
                    f"by rows: {{{name}: '{values[0]}'}}, or all of one signal by rows: {{{name}: '*'}}"
                )

    def _check_shared_rows(self) -> None:
        """Refuse stated rates that contradict the rows which two streams without times share."""
        rates = {one.name: one.rate_hz for one in self._streams
                 if one.time_s is None and one.group == self._reference.group}  # fmt: skip
        if max(rates.values(), default=1.0) > SAME_RATE * min(rates.values(), default=1.0):
            stated = ', '.join(f"{rate_hz:.4g} by '{name}'" for name, rate_hz in rates.items())
            raise InvalidData(
                f"'{self._place}': rows per second are {stated}, which share their rows; correct `rate_hz`"
            )

    def _line(self, row: int) -> int:
        lines = self._columns.lines
        return int(row) if lines is None or row >= len(lines) else int(lines[row])

    def _group(self, name: str) -> tuple[str, int]:
        columns = self._columns
        array = columns.texts[name] if name in columns.texts else columns.numbers[name]
        return self._frame.clocks.get(name, ''), len(array)

    def _blank(self, name: str) -> AnyArray:
        """Return rows in which a stream has no value and another one has: they are none of a slower stream's."""
        group = self._group(self._chosen[name][0])
        others = [
            self._columns.numbers[column]
            for other, columns in self._chosen.items() if other != name
            for column in columns if self._group(column) == group
        ]  # fmt: skip
        if not others or not self._mapping.streams[name].time.column:
            return np.zeros(group[1], dtype=bool)
        none = np.logical_and.reduce([np.isnan(self._columns.numbers[column]) for column in self._chosen[name]])
        blank: AnyArray = none & np.logical_or.reduce([np.isfinite(column) for column in others])
        return blank

    def _check_rows(self) -> None:
        """Count the rows with a bad number; InvalidData if they are too many."""
        bad: dict[int, AnyArray] = {}
        for name, columns in self._chosen.items():
            if len({self._group(column)[1] for column in columns}) > 1:
                lengths = sorted({self._group(column)[1] for column in columns})
                raise InvalidData(
                    f"'{self._place}': the columns of '{name}' have {lengths} rows; put columns of different rates "
                    'into two streams'
                )
            blank = self._blank(name)
            found = bad.setdefault(len(blank), np.zeros(len(blank), dtype=bool))
            for column in columns:
                found |= np.isnan(self._columns.numbers[column]) & ~blank
            if (time := self._mapping.streams[name].time.column) and len(self._columns.numbers[time]) == len(found):
                found |= np.isnan(self._columns.numbers[time])
        for length, marked in bad.items():
            junk = self._columns.junk
            found = marked | junk if junk is not None and length == len(junk) else marked
            count = int(found.sum())
            self._report.rows += length
            by_line = dict(self._columns.reasons)
            if count and not by_line:
                by_line[self._line(int(found.argmax()))] = 'no finite number'
            reasons = [f'row {line}, {reason}' for line, reason in by_line.items()]
            if not length or count > MAX_LEFT_OUT * length:
                raise InvalidData(
                    f"'{self._place}' has {count} malformed rows of {length}, first "
                    f'{(reasons or ["no row at all"])[0]}; at most {100 * MAX_LEFT_OUT:g} % are taken; look at the '
                    'columns and at `format` in the mapping'
                )
            self._report.leave_out('malformed rows', count, *(f"'{self._place}', {reason}" for reason in reasons))

    def _stream(self, name: str, params: StreamColumns) -> Stream:
        names, group = self._chosen[name], self._group(self._chosen[name][0])
        per_row = params.samples_per_row or 1
        if len(names) % per_row:
            raise InvalidData(
                f"'{self._place}': the stream '{name}' has {len(names)} columns, no multiple of "
                f'samples_per_row: {per_row}'
            )
        channels = tuple(params.channels) or tuple(names[::per_row])
        if len(channels) * per_row != len(names):
            raise InvalidData(
                f"'{self._place}': the stream '{name}' has {len(names) // per_row} channels and {len(channels)} names "
                'of channels; give one for each'
            )
        samples = np.empty((group[1], len(names)), dtype=np.float32)
        with np.errstate(over='ignore'):
            for place, column in enumerate(names):
                samples[:, place] = self._columns.numbers[column] * params.scale
        if np.isinf(samples).any():
            raise InvalidData(f"'{self._place}': '{name}' has values above 3.4e38; look at the columns and at `scale`")
        self._check_groups(name, params, names, len(samples))
        kept, time_s = ~self._blank(name), None
        column = params.time.column or self._frame.clocks.get(names[0], '')
        if column:
            raw = self._columns.numbers[column]
            if len(raw) != len(samples):
                raise InvalidData(f"'{self._place}': column '{column}' has {len(raw)} rows, '{name}' {len(samples)}")
            raw = with_places(raw, kept)
            kept &= np.isfinite(raw)
            unit = TIME_UNITS[params.time.unit if params.time.column else 's']
            time_s = unwrapped(raw[kept]) * unit
        else:  # rows without any number above the samples and below them are none
            numbers = [one for one in self._columns.numbers.values() if len(one) == len(kept)]
            known = np.flatnonzero(np.isfinite(numbers).any(axis=0))
            kept[: known[0]] = kept[known[-1] + 1 :] = False
        rows = np.flatnonzero(kept)
        self._report.channels.setdefault(name, channels)
        if self._report.channels[name] != channels and len(self._report.channels[name]) != len(channels):
            raise InvalidData(
                f"'{self._place}': '{name}' has {len(channels)} channels, {len(self._report.channels[name])} in the "
                'files before; give each sensor a mapping'
            )
        return Stream(name, params, channels, samples[rows], rows, time_s, group, per_row)

    def _check_groups(self, name: str, params: StreamColumns, names: Sequence[str], rows: int) -> None:
        """Refuse columns that may be consecutive samples unless the mapping tells, or that it wrongly calls so."""
        parts = [re.fullmatch(r'(.*?)(\d{1,9})', one) for one in names]
        follows = [bool(a and b and a[1] == b[1] and int(b[2]) == int(a[2]) + 1) for a, b in pairwise(parts)]
        count = params.samples_per_row
        if not count:
            together = max((len(list(same)) for follow, same in groupby(follows) if follow), default=0) + 1
            if together > MAX_NUMBERED:
                raise InvalidData(
                    f"'{self._place}': the stream '{name}' has {len(names)} columns, {names[0]} … {names[-1]}, and "
                    f'{rows} rows; write samples_per_row: {together} if a row holds that many consecutive samples of '
                    'one channel (slides: {by: row} if it is a window), samples_per_row: 1 if the columns are '
                    'channels, or format: {transpose: true} if the array lies on its side'
                )
        elif all(parts) and not all(follows[at] for at in range(len(follows)) if (at + 1) % count):
            raise InvalidData(
                f"'{self._place}': the columns of '{name}' are {', '.join(names[:4])} …, whose numbers do not "
                f'count up within {count} columns; write them in the order of the samples, such as a range '
                f"'{parts[0][1]}0-{count - 1}'"  # type: ignore[index]
            )

    def _cut(self) -> list[slice]:
        """Return the rows of the reference in each slide."""
        params, reference = self._mapping.slides, self._reference
        count, times = len(reference.rows), reference.time_s
        changes: AnyArray = np.empty(0, dtype=np.intp)
        keys = None
        if params.by == 'row':
            changes = np.arange(1, count)
        elif params.by == 'column' and params.column not in self._fields:
            keys = self._aligned(params.column)
            changes = np.flatnonzero(keys[1:] != keys[:-1]) + 1
        elif params.by == 'pause' and times is not None and count > 1:
            steps = np.diff(times)
            changes = np.flatnonzero(np.abs(steps) >= params.pause_s) + 1
            self._refuse_copies(reference, times, np.flatnonzero(steps <= -params.pause_s) + 1)
        found = [slice(first, last) for first, last in pairwise([0, *changes.tolist(), count])]
        if keys is None:
            return found
        found = [span for span in found if _slides_at(str(keys[span.start]), params.values)]
        if not found:
            raise InvalidData(
                f"'{self._place}': column '{params.column}' has none of the values "
                f'{", ".join(params.values) or "but empty"}; it has {", ".join(np.unique(keys)[:5].tolist())}'
            )
        return found

    def _refuse_copies(self, stream: Stream, times: Array, starts: AnyArray) -> None:
        """Refuse runs that begin with the last rows of the one before, as logs do that were joined."""
        for begin, start in pairwise([0, *starts.tolist()]):
            row = begin + int(np.searchsorted(times[begin:start], times[start]))
            count = min(start - row, COPIED_ROWS)
            if count == COPIED_ROWS and all(
                np.array_equal(array[row : row + count], array[start : start + count], equal_nan=True)
                for array in (times, stream.samples)
            ):
                raise InvalidData(self._fault(
                    stream, start, f'the rows from here on are those from row {self._line(stream.rows[row])} on, with '
                    'the same times and values; save each row once',
                ))  # fmt: skip

    def _rated(self, stream: Stream) -> Stream:
        """Return a stream with the rate of its rows: as stated, else by its times, which must agree."""
        name, params, per_row = stream.name, stream.params, stream.per_row
        measured, burst_s = self._frame.rate_hz, 0.0
        if stream.time_s is not None:
            burst_s = burst_step_s(np.diff(stream.time_s))
            measured = per_row * estimated_rate_hz(stream.time_s, burst_s)
            if not measured > 0:
                raise InvalidData(
                    f"'{self._place}': the times of '{name}' do not grow from row to row; give a column of time that "
                    'grows and has enough digits, or `rate_hz` in its place'
                )
        # Of the first file: windows of all are to have as many samples.
        rate_hz = self._report.rates_hz.get(name) or params.rate_hz or measured
        if measured and not 1 / SAME_RATE <= measured / rate_hz <= SAME_RATE:
            raise InvalidData(
                f"'{self._place}': '{name}' has {measured:g} Hz by its times, {rate_hz:g} Hz are expected; "
                f"look at the unit of column '{params.time.column}' and at `rate_hz` in the mapping"
            )
        low, high = PLAUSIBLE_HZ if not params.rate_hz else (MIN_HZ, MAX_HZ)
        if not low <= rate_hz <= high:
            unit = TIME_UNITS[params.time.unit]
            likely = [
                one for one, factor in TIME_UNITS.items() if LIKELY_HZ[0] <= rate_hz * unit / factor <= LIKELY_HZ[1]
            ]
            hint = f'; with unit: {likely[0]} it were {rate_hz * unit / TIME_UNITS[likely[0]]:g} Hz' if likely else ''
            raise InvalidData(
                f"'{self._place}': the rate of '{name}' is {rate_hz:g} Hz by its times{hint}; give a column of "
                f'time that grows and its unit, or `rate_hz`, from {low:g} to {high:g}'
            )
        self._report.rates_hz[name] = rate_hz
        return replace(stream, rate_hz=rate_hz / per_row, burst_s=burst_s)

    def _aligned(self, name: str) -> AnyArray:
        """Return a column at the rows of the reference: of another clock, the last value until then."""
        columns = self._columns
        values: AnyArray = columns.texts[name] if name in columns.texts else columns.numbers[name]
        if self._group(name) == self._reference.group:
            return values[self._reference.rows]
        clock, times = self._frame.clocks.get(name), self._reference.time_s
        if clock is None or times is None:
            raise InvalidData(
                f"'{self._place}': column '{name}' has {len(values)} rows, as no stream has; name one of the same "
                'length'
            )
        held = np.searchsorted(columns.numbers[clock], times + SAME_TIME_S, 'right') - 1
        return np.where(held >= 0, values[np.maximum(held, 0)], '' if name in columns.texts else math.nan)

    def _value(self, name: str, rows: slice, kind: str) -> str:
        """Return the one value that a column has during a slide, the last one before it where it has none."""
        if name in self._fields:
            return str(self._fields[name])
        texts = self._aligned(name)[: rows.stop]
        held = texts[np.maximum.accumulate(np.where(texts != '', np.arange(len(texts)), 0))][rows]
        known = np.flatnonzero(held != '')
        if not len(known):
            raise InvalidData(f"'{self._place}': column '{name}' has no value during a slide; name another")
        first = str(held[known[0]])
        other = known[held[known] != first]
        if len(other):
            raise InvalidData(
                f"'{self._place}', row {self._line(self._reference.rows[rows.start + other[0]])}, column '{name}': the "
                f"{kind} changes from '{first}' to '{held[other[0]]}' within a slide; let slides end where '{name}' "
                'changes (`slides: {by: column}`)'
            )
        return first

    def _slide(self, times: Array, rows: slice, number: int) -> tuple[str, ExplorationState, SlideStreams, Conditions]:
        label, reference = self._mapping.label, self._reference
        code = label.value or self._value(label.column, rows, 'label')
        surface = checked_label(self._named(code))
        if not surface:
            raise InvalidData(f"'{self._place}': a slide has an empty label; name another column under `label`")
        session = self._value(self._mapping.session, rows, 'session') if self._mapping.session else surface
        begin_s, end_s = float(times[rows].min()), float(times[rows].max()) + 1.0 / reference.rate_hz
        if end_s - begin_s > LONGEST_SLIDE_S:
            raise InvalidData(
                f"'{self._place}', row {self._line(reference.rows[rows.start])}: a slide lasts "
                f'{end_s - begin_s:.4g} s, at most {LONGEST_SLIDE_S:g} s are plausible{TIMES}'
            )
        group_rows = reference.rows[rows.start], reference.rows[rows.stop - 1] + 1
        streams = {one.name: self._samples(one, surface, group_rows, begin_s, end_s) for one in self._streams}
        conditions = self._conditions(times, rows, begin_s, end_s)
        for place, name in enumerate(CONDITION_UNITS, 1):
            known = [state[place] for state in conditions if math.isfinite(state[place])]
            if known:
                self._report.conditions[surface, name].append(self._plausible(name, float(np.mean(known))))
        self._report.slides[surface] += 1
        named = ExplorationState(0, f'{self._place}/{number}', self._mapping.motion, Phase.SLIDE, surface=surface)
        return session, named, streams, conditions

    def _named(self, code: str) -> str:
        """Return the name of a label, by number where codes are numbers: 1 names '1.0' and '01', too."""
        names = self._mapping.label.names
        number = number_of(code)
        same = [code] if code in names else [one for one in names if number_of(one) == number]
        if same:
            self._report.named.add(names[same[0]])
            return names[same[0]]
        if names and math.isfinite(number) and all(math.isfinite(number_of(one)) for one in names):
            raise InvalidData(
                f"'{self._place}': the label {code} has no name; it is none of {', '.join(names)} under `names`; add "
                'it, or leave its rows out by `values` under `slides`'
            )
        return code

    def _samples(
        self, stream: Stream, surface: str, group_rows: tuple[int, int], begin_s: float, end_s: float
    ) -> tuple[Stream, AnyArray, AnyArray]:
        if stream.group == self._reference.group:
            first, last = np.searchsorted(stream.rows, group_rows)
        else:
            first, last = np.searchsorted(stream.at_s(), (begin_s - SAME_TIME_S, end_s - SAME_TIME_S))
        samples = stream.samples[first:last]
        if not len(samples):
            raise InvalidData(
                f"'{self._place}' has no samples of '{stream.name}' from {begin_s:g} to {end_s:g} s of a slide; "
                'look at the times of the streams'
            )
        rows: AnyArray
        index: AnyArray
        if stream.time_s is None or len(samples) < 2:
            rows, index, counts = np.arange(len(samples)), np.arange(len(samples)), Counter(samples=len(samples))
        else:
            try:
                rows, index, counts = on_grid(
                    samples, stream.time_s[first:last], stream.rate_hz, stream.burst_s, stated=stream.params.rate_hz > 0
                )
            except ClockFault as fault:
                raise InvalidData(self._fault(stream, first + fault.row, str(fault))) from fault
        # Successive columns that are consecutive samples of one channel.
        count, wide = stream.per_row, samples if len(rows) == len(samples) else samples[rows]
        flat = (
            wide if count == 1 else wide.reshape(len(rows), -1, count).transpose(0, 2, 1).reshape(len(rows) * count, -1)
        )
        places = (index[:, None] * count + np.arange(count)).ravel()
        total = self._report.streams[surface, stream.name]
        total['samples'] += count * counts['samples']
        total['lost'] += count * counts['lost']
        for reason, left in counts.items():
            if reason not in ('samples', 'lost'):
                self._report.leave_out(f"{reason} of '{stream.name}'", left, f"'{self._place}'")
        return stream, flat, places

    def _fault(self, stream: Stream, row: int, reason: str) -> str:
        column = stream.params.time.column or self._frame.clocks.get(self._chosen[stream.name][0], '')
        return f"'{self._place}', row {self._line(stream.rows[row])}, column '{column}': {reason}"

    def _plausible(self, name: str, value: float) -> float:
        """Return the mean of a condition over a slide; InvalidData if no finger reaches it."""
        low, high = PLAUSIBLE[name]
        if low <= value <= high or (value == 0.0 and name != 'direction'):
            return value
        units = CONDITION_UNITS[name]
        given = self._mapping.conditions[name].unit or next(iter(units))
        number = value / units[given]
        likely = [unit for unit, factor in units.items() if low <= number * factor <= high]
        raise InvalidData(
            f"'{self._place}': the {name} of a slide is {number:.4g} {given}, plausible are "
            f'{low / units[given]:.3g} to {high / units[given]:.3g} {given}; look at its unit in the mapping'
            + (f', which may be {" or ".join(likely)}' if likely else '')
        )

    def _conditions(self, times: Array, rows: slice, begin_s: float, end_s: float) -> Conditions:
        """Return what holds from 0 on, and every 0.1 s after if a condition changes along the slide."""
        tracks = {name: self._track(name, times, rows) for name in CONDITION_UNITS}
        changing = any(len(values) > 1 and np.ptp(values) > 0 for _, values in tracks.values())
        count = max(1, round((end_s - begin_s) / STATE_S)) if changing else 1
        edges = begin_s + STATE_S * np.arange(count + 1) if changing else np.array([begin_s, math.inf])
        edges[-1] = math.inf
        means = [[_mean(*tracks[name], a, b) for name in CONDITION_UNITS] for a, b in pairwise(edges)]
        return [(start, *mean) for start, mean in zip((edges[:-1] - begin_s).tolist(), means, strict=True)]

    def _track(self, name: str, times: Array, rows: slice) -> tuple[Array, Array]:
        """Return times and known values of a condition in SI units, (n,) each; a force and a speed without sign."""
        quantity = self._mapping.conditions.get(name, Quantity())
        factor = CONDITION_UNITS[name].get(quantity.unit, 1.0)
        if quantity.column in self._fields or not quantity.column:
            text = self._fields[quantity.column] if quantity.column else quantity.value or 'nan'
            try:
                times, values = times[rows][:1], np.array([float(text)])
            except ValueError as error:
                raise InvalidParameter(
                    f"'{self._place}': '{quantity.column}' is '{text}' in its name; a number is needed there"
                ) from error
        else:
            times, values = times[rows], self._aligned(quantity.column)[rows]
        times, values = times[np.isfinite(values)], values[np.isfinite(values)] * factor
        negative = name != 'direction' and len(values) and values.mean() < 0
        return times, -values if negative else values


def _slides_at(value: str, wanted: Sequence[str]) -> bool:
    """Return whether the finger slides at a value of the column: one of those wanted, or any that is not empty."""
    return any(fnmatch.fnmatchcase(value, one) or value == one for one in wanted) if wanted else value != ''


def _mean(times: Array, values: Array, begin_s: float, end_s: float) -> float:
    """Return the mean of values between two times; the last one before where there is none."""
    if len(values) <= 1:
        return float(values[0]) if len(values) else math.nan
    inside = values[(times >= begin_s) & (times < end_s)]
    return float(inside.mean()) if len(inside) else float(values[max(0, int(np.searchsorted(times, begin_s)) - 1)])


# --------------------
# Bags of the slides.

MAX_BAGS = 500
Message = tuple[int, str, TactileSignal | ExplorationState]  # log time, topic, value


class SlideBags:
    """Bags below a folder, written slide by slide; use it in a `with` block, where an error removes them again.

    Stamps are made up: each slide begins a second after the one before, in whatever bag that is, so slides keep their
    order over all bags.
    """

    def __init__(self, mapping: TableMapping, out: str | Path | None) -> None:
        self._mapping, self._out = mapping, None if out is None else Path(out)
        self._open = ExitStack()
        self._bags: dict[str, BagWriter] = {}
        self._next: dict[tuple[str, str], int] = {}
        self._now_ns = START_NS

    @property
    def paths(self) -> list[Path]:
        """Paths of the bags in the order in which they were begun."""
        return [bag.path for bag in self._bags.values()]

    def write(self, session: str, named: ExplorationState, streams: SlideStreams, conditions: Conditions) -> None:
        """Write a slide into the bag of a session."""
        bag = self._bag(session)
        if bag is None:
            return
        duration_s = max(
            float(index[-1] + 1) / (stream.rate_hz * stream.per_row) for stream, _, index in streams.values()
        )
        messages: list[Message] = [*self._states(named, conditions, duration_s)]
        sensor = self._mapping.sensor
        for topic, (stream, samples, index) in streams.items():
            first, units = self._next.get((session, topic), 0), (stream.params.unit,) * len(stream.channels)
            none = np.empty((0, len(units)), dtype=np.float32)
            like = TactileSignal(
                0, sensor, stream.channels, units, stream.rate_hz * stream.per_row, first, none, sensor
            )
            for batch in slide_batches(like, samples, index, self._now_ns):
                messages.append((batch.end_ns + DELAY_NS, topic, batch))
                self._next[session, topic] = batch.next_sample
        bag.write_all(messages)
        self._now_ns = max(log_ns for log_ns, _, _ in messages) + PAUSE_NS

    def _bag(self, session: str) -> BagWriter | None:
        if session not in self._bags:
            name = checked_label(session)
            if not name or name.startswith('.') or len(self._bags) >= MAX_BAGS:
                raise InvalidData(
                    f"no bag can be named '{name}' as the {len(self._bags) + 1}th; at most {MAX_BAGS} bags with plain "
                    'names are made, choose another `session`'
                )
            if self._out is None:
                return None
            self._out.mkdir(parents=True, exist_ok=True)
            self._bags[session] = self._open.enter_context(BagWriter(self._out / name))
        return self._bags[session]

    def _states(self, named: ExplorationState, conditions: Conditions, duration_s: float) -> Iterator[Message]:
        ends_s = [*(start_s for start_s, *_ in conditions[1:]), duration_s]
        for (begin_s, speed_m_s, force_n, direction_rad), until_s in zip(conditions, ends_s, strict=True):
            stamp_ns, stop_ns = (self._now_ns + round(at_s * NANOSECONDS) for at_s in (begin_s, until_s))
            yield stamp_ns, 'exploration', replace(
                named, stamp_ns=stamp_ns, steady_s=max(0, stop_ns - stamp_ns) / NANOSECONDS, speed_m_s=speed_m_s,
                force_n=force_n, direction_rad=direction_rad, progress=begin_s / max(duration_s, 1e-9),
            )  # fmt: skip
        end_ns = self._now_ns + round(duration_s * NANOSECONDS)
        for count, phase in enumerate((Phase.LIFT, Phase.DONE), 1):
            state = replace(named, stamp_ns=end_ns, phase=phase, progress=1.0)
            yield end_ns + (2 + count) * DELAY_NS, 'exploration', state

    def __enter__(self) -> SlideBags:
        return self

    def __exit__(self, *error: Any) -> None:
        self._open.__exit__(*error)
        if error[0]:
            for path in self.paths:
                shutil.rmtree(path, ignore_errors=True)
