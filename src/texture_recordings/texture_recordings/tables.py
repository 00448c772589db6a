# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Import foreign tables: a frame gives clock, streams, labels, slides and conditions by a mapping, or is refused."""

from __future__ import annotations

import fnmatch
import json
import math
import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.cli import progress
from texture_core.config import parse_yaml, unknown_name
from texture_core.errors import InvalidData, counted
from texture_core.types import AnyArray, Array, ExplorationState, Phase, TactileSignal, checked_label
from texture_recordings.bags import SlideBags, SlideStreams, is_bag, is_cut_off
from texture_recordings.clock import SAME_RATE, ClockFault, estimated, on_grid, with_malformed
from texture_recordings.mapping import (
    CONDITION_COLUMNS,
    CONDITION_UNITS,
    TIME_UNITS,
    Quantity,
    StreamColumns,
    TableMapping,
    plausible,
    template_fields,
)
from texture_recordings.readers import (
    EXAMPLES,
    MAPPED,
    MOST_COLUMNS,
    OTHER_KINDS,
    TableFrame,
    chosen,
    frames,
    kind_of,
    natural,
    number_of,
    placed,
)

PLAUSIBLE_HZ, LIKELY_HZ = (5.0, 200_000.0), (20.0, 20_000.0)
LONGEST_SLIDE_S = 1800.0
LONGEST_TRACK_M = 50.0  # many turns of a turntable; a second at 8 kHz, read as 1000 s, has more
MOST_ROUNDING, NO_CHANGE = 0.01, 1e-12  # of the standard deviation, and of the largest value, by rounding in 64 bits
SAME_TIME_S = 1e-9
MAX_LEFT_OUT = 0.1  # share of the rows
MAX_NUMBERED = 3  # columns name_1 … name_n beyond this may be samples: the mapping has to tell
FEW_ROWS = 3  # whose intervals tell no unit
ROWS_A_CODE = 2  # at least, of a column that may name sensors, trials or runs
MANY_TEXTS = 50  # different ones are no codes
# Ratios of successive steps of a channel that make a word, of which a fifth may come twice; words that a slide keeps.
# Of few levels, as a converter of 12 bits has, a robot that repeats itself to 0.3 of them gives 20 again by chance.
WORD, COARSE_WORD, COARSE_LEVELS, MOST_WORDS = 20, 40, 4096, 1000
WEIGHTS = 2 * np.random.default_rng(0).integers(2**62, size=COARSE_WORD, dtype=np.uint64) + 1
# A vibration stands still if its samples are equal for longer, and is held by a slower sensor if fewer of its values
# last one sample. In 1356 slides of public sets they are equal for 0.08 s at most, and at least 74 % last one sample.
STILL_S, STILL_ROWS, FEWEST_SINGLE = 0.1, 10, 0.1
# A channel with more changes, of which a larger share go one way, is a clock or a counter: of 57 000 channels in public
# sets at most 0.78 do but those of the time.
CLOCK_CHANGES, ONE_WAY = 100, 0.9
IN_NAMES = ('label', 'session', 'conditions')  # keys whose values names of files may hold
FLAGS = {'true', 'false', 'yes', 'no', 'on', 'off'}
CODE_NAME = re.compile(
    r'(?:sensor|finger|trial|run|rep|repeat|repetition|recording|session|pass|stroke)s?[ _-]?(?:id|no|nr|number)?'
)
MAX_TURNS, IN_TURN = 100, 0.7  # sensors in turn, and share of rows with the number of as many rows before


