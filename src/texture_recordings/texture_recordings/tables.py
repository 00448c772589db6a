# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Import foreign tables by a mapping file: readers, columns, borders of slides, bags."""

from __future__ import annotations

import codecs
import csv
import dataclasses
import fnmatch
import io
import math
import os
import re
import resource
import shutil
import signal
import struct
import subprocess
import sys
import time
import warnings
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import islice, pairwise
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.cli import progress
from texture_core.config import (
    MB,
    FileRefused,
    find_file,
    library,
    load_yaml,
    open_regular,
    param,
    tree_from_mapping,
    unknown_name,
)
from texture_core.errors import InvalidData, InvalidParameter, MissingLibrary
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
from texture_recordings.bags import (
    DELAY_NS,
    PAUSE_NS,
    START_NS,
    BagWriter,
    RawMessage,
    is_bag,
    read_foreign,
    slide_batches,
    typestore,
)
from texture_recordings.dataset import STREAMS

try:
    from rosbags.interfaces import Connection as BagConnection
    from rosbags.serde import SerdeError
    from rosbags.typesys import get_types_from_msg
    from rosbags.typesys.store import Typestore
except ModuleNotFoundError as error:
    raise MissingLibrary('rosbags', 'bags', 'bags') from error

# --------------------
# What a mapping file (YAML) says: which columns are signals, and what labels, slides and conditions come from.

FIELD = re.compile(r'\{(\w*)\}|\*')


@cache
def template_pattern(template: str) -> tuple[re.Pattern[str], Sequence[str]]:
    """Return what names of the form of a template match, and the name of each group, '' for what is not kept.

    A field in braces is one character or more, holds no '/', and ends where the text behind it comes first; '*' and
    '{}' stand for any text that is not kept.
    """
    first, *literals = FIELD.sub('\0', template).split('\0')
    if '' in literals[:-1]:
        raise InvalidParameter(f"the template '{template}' has fields without text between; put text there")
    names = [match[1] or '' for match in FIELD.finditer(template)]
    if len(set(filter(None, names))) < len(list(filter(None, names))):
        raise InvalidParameter(f"the template '{template}' has a field twice; give each a name of its own")
    pattern = re.escape(first)
    for number, (name, literal) in enumerate(zip(names, map(re.escape, literals), strict=True), 1):
        text = '[^/]+' if name else '[^/]*'
        # What a lookahead has found is not tried anew, so no name takes long to compare.
        own = f'(?=({text}?){literal})\\{number}' if number < len(names) else f'({text})'
        pattern += f'{own}{literal}'
    return re.compile(pattern, re.DOTALL), names


def template_fields(template: str, name: str) -> dict[str, str] | None:
    """Return the fields of a name; None if it is not of the form of the template."""
    pattern, names = template_pattern(template)
    match = pattern.fullmatch(name)
    return {key: text for key, text in zip(names, match.groups(), strict=True) if key} if match else None


TIME_UNITS: Mapping[str, float] = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'min': 60.0}
BORDERS = ('file', 'column', 'pause', 'time')


@dataclass(frozen=True)
class FileFormat:
    """How a file is read, where its kind does not say it."""

    delimiter: str = param('', "Character between columns of a text file; '' finds one of , ; tab | or space.")
    decimal: str = param('.', 'Decimal sign of numbers in a text file.', choices=('.', ','))
    comment: str = param('#', "Lines of a text file that begin with it are skipped; '' skips none.")
    skip_rows: int = param(0, 'Number of lines of a text file that are skipped at its top.', low=0, high=10_000)
    header: bool = param(True, 'Says whether a row with names of columns comes first; without, they count from 0.')
    transpose: bool = param(False, 'Says whether arrays are (n_channels, n_samples) and not (n_samples, n_channels).')
    reshape: list[int] = param(  # noqa: RUF009 – it gives a field
        [], 'Shape in which the values of an array are read, for arrays that were stored with mixed up axes.'
    )
    axes: list[int] = param(  # noqa: RUF009 – it gives a field
        [], 'Order of the axes of `reshape` in which the values fill the shape of the array, all from 0.'
    )

    def __post_init__(self) -> None:
        if sorted(self.axes) != list(range(len(self.reshape))):
            raise InvalidParameter(
                f'format: reshape is {self.reshape} and axes are {self.axes}; each axis of reshape is needed once, '
                'such as reshape: [75, 6, 10] and axes: [1, 0, 2]'
            )


@dataclass(frozen=True)
class TimeColumn:
    """When the rows were sampled."""

    column: str = param('', "Names the column of time; '' takes rows as evenly spaced at `rate_hz`.")
    unit: str = param('s', 'Names the unit of the column of time.', choices=tuple(TIME_UNITS))


@dataclass(frozen=True)
class StreamColumns:
    """The columns of one stream: `signal` for vibration, `signal_static` for slow channels."""

    columns: list[str] = param(  # noqa: RUF009 – it gives a field
        [], "Names the columns in their order: names, patterns ('taxel*') or ranges ('0-8')."
    )
    channels: list[str] = param(  # noqa: RUF009 – it gives a field
        [], 'Names the channels in the bag; [] takes the names of the columns.'
    )
    unit: str = param('', "Names the unit of the samples after scaling, such as 'g' or 'Pa'; '' if unknown.")
    scale: float = param(1.0, 'Factor by which samples are multiplied.')
    rate_hz: float = param(
        0.0, 'Sampling rate; 0 takes it from the column of time, or from the file.', unit='Hz', low=0.0, high=MAX_HZ
    )
    time: TimeColumn = field(default_factory=TimeColumn)

    def __post_init__(self) -> None:
        if 0.0 < self.rate_hz < MIN_HZ:
            raise InvalidParameter(
                f"parameter 'rate_hz' is {self.rate_hz:g}; allowed are 0 and {MIN_HZ:g} to {MAX_HZ:g}"
            )


@dataclass(frozen=True)
class LabelColumn:
    """Where the surface of a slide is named."""

    column: str = param('', 'Names the column, or the field of `files` or `tables`, that holds the label.')
    value: str = param('', 'Names the label of all slides, in place of a column.')
    names: Mapping[str, str] = field(
        default_factory=dict,
        metadata={
            'description': 'Names of labels by their codes, such as {0: cork, 1: felt}; others stay as they are.'
        },
    )


@dataclass(frozen=True)
class SlideBorders:
    """Parameters that say where slides begin and end."""

    by: str = param(
        'file',
        "Says what ends a slide: 'file' (each file or table is one slide), 'column' (a value changes), 'pause' (time "
        "jumps by `pause_s` or back) or 'time' (every `length_s`).",
        choices=BORDERS,
    )
    column: str = param('', "Names the column whose value changes between slides, for 'column'.")
    values: list[str] = param(  # noqa: RUF009 – it gives a field
        [],
        "Values of the column at which the finger slides, or patterns of them ('pass *'); [] takes all but empty ones.",
    )
    pause_s: float = param(0.5, "Shortest pause between slides, for 'pause'.", unit='s', low=0.0)
    length_s: float = param(5.0, "Length of a slide, for 'time'.", unit='s', low=0.05)
    start_s: float = param(0.0, 'Time at the start of each slide that is left out.', unit='s', low=0.0)
    end_s: float = param(0.0, 'Time at the end of each slide that is left out.', unit='s', low=0.0)
    min_s: float = param(0.2, 'Shortest slide that is kept; shorter ones are counted.', unit='s', low=0.0)


@dataclass(frozen=True)
class Quantity:
    """A number that holds for a slide or changes along it."""

    column: str = param('', 'Names the column, or the field of `files` or `tables`, that holds the number.')
    value: str = param('', 'Number for all slides, in place of a column.')
    unit: str = param('', "Unit of the number; '' is the SI unit.")


# Factor to the SI unit, by the name of the condition.
CONDITION_UNITS: Mapping[str, Mapping[str, float]] = {
    'speed': {'m/s': 1.0, 'cm/s': 1e-2, 'mm/s': 1e-3},
    'force': {'N': 1.0, 'mN': 1e-3, 'gf': 9.80665e-3, 'kgf': 9.80665},
    'direction': {'rad': 1.0, 'deg': 0.017453292519943295},
}


@dataclass(frozen=True)
class TableMapping:
    """Parameters that map the columns of tables to signals and slides."""

    files: str = param('*', "Gives the template of the paths below the source, such as '{material}/run{run}.csv'.")
    tables: str = param(
        '', "Gives the template of the arrays in a file that are a slide each, such as '{material}/speed{speed}'."
    )
    format: FileFormat = field(default_factory=FileFormat)
    streams: Mapping[str, StreamColumns] = field(default_factory=dict)
    label: LabelColumn = field(default_factory=LabelColumn)
    slides: SlideBorders = field(default_factory=SlideBorders)
    conditions: Mapping[str, Quantity] = field(default_factory=dict)  # what is not named is unknown
    session: str = param('', "Names the column or field by which slides go into bags; '' makes one bag a surface.")
    sensor: str = param('imported', 'Names the sensor in the bags.')
    motion: str = param('linear_slide', 'Names the motion in the bags.')
    max_malformed: float = param(
        0.1, 'Largest fraction of malformed rows of a file; one with more is refused.', low=0.0, high=1.0
    )

    def __post_init__(self) -> None:
        for template in filter(None, (self.files, self.tables)):
            template_pattern(template)
        for name, quantity in self.conditions.items():
            if name not in CONDITION_UNITS:
                raise unknown_name(name, CONDITION_UNITS, 'condition')
            if quantity.unit and quantity.unit not in CONDITION_UNITS[name]:
                units = ', '.join(CONDITION_UNITS[name])
                raise InvalidParameter(f"the unit of {name} is '{quantity.unit}'; use one of {units}")
            try:
                float(quantity.value or 0.0)
            except ValueError as error:
                raise InvalidParameter(f"the {name} is '{quantity.value}'; write a number, such as 0.05") from error
        if not self.streams or not set(self.streams) <= set(STREAMS):
            raise InvalidParameter(
                f'the streams are {", ".join(self.streams) or "none"}; name {" or ".join(STREAMS)}, or both'
            )
        for name, stream in self.streams.items():
            if not stream.columns:
                raise InvalidParameter(f"the stream '{name}' has no columns; list their names")
        if bool(self.label.column) == bool(self.label.value):
            raise InvalidParameter('the label has not one origin; give `column` or `value` under `label`')
        if self.slides.by == 'column' and not self.slides.column:
            raise InvalidParameter('slides end where a column changes, and none is named; give `column` under `slides`')

    def texts(self) -> list[str]:
        """Return the names of the columns that are read as texts."""
        return [self.label.column, self.session, *[self.slides.column] * (self.slides.by == 'column')]

    def numbers(self) -> list[str]:
        """Return the names of the columns that are read as numbers, beside those of the streams."""
        return [one.time.column for one in self.streams.values()] + [one.column for one in self.conditions.values()]


def load_mapping(name_or_path: str | Path) -> TableMapping:
    """Return the mapping in a file, or one that the package ships in config/mappings, by name.

    Raises
    ------
    UnknownName, InvalidParameter
        If there is no such file, or it contains something unknown or impossible.
    """
    path = find_file(str(name_or_path), 'texture_recordings', 'config/mappings', 'mapping')
    return mapping_from(load_yaml(path, 'mapping'), f"mapping '{path}'")


def mapping_from(content: object, where: str = 'mapping') -> TableMapping:
    """Return the mapping that plain values describe; InvalidParameter if they are unknown or impossible."""
    return tree_from_mapping(TableMapping, content, where)


# --------------------
# Files of anybody as tables: CSV, NumPy, MATLAB, HDF5, Parquet, sound, and bags of standard messages.
#
# The libraries that read them believe what a file says of its size. So a child process reads, with a limit of memory
# and of time, and no reader has limits of its own.

MAX_FILE_BYTES = 1000 * MB
MEMORY_BYTES = 1000 * MB  # beyond what the interpreter takes, and `MEMORY_TIMES` the size of the file
MEMORY_TIMES = 4
DEADLINE_S, DEADLINE_BYTES = 10.0, 5 * MB  # for each of so many bytes; the machine may be busy
START_S = 120.0  # for the process to load its libraries, on a machine that does much else
MAX_VALUES = 50_000_000  # of one table: 400 MB
EXAMPLES = 5
RANGE = re.compile(r'(\D*)(\d{1,9})-\1(\d{1,9})')
MAX_RANGE = 10_000
TRIAL = 'trial'  # number of the first axis of arrays (n_trials, n_samples, n_channels)
MAX_CHANNELS = 10_000  # more are samples: the array lies on its side
DELIMITERS = (',', ';', '\t', '|', ' ')
BLOCK_ROWS = 20_000  # of a text file, which are parsed at once
MAX_TEXT = 200  # characters of a cell that is shown or a label


@dataclass(frozen=True, eq=False)
class Columns:
    """What was read of a table."""

    numbers: Mapping[str, Array]
    texts: Mapping[str, NDArray[np.str_]]
    rows: AnyArray | None = None
    malformed: Mapping[int, str] = field(default_factory=dict)
    place: str = ''
    fields: Mapping[str, str] = field(default_factory=dict)
    rate_hz: float = 0.0
    clocks: Mapping[str, str] = field(default_factory=dict)
    chosen: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def row(self, index: int) -> int:
        """Return the number in the file of a row."""
        return index if self.rows is None or index >= len(self.rows) else int(self.rows[index])


@dataclass(frozen=True, eq=False)
class Table:
    """Columns that belong together."""

    place: str
    names: Sequence[str]
    read: Callable[[Sequence[str], Sequence[str]], Columns]
    fields: Mapping[str, str] = field(default_factory=dict)
    rate_hz: float = 0.0
    clocks: Mapping[str, str] = field(default_factory=dict)

    def chosen(self, wanted: Sequence[str]) -> list[str]:
        """Return the columns that names, patterns such as 'taxel*' and ranges such as '0-8' mean, in their order."""
        known = frozenset(self.names)
        found = []
        for name in wanted:
            meant = [name] if name in known else _meant(name, self.names)
            for one in meant or [name]:
                if one not in known:
                    raise InvalidData(f"'{self.place}': {unknown_name(one, self.names, 'column')}")
            found += meant
        return found

    def mapped(self, mapping: TableMapping, fields: Mapping[str, str]) -> Columns:
        """Return the columns that a mapping uses; `fields` are those of the name of the file."""
        fields = {**self.fields, **fields}
        chosen = {name: self.chosen(stream.columns) for name, stream in mapping.streams.items()}
        wanted = [column for columns in chosen.values() for column in columns] + mapping.numbers()
        texts = mapping.texts()
        for name in filter(None, (*wanted, *texts)):
            if name not in fields and name not in self.names:
                raise InvalidData(f"'{self.place}': {unknown_name(name, (*self.names, *fields), 'column')}")
        clocks = {name: self.clocks[name] for name in (*wanted, *texts) if name in self.clocks}
        numbers = dict.fromkeys((*wanted, *clocks.values()))
        both = (numbers, dict.fromkeys(texts))
        read = self.read(*([name for name in names if name and name not in fields] for names in both))
        return replace(read, place=self.place, fields=fields, rate_hz=self.rate_hz, clocks=clocks, chosen=chosen)


def _meant(name: str, names: Sequence[str]) -> list[str]:
    match = RANGE.fullmatch(name)
    if match and 0 <= int(match[3]) - int(match[2]) < MAX_RANGE:
        return [f'{match[1]}{number}' for number in range(int(match[2]), int(match[3]) + 1)]
    return [one for one in names if fnmatch.fnmatchcase(one, name)] if len(name) <= 100 else []