@dataclass
class ImportReport:
    """What an import found, and all that it left out."""

    bags: list[Path] = field(default_factory=list)
    files: int = 0
    rows: int = 0
    slides: Counter[str] = field(default_factory=Counter)
    with_nan: int = 0  # slides: windows with such a sample are unusable
    streams: dict[tuple[str, str], Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    channels: dict[str, Sequence[str]] = field(default_factory=dict)
    rates_hz: dict[str, float] = field(default_factory=dict)
    conditions: dict[tuple[str, str], list[float]] = field(default_factory=lambda: defaultdict(list))
    left_out: Counter[str] = field(default_factory=Counter)  # by reason
    kept: Counter[str] = field(default_factory=Counter)  # but to be looked at, by reason
    examples: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    columns: dict[str, list[str]] = field(default_factory=dict)  # of each stream in the first file
    words: dict[int, str] = field(default_factory=dict)  # of channels, with the slide; see `refuse_copy`
    phases: set[str] = field(default_factory=set)  # in the column of the slides

    def leave_out(self, reason: str, count: int, *examples: str) -> None:
        """Count what is left out, with the first places."""
        if count:
            self.left_out[reason] += count
            self.examples[reason] += examples[: EXAMPLES - len(self.examples[reason])]

    def refuse_copy(self, name: str, streams: SlideStreams) -> None:
        """Refuse a slide with a channel of which a part is in one before: in training and test it were no other one."""
        words: list[int] = []
        shapes = []  # of channels in any order
        for signal, _ in streams.values():
            steps = np.abs(np.diff(signal.samples.astype(float), axis=0))
            # The sum tells slides apart whose channels have too few levels each.
            lengths = [COARSE_WORD if _is_coarse(one) else WORD for one in signal.samples.T.astype(float)]
            channels = zip((*steps.T, steps.sum(axis=1)), (*lengths, max(lengths)), strict=True)
            words += [word for one, length in channels for word in _words(one, length)]
            sizes = np.rint(1e6 * steps / np.fmax.reduce(steps, axis=0, initial=1e-99)).T
            shapes += [min(hash(one.tobytes()), hash(one[::-1].tobytes())) for one in sizes]
        if sum(signal.samples.size for signal, _ in streams.values()) > 2 * WORD:
            words.append(hash(tuple(sorted(shapes))))
        if copied := next((self.words[word] for word in words if word in self.words), ''):
            raise InvalidData(
                f"the slides '{name}' and '{copied}' (file/number of the slide) have the same samples in all or in a "
                'part; a copy is no further slide, nor is an overlapping window: remove one of them, or its row or '
                'file, or a channel that was computed and not measured'
            )
        for word in words[:: 1 + len(words) // MOST_WORDS]:
            self.words.setdefault(word, name)

    def refuse_like_labels(self, names: Mapping[str, str]) -> None:
        """Refuse labels that differ in nothing that a person would tell apart, and that `names` does not name."""
        like: dict[str, str] = {}
        for label in sorted(self.slides):
            other = like.setdefault(_plain(label), label)
            if other != label and not {label, other} <= {*names.values()}:
                # What looks the same is shown by its codes, as YAML reads them.
                alike = unicodedata.normalize('NFC', other) == unicodedata.normalize('NFC', label)
                one, same = map(json.dumps if alike else repr, (other, label))
                raise InvalidData(
                    f'the labels {one} and {same} differ only in case, blanks, signs, the coding of letters or digits '
                    f'behind the point; write both under `label`, such as names: {{{one}: {same}, {same}: {same}}}'
                )

    def lines(self) -> list[str]:
        """Return the table that a person checks, and below it what was left out and why."""
        units = {'speed': 'm/s', 'force': 'N', 'direction': 'rad'}
        named = [name for name in units if any(key[1] == name for key in self.conditions)]
        table = [['surface', 'stream', 'slides', 'seconds', 'rate', 'channels', 'lost', 'NaN',
                  *(f'{name} ({units[name]})' for name in named)]]  # fmt: skip
        for (surface, stream), counts in sorted(self.streams.items()):
            names, rate_hz = self.channels[stream], self.rates_hz[stream]
            shown = names[0] if len(names) == 1 else f'{len(names)}: {names[0]} … {names[-1]}'
            spread = [_range(self.conditions.get((surface, name), ())) for name in named]
            shown = f'1: {shown}' if shown.isdigit() else shown
            table.append([surface, stream, str(self.slides[surface]), f'{counts["samples"] / rate_hz:.1f}',
                          f'{rate_hz:g} Hz', shown, str(counts['lost']), str(counts['NaN']), *spread])  # fmt: skip
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines = ['  '.join(map(str.ljust, row, widths)).rstrip() for row in table]
        slides = sum(self.slides.values())
        found = f'{counted(slides, "slide")} over {counted(len(self.slides), "surface")}'
        total = f'{found} from {counted(self.files, "file")} of {counted(self.rows, "row")}'
        lines.append(
            total
            + (f'; {self.with_nan} slides have NaN samples, and windows with one are unusable' if self.with_nan else '')
        )
        lines.append('left out: nothing' if not self.left_out else 'left out:')
        for reason, count in self.left_out.items():
            lines += [f'  {count} {reason}', *(f'    {example}' for example in self.examples[reason])]
        lines += ['kept; check the sensor and the columns:'] * bool(self.kept)
        lines += [f'  {count} {reason}' for reason, count in self.kept.items()]
        return lines


def _plain(label: str) -> str:
    """Return a label as a person reads it: without case, kinds of blanks, signs between words and zeros."""
    text = re.sub(r'[\s_-]+', ' ', unicodedata.normalize('NFKC', label).casefold()).strip()
    return f'{float(text):g}' if re.fullmatch(r'\d{1,15}(\.\d*)?', text) else text


def _range(values: Sequence[float]) -> str:
    if not values:
        return 'unknown'
    low, high = f'{min(values):.3g}', f'{max(values):.3g}'
    return low if low == high else f'{low} to {high}'


def import_tables(
    mapping: TableMapping, source: str | Path, out: str | Path | None, kinds: Sequence[str] = MAPPED['table']
) -> ImportReport:
    """Write bags of the slides in the tables below a folder, none if `out` is None, and return what was found.

    InvalidData if no file matches, one lacks a column or contradicts itself, more than a tenth of its rows would be
    left out, or a bag exists already.
    """
    report = ImportReport()
    with SlideBags(out) as bags:
        for path, place, fields in progress(_files(mapping, Path(source), kinds, report), 'importing files'):
            for frame in frames(path, place, mapping):
                with placed(frame.place):
                    for session, states, streams in FrameSlides(mapping, _with_fields(frame, fields), report).slides():
                        report.refuse_copy(states[0].exploration_id, streams)
                        bags.write(session, states, streams)
            if kind_of(path) == 'bag' and is_cut_off(path):
                report.leave_out(
                    'bags were cut off: what came behind their last whole part is missing', 1, f"'{place}'"
                )
        report.refuse_like_labels(mapping.label.names)
        for value in filter(None, mapping.slides.values):
            if not any(_is_one_of(run, [value]) for run in report.phases):
                has = ', '.join(sorted(report.phases)[:5])
                raise InvalidData(f"column '{mapping.slides.column}' has '{value}' in no file; it has {has}")
        if not report.slides:
            left = [f'{count} {reason}' for reason, count in report.left_out.items() if reason.startswith('slides')]
            raise InvalidData(
                f"no slide of {mapping.slides.min_s:g} s or more with samples that change in '{source}': "
                f'{", ".join(left)}; look at `slides` and at `columns` in the mapping'
            )
    report.bags = bags.paths
    return report


def _with_fields(frame: TableFrame, fields: Mapping[str, str]) -> TableFrame:
    """Return a frame with the fields of its name; InvalidData if a column says otherwise."""
    for name in sorted(fields.keys() & frame.columns.keys()):
        has = {*map(str, np.atleast_1d(frame.texts(name)).tolist())} - {'', fields[name]}
        if other := [one for one in has if number_of(one) != number_of(fields[name])]:
            raise InvalidData(
                f"'{name}' is '{fields[name]}' in the name and '{min(other)}' in a column; give the field another "
                'name in `files`'
            )
    return replace(frame, columns={**frame.columns, **{name: np.array(text) for name, text in fields.items()}})


def _files(
    mapping: TableMapping, source: Path, kinds: Sequence[str], report: ImportReport
) -> Iterator[tuple[Path, str, dict[str, str]]]:
    """Yield the files that the mapping means, in the order of their names, with these and what they hold."""
    if not source.exists():
        raise InvalidData(f"there is no '{source}'; give the folder that holds the files")
    whole, depth = source.is_file() or is_bag(source), mapping.files.count('/')
    for path in () if whole else sorted(source.rglob('*')):
        place = path.relative_to(source).as_posix()
        if place.count('/') != depth and path.is_file() and kind_of(path) in kinds and not is_bag(path.parent):
            report.leave_out('files lie in more or fewer folders than `files` names', 1, f"'{place}'")
    # Not those of the walk above, which does not follow links to folders.
    found = [source] if whole else source.glob('/'.join('*' * (depth + 1)))
    for path in sorted(found, key=lambda path: natural(path.as_posix())):
        place = path.name if whole else path.relative_to(source).as_posix()
        fields = template_fields(mapping.files, place)
        if path.is_dir() and not is_bag(path):
            parts = [one.name for one in path.iterdir() if 'bag' in kinds and one.suffix in ('.mcap', '.db3')]
            if fields is not None and (parts or path.suffix.lower() in kinds):
                holds = (
                    f'; it holds {", ".join(sorted(parts)[:3])} without metadata.yaml: ros2 bag reindex'
                    if parts
                    else ''
                )
                raise InvalidData(
                    f"'{place}' is a folder and no file{holds}; move it elsewhere, or correct `files` in the mapping"
                )
        elif fields is None or kind_of(path) not in (*kinds, *OTHER_KINDS):
            report.leave_out('files have other names or endings', 1, f"'{place}'")
        else:
            report.files += 1
            yield path, place, fields
    if not report.files:
        has = ', '.join([*chain(*report.examples.values())][:EXAMPLES])
        raise InvalidData(
            f"no file in '{source}' has the form '{mapping.files}' and one of the endings {', '.join(kinds)}; it has "
            f'{has or "none"}; give the folder that holds them, or correct `files` in the mapping'
        )


@dataclass(frozen=True, eq=False)
class Stream:
    """One stream of a frame: its rows, (n, n_values), which of the frame these are, and their times, s, if any."""

    name: str
    params: StreamColumns
    channels: tuple[str, ...]
    samples: AnyArray
    rows: AnyArray
    time_s: Array | None
    clock: str  # column of the times, '' if there is none
    group: tuple[str, int]  # clock and number of rows of the columns: rows correspond where both are equal
    per_row: int
    rate_hz: float = 0.0  # of rows

    @property
    def at_s(self) -> Array:
        """Times of the rows, by their number where there are no others."""
        return self.rows / self.rate_hz if self.time_s is None else self.time_s


class FrameSlides:
    """The slides of one frame."""

    def __init__(self, mapping: TableMapping, frame: TableFrame, report: ImportReport) -> None:
        self._mapping, self._report, self._place = mapping, report, frame.place
        self._frame = self._wanted_rows(frame)
        names = [name for name, array in self._frame.columns.items() if array.ndim]
        other = {**dict.fromkeys(frame.clocks.values(), 'time'), **mapping.roles()}
        self._used: dict[str, list[str]] = {}
        for name, stream in mapping.streams.items():  # in the order of the first file, whose channels all have
            columns = chosen(stream.columns, names, other)
            first = report.columns.setdefault(name, columns)
            if more := [column for column in columns if column not in first]:
                raise InvalidData(
                    f"'{name}' has the column '{more[0]}', and none in the first file ({', '.join(first[:5])}); name "
                    'those that all files have, or give each kind of file a mapping'
                )
            self._used[name] = chosen(first, names, other)
        lacking = [one for one, key in mapping.roles().items() if key in IN_NAMES and one not in self._frame.columns]
        if lacking and '{' not in mapping.files + mapping.tables:
            error = unknown_name(lacking[0], self._frame.columns, 'column', MOST_COLUMNS)
            raise InvalidData(f"{error}; if names of files hold it, write files: '{{{lacking[0]}}}_{{run}}.csv', say")
        self._texts = {name: self._frame.texts(name) for name in mapping.texts()}
        numbers = [*(column for columns in self._used.values() for column in columns), *mapping.numbers()]
        self._numbers = {name: self._frame.numbers(name) for name in numbers}
        self._unknown: dict[int, str] = {}  # by line, of the first rows without a number, which and why
        self._malformed: dict[tuple[int, str], AnyArray] = {}  # by number of rows and what is done with them
        streams = [self._stream(name, params) for name, params in mapping.streams.items()]
        self._check_malformed()
        # Slides are cut by the rows of the stream that corresponds to the column at which they end.
        by = mapping.slides.column if mapping.slides.by == 'column' else ''
        same = [one for one in streams if by and one.group == self._group(by)]
        reference = self._reference = max(same or streams[:1], key=lambda one: len(one.rows))
        self._spans = self._cut()
        self._refuse_unused_codes()
        self._streams = [self._rated(one) for one in streams]
        self._reference = self._streams[streams.index(reference)]
        rates = {one.name: one.rate_hz for one in self._streams if one.time_s is None and one.group == reference.group}
        if rates and max(rates.values()) > SAME_RATE * min(rates.values()):
            stated = ', '.join(f"{rate_hz:.4g} by '{name}'" for name, rate_hz in rates.items())
            raise InvalidData(f'rows per second are {stated}, which share their rows; correct `rate_hz`')

    def slides(self) -> Iterator[tuple[str, list[ExplorationState], SlideStreams]]:
        """Yield what `SlideBags.write` takes."""
        params, reference, short, inside = self._mapping.slides, self._reference, 0, 0
        times = reference.at_s
        for number, span in enumerate(self._spans, 1):
            rows = span.stop - span.start
            inside += rows
            where = f"'{self._place}', row {self._line(reference.rows[span.start])}"
            span_s = float(times[span].min()), float(times[span].max()) + 1.0 / reference.rate_hz
            lasts_s = max(rows / reference.rate_hz, span_s[1] - span_s[0])
            if rows * reference.per_row < 2 or lasts_s < params.min_s - 1e-6:
                short += rows
                self._report.leave_out('slides are too short', 1, f'{where}: {rows * reference.per_row} samples')
                continue
            found = [(one, _flat(one.samples[self._within(one, span, span_s)], one.per_row)) for one in self._streams]
            if still := [f"'{one.name}' {how}" for one, samples in found if (how := _still(one, samples))]:
                self._report.leave_out(f'slides in which {still[0]}', 1, where)
                continue
            for one, samples in found:
                for name, channel in zip(one.channels, samples.T, strict=True):
                    if how := _still(one, channel[:, None]):
                        self._report.kept[f"slides in which '{name}' of '{one.name}' {how}"] += 1
            yield self._slide(span, span_s, number)
        if short > MAX_LEFT_OUT * inside and short < inside and params.min_s == type(params).min_s:
            raise InvalidData(
                f'{short} of {inside} rows lie in slides that are shorter than {params.min_s:g} s; look at `slides` in '
                'the mapping, or set another `min_s` there'
            )

    # ---- rows and streams

    def _wanted_rows(self, frame: TableFrame) -> TableFrame:
        for name, value in self._mapping.rows.items():
            texts = frame.texts(name)
            if not texts.ndim:
                raise InvalidData(f"'{name}' under `rows` holds for the whole file; name a column")
            mask = np.array([_is_one_of(text, [value]) for text in texts])
            if not mask.any():
                has = ', '.join(sorted({*texts.tolist()})[:5])
                raise InvalidData(f"column '{name}' has no row '{value}'; it has {has}")
            good = np.flatnonzero(np.ones(len(mask)) if frame.junk is None else ~frame.junk)
            # Behind the last good row nothing shifts.
            if (np.diff(good) > 1).any() and any(not one.time.column for one in self._mapping.streams.values()):
                line, reason = next(iter(frame.reasons.items()))
                raise InvalidData(
                    f'row {line}, {reason}: of a malformed row nobody knows whether it is one of those under `rows`, '
                    'so without a column of time the rows behind it may shift; give one, or remove the row'
                )
            self._report.leave_out('rows are not those under `rows`', int((~mask).sum()))
            lines = np.arange(len(mask)) if frame.lines is None else frame.lines
            frame = replace(
                frame, lines=lines[mask], junk=None if frame.junk is None else frame.junk[mask],
                gaps=None if frame.gaps is None else frame.gaps[mask],
                columns={key: one[mask] if one.shape == mask.shape else one for key, one in frame.columns.items()},
            )  # fmt: skip
        return frame

    def _line(self, row: int) -> int:
        lines = self._frame.lines
        return int(row) if lines is None or row >= len(lines) else int(lines[row])

    def _group(self, name: str) -> tuple[str, int]:
        return self._frame.clocks.get(name, ''), self._frame[name].size

    def _stream(self, name: str, params: StreamColumns) -> Stream:
        """Return the rows of a stream with their times."""
        # Which columns are its channels.
        names, per_row = self._used[name], params.samples_per_row or 1
        group = self._group(names[0])
        if lengths := {self._group(column)[1] for column in names} - {group[1]}:
            unlike = f'{group[1]} and {min(lengths)} rows'
            raise InvalidData(f"the columns of '{name}' have {unlike}; put columns of different rates into two streams")
        channels = tuple(params.channels) or tuple(names[::per_row])
        if len(channels) * per_row != len(names):
            raise InvalidData(
                f"the stream '{name}' has {len(names)} columns for {len(channels)} channels of "
                f'samples_per_row: {per_row}; give a name for each channel, and the number of its columns in a row'
            )
        for key, listed in (('columns', names), ('channels', channels)):
            if twice := [one for one, count in Counter(listed).items() if count > 1]:
                raise InvalidData(f"'{name}' has '{twice[0]}' twice under `{key}`; name each once")
        self._report.channels[name] = channels
        self._check_groups(name, params.samples_per_row, group[1])
        samples = np.stack([np.atleast_1d(self._numbers[column] * params.scale) for column in names], axis=1)
        samples[np.abs(samples) > np.finfo(np.float32).max] = np.nan  # a bag has no such numbers
        # Of streams with a column of time, rows in which another one alone has a value are none of the slower one.
        kept, bad = np.ones(len(samples), dtype=bool), ~np.isfinite(samples).all(axis=1)
        untimed = np.zeros_like(bad)
        others = {column for one in self._used.values() for column in one} - {*names}
        for other in others if params.time.column else ():
            if self._group(other) == group:
                kept &= ~(np.isnan(samples).all(axis=1) & np.isfinite(self._numbers[other]))
        bad &= kept
        for row in np.flatnonzero(bad)[:EXAMPLES].tolist():
            column = names[int(np.argmin(np.isfinite(samples[row])))]
            reason = 'no finite number (NaN, infinity, blank or beyond 32 bits)'
            self._unknown.setdefault(self._line(row), f"column '{column}': {reason}")
        if self._frame.junk is not None and len(self._frame.junk) == len(bad):
            bad |= self._frame.junk
            samples[self._frame.junk] = np.nan
        # When the rows were sampled; those without a time are left out.
        clock, time_s = params.time.column or group[0], None
        if clock:
            raw = self._frame.numbers(clock)
            if raw.size != len(samples):
                raise InvalidData(f"column '{clock}' has {raw.size} rows, '{name}' {len(samples)}")
            untimed = np.isnan(raw)
            raw = with_malformed(raw, kept) * TIME_UNITS[params.time.unit if params.time.column else 's']
            kept &= np.isfinite(raw)
            time_s = raw[kept]
        elif not bad.all():  # malformed rows above the samples and below them are none
            kept[: int(np.argmin(bad))] = kept[len(bad) - int(np.argmin(bad[::-1])) :] = False
        for done, found in (
            ('malformed rows, NaN where they are in a slide', bad & kept),
            ('malformed rows, of which the time alone, which is that between the rows around', untimed & kept & ~bad),
            ('malformed rows, which were dropped', (bad | untimed) & ~kept),
        ):
            self._malformed[len(bad), done] = self._malformed.get((len(bad), done), False) | found
        rows = np.flatnonzero(kept)
        return Stream(name, params, channels, samples[rows], rows, time_s, clock, group, per_row)

    def _check_groups(self, name: str, count: int, rows: int) -> None:
        """Refuse columns that may be consecutive samples unless the mapping tells, or that it wrongly calls so."""
        names = self._used[name]
        parts = [re.fullmatch(r'(.*?)(\d{1,9})', one) for one in names]
        follows = [bool(a and b and a[1] == b[1] and int(b[2]) == int(a[2]) + 1) for a, b in pairwise(parts)]
        breaks = [-1, *(at for at, one in enumerate(follows) if not one), len(follows)]
        together = max(after - before for before, after in pairwise(breaks))
        if not count and together > MAX_NUMBERED:
            raise InvalidData(
                f"the stream '{name}' has {len(names)} columns, {names[0]} … {names[-1]}, and {rows} rows; write "
                f'samples_per_row: {together} if a row holds that many consecutive samples of one channel (slides: '
                '{by: row} if it is a window), samples_per_row: 1 if the columns are channels, or format: '
                '{transpose: true} if the array lies on its side'
            )
        if count and all(parts) and any((at + 1) % count for at in breaks[1:-1]):
            raise InvalidData(
                f"the columns of '{name}' are {', '.join(names[:4])} …, whose numbers do not count up within {count} "
                f"columns; write them in the order of the samples, such as a range 'name_0-{count - 1}'"
            )

    def _fault(self, column: str, row: int, reason: object) -> InvalidData:
        if isinstance(reason, ClockFault) and (side := self._side(column)):
            reason = f'{reason}; {side}'
        return InvalidData(f"row {self._line(row)}, column '{column}': {reason}")

    def _side(self, column: str) -> str:
        """Return that the array of a column may lie on its side, '' if it has no more columns than rows."""
        rows, columns = self._frame[column].size, sum(one.ndim for one in self._frame.columns.values())
        wide = self._frame.lines is None and not self._frame.clocks and rows < columns
        shape = f'it has {rows} rows and {columns} columns'
        return f'{shape}: if the array lies on its side, write format: {{transpose: true}}' * wide

    def _check_malformed(self) -> None:
        """Count malformed rows of streams and cells of conditions; InvalidData if they are too many."""
        frame, found = self._frame, dict(self._malformed)
        self._report.rows += sum({length for length, _ in found})
        if frame.gaps is not None:
            found[len(frame.gaps), 'rows with a condition that is no number'] = frame.gaps
        for (length, done), rows in found.items():
            what = done.split(', ')[0]
            reasons = frame.gap_reasons if rows is frame.gaps else {**self._unknown, **frame.reasons}
            alike = [one for (size, other), one in found.items() if size == length and other.startswith(what)]
            count = np.count_nonzero(np.any(alike, axis=0))  # a row may be malformed in both streams
            marked = frame.lines[rows] if frame.lines is not None and len(frame.lines) == length else rows.nonzero()[0]
            known = sorted(line for line in reasons if line in marked)[:EXAMPLES] or marked[:1].tolist()
            places = [f'row {line}, {reasons.get(line, "no finite number")}' for line in known] or ['no row at all']
            self._report.leave_out(done, len(marked), *(f"'{self._place}', {place}" for place in places))
            if not length or (len(marked) and count > MAX_LEFT_OUT * length):
                raise InvalidData(
                    f'it has {count} {what} of {length}, first {places[0]}; at most '
                    f'{100 * MAX_LEFT_OUT:g} % are taken; look at the columns and at `format` in the mapping'
                )

    # ---- slides

    def _cut(self) -> list[slice]:
        """Return the rows of the reference in each slide."""
        params, count, times = self._mapping.slides, len(self._reference.rows), self._reference.time_s
        starts: AnyArray = np.empty(0, dtype=np.intp)
        wanted = None
        if params.by == 'row':
            starts = np.arange(1, count)
        elif params.by == 'column':
            wanted = self._aligned(self._texts, params.column)
            starts = np.flatnonzero(wanted[1:] != wanted[:-1]) + 1
        elif params.by == 'pause' and times is not None:
            steps = np.diff(times)
            starts = np.flatnonzero((np.abs(steps) >= params.pause_s) | (steps < 0)) + 1
            for before, start in pairwise([0, *starts.tolist()]):
                if times[before] + params.pause_s < times[start] < times[start - 1]:
                    raise self._fault(
                        self._reference.clock, self._reference.rows[start], f'time goes back to {times[start]:.9g} s, '
                        f'into the run that began at {times[before]:.9g} s; save each row once and in the order of '
                        'time, and each run as a file',
                    )  # fmt: skip
        spans = [slice(first, last) for first, last in pairwise([0, *starts.tolist(), count])]
        if wanted is not None:
            self._report.phases.update(wanted[one.start] for one in spans)
            spans = [one for one in spans if _is_one_of(wanted[one.start], params.values or ['?*'])]
            if not spans:
                values, has = ', '.join(params.values) or 'but empty', ', '.join(sorted({*wanted.tolist()})[:5])
                raise InvalidData(f"column '{params.column}' has none of the values {values}; it has {has}")
        return spans

    def _refuse_unused_codes(self) -> None:
        """Refuse a slide within which an unused column of texts or codes changes, as of sensors, trials or runs."""
        used = {*self._texts, *self._numbers, *self._mapping.rows}
        found: dict[str, AnyArray] = {}  # the rows before a change and behind it
        for name, array in self._frame.columns.items():
            plain = array.ndim and array.dtype.kind in 'OUSbiuf'
            if name in used or not plain or self._group(name) != self._reference.group:
                continue
            values = self._frame.texts(name) if array.dtype.kind in 'OUSb' else self._frame.numbers(name)
            if values.dtype.kind == 'O' and not _is_code(name) and len({*values.tolist()} - {''}) > MANY_TEXTS:
                continue
            for span in self._spans:
                rows = self._reference.rows[span]
                rows = rows[values[rows] != ''] if values.dtype.kind == 'O' else rows[np.isfinite(values[rows])]
                if name not in found and (row := _mixed(values[rows], named=_is_code(name))):
                    found[name] = rows[row - 1 : row + 1]
        if found:
            name, rows = next(iter(found.items()))
            first, other = self._frame.texts(name)[rows]
            key, also = _key(name), f' ({", ".join(list(found)[1:])} too)' if len(found) > 1 else ''
            all_of = ', '.join(f"{_key(one)}: '*'" for one in found)
            raise self._fault(
                name, rows[1], f"it changes from '{first}' to '{other}' within a slide{also} and no key uses it: rows "
                f"of several sensors, trials or runs may be mixed; choose some by rows: {{{key}: '{first}'}}, cut "
                f'there by slides: {{by: column, column: {key}}}, or take all as one signal by rows: '
                f'{{{all_of}}}'
            )  # fmt: skip

    def _rated(self, stream: Stream) -> Stream:
        """Return a stream with the rate of its rows: as stated, else by its times, which must agree."""
        name, params, per_row = stream.name, stream.params, stream.per_row
        measured, side = self._frame.rate_hz, self._side(self._used[name][0])
        first = f'{side}; ' if side else ''
        if stream.time_s is not None:
            steps = np.diff(stream.time_s)
            if stream.group == self._reference.group and self._mapping.slides.by != 'row':
                edges = [row for span in self._spans for row in self._frame_rows(span)]
                slide = np.searchsorted(edges, stream.rows, 'right')
                steps = steps[slide[1:] == slide[:-1]]
            measured = per_row * estimated(steps)
            if not measured or np.count_nonzero(steps < 0) > CLOCK_CHANGES:
                raise InvalidData(
                    f"{first}the times of '{name}' do not grow from row to row; if rows are out of order, sort them by "
                    'time, else give a column of time that grows and has enough digits, or `rate_hz` in its place'
                )
        elif not (measured or params.rate_hz):
            raise InvalidData(f"'{name}' has no column of time and no rate; write time: {{column: NAME}}, or `rate_hz`")
        # Of the first file: windows of all are to have as many samples.
        rate_hz = self._report.rates_hz.get(name) or params.rate_hz or measured
        if measured and not 1 / SAME_RATE <= measured / rate_hz <= SAME_RATE:
            by, where = ('itself', '') if stream.time_s is None else ('its times', f"the unit of '{stream.clock}' and ")
            raise InvalidData(
                f"{first}'{name}' has {measured:g} Hz by {by}, {rate_hz:g} Hz are expected; look at {where}`rate_hz` "
                'in the mapping, and give each rate another one'
            )
        low, high = PLAUSIBLE_HZ
        if not low <= rate_hz <= high:
            by = 'the mapping' if params.rate_hz else 'its times'
            units = () if params.rate_hz or side or len(stream.rows) <= FEW_ROWS else _units(params, rate_hz)
            likely = [f'; with unit: {one} it would be {rate_hz / factor:g} Hz' for one, factor in units]
            raise InvalidData(
                f"{first}the rate of '{name}' is {rate_hz:g} Hz by {by}{''.join(likely[:1])}; give a column of time "
                f'that grows and its unit, or `rate_hz`, from {low:g} to {high:g}'
            )
        self._report.rates_hz[name] = rate_hz
        return replace(stream, rate_hz=rate_hz / per_row)

    def _frame_rows(self, span: slice) -> tuple[int, int]:
        """Return the first row of the frame in a slide of the reference, and the row behind the last."""
        return int(self._reference.rows[span.start]), int(self._reference.rows[span.stop - 1]) + 1

    def _aligned(self, columns: Mapping[str, AnyArray], name: str, span: slice = slice(None)) -> AnyArray:
        """Return a column at rows of the reference: of another clock, the last value until then."""
        values, reference = columns[name], self._reference
        rows = reference.rows[span]
        if not values.ndim:
            return np.full(len(rows), values[()], dtype=values.dtype)
        if self._group(name) == reference.group:
            return values[rows]
        clock = self._frame.clocks.get(name)
        if clock is None or reference.time_s is None:
            raise InvalidData(f"column '{name}' has {len(values)} rows, as no stream; name one of the same length")
        held = np.searchsorted(self._frame[clock], reference.time_s[span] + SAME_TIME_S, 'right') - 1
        return np.where(held >= 0, values[np.maximum(held, 0)], '' if columns is self._texts else math.nan)

    def _value(self, name: str, rows: slice, kind: str) -> str:
        """Return the one value that a column has during a slide."""
        held = self._aligned(self._texts, name, rows)
        known = np.flatnonzero(held != '')
        if not len(known):
            raise self._fault(
                name, self._reference.rows[rows.start],
                f'the {kind} is blank in all rows of a slide; fill it in, or name another column',
            )  # fmt: skip
        first = str(held[known[0]])
        other = known[held[known] != first]
        if len(other):
            raise self._fault(
                name, self._reference.rows[rows.start + other[0]], f"the {kind} changes from '{first}' to "
                f"'{held[other[0]]}' within a slide; let slides end where '{name}' changes (`slides: {{by: column}}`)"
            )  # fmt: skip
        return first

    def _slide(
        self, rows: slice, span_s: tuple[float, float], number: int
    ) -> tuple[str, list[ExplorationState], SlideStreams]:
        label, (begin_s, end_s) = self._mapping.label, span_s
        surface = checked_label(label.value or self._named(self._value(label.column, rows, 'label')))
        if not surface:
            raise InvalidData('a slide has an empty label; name another column under `label`')
        session = self._value(self._mapping.session, rows, 'session') if self._mapping.session else surface
        known: dict[str, Any] = {}
        for name, column in CONDITION_COLUMNS.items():
            mean = self._condition(name, rows)
            if math.isfinite(mean):
                known[column] = plausible(name, mean, self._mapping.conditions[name].unit)
                self._report.conditions[surface, name].append(mean)
            elif name in self._mapping.conditions:
                self._report.kept[f'slides without {name}'] += 1
        lasts_s, speed_m_s = end_s - begin_s, known.get('speed_m_s', 0.0)
        if lasts_s > LONGEST_SLIDE_S or lasts_s * speed_m_s > LONGEST_TRACK_M:
            track = f' at {speed_m_s:.3g} m/s, so it has {lasts_s * speed_m_s:.3g} m' if speed_m_s else ''
            units = [unit for unit, factor in _units(self._reference.params, self._reference.rate_hz) if factor < 1.0]
            raise InvalidData(
                f'row {self._line(self._reference.rows[rows.start])}: a slide lasts {lasts_s:.4g} s{track}; at most '
                f'{LONGEST_SLIDE_S:g} s and {LONGEST_TRACK_M:g} m are plausible; look at `slides`, the speed, and '
                f'the column of time, where it may go back, and its unit{", which may be " * bool(units)}'
                + ''.join(units[:1])
            )
        streams = {one.name: self._samples(one, surface, rows, span_s) for one in self._streams}
        self._report.with_nan += any(np.isnan(signal.samples).any() for signal, _ in streams.values())
        self._report.slides[surface] += 1
        place, motion = f'{self._place}/{number}', self._mapping.motion
        state = ExplorationState(0, place, motion, Phase.SLIDE, surface=surface, **known)
        return session, [state], streams

    def _named(self, code: str) -> str:
        """Return the name of a label, by number where codes are numbers: 1 names '1.0' and '01', too."""
        names = self._mapping.label.names
        number = number_of(code)
        same = [code] if code in names else [one for one in names if number_of(one) == number]
        if not same and math.isfinite(number):
            raise InvalidData(
                f'the label {code} has no name; it is none of {", ".join(names) or "the codes"} under `names`; write '
                f'names: {{{code}: NAME}} under `label`, name another column, or leave its rows out by `values` under '
                '`slides`'
            )
        return names[same[0]] if same else code

    def _within(self, stream: Stream, span: slice, span_s: tuple[float, float]) -> slice:
        """Return the rows of a stream in a slide of the reference."""
        if stream.group == self._reference.group:
            first, last = np.searchsorted(stream.rows, self._frame_rows(span))
        else:
            first, last = np.searchsorted(stream.at_s, np.subtract(span_s, SAME_TIME_S))
        if first == last:
            raise InvalidData(
                f"no samples of '{stream.name}' from {span_s[0]:g} to {span_s[1]:g} s of a slide; look at the times of "
                'the streams'
            )
        return slice(int(first), int(last))

    def _samples(
        self, stream: Stream, surface: str, span: slice, span_s: tuple[float, float]
    ) -> tuple[TactileSignal, AnyArray]:
        """Return the samples of a slide, and their places on the grid."""
        within = self._within(stream, span, span_s)
        samples = stream.samples[within]
        index: AnyArray = np.arange(len(samples))
        counts = Counter(samples=len(samples))
        if stream.time_s is not None and len(samples) > 1:
            try:
                kept, index, counts = on_grid(stream.at_s[within], stream.rate_hz, stated=stream.params.rate_hz > 0)
                samples = samples[kept]
            except ClockFault as fault:
                raise self._fault(stream.clock, stream.rows[within.start + fault.row], fault) from fault
        for reason, left in counts.items():
            if reason in ('samples', 'lost'):
                self._report.streams[surface, stream.name][reason] += stream.per_row * left
            else:
                self._report.leave_out(f"{reason} of '{stream.name}'", left, f"'{self._place}'")
        # Successive columns that are consecutive samples of one channel.
        count, flat = stream.per_row, _flat(samples, stream.per_row)
        self._report.streams[surface, stream.name]['NaN'] += int(np.isnan(flat).any(axis=1).sum())
        self._check_channels(stream, flat)
        units, sensor = (stream.params.unit,) * len(stream.channels), self._mapping.sensor
        signal = TactileSignal(0, sensor, stream.channels, units, stream.rate_hz * count, 0, flat, sensor)
        return signal, np.add.outer(index * count, np.arange(count)).ravel()

    def _check_channels(self, stream: Stream, samples: Array) -> None:
        """Refuse a channel that a bag, with 32 bits for a number, cannot hold, and one that is a clock."""
        known = samples[np.isfinite(samples).all(axis=1)]
        for channel, exact in zip(stream.channels, known.T, strict=True):
            rising, falling = (np.count_nonzero(sign * np.diff(exact) > 0) for sign in (1, -1))
            if rising + falling > CLOCK_CHANGES and max(rising, falling) > ONE_WAY * (rising + falling):
                raise InvalidData(
                    f"channel '{channel}' of '{stream.name}' rises {rising} times and falls {falling} times, as time, "
                    'a counter or a position does; leave it out of `columns`, or name it as the column of `time`'
                )
            spread, far = exact.std() if len(exact) else 0.0, abs(exact).max(initial=0.0)
            off = abs(exact.astype(np.float32) - exact).max(initial=0.0)
            if spread > NO_CHANGE * far and off > MOST_ROUNDING * spread:
                raise InvalidData(
                    f"channel '{channel}' of '{stream.name}' varies by {spread:.3g} (standard deviation) at {far:.9g}; "
                    f'there a bag, which has 32 bits for a number, is off by up to {off:.2g}: subtract a constant from '
                    'its column, or correct `scale` in the mapping'
                )

    # ---- conditions

    def _condition(self, name: str, rows: slice) -> float:
        """Return the mean of a condition over a slide in SI units, NaN if unknown; a force and a speed without sign."""
        quantity = self._mapping.conditions.get(name, Quantity())
        if quantity.column and self._frame[quantity.column].ndim:
            values = self._aligned(self._numbers, quantity.column, rows)
        else:
            text = str(self._frame[quantity.column]) if quantity.column else quantity.value or 'nan'
            values = np.array([number_of(text)])
            if np.isnan(values[0]) and text != 'nan':
                where = f"'{quantity.column}' in its name" if quantity.column else f"`value` under '{name}'"
                raise InvalidData(f"the {name} is '{text}', by {where}; a number is needed there, such as 0.05")
        values = values[np.isfinite(values)] * CONDITION_UNITS[name].get(quantity.unit, 1.0)
        if name == 'direction' and len(values):  # 359° next to 1° is 361°
            values -= math.tau * np.round((values - values[0]) / math.tau)
        values = np.abs(values) if name == 'speed' else values
        mean = float(values.mean()) if len(values) else math.nan
        return abs(mean) if name == 'force' else mean


def _units(params: StreamColumns, rate_hz: float) -> list[tuple[str, float]]:
    """Return the units that times may have at a likely rate, and the factors by which they are then shorter."""
    factors = {unit: factor / TIME_UNITS[params.time.unit] for unit, factor in TIME_UNITS.items() if params.time.column}
    return [(unit, one) for unit, one in factors.items() if LIKELY_HZ[0] <= rate_hz / one <= LIKELY_HZ[1]]


def _flat(samples: AnyArray, per_row: int) -> AnyArray:
    """Return samples, (n, n_channels), of rows with `per_row` consecutive ones of each channel."""
    return samples.reshape(len(samples), -1, per_row).swapaxes(1, 2).reshape(len(samples) * per_row, -1)


def _still(stream: Stream, samples: AnyArray) -> str:
    """Return how samples of a stream stand still, '' if they do not: of slow streams, only if none changes."""
    samples = samples[np.isfinite(samples).all(axis=1)]
    changes = np.flatnonzero((samples[1:] != samples[:-1]).any(axis=1))
    lasts = np.diff(np.concatenate(([-1], changes, [len(samples) - 1])))
    if len(lasts) == 1:
        return 'does not change' if len(samples) > 1 else ''
    if stream.name == 'signal' and lasts.max() > max(STILL_ROWS, STILL_S * stream.rate_hz * stream.per_row):
        return f'does not change for over {STILL_S:g} s, as while a sensor is frozen or the finger rests (cut rest off)'
    if stream.name == 'signal' and (lasts == 1).mean() < FEWEST_SINGLE:
        return f'has each sample {np.median(lasts):g} times, as if a slower sensor were held'
    return ''


def _is_coarse(samples: Array) -> bool:
    """Return whether the samples of a channel are few even levels, as of a converter of at most 12 bits."""
    levels = np.unique(samples[np.isfinite(samples)])
    apart = np.diff(levels)
    places = (levels - levels[:1]) / apart[apart < 1.5 * apart.min()].mean() if len(apart) else levels[:0]
    return bool((places < COARSE_LEVELS).all() and (np.abs(places - np.rint(places)) < 0.1).all())


def _words(steps: Array, length: int) -> list[int]:
    """Return codes of the ratios of successive steps, (n,), `length` at a time: of a copy they are the same.

    An offset, a factor and the direction of time leave them. Left out are words of few levels, and such as come again
    within the slide: by chance or period other slides have them, too.
    """
    steps = steps[steps > 0]
    if len(steps) <= length:
        return []
    ratios = (1000 * np.abs(np.diff(np.log(steps)))).astype(np.uint64)
    order = np.argsort(ratios, kind='stable')
    again = np.zeros(len(ratios))
    again[order[1:]] = (np.diff(ratios[order]) == 0) & (np.diff(order) < WORD)
    codes = np.minimum(*(fold(ratios, WEIGHTS[:length], 'valid') for fold in (np.correlate, np.convolve)))
    _, places, counts = np.unique(codes, return_inverse=True, return_counts=True)
    return codes[(np.convolve(again, np.ones(length), 'valid') <= length // 5) & (counts[places] == 1)].tolist()


def _is_one_of(text: str, wanted: Sequence[str]) -> bool:
    """Return whether a text is one of those wanted, or of their patterns."""
    return any(fnmatch.fnmatchcase(text, one) or text == one for one in wanted)


def _is_code(name: str) -> bool:
    return CODE_NAME.fullmatch(re.split(r'[/.]', name)[-1].strip().lower()) is not None


def _key(name: str) -> str:
    """Return a name as a mapping in YAML needs it."""
    return name if re.fullmatch(r'[^\W\d][\w/.]+|/[\w/.]+', name) and parse_yaml(name) == name else repr(name)


def _mixed(values: AnyArray, *, named: bool) -> int:
    """Return the first row at which few texts of a slide change, or whole numbers in turn or in blocks; 0 if none does.

    Flags in blocks are no codes, unless the column is named as one of codes, whose every change counts.
    """
    found, codes = np.unique(values, return_inverse=True)
    changes, count = np.flatnonzero(codes[1:] != codes[:-1]) + 1, len(found)
    mixed = 2 <= count <= len(values) / ROWS_A_CODE
    if values.dtype.kind == 'O':
        mixed &= named or not {text.lower() for text in found.tolist()} <= FLAGS
    elif not named and mixed:
        in_blocks = len(changes) == count - 1 and not {*found.tolist()} <= {0.0, 1.0}
        in_turn = len(changes) > 0.5 * len(codes) and (codes[count:] == codes[:-count]).mean() > IN_TURN
        mixed = not (found % 1.0).any() and (in_blocks or (count <= MAX_TURNS and bool(in_turn)))
    return int(changes[0]) if mixed else 0