# ---- the process that reads ------------------------------------------------------------------------------------------


class TableFiles:
    """Read tables in a child process that has limits; use it in a `with` block.

    The child reads one file after another.
    """

    def __enter__(self) -> TableFiles:
        self._child: subprocess.Popen[bytes] | None = None
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def tables(
        self, kind: str, path: Path, place: str, mapping: TableMapping, fields: Mapping[str, str] | None = None
    ) -> Iterator[Columns]:
        """Yield the tables of a file, of each the columns that a mapping uses."""
        size = _checked_size(path, place)
        if self._child is None:
            self._begin()
        memory = MEMORY_BYTES + MEMORY_TIMES * size
        with suppress(OSError):  # it has ended: the answer says why
            self._connection.send((kind, path, place, mapping, dict(fields or {}), memory))
        self._receive(place, START_S, memory)  # it has its libraries, whose time is not the file's fault
        left_s = DEADLINE_S * max(1.0, size / DEADLINE_BYTES)
        while True:
            began_s = time.monotonic()
            columns = self._receive(place, left_s, memory)
            left_s -= time.monotonic() - began_s
            if columns is None:
                return
            try:
                yield columns
            except GeneratorExit:
                self._end()  # in the middle of a file: what comes next would be taken for an answer
                raise

    def _begin(self) -> None:
        self._connection, theirs = Pipe()
        code = f'from texture_recordings.tables import serve; serve({theirs.fileno()})'
        # One thread: the stack and the pool of each would count as memory taken.
        single = {'OPENBLAS_NUM_THREADS': '1', 'OMP_NUM_THREADS': '1', 'MALLOC_ARENA_MAX': '1'}
        path = {'PYTHONPATH': os.pathsep.join(sys.path), 'ARROW_DEFAULT_MEMORY_POOL': 'system'}
        self._child = subprocess.Popen(
            [sys.executable, '-c', code], pass_fds=[theirs.fileno()], env={**os.environ, **single, **path},
            stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        theirs.close()

    def _end(self) -> int:
        child, self._child = self._child, None
        if child is None:
            return 0
        self._connection.close()
        child.kill()
        return child.wait()

    def _receive(self, place: str, left_s: float, memory: int) -> Any:
        """Return the next answer of the child, which has so many seconds; InvalidData if it is a refusal."""
        began_s, late = time.monotonic(), False
        try:
            arrived = self._connection.poll(max(0.0, left_s))
            late = not arrived or time.monotonic() - began_s >= left_s
            reply = None if late else self._connection.recv()
        except (EOFError, OSError):
            late, reply = False, ''
        if late or reply == '':
            code = self._end()
            ended = f'the process that reads it ended with code {code}, having at most {memory / MB:.0f} MB'
            reason = 'it takes longer to read than a file of its size may' if late else ended
            raise InvalidData(f"'{place}' was refused: {reason}; save it again, or split it")
        if isinstance(reply, str):
            raise InvalidData(reply)
        return reply


def _checked_size(path: Path, place: str) -> int:
    try:
        if path.is_dir() and (path / 'metadata.yaml').is_file():
            return sum(file.stat().st_size for file in path.iterdir() if file.is_file())
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
    except (OSError, FileRefused) as error:
        raise InvalidData(f"'{place}' cannot be read: {error}; give a file") from error
    if size > MAX_FILE_BYTES:
        raise InvalidData(f"'{place}' has {size / MB:.0f} MB; at most {MAX_FILE_BYTES / MB:.0f} are read, split it")
    return size


def serve(number: int) -> None:
    """Read files as asked for over an inherited connection, until it ends: the work of the child process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, whose end is ours
    connection = Connection(number)
    while True:
        try:
            kind, path, place, mapping, fields, memory = connection.recv()
        except EOFError:
            return
        refused = None
        try:
            for name, files, extra in LIBRARIES.get(kind, ()):
                library(name, files, extra)
            connection.send(True)
            taken = int(Path('/proc/self/statm').read_text(encoding='ascii').split()[0]) * resource.getpagesize()
            _limit_memory(taken + memory)
            for table in READERS[kind](path, place, mapping):
                columns = table.mapped(mapping, fields)
                _check_content(columns, place)
                _limit_memory(resource.RLIM_INFINITY)  # what is sent is copied
                connection.send(columns)
                _limit_memory(taken + memory)
        except (InvalidData, MissingLibrary) as error:
            refused = str(error)
        # Whatever a library raises, which depends on the byte that is wrong, is said of the file.
        except Exception as error:
            out_of_memory = f'it takes more than {memory / MB:.0f} MB of memory to read'
            reason = out_of_memory if isinstance(error, MemoryError) else str(error) or type(error).__name__
            refused = f"'{place}' cannot be read: {reason[:300]}; save it again"
        _limit_memory(resource.RLIM_INFINITY)
        connection.send(refused)


def _limit_memory(most: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))


def _check_content(columns: Columns, place: str) -> None:
    for array in columns.texts.values():
        array.tolist()  # raises an error at what are no characters
    arrays = (*columns.numbers.values(), *columns.texts.values())
    if sum(array.nbytes for array in arrays) > 8 * MAX_VALUES:
        raise InvalidData(f"'{place}' has more than {MAX_VALUES // 1_000_000} million values; split it into files")


# ---- text files ------------------------------------------------------------------------------------------------------

Line = tuple[int, str]  # its number in the file, from 1


def _read_csv(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    form = mapping.format
    with _lines(path, form) as lines:
        _, first = next(lines, (0, ''))
    form = replace(form, delimiter=form.delimiter or _likely_delimiter(first))
    cells = _cells(first, form.delimiter)
    if not first:
        raise InvalidData(f"'{place}' has no columns; give a text file with a row for each sample")
    names = cells if form.header else [str(number) for number in range(len(cells))]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InvalidData(f"'{place}' has the column '{twice}' twice; give each column a name of its own")
    yield Table(place, names, lambda *wanted: _csv_columns(path, place, form, (names, *wanted)))


def _csv_columns(path: Path, place: str, form: FileFormat, wanted: tuple[Sequence[str], ...]) -> Columns:
    names, numbers, texts = wanted
    at = {name: number for number, name in enumerate(names)}
    blocks: list[dict[str, AnyArray]] = []
    malformed: dict[int, str] = {}
    with _lines(path, form) as lines:
        if form.header:
            next(lines, None)
        while block := list(islice(lines, BLOCK_ROWS)):
            cells = [_cells(line, form.delimiter) for _, line in block]
            rows = [row if len(row) == len(names) else None for row in cells]
            found = {
                number: f"column 'all': {len(row)} cells, {len(names)} are needed"
                for (number, _), row in zip(block, cells, strict=True)
                if len(row) != len(names)
            }
            read: dict[str, AnyArray] = {'': np.array([number for number, _ in block])}
            for name in numbers:
                read[f'number {name}'] = values = _parsed(rows, at[name], form.decimal)
                for index in np.flatnonzero(np.isnan(values)).tolist():
                    if row := rows[index]:
                        reason = f"column '{name}': '{row[at[name]][:40]}' is not a finite number"
                        if form.decimal == '.' and math.isfinite(_number(row[at[name]].replace(',', '.'))):
                            reason += "; if commas are decimal, write format: {decimal: ','}"
                        found.setdefault(block[index][0], reason)
            malformed |= dict(sorted(found.items())[: EXAMPLES - len(malformed)])
            # A row without any number, such as names or units that a logger wrote again, is none of a sample: its texts
            # are none of a sample, too, and a slide must not end at them.
            empty = np.logical_and.reduce([np.isnan(read[f'number {name}']) for name in numbers])
            for name in texts:
                read[f'text {name}'] = np.array(
                    [
                        None if row is None or left_out else row[at[name]][:MAX_TEXT].replace('\0', '')
                        for row, left_out in zip(rows, empty, strict=True)
                    ]
                )
            blocks.append(read)
    if not blocks:
        raise InvalidData(f"'{place}' has no rows below the names of its columns; choose files with samples")
    whole = {key: np.concatenate([read[key] for read in blocks]) for key in blocks[0]}
    return Columns(
        {name: whole[f'number {name}'] for name in numbers},
        {name: _without_gaps(whole[f'text {name}']) for name in texts},
        whole[''],
        malformed,
    )


CP1252 = 'texture-cp1252'  # what is no UTF-8 is read as Windows of Western Europe writes it, such as 'm/s²'


def _from_windows(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeDecodeError):
        raise error
    return error.object[error.start : error.end].decode('cp1252', 'replace'), error.end


codecs.register_error(CP1252, _from_windows)


@contextmanager
def _lines(path: Path, form: FileFormat) -> Iterator[Iterator[Line]]:
    """Give the lines that are neither empty nor comments, each with its number."""
    with open_regular(path) as opened, io.TextIOWrapper(opened, 'utf-8-sig', CP1252, newline=None) as text:
        yield (
            (number, bare)
            for number, line in enumerate(text, 1)
            if number > form.skip_rows
            and (bare := line.rstrip('\n')).strip()
            and not (form.comment and bare.startswith(form.comment))
        )


def _likely_delimiter(line: str) -> str:
    return next((delimiter for delimiter in DELIMITERS if delimiter in line), ',')


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line without blanks around them; none if its quotes cannot be read.

    Each line by itself: a quote that is never closed spoils one row and not the rest of the file.
    """
    if delimiter == ' ':
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
    except csv.Error:
        return []


def _parsed(rows: Sequence[list[str] | None], place: int, decimal: str) -> Array:
    cells = ['nan' if row is None else row[place].replace(decimal, '.') for row in rows]
    try:
        values = np.array(list(map(float, cells)))
    except ValueError:
        values = np.array([_number(cell) for cell in cells])
    values[~np.isfinite(values)] = np.nan
    return values


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _without_gaps(texts: AnyArray) -> AnyArray:
    """Return texts in which a malformed row has the one before it: no border is seen there."""
    known = np.array([text is not None for text in texts])
    if not known.any():
        return np.full(len(texts), '', dtype=str)
    last = np.maximum.accumulate(np.where(known, np.arange(len(texts)), -1))
    last[last < 0] = int(np.argmax(known))
    filled: AnyArray = texts[last].astype(str)
    return filled


# ---- files of arrays -------------------------------------------------------------------------------------------------


def _read_numpy(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    with open_regular(path) as opened:
        content = np.load(opened, allow_pickle=False)  # nothing in a file is run
        if isinstance(content, np.ndarray):
            yield from _tables([''], lambda _: content, place, mapping)
        else:
            yield from _tables(content.files, content.__getitem__, place, mapping)


def _read_mat(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    from scipy.io import loadmat  # noqa: PLC0415 – recording needs no scipy

    try:
        with open_regular(path) as opened:
            content = loadmat(opened, struct_as_record=True)
    except NotImplementedError:  # version 7.3 is HDF5 with all dimensions in reverse order
        yield from _read_hdf5(path, place, mapping, reverse=True)
        return
    arrays = dict(_members({name: value for name, value in content.items() if not name.startswith('__')}))
    yield from _tables(tuple(arrays), arrays.__getitem__, place, mapping)


def _members(values: Mapping[str, Any], prefix: str = '') -> Iterator[tuple[str, AnyArray]]:
    """Yield the arrays of numbers and texts, those in structs by their path; others are left out."""
    for name, value in values.items():
        if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
            inner = value.ravel()[0]
            yield from _members({part: inner[part] for part in value.dtype.names}, f'{prefix}{name}/')
        elif isinstance(value, np.ndarray) and value.dtype.kind in 'biufU':
            yield f'{prefix}{name}', value


def _read_hdf5(path: Path, place: str, mapping: TableMapping, *, reverse: bool = False) -> Iterator[Table]:
    h5py = library(*HDF5)
    with open_regular(path) as opened, h5py.File(opened, 'r') as file:
        names: list[str] = []

        def note(name: str, member: Any) -> None:
            if isinstance(member, h5py.Dataset) and not name.startswith('#refs#'):  # cells and objects of MATLAB
                names.append(name)

        file.visititems(note)  # follows no link out of the file, and comes to each data set once

        def load(name: str) -> AnyArray:
            member = file[name]
            if member.is_virtual or member.external:
                raise InvalidData(f"'{place}': data set '{name}' lies in another file; copy it into this one")
            texts = h5py.check_string_dtype(member.dtype) is not None and member.dtype.kind == 'O'
            array = np.asarray(member.asstr(errors='replace')[()]).astype(str) if texts else np.asarray(member[()])
            return array.T if reverse else array

        yield from _tables(names, load, place, mapping)


def _read_wav(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    from scipy.io import wavfile  # noqa: PLC0415 – recording needs no scipy

    with open_regular(path) as opened, warnings.catch_warnings():
        warnings.simplefilter('ignore')  # chunks that it does not know
        rate_hz, samples = wavfile.read(opened)
    if not 0 < rate_hz <= MAX_HZ:
        raise InvalidData(f"'{place}' has a sampling rate of {rate_hz} Hz; above 0 and at most {MAX_HZ:g} is allowed")
    if samples.dtype.kind == 'u':
        samples = (samples.astype(np.float64) - 128.0) / 128.0
    elif samples.dtype.kind == 'i':
        samples = samples / -float(np.iinfo(samples.dtype).min)  # full scale is 1
    for table in _tables([''], lambda _: samples, place, mapping):
        yield replace(table, rate_hz=float(rate_hz))


def _read_parquet(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    types, parquet = library('pyarrow', *PARQUET[1:]).types, library(*PARQUET)
    plain = (types.is_integer, types.is_floating, types.is_boolean, types.is_string, types.is_dictionary,
             types.is_large_string, types.is_timestamp)  # fmt: skip

    def array(column: Any) -> AnyArray:
        values = np.asarray(column.to_numpy())
        if types.is_timestamp(column.type):
            return values.astype('datetime64[ns]').astype(np.int64)
        return np.array(['' if value is None else str(value) for value in values]) if values.dtype == object else values

    def read(numbers: Sequence[str], texts: Sequence[str]) -> Columns:
        content = file.read(columns=list(dict.fromkeys((*numbers, *texts))), use_threads=False)
        if not content.num_rows:
            raise InvalidData(f"'{place}' has no rows; choose files with samples")
        return table_columns({name: array(content[name]) for name in content.column_names}, place, numbers, texts)

    with open_regular(path) as opened:
        file = parquet.ParquetFile(opened)
        names = [one.name for one in file.schema_arrow if any(check(one.type) for check in plain)]
        yield Table(place, names, read)


def _tables(
    names: Sequence[str], load: Callable[[str], AnyArray], place: str, mapping: TableMapping
) -> Iterator[Table]:
    """Yield the tables that arrays form.

    Without a template all arrays are one table. With one, an array whose name is of its form is a table whose columns
    count from 0, and arrays of which the first parts of the name are of its form are columns of one table.
    """
    groups = _groups(names, mapping.tables)
    if not groups:
        raise InvalidData(
            f"'{place}' has no array of the form '{mapping.tables}'; it has {', '.join(names[:5]) or 'none'}"
        )
    for table, (fields, members) in sorted(groups.items()):
        within = f'{place}, {table}' if table else place
        arrays = {column: _arranged(load(name), mapping.format, within) for column, name in members.items()}
        columns, constants = _unfolded_columns(arrays, within)
        yield Table(within, tuple(columns), partial(table_columns, columns, within), {**constants, **fields})


def _groups(names: Sequence[str], template: str) -> dict[str, tuple[dict[str, str], dict[str, str]]]:
    """Return by table its fields, and the names of its arrays by that of their columns."""
    if not template:
        return {'': ({}, {name: name for name in names})}
    groups: dict[str, tuple[dict[str, str], dict[str, str]]] = {}
    depth = template.count('/') + 1
    for name in names:
        parts = name.split('/')
        table, rest = '/'.join(parts[:depth]), '/'.join(parts[depth:])
        fields = template_fields(template, table)
        if fields is not None:
            groups.setdefault(table, (fields, {}))[1][rest] = name
    return groups


def _arranged(array: AnyArray, form: FileFormat, place: str) -> AnyArray:
    if form.reshape and array.ndim > 1:
        if array.size != math.prod(form.reshape):
            raise InvalidData(
                f"'{place}': an array of the shape {array.shape} has {array.size} values and cannot be read as "
                f'{form.reshape}; correct `reshape` under `format`'
            )
        array = array.reshape(form.reshape).transpose(form.axes).reshape(array.shape)
    return np.swapaxes(array, -1, -2) if form.transpose and array.ndim > 1 else array


def _unfolded_columns(arrays: Mapping[str, AnyArray], place: str) -> tuple[dict[str, AnyArray], dict[str, str]]:
    """Return the columns of arrays, (n,) each, and what holds for all rows."""
    columns: dict[str, AnyArray] = {}
    constants: dict[str, str] = {}
    trials = next((array.shape[:2] for array in arrays.values() if array.ndim == 3), None)
    for name, array in arrays.items():
        if array.dtype.names:
            columns |= {_joined(name, part): array[part].ravel() for part in array.dtype.names}
        elif array.size == 1:
            constants[name] = str(array.item())[:MAX_TEXT]
        elif trials and array.ndim <= 2 and array.size == trials[0]:
            columns[name] = np.repeat(array.ravel(), trials[1])
        else:
            columns |= _unfolded(name, array, place)
    if trials:
        columns[TRIAL] = np.repeat(np.arange(trials[0]), trials[1])
    return columns, constants


def _unfolded(name: str, array: AnyArray, place: str) -> dict[str, AnyArray]:
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.ndim == 1:
        return {name or '0': array}
    if array.ndim not in (2, 3) or array.shape[-1] > MAX_CHANNELS:
        raise InvalidData(
            f"'{place}': '{name}' has the shape {array.shape}; (n_samples, n_channels) is needed, at most "
            f'{MAX_CHANNELS} channels; see `transpose` under `format`'
        )
    flat = array.reshape(-1, array.shape[-1])
    return {_joined(name, str(number)): flat[:, number] for number in range(flat.shape[1])}


def _joined(name: str, part: str) -> str:
    return f'{name}.{part}' if name else part


def table_columns(columns: Mapping[str, AnyArray], place: str, numbers: Sequence[str], texts: Sequence[str]) -> Columns:
    """Return columns, (n,) each, as numbers and texts; NaN for numbers that are not finite."""
    read: dict[str, Array] = {}
    malformed: dict[int, str] = {}
    for name in numbers:
        array = columns[name]
        if array.dtype.kind not in 'biuf':
            raise InvalidData(f"'{place}': column '{name}' holds {array.dtype}; numbers are needed, name another")
        read[name] = array.astype(np.float64)
        bad = ~np.isfinite(read[name])
        for index in np.flatnonzero(bad)[:EXAMPLES].tolist():
            malformed.setdefault(index, f"column '{name}': is not a finite number")
        read[name][bad] = np.nan
    first = dict(sorted(malformed.items())[:EXAMPLES])
    return Columns(read, {name: _texts(columns[name]) for name in texts}, None, first)


def _texts(array: AnyArray) -> AnyArray:
    if array.dtype.kind == 'S':
        return np.char.decode(array, 'utf-8', 'replace')
    if array.dtype.kind == 'f' and np.array_equal(array, np.round(array)):  # 3.0 is meant as 3
        return array.astype(np.int64).astype(str)
    return array.astype(str)


# --------------------
# Bags of standard messages: each number of a message is a column, such as '/wrench/wrench.force.x'.

MAX_FIELDS = 2000  # of one message
Rows = Mapping[str, AnyArray]  # name → values of one message, (n,) each; n > 1 where it holds consecutive samples


def one_row(value: Any) -> Rows:
    """Return every number and text of a message by its path, such as 'wrench.force.x' or 'data.3'."""
    found: dict[str, AnyArray] = {}
    _collect(value, '', found)
    return found


def _collect(value: Any, path: str, found: dict[str, AnyArray]) -> None:
    if len(found) > MAX_FIELDS:
        raise ValueError(f'it has more than {MAX_FIELDS} numbers')
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            if field.name not in ('header', '__msgtype__'):
                _collect(getattr(value, field.name), f'{path}.{field.name}' if path else field.name, found)
    elif isinstance(value, (np.ndarray, Sequence)) and not isinstance(value, str):
        if len(value) > MAX_FIELDS:
            raise ValueError(f"'{path}' has {len(value)} numbers; {MAX_FIELDS} are allowed")
        for number, part in enumerate(value):
            _collect(part, f'{path}.{number}', found)
    else:
        found[path] = np.array([value])


def _joints(value: Any) -> Rows:
    """Return position, velocity and effort by the names of the joints."""
    kinds = ('position', 'velocity', 'effort')
    return {
        f'{kind}.{joint}': np.array([number])
        for kind in kinds
        for joint, number in zip(value.name, getattr(value, kind), strict=False)
    }


def _multi_array(value: Any) -> Rows:
    """Return a row of numbers; consecutive rows if the layout has two dimensions, (n_samples, n_channels)."""
    shape = [dim.size for dim in value.layout.dim]
    data = value.data[value.layout.data_offset :]
    table = data.reshape(shape) if len(shape) == 2 else data[None]
    if table.shape[1] > MAX_FIELDS:
        raise ValueError(f'it has {table.shape[1]} channels; {MAX_FIELDS} are allowed')
    return {f'data.{number}': table[:, number] for number in range(table.shape[1])}


def _audio(value: Any) -> Rows:
    """Return the samples of sound of one channel, 16 bits little endian; full scale is 1."""
    data = getattr(value, 'audio', value).data
    return {'data': np.frombuffer(data.tobytes(), '<i2') / 32768.0}


MESSAGE_BAG_RULES: Mapping[str, Callable[[Any], Rows]] = {
    'sensor_msgs/msg/JointState': _joints,
    'std_msgs/msg/Float32MultiArray': _multi_array,
    'std_msgs/msg/Float64MultiArray': _multi_array,
    'audio_common_msgs/msg/AudioData': _audio,
    'audio_common_msgs/msg/AudioDataStamped': _audio,
}


TIME = 'time'
BROKEN = (SerdeError, struct.error, UnicodeDecodeError, ValueError, IndexError, AssertionError, KeyError)
# Not among the messages of ROS 2 itself. Definitions in bags are not used: they would become code.
AUDIO: Mapping[str, str] = {
    'audio_common_msgs/msg/AudioData': 'uint8[] data',
    'audio_common_msgs/msg/AudioDataStamped': 'std_msgs/Header header\nAudioData audio',
}


def read_message_bag(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    """Yield the one table of a bag: the topics that the mapping names, each with its time.

    Times are those of the headers, or of logging where there are none, from the first message of the bag on.
    """
    columns_of_streams = [column for stream in mapping.streams.values() for column in stream.columns]
    wanted = set(filter(None, [*columns_of_streams, *mapping.numbers(), *mapping.texts()]))
    topics: dict[str, _Topic] = {}
    first_ns = -1
    for message in read_foreign(path, partial(_is_wanted, wanted)):
        topic = topics.setdefault(message.topic, _Topic(message.topic, message.msgtype, place))
        stamp_ns = topic.add(message)
        first_ns = stamp_ns if first_ns < 0 else first_ns
    columns: dict[str, AnyArray] = {}
    clocks: dict[str, str] = {}
    for name, topic in topics.items():
        clock = f'{name}/{TIME}'
        columns[clock] = topic.time_s(first_ns)
        for part, array in topic.columns().items():
            columns[f'{name}/{part}'] = array
            clocks[f'{name}/{part}'] = clock
    if not columns:
        raise InvalidData(
            f"'{place}' has no topic that the mapping names ({', '.join(sorted(wanted))}); write columns as topic and "
            "field, such as '/wrench/wrench.force.x'"
        )
    yield Table(place, tuple(columns), partial(table_columns, columns, place), clocks=clocks)


def _is_wanted(wanted: set[str], connection: BagConnection) -> bool:
    topic = connection.topic
    return any(fnmatch.fnmatchcase(topic, name.rpartition('/')[0] or name) for name in wanted)


@cache
def _types() -> Typestore:
    store = typestore()
    for name, definition in AUDIO.items():
        store.register(get_types_from_msg(definition, name))
    return store


class _Topic:
    """The messages of one topic as columns."""

    def __init__(self, name: str, msgtype: str, place: str) -> None:
        if msgtype not in _types().types:
            raise InvalidData(
                f"'{place}': the messages of '{name}' are {msgtype}, which are none of ROS 2 itself; republish them as "
                'std_msgs/msg/Float32MultiArray, geometry_msgs/msg/WrenchStamped or the like'
            )
        self._name, self._msgtype, self._place = name, msgtype, place
        self._rows: list[Rows] = []
        self._stamps_ns: list[int] = []
        self._counts: list[int] = []

    def add(self, message: RawMessage) -> int:
        """Add a message, and return its time."""
        try:
            value = _types().deserialize_cdr(message.data, self._msgtype)
            rows = MESSAGE_BAG_RULES.get(self._msgtype, one_row)(value)
        except BROKEN as error:
            raise InvalidData(
                f"'{self._place}': message {len(self._rows)} of '{self._name}' is damaged: {error}; record it again"
            ) from error
        if self._rows and rows.keys() != self._rows[0].keys():
            raise InvalidData(
                f"'{self._place}': message {len(self._rows)} of '{self._name}' has other fields than the first: "
                f'{", ".join(sorted(rows.keys() ^ self._rows[0].keys())[:5])}'
            )
        self._rows.append(rows)
        self._counts.append(max((len(array) for array in rows.values()), default=0))
        stamp = getattr(getattr(value, 'header', None), 'stamp', None)
        stamped_ns = stamp.sec * NANOSECONDS + stamp.nanosec if stamp else 0
        self._stamps_ns.append(stamped_ns or message.log_ns)
        return self._stamps_ns[-1]

    def columns(self) -> dict[str, AnyArray]:
        """Return all columns, (n,) each."""
        names = self._rows[0]
        return {name: np.concatenate([rows[name] for rows in self._rows]) for name in names}

    def time_s(self, first_ns: int) -> Array:
        """Return the time of each row; the samples of one message lie evenly between it and the next."""
        stamps_s = (np.array(self._stamps_ns) - first_ns) / NANOSECONDS
        counts = np.array(self._counts)
        steps_s = np.diff(stamps_s, append=stamps_s[-1] + _usual(np.diff(stamps_s)))
        within = np.concatenate([np.arange(count) / max(count, 1) for count in counts])
        times: Array = np.repeat(stamps_s, counts) + np.repeat(steps_s, counts) * within
        return times


def _usual(steps_s: Array) -> float:
    return float(np.median(steps_s)) if len(steps_s) else 0.0


# --------------------
# The kinds of files.

# Opens a file as tables, in the child process: path, name to be shown, mapping. What it raises is said of the file.
TableReader = Callable[[Path, str, TableMapping], Iterator[Table]]


BAG = 'bag'
READERS: Mapping[str, TableReader] = {
    '.csv': _read_csv,
    '.tsv': _read_csv,
    '.txt': _read_csv,
    '.npz': _read_numpy,
    '.npy': _read_numpy,
    '.mat': _read_mat,
    '.wav': _read_wav,
    '.h5': _read_hdf5,
    '.hdf5': _read_hdf5,
    '.parquet': _read_parquet,
    BAG: read_message_bag,
}
# Libraries that a kind of file needs: module, what it reads, and the extra of this package that brings it.
HDF5 = ('h5py', 'HDF5 files', 'hdf5')
PARQUET = ('pyarrow.parquet', 'Parquet files', 'parquet')
LIBRARIES: Mapping[str, Sequence[tuple[str, str, str]]] = {
    '.mat': (('scipy.io', 'MATLAB files', 'mat'),),
    '.wav': (('scipy.io', 'sound files', 'wav'),),
    '.h5': (HDF5,),
    '.hdf5': (HDF5,),
    '.parquet': (PARQUET,),
}
# What `texture import` is given a mapping for, and the kinds of files which that means.
MAPPED: Mapping[str, Sequence[str]] = {'table': tuple(kind for kind in READERS if kind != BAG), 'bag': (BAG,)}


# --------------------
# Turn tables into labelled bags, as a mapping says.

SIGNIFICANT = 4  # digits of an estimated rate: the resolution of time stamps allows no more
ROUND_RATE = 1e-3  # a rate that is so near to one of two digits is taken for that one
GAP = 1.75  # steps of time longer than so many sampling intervals are gaps, whose samples count as lost


def estimated_rate_hz(time_s: Array) -> float:
    """Return the rate of rows in spite of jitter and gaps, of four digits; NaN if no two times follow each other."""
    steps = np.diff(_spread(time_s[np.isfinite(time_s)]))
    steps = steps[steps > 0]
    if not len(steps):
        return float('nan')
    usual = steps[steps < GAP * np.median(steps)]
    rate_hz = 1.0 / float(usual.mean())
    simple = float(f'{rate_hz:.2g}')
    return simple if abs(rate_hz / simple - 1.0) < ROUND_RATE else float(f'{rate_hz:.{SIGNIFICANT}g}')


def on_grid(samples: Array, time_s: Array | None, rate_hz: float) -> tuple[Array, NDArray[np.int64], Counter[str]]:
    """Return the rows of one slide on a grid that begins with its first row, evenly spaced between gaps.

    Jitter of the times is that of the host that stamped them, and not of the device that sampled.
    """
    if time_s is None or len(samples) < 2:
        return samples, np.arange(len(samples)), Counter(samples=len(samples))
    times = _spread(_known(time_s))
    later = np.concatenate(([True], times[1:] > np.maximum.accumulate(times)[:-1]))
    steps = np.diff(times[later]) * rate_hz
    missing = np.where(steps > GAP, np.maximum(np.rint(steps) - 1, 0), 0).astype(np.int64)
    index = np.concatenate(([0], np.cumsum(1 + missing)))
    counts = {'gaps': int((steps > GAP).sum()), 'lost': int(missing.sum()), 'disordered': int((~later).sum())}
    return samples[later], index, Counter(samples=len(index), **counts)


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


@dataclass
class ImportReport:
    """Counts of an import."""

    bags: list[Path] = field(default_factory=list)
    files: int = 0
    ignored_files: int = 0
    rows: int = 0
    malformed_rows: int = 0
    examples: list[str] = field(default_factory=list)
    short_slides: int = 0
    slides: Counter[str] = field(default_factory=Counter)
    streams: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))  # as `on_grid` counts
    rates_hz: dict[str, float] = field(default_factory=dict)

    def lines(self) -> list[str]:
        """Return the counts in lines for people."""
        slides = sum(self.slides.values())
        said = [
            f'{slides} slides over {len(self.slides)} surfaces from {self.files} files'
            + (f'; {self.ignored_files} files have other names' if self.ignored_files else ''),
            f'malformed rows: {self.malformed_rows} of {self.rows}',
            *(f'  {example}' for example in self.examples),
        ]
        said += [
            f'{name}: {counts["samples"]} samples at {self.rates_hz[name]:g} Hz; {counts["lost"]} samples lost in '
            f'{counts["gaps"]} gaps, {counts["disordered"]} rows out of order left out'
            for name, counts in self.streams.items()
        ]
        if self.short_slides:
            said.append(f'slides too short, left out: {self.short_slides}')
        return said


def spans(time_s: Array, rate_hz: float, keys: AnyArray | None, borders: SlideBorders, place: str) -> list[slice]:
    """Return the rows of each slide in their order, the ends that are left out already taken away."""
    changes: NDArray[np.intp] = np.empty(0, dtype=np.intp)
    if borders.by == 'column' and keys is not None:  # without, it is a field of the name, which the whole file has
        changes = np.flatnonzero(keys[1:] != keys[:-1]) + 1
    elif borders.by == 'pause':
        known = np.flatnonzero(np.isfinite(time_s))
        steps = np.diff(time_s[known])
        changes = known[1:][(steps >= borders.pause_s) | (steps < 0)]
    elif borders.by == 'time':
        since = np.nan_to_num(time_s - np.nanmin(time_s), nan=0.0)
        changes = np.flatnonzero(np.diff(np.floor(np.maximum.accumulate(since) / borders.length_s + 1e-9))) + 1
    found = [slice(first, last) for first, last in pairwise([0, *changes.tolist(), len(time_s)])]
    if borders.by == 'time':
        whole = (1.0 - 1e-6) * borders.length_s * rate_hz - 1.0
        found = [span for span in found if span.stop - span.start >= whole]
    elif borders.by == 'column' and keys is not None:
        found = [span for span in found if _slides_at(str(keys[span.start]), borders.values)]
        if not found:
            raise InvalidData(
                f"'{place}': column '{borders.column}' has none of the values "
                f'{", ".join(borders.values) or "but empty"}; it has {", ".join(np.unique(keys)[:5].tolist())}'
            )
    skip, drop = (round(seconds * rate_hz) for seconds in (borders.start_s, borders.end_s))
    return [slice(span.start + skip, max(span.start + skip, span.stop - drop)) for span in found]


def _slides_at(value: str, wanted: Sequence[str]) -> bool:
    """Return whether the finger slides at a value of the column: one of those wanted, or any that is not empty."""
    return any(fnmatch.fnmatchcase(value, one) or value == one for one in wanted) if wanted else value != ''


MAX_BAGS = 500
Message = tuple[int, str, TactileSignal | ExplorationState]  # log time, topic, value


@dataclass(frozen=True, eq=False)
class Stream:
    """One stream of a table: its samples, (n, n_channels), and the time of each, s.

    `timed` says whether times were recorded, and `clock` names the column of time that the file states for it.
    """

    params: StreamColumns
    channels: tuple[str, ...]
    samples: Array
    time_s: Array
    timed: bool
    rate_hz: float
    clock: str


# By topic: a stream, and of one slide its samples and their places on the grid.
SlideStreams = Mapping[str, tuple[Stream, Array, NDArray[np.int64]]]
# What holds from a time since the start of a slide on, in SI units, NaN if unknown: time, speed, force, direction.
Conditions = Sequence[tuple[float, float, float, float]]


class SlideBags:
    """Bags below a folder, written slide by slide; use it in a `with` block, where an error removes them again.

    Stamps are made up: each slide begins a second after the one before, in whatever bag that is, so slides keep their
    order over all bags.
    """

    def __init__(self, mapping: TableMapping, out: str | Path) -> None:
        self._mapping, self._out = mapping, Path(out)
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
        duration_s = min(float(index[-1] + 1) / stream.rate_hz for stream, _, index in streams.values())
        messages: list[Message] = [*self._states(named, conditions, duration_s)]
        sensor = self._mapping.sensor
        for topic, (stream, samples, index) in streams.items():
            first, units = self._next.get((session, topic), 0), (stream.params.unit,) * len(stream.channels)
            none = np.empty((0, len(units)), dtype=np.float32)
            like = TactileSignal(0, sensor, stream.channels, units, stream.rate_hz, first, none, sensor)
            for batch in slide_batches(like, samples, index, self._now_ns):
                messages.append((batch.end_ns + DELAY_NS, topic, batch))
                self._next[session, topic] = batch.next_sample
        bag.write_all(messages)
        self._now_ns = max(log_ns for log_ns, _, _ in messages) + PAUSE_NS

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
    with SlideBags(mapping, out) as bags, TableFiles() as files:
        for path, place, fields in progress(_files(mapping, Path(source), kinds, report), 'import files'):
            for table in files.tables(_kind(path), path, place, mapping, fields):
                for session, named, streams, conditions in _TableSlides(mapping, table, report).slides():
                    bags.write(session, named, streams, conditions)
                    report.slides[named.surface] += 1
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
    found = False
    for path in _paths(source, mapping.files.count('/') + 1):
        place = path.name if path == source else path.relative_to(source).as_posix()
        fields = template_fields(mapping.files, place)
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
    """Return the files at a depth below a folder, in the order of their names as texts: 10 comes before 2."""
    if not source.exists():
        raise InvalidData(f"there is no '{source}'; give the folder that holds the files")
    if source.is_file() or is_bag(source):
        return [source]
    found = source.glob('/'.join('*' * depth))
    return sorted(path for path in found if is_bag(path) or not path.is_dir())


def _kind(path: Path) -> str:
    return BAG if is_bag(path) else path.suffix.lower()


class _TableSlides:
    """The slides of one table."""

    def __init__(self, mapping: TableMapping, columns: Columns, report: ImportReport) -> None:
        self._mapping, self._columns, self._report = mapping, columns, report
        self._place, self._fields, self._clocks = columns.place, columns.fields, columns.clocks
        self._check_rows()
        self._streams = {name: self._stream(name, params) for name, params in mapping.streams.items()}

    def slides(self) -> Iterator[tuple[str, ExplorationState, SlideStreams, Conditions]]:
        """Yield what `SlideBags.write` takes."""
        borders = self._mapping.slides
        reference, found = self._spans()
        for number, span in enumerate(found, 1):
            if (span.stop - span.start) / reference.rate_hz < max(borders.min_s, 2.0 / reference.rate_hz):
                self._report.short_slides += 1
                continue
            yield self._slide(reference, span, number)

    def _spans(self) -> tuple[Stream, list[slice]]:
        """Return the stream by which slides are cut, and its rows of each slide."""
        borders, place = self._mapping.slides, self._place
        reference = next(iter(self._streams.values()))
        keys = self._text(borders.column) if borders.by == 'column' else None
        if keys is None:
            return reference, spans(reference.time_s, reference.rate_hz, None, borders, place)
        clock = self._clocks.get(borders.column, '')
        # Rows of the column and of a stream correspond where their clocks and numbers do; otherwise, as of topics of a
        # bag, only their times can be compared.
        same = [one for one in self._streams.values() if len(one.samples) == len(keys) and one.clock == clock]
        if same:
            return same[0], spans(same[0].time_s, same[0].rate_hz, keys, borders, place)
        times = self._times_of(borders.column, len(keys))
        found = spans(times, estimated_rate_hz(times), keys, borders, place)
        return reference, [_rows_between(reference.time_s, *_ends(times, span)) for span in found]

    def _slide(
        self, reference: Stream, span: slice, number: int
    ) -> tuple[str, ExplorationState, SlideStreams, Conditions]:
        times = reference.time_s[span]
        begin_s, end_s = float(np.nanmin(times)), float(np.nanmax(times)) + 1.0 / reference.rate_hz
        cut = _Cut(len(reference.samples), reference.clock, span, begin_s, end_s)
        surface = self._label(cut)
        session = self._value(self._mapping.session, cut, 'session') if self._mapping.session else surface
        named = ExplorationState(0, f'{self._place}/{number}', self._mapping.motion, Phase.SLIDE, surface=surface)
        streams = {name: self._samples(name, stream, cut) for name, stream in self._streams.items()}
        return session, named, streams, self._conditions(cut)

    def _samples(self, name: str, stream: Stream, cut: _Cut) -> tuple[Stream, Array, NDArray[np.int64]]:
        rows = cut.rows(len(stream.samples), stream.clock, stream.time_s)
        samples, times = stream.samples[rows], stream.time_s[rows]
        if not len(samples):
            raise InvalidData(
                f"'{self._place}' has no samples of '{name}' from {cut.begin_s:g} to {cut.end_s:g} s of a slide; "
                'look at the times of the streams'
            )
        steps = np.diff(times[np.isfinite(times)]) if stream.timed else np.empty(0)
        if steps.max(initial=0.0) > LONGEST_GAP_S:
            row = self._columns.row(rows.start + int(steps.argmax()) + 1)
            raise InvalidData(
                f"'{self._place}', row {row}, column '{stream.params.time.column}': time jumps by "
                f'{steps.max():g} s within a slide; look at the unit of time and at `slides` in the mapping'
            )
        samples, index, counts = on_grid(samples, times if stream.timed else None, stream.rate_hz)
        self._report.streams[name] += counts
        return stream, samples, index

    def _stream(self, name: str, params: StreamColumns) -> Stream:
        names = self._columns.chosen[name]
        columns = [self._columns.numbers[column] for column in names]
        # Arrays of a file need not be of one length: those of one stream must.
        if len({len(column) for column in columns}) > 1:
            raise InvalidData(
                f"'{self._place}': the columns of '{name}' have {sorted({len(c) for c in columns})} rows; put "
                'columns of different rates into two streams'
            )
        if params.channels and len(params.channels) != len(names):
            raise InvalidData(
                f"'{self._place}': the stream '{name}' has {len(names)} columns and {len(params.channels)} names "
                'of channels; give one for each'
            )
        samples = np.stack(columns, axis=1)
        samples *= params.scale
        time_column = params.time.column or self._clocks.get(names[0], '')
        if not time_column:
            rate_hz = self._rate_hz(name, params, self._columns.rate_hz)
            time_s = np.arange(len(samples)) / rate_hz
        else:
            unit = params.time.unit if params.time.column else 's'
            time_s = self._columns.numbers[time_column] * TIME_UNITS[unit]
            rate_hz = self._rate_hz(name, params, estimated_rate_hz(time_s))
            if len(time_s) != len(samples):
                raise InvalidData(
                    f"'{self._place}': column '{time_column}' has {len(time_s)} rows, '{name}' {len(samples)}"
                )
        channels = tuple(params.channels) or tuple(names)
        return Stream(params, channels, samples, time_s, bool(time_column), rate_hz, self._clocks.get(names[0], ''))

    def _rate_hz(self, name: str, params: StreamColumns, own: float) -> float:
        """Return the rate of a stream: as stated, else that of the first file, from which later ones differ little."""
        # Of the first file: windows of all are to have as many samples.
        rate_hz = self._report.rates_hz.setdefault(name, params.rate_hz or own)
        if not MIN_HZ <= rate_hz <= MAX_HZ:
            raise InvalidData(
                f"'{self._place}': the rate of '{name}' is {rate_hz:g} Hz by its times; give a column of "
                f'time that grows and its unit, or `rate_hz`, from {MIN_HZ:g} to {MAX_HZ:g}'
            )
        if own and not 1 / SAME_RATE <= own / rate_hz <= SAME_RATE:
            raise InvalidData(
                f"'{self._place}': '{name}' has {own:g} Hz by its times, {rate_hz:g} Hz are expected; "
                f"look at the unit of column '{params.time.column}' and at `rate_hz` in the mapping"
            )
        return rate_hz

    def _check_rows(self) -> None:
        """Count the rows with a bad number; InvalidData if they are too many."""
        by_length: dict[int, AnyArray] = {}
        for values in self._columns.numbers.values():
            bad = by_length.setdefault(len(values), np.zeros(len(values), dtype=bool))
            bad |= np.isnan(values)
        for rows, bad in by_length.items():
            count = int(bad.sum())
            self._report.rows += rows
            self._report.malformed_rows += count
            if count:
                told = [f"'{self._place}', row {row}, {reason}" for row, reason in self._columns.malformed.items()]
                self._report.examples += told[: EXAMPLES - len(self._report.examples)]
            if not rows or count > self._mapping.max_malformed * rows:
                first = next((f'row {row}, {why}' for row, why in self._columns.malformed.items()), 'no row at all')
                raise InvalidData(
                    f"'{self._place}' has {count} malformed rows of {rows}, first {first}; "
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
            raise InvalidData(f"'{self._place}': a slide has an empty label; name another column under `label`")
        return surface

    def _value(self, name: str, cut: _Cut, kind: str) -> str:
        """Return the one value that a column has during a slide."""
        texts = self._text(name)
        if texts is None:
            return str(self._fields[name])
        rows = cut.rows(len(texts), self._clocks.get(name, ''), self._times_of(name, len(texts)))
        own = texts[rows]
        if not len(own):
            raise InvalidData(f"'{self._place}': column '{name}' has no value during a slide; name another")
        other = np.flatnonzero(own != own[0])
        if len(other):
            place = f"'{self._place}', row {self._columns.row(rows.start + int(other[0]))}, column '{name}'"
            change = f"the {kind} changes from '{own[0]}' to '{own[other[0]]}' within a slide"
            raise InvalidData(f"{place}: {change}; let slides end where '{name}' changes (`slides: {{by: column}}`)")
        return str(own[0])

    def _times_of(self, name: str, length: int) -> Array:
        """Return the times of a column: of its own clock, or of the stream with as many rows."""
        clock = self._clocks.get(name)
        if clock:
            return self._columns.numbers[clock]
        for stream in self._streams.values():
            if len(stream.samples) == length:
                return stream.time_s
        raise InvalidData(
            f"'{self._place}': column '{name}' has {length} rows, as no stream has; name one of the same length"
        )

    def _conditions(self, cut: _Cut) -> list[tuple[float, float, float, float]]:
        """Return what holds from 0 on, and every 0.1 s after if a condition changes along the slide."""
        tracks = {name: self._track(name, cut) for name in CONDITION_UNITS}
        changing = any(len(values) > 1 and np.ptp(values[np.isfinite(values)]) > 0 for _, values in tracks.values()
                       if np.isfinite(values).any())  # fmt: skip
        count = max(1, round((cut.end_s - cut.begin_s) / STATE_S)) if changing else 1
        edges = cut.begin_s + STATE_S * np.arange(count + 1) if changing else np.array([cut.begin_s, math.inf])
        edges[-1] = math.inf
        means = [[_mean(*tracks[name], a, b) for name in CONDITION_UNITS] for a, b in pairwise(edges)]
        starts = (edges[:-1] - cut.begin_s).tolist()
        return [(start, *mean) for start, mean in zip(starts, means, strict=True)]

    def _track(self, name: str, cut: _Cut) -> tuple[Array, Array]:
        """Return times and values of a condition in SI units, (n,) each."""
        quantity = self._mapping.conditions.get(name, Quantity())
        factor = CONDITION_UNITS[name].get(quantity.unit, 1.0)
        if quantity.column in self._fields or not quantity.column:
            text = self._fields[quantity.column] if quantity.column else quantity.value or 'nan'
            try:
                return np.array([cut.begin_s]), np.array([float(text)]) * factor
            except ValueError as error:
                raise InvalidParameter(
                    f"'{self._place}': '{quantity.column}' is '{text}' in its name; a number is needed there"
                ) from error
        values = self._columns.numbers[quantity.column]
        times = self._times_of(quantity.column, len(values))
        rows = cut.rows(len(values), self._clocks.get(quantity.column, ''), times)
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
