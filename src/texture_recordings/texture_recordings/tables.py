# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Import foreign tables by a mapping file: readers give frames, one strict step gives streams, labels and slides."""

from __future__ import annotations

import codecs
import csv
import dataclasses
import fnmatch
import io
import math
import re
import shutil
import struct
import warnings
import zlib
from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.cli import progress
from texture_core.config import (
    MB,
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
    is_cut_off,
    message_types,
    read_foreign,
    slide_batches,
)
from texture_recordings.dataset import STREAMS

# --------------------
# What a mapping file (YAML) names: which columns are signals, and what labels, slides and conditions come from.

FIELD = re.compile(r'\{(\w*)(:d)?\}|\*')


def template_fields(template: str, name: str) -> dict[str, str] | None:
    """Return the fields of a name, None if it is not of the form of the template; InvalidData if it fits in two ways.

    A field in braces is one character or more without '/', `{run:d}` digits alone, '*' and '{}' any text that is not
    kept.
    """
    found: list[dict[str, str]] = []
    for fields in islice(_fits(template, name), 100):
        if fields not in found:
            found.append(fields)
        if len(found) > 1:
            one, other = (', '.join(f'{key}={text}' for key, text in fields.items()) for fields in found)
            raise InvalidData(
                f"'{name}' fits '{template}' in two ways: {one}; or {other}; write a part that tells them apart, or "
                'digits as {code:d}, or rename the files'
            )
    return found[0] if found else None


def _fits(template: str, name: str) -> Iterator[dict[str, str]]:
    """Yield the fields of a name in each way in which it is of the form of a template."""
    first, *literals = FIELD.sub('\0', template).split('\0')
    fields = [(match[1] or '', match[2] is not None) for match in FIELD.finditer(template)]
    dead: set[tuple[int, int]] = set()  # so that no name takes long

    def rest(number: int, at: int) -> Iterator[dict[str, str]]:
        if number == len(fields):
            if at == len(name):
                yield {}
            return
        (field_name, digits), literal = fields[number], literals[number]
        if (number, at) in dead:
            return
        fits, end = False, at + bool(field_name)
        while (end := name.find(literal, end)) >= 0:
            text = name[at:end]
            if '/' in text or (digits and not text.isdigit()):
                break
            for others in rest(number + 1, end + len(literal)):
                fits = True
                yield {**({field_name: text} if field_name else {}), **others}
            end += 1
        if not fits:
            dead.add((number, at))

    if name.startswith(first):
        yield from rest(0, len(first))


def _checked_template(template: str) -> None:
    """Refuse a template whose fields follow each other without text between, or that names one twice."""
    if '' in FIELD.sub('\0', template).split('\0')[1:-1]:
        raise InvalidParameter(f"the template '{template}' has fields without text between; put text there")
    names = [match[1] for match in FIELD.finditer(template) if match[1]]
    if len(set(names)) < len(names):
        raise InvalidParameter(f"the template '{template}' has a field twice; give each a different name")


TIME_UNITS: Mapping[str, float] = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'min': 60.0}
BORDERS = ('file', 'column', 'pause', 'time', 'row')


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
    samples_per_row: int = param(
        0, 'Number of successive columns that are consecutive samples of one channel; 0 as 1.', low=0, high=1_000_000
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
        "jumps by `pause_s` or back), 'time' (every `length_s`) or 'row' (each row is one, see `samples_per_row`).",
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
    rows: Mapping[str, str] = field(
        default_factory=dict,
        metadata={'description': 'Values of columns, such as {sensor: S1}: only rows that have them are read.'},
    )
    streams: Mapping[str, StreamColumns] = field(default_factory=dict)
    label: LabelColumn = field(default_factory=LabelColumn)
    slides: SlideBorders = field(default_factory=SlideBorders)
    conditions: Mapping[str, Quantity] = field(default_factory=dict)  # what is not named is unknown
    session: str = param('', "Names the column or field by which slides go into bags; '' makes one bag a surface.")
    sensor: str = param('imported', 'Names the sensor in the bags.')
    motion: str = param('linear_slide', 'Names the motion in the bags.')

    def __post_init__(self) -> None:
        for template in filter(None, (self.files, self.tables)):
            _checked_template(template)
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
        by_column = [self.slides.column] * (self.slides.by == 'column')
        return [name for name in (self.label.column, self.session, *by_column, *self.rows) if name]

    def numbers(self) -> list[str]:
        """Return the names of the columns that are read as numbers, beside those of the streams."""
        names = [one.time.column for one in self.streams.values()] + [one.column for one in self.conditions.values()]
        return [name for name in names if name]


def load_mapping(name_or_path: str | Path) -> TableMapping:
    """Return the mapping in a file, or one that the package ships in config/mappings, by name."""
    path = find_file(str(name_or_path), 'texture_recordings', 'config/mappings', 'mapping')
    return mapping_from(load_yaml(path, 'mapping'), f"mapping '{path}'")


def mapping_from(content: object, where: str = 'mapping') -> TableMapping:
    """Return the mapping that plain values describe; InvalidParameter if they are unknown or impossible."""
    return tree_from_mapping(TableMapping, content, where)


# --------------------
# Readers: a file of anybody as frames. Each reads rows × columns from headers and asks for them before it loads.

MAX_FILE_BYTES = 1000 * MB
MAX_VALUES = 8_000_000  # of 8 bytes, of one file; a larger file may have as many as it has bytes
EXAMPLES = 3
RANGE = re.compile(r'(\D*)(\d{1,9})-\1(\d{1,9})')
MAX_RANGE = 10_000
TRIAL = 'trial'  # number of the first axis of arrays (n_trials, n_samples, n_channels)
MAX_ARRAYS = 50_000  # in the cells and structs of a MATLAB file, or data sets of an HDF5 file
MAX_CHANNELS = 10_000  # more are samples: the array lies on its side
DELIMITERS = (',', ';', '\t', '|', ' ')
BLOCK_ROWS = 20_000  # of a text file, which are parsed at once
MAX_TEXT = 200  # characters of a cell that is shown or a label

Take = Callable[[float], None]  # asks for a number of values; InvalidData beyond the limit of the file


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of a frame, (n,) each: numbers, NaN where there is none, and texts."""

    numbers: Mapping[str, Array]
    texts: Mapping[str, AnyArray]
    lines: AnyArray | None = None  # number in the file of each row
    junk: AnyArray | None = None  # rows with something that is no number
    reasons: Mapping[int, str] = field(default_factory=dict)  # of the first such rows, by line


@dataclass(frozen=True, eq=False)
class TableFrame:
    """Columns that belong together, by name, with what holds for all their rows."""

    place: str
    names: Sequence[str]
    read: Callable[[Sequence[str], Sequence[str]], Columns]
    fields: Mapping[str, str] = field(default_factory=dict)
    rate_hz: float = 0.0
    clocks: Mapping[str, str] = field(default_factory=dict)  # column → column of its times, s

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


def _meant(name: str, names: Sequence[str]) -> list[str]:
    match = RANGE.fullmatch(name)
    if match and 0 <= int(match[3]) - int(match[2]) < MAX_RANGE:
        return [f'{match[1]}{number}' for number in range(int(match[2]), int(match[3]) + 1)]
    return [one for one in names if fnmatch.fnmatchcase(one, name)] if len(name) <= 100 else []


def frames(path: Path, place: str, mapping: TableMapping) -> Iterator[TableFrame]:
    """Yield the frames of a file; InvalidData with its place, whatever is wrong with it."""
    kind = _kind(path)
    if kind in OTHER_KINDS:
        raise InvalidData(f"'{place}' {OTHER_KINDS[kind]}")
    try:
        if not path.is_dir():
            with open_regular(path, MAX_FILE_BYTES) as file:
                size = file.seek(0, io.SEEK_END)
        else:
            size = sum(one.stat().st_size for one in path.iterdir() if one.is_file())
        left = float(max(MAX_VALUES, size))

        def take(count: float) -> None:
            nonlocal left
            left -= count
            if left < 0:
                most = max(MAX_VALUES, size)
                raise InvalidData(
                    f"'{place}' declares more than {most / 1e6:.0f} million values in {size / MB:.3g} MB; at most that "
                    'many are read, split it or save what the mapping needs'
                )

        for frame in READERS[kind](path, place, mapping, take):
            yield replace(frame, read=partial(_guarded, frame.read, place))
    except (InvalidData, MissingLibrary):
        raise
    # Whatever a library raises, which depends on the byte that is wrong, is a fact about the file.
    except Exception as error:
        raise _unreadable(place, error) from error


def _guarded(
    read: Callable[[Sequence[str], Sequence[str]], Columns], place: str, numbers: Sequence[str], texts: Sequence[str]
) -> Columns:
    """Return what a frame reads; InvalidData whatever a library raises."""
    try:
        return read(numbers, texts)
    except InvalidData:
        raise
    except Exception as error:
        raise _unreadable(place, error) from error


def _unreadable(place: str, error: Exception) -> InvalidData:
    return InvalidData(f"'{place}' cannot be read: {(str(error) or type(error).__name__)[:300]}; save it again")


# ---- text files

Line = tuple[int, str]  # its number in the file, from 1
BLANK = frozenset(('', 'nan', 'na', 'null', 'none'))


def _read_csv(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    form = mapping.format
    with _lines(path, form) as lines:
        _, first = next(lines, (0, ''))
    form = replace(form, delimiter=form.delimiter or next((one for one in DELIMITERS if one in first), ','))
    cells = _cells(first, form.delimiter)
    if not first:
        raise InvalidData(f"'{place}' has no columns; give a text file with a row for each sample")
    names = cells if form.header else [str(number) for number in range(len(cells))]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InvalidData(f"'{place}' has the column '{twice}' twice; give each column a different name")
    yield TableFrame(place, names, partial(_csv_columns, path, place, form, names, take))


def _csv_columns(  # noqa: PLR0917 – bound one after the other
    path: Path, place: str, form: FileFormat, names: Sequence[str], take: Take, numbers: Sequence[str],
    texts: Sequence[str],
) -> Columns:  # fmt: skip
    at = {name: number for number, name in enumerate(names)}
    blocks: list[dict[str, AnyArray]] = []
    reasons: dict[int, str] = {}
    with _lines(path, form) as lines:
        if form.header:
            next(lines, None)
        while block := list(islice(lines, BLOCK_ROWS)):
            take(len(block) * (len(numbers) + 2 * len(texts)))
            rows = [_row(_cells(line, form.delimiter), len(names)) for _, line in block]
            read: dict[str, AnyArray] = {'': np.array([number for number, _ in block])}
            junk = np.array([row is None for row in rows])
            found = {
                block[index][0]: f"column 'all': {len(_cells(block[index][1], form.delimiter))} cells, {len(names)} "
                'are needed' for index in np.flatnonzero(junk)[:EXAMPLES].tolist()
            }  # fmt: skip
            for name in numbers:
                read[f'number {name}'] = values = _parsed(rows, at[name], form.decimal)
                for index in np.flatnonzero(np.isnan(values)).tolist():
                    cell = rows[index][at[name]] if rows[index] else ''
                    if cell.lower() in BLANK:
                        continue
                    junk[index] = True
                    if len(found) < 2 * EXAMPLES:
                        reason = f"column '{name}': '{cell[:40]}' is not a finite number"
                        if form.decimal == '.' and math.isfinite(_number(cell.replace(',', '.'))):
                            reason += "; if commas are decimal, write format: {decimal: ','}"
                        found.setdefault(block[index][0], reason)
            reasons |= dict(sorted(found.items())[: EXAMPLES - len(reasons)])
            # A row without any number, such as names or units that a logger wrote again, is none of a sample: its texts
            # are none of a sample, too, and a slide must not end at them.
            empty = junk & np.logical_and.reduce([np.isnan(read[f'number {name}']) for name in numbers])
            for name in texts:
                read[f'text {name}'] = np.array(
                    [
                        None if row is None or left_out else row[at[name]][:MAX_TEXT].replace('\0', '')
                        for row, left_out in zip(rows, empty, strict=True)
                    ]
                )
            blocks.append({**read, 'junk': junk})
    if not blocks:
        raise InvalidData(f"'{place}' has no rows below the names of its columns; choose files with samples")
    whole = {key: np.concatenate([read[key] for read in blocks]) for key in blocks[0]}
    return Columns(
        {name: whole[f'number {name}'] for name in numbers},
        {name: _without_gaps(whole[f'text {name}']) for name in texts},
        whole[''], whole['junk'], reasons,
    )  # fmt: skip


CP1252 = 'texture-cp1252'  # what is no UTF-8 is read as Windows of Western Europe writes it, such as 'm/s²'


def _from_windows(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeDecodeError):
        raise error
    return error.object[error.start : error.end].decode('cp1252', 'replace'), error.end


codecs.register_error(CP1252, _from_windows)


@contextmanager
def _lines(path: Path, form: FileFormat) -> Iterator[Iterator[Line]]:
    """Give the lines that are neither empty nor comments, each with its number."""
    with open_regular(path) as opened:
        start = opened.read(2)
        opened.seek(0)
        coding = 'utf-16' if start in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else 'utf-8-sig'
        with io.TextIOWrapper(opened, coding, CP1252 if coding == 'utf-8-sig' else 'replace', newline=None) as text:
            yield (
                (number, bare)
                for number, line in enumerate(text, 1)
                if number > form.skip_rows
                and (bare := line.rstrip('\n')).strip()
                and not (form.comment and bare.startswith(form.comment))
            )


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


def _row(cells: list[str], count: int) -> list[str] | None:
    """Return the cells of a row without an empty one behind the last delimiter; None if they are not `count`."""
    if len(cells) == count + 1 and not cells[-1]:
        cells = cells[:-1]
    return cells if len(cells) == count else None


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


# ---- files of arrays


def _read_numpy(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    def declared(file: Any) -> None:
        version = np.lib.format.read_magic(file)  # type: ignore[no-untyped-call]
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read(file)  # type: ignore[no-untyped-call]
        take(math.prod(shape) * max(1.0, dtype.itemsize / 8))

    with open_regular(path) as opened:
        if path.suffix.lower() == '.npy':
            declared(opened)
            opened.seek(0)
            content = np.load(opened, allow_pickle=False)  # nothing in a file is run
            yield from _frames([''], lambda _: content, place, mapping)
            return
        archive = np.load(opened, allow_pickle=False)

        def load(name: str) -> AnyArray:
            with archive.zip.open(f'{name}.npy') as member:
                declared(member)
            array: AnyArray = archive[name]
            return array

        yield from _frames(archive.files, load, place, mapping)


def _read_mat(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    from scipy.io import loadmat  # noqa: PLC0415 – recording needs no scipy

    with open_regular(path) as opened:
        if opened.read(19).startswith(b'MATLAB 7.3 MAT-file'):  # HDF5 with all dimensions in reverse order
            yield from _read_hdf5(path, place, mapping, take, matlab=True)
            return
        take(_unpacked_bytes(opened, place) / 8)
        opened.seek(0)
        content = loadmat(opened, struct_as_record=True)
    arrays = dict(_members({name: value for name, value in content.items() if not name.startswith('__')}))
    yield from _frames(tuple(arrays), arrays.__getitem__, place, mapping)


def _unpacked_bytes(file: Any, place: str) -> int:
    """Return how many bytes the variables of a MATLAB file (version 5 to 7) unpack to, without keeping them."""
    file.seek(124)
    order = '<' if file.read(4)[2:] == b'IM' else '>'
    total = arrays = 0
    element = struct.pack(f'{order}I', 14)
    while len(tag := file.read(8)) == 8:
        kind, length = struct.unpack(f'{order}II', tag)
        after = file.tell() + length
        unpacker = zlib.decompressobj()
        while length > 0 and total < MAX_FILE_BYTES and (packed := file.read(min(length, 1 << 16))):
            length -= len(packed)
            while packed:
                part = unpacker.decompress(packed, 1 << 20) if kind == 15 else packed
                total, arrays = total + len(part), arrays + part.count(element)
                packed = unpacker.unconsumed_tail if kind == 15 else b''
        file.seek(after)
    from scipy.io import whosmat  # noqa: PLC0415 – recording needs no scipy

    file.seek(0)
    nested = any(kind in ('cell', 'struct', 'object') for _, _, kind in whosmat(file))
    if nested and arrays > MAX_ARRAYS:
        raise InvalidData(f"'{place}' has more than {MAX_ARRAYS} arrays in cells and structs; split it")
    return total


def _members(values: Mapping[str, Any], prefix: str = '') -> Iterator[tuple[str, AnyArray]]:
    """Yield arrays by their path: members of structs as 'run/acc', elements of arrays of these and cells from 1 on."""
    for name, value in values.items():
        if not isinstance(value, np.ndarray):
            continue
        elements = {str(number): one for number, one in enumerate(value.ravel(order='F'), 1)}
        if value.dtype.names and value.size == 1:
            yield from _members(_record(value.ravel()[0]), f'{prefix}{name}/')
        elif value.dtype.names:
            for number, one in elements.items():
                yield from _members(_record(one), f'{prefix}{name}/{number}/')
        elif value.dtype.kind == 'O':
            plain = [one for one in elements.values() if isinstance(one, np.ndarray) and one.size == 1]
            if elements and len(plain) == len(elements) and all(one.dtype.kind in 'biufU' for one in plain):
                yield f'{prefix}{name}', np.array([one.item() for one in plain])
            else:
                yield from _members(elements, f'{prefix}{name}/')
        elif value.dtype.kind in 'biufU':
            yield f'{prefix}{name}', value


def _record(value: Any) -> dict[str, Any]:
    return {part: value[part] for part in value.dtype.names}


def _read_hdf5(
    path: Path, place: str, mapping: TableMapping, take: Take, *, matlab: bool = False
) -> Iterator[TableFrame]:
    h5py = library(*HDF5)
    with open_regular(path) as opened, h5py.File(opened, 'r') as file:
        found: dict[str, Any] = {}

        def note(name: str, member: Any) -> None:
            """Keep a data set; the elements of references, as of cells and arrays of structs of MATLAB, from 1 on."""
            if len(found) > MAX_ARRAYS or name.count('/') > 20:
                raise InvalidData(f"'{place}' has more than {MAX_ARRAYS} data sets, or circles of them; split it")
            if isinstance(member, h5py.Group):
                for part, inner in member.items():
                    note(f'{name}/{part}', inner)
            elif isinstance(member, h5py.Dataset) and h5py.check_ref_dtype(member.dtype) is h5py.Reference:
                take(member.size)
                folder, _, last = name.rpartition('/')
                for number, one in enumerate(np.asarray(member[()]).ravel(), 1):
                    # Of an array of structs each member has as many references: the number stands before its name.
                    in_struct = matlab and folder and 'MATLAB_class' not in member.attrs
                    if one:
                        note(f'{folder}/{number}/{last}' if in_struct else f'{name}/{number}', file[one])
            elif isinstance(member, h5py.Dataset):
                found[name] = member

        def visit(name: str, member: Any) -> None:
            if isinstance(member, h5py.Dataset) and not name.startswith('#refs#'):
                note(name, member)

        file.visititems(visit)  # follows no link out of the file, and comes to each data set once

        def load(name: str) -> AnyArray:
            member = found[name]
            if member.is_virtual or member.external:
                raise InvalidData(f"'{place}': data set '{name}' lies in another file; copy it into this one")
            texts = h5py.check_string_dtype(member.dtype) is not None and member.dtype.kind == 'O'
            take(member.size * max(1.0, member.dtype.itemsize / 8) * (4 if texts else 1))
            if matlab and member.attrs.get('MATLAB_class') == b'char':
                return np.array(''.join(map(chr, np.asarray(member[()]).ravel().tolist())))
            if not texts:
                array = np.asarray(member[()])
                return array.T if matlab else array
            cells = member.asstr(errors='replace')
            if not member.shape:
                return np.array(cells[()][:MAX_TEXT])
            return np.array([text[:MAX_TEXT] for text in np.ravel(cells[()])]).reshape(member.shape)

        yield from _frames(list(found), load, place, mapping)


def _read_wav(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    from scipy.io import wavfile  # noqa: PLC0415 – recording needs no scipy

    with open_regular(path) as opened, warnings.catch_warnings():
        warnings.simplefilter('ignore')  # chunks that it does not know
        rate_hz, samples = wavfile.read(opened)
    take(samples.size)
    if not 0 < rate_hz <= MAX_HZ:
        raise InvalidData(f"'{place}' has a sampling rate of {rate_hz} Hz; above 0 and at most {MAX_HZ:g} is allowed")
    if samples.dtype.kind == 'u':
        samples = (samples.astype(np.float64) - 128.0) / 128.0
    elif samples.dtype.kind == 'i':
        samples = samples / -float(np.iinfo(samples.dtype).min)  # full scale is 1
    for frame in _frames([''], lambda _: samples, place, mapping):
        yield replace(frame, rate_hz=float(rate_hz))


def _read_parquet(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    types, parquet = library('pyarrow', *PARQUET[1:]).types, library(*PARQUET)
    plain = (types.is_integer, types.is_floating, types.is_boolean, types.is_string, types.is_dictionary,
             types.is_large_string, types.is_timestamp)  # fmt: skip

    def array(column: Any) -> AnyArray:
        if types.is_dictionary(column.type):  # each text once, however many rows have it
            column = column.unify_dictionaries().combine_chunks()
            one = column.chunk(0) if hasattr(column, 'chunk') else column
            texts = np.array(['', *(str(text)[:MAX_TEXT] for text in one.dictionary.to_pylist())])
            chosen: AnyArray = texts[1 + np.asarray(one.indices.fill_null(-1))]
            return chosen
        if types.is_timestamp(column.type):
            return np.asarray(column.to_numpy()).astype('datetime64[ns]').astype(np.int64)
        return np.asarray(column.to_numpy())

    def read(numbers: Sequence[str], texts: Sequence[str]) -> Columns:
        wanted = list(dict.fromkeys((*numbers, *texts)))
        take(file.metadata.num_rows * (len(wanted) + sum(name in coded for name in texts)))
        if not file.metadata.num_rows:
            raise InvalidData(f"'{place}' has no rows; choose files with samples")
        content = file.read(columns=wanted, use_threads=False)
        return columns_of({name: array(content[name]) for name in content.column_names}, place, numbers, texts)

    with open_regular(path) as opened:
        schema = parquet.ParquetFile(opened).schema_arrow
        names = [one.name for one in schema if any(check(one.type) for check in plain)]
        coded = [one.name for one in schema if types.is_string(one.type) or types.is_large_string(one.type)]
        opened.seek(0)
        file = parquet.ParquetFile(opened, read_dictionary=coded)
        yield TableFrame(place, names, read)


def _frames(
    names: Sequence[str], load: Callable[[str], AnyArray], place: str, mapping: TableMapping
) -> Iterator[TableFrame]:
    """Yield the frames that arrays form.

    Without a template all arrays are one frame. With one, an array whose name is of its form is a frame whose columns
    count from 0, and arrays of which the first parts of the name are of its form are columns of one frame.
    """
    groups: dict[str, tuple[dict[str, str], dict[str, str]]] = {}
    depth = mapping.tables.count('/') + 1
    for name in names:
        parts = name.split('/')
        table, rest = ('/'.join(parts[:depth]), '/'.join(parts[depth:])) if mapping.tables else ('', name)
        fields = template_fields(mapping.tables, table) if mapping.tables else {}
        if fields is not None:
            groups.setdefault(table, (fields, {}))[1][rest] = name
    if not groups:
        raise InvalidData(
            f"'{place}' has no array of the form '{mapping.tables}'; it has {', '.join(names[:5]) or 'none'}"
        )
    # What has an element for each of the numbered frames, such as a list of their labels, holds for each its own.
    grouped = {name for _, members in groups.values() for name in members.values()}
    listed = {}
    if mapping.tables and all(set(fields) and all(map(str.isdigit, fields.values())) for fields, _ in groups.values()):
        lists = {name: load(name).ravel() for name in names if name not in grouped and '/' not in name}
        listed = {name: array for name, array in lists.items() if len(array) == len(groups)}
    for table, (fields, members) in sorted(groups.items()):
        within = f'{place}, {table}' if table else place
        arrays = {column: _arranged(load(name), mapping.format, within) for column, name in members.items()}
        columns, constants = _unfolded_columns(arrays, within)
        number = int(next(iter(fields.values()))) if listed else 0
        of_list = {name: str(array[number - 1])[:MAX_TEXT] for name, array in listed.items() if number <= len(array)}
        yield TableFrame(
            within, tuple(columns), partial(columns_of, columns, within), {**of_list, **constants, **fields}
        )


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
        elif array.ndim == 1 or (array.ndim == 2 and 1 in array.shape):
            columns[name or '0'] = array.ravel()
        elif array.ndim not in (2, 3) or array.shape[-1] > MAX_CHANNELS:
            raise InvalidData(
                f"'{place}': '{name}' has the shape {array.shape}; (n_samples, n_channels) is needed, at most "
                f'{MAX_CHANNELS} channels; see `transpose` under `format`'
            )
        else:
            flat = array.reshape(-1, array.shape[-1])
            columns |= {_joined(name, str(number)): flat[:, number] for number in range(flat.shape[1])}
    if trials:
        columns[TRIAL] = np.repeat(np.arange(trials[0]), trials[1])
    return columns, constants


def _joined(name: str, part: str) -> str:
    return f'{name}.{part}' if name else part


def columns_of(columns: Mapping[str, AnyArray], place: str, numbers: Sequence[str], texts: Sequence[str]) -> Columns:
    """Return columns, (n,) each, as numbers and texts; NaN for numbers that are not finite."""
    read: dict[str, Array] = {}
    for name in numbers:
        array = columns[name]
        if array.dtype.kind not in 'biuf':
            raise InvalidData(f"'{place}': column '{name}' holds {array.dtype}; numbers are needed, name another")
        read[name] = array.astype(np.float64)
        read[name][~np.isfinite(read[name])] = np.nan
    return Columns(read, {name: _texts(columns[name]) for name in texts})


def _texts(array: AnyArray) -> AnyArray:
    if array.dtype.kind == 'S':
        return np.char.decode(array, 'utf-8', 'replace')
    if array.dtype.kind == 'f' and np.array_equal(array, np.round(array)):  # 3.0 is meant as 3
        return array.astype(np.int64).astype(str)
    return array.astype(str)


# --------------------
# Bags of messages: each number of a message is a column, such as '/wrench/wrench.force.x'.

MAX_FIELDS = 2000  # of one message
Rows = Mapping[str, AnyArray]  # name → values of one message, (n,) each; n > 1 where it holds consecutive samples
BROKEN = (struct.error, UnicodeDecodeError, ValueError, IndexError, AssertionError, KeyError, TypeError)
TIME = 'time'


def _collect(value: Any, path: str, found: dict[str, AnyArray]) -> None:
    """Add every number and text of a message by its path, such as 'wrench.force.x' or 'data.3'."""
    if len(found) > MAX_FIELDS:
        raise ValueError(f'it has more than {MAX_FIELDS} numbers')
    if dataclasses.is_dataclass(value):
        for part in dataclasses.fields(value):
            if part.name not in ('header', '__msgtype__'):
                _collect(getattr(value, part.name), f'{path}.{part.name}' if path else part.name, found)
    elif isinstance(value, (np.ndarray, Sequence)) and not isinstance(value, str):
        if len(value) > MAX_FIELDS:
            raise ValueError(f"'{path}' has {len(value)} numbers; {MAX_FIELDS} are allowed")
        for number, one in enumerate(value):
            _collect(one, f'{path}.{number}', found)
    else:
        found[path] = np.array([value])


def _rows_of(value: Any, msgtype: str) -> Rows:
    """Return the values of a message by name; of sound and of arrays with two dimensions, consecutive rows."""
    if msgtype == 'sensor_msgs/msg/JointState':
        kinds = ('position', 'velocity', 'effort')
        return {
            f'{kind}.{joint}': np.array([number])
            for kind in kinds for joint, number in zip(value.name, getattr(value, kind), strict=False)
        }  # fmt: skip
    if msgtype in ('std_msgs/msg/Float32MultiArray', 'std_msgs/msg/Float64MultiArray'):
        shape = [dim.size for dim in value.layout.dim]
        data = value.data[value.layout.data_offset :]
        table = data.reshape(shape) if len(shape) == 2 else data[None]
        if table.shape[1] > MAX_FIELDS:
            raise ValueError(f'it has {table.shape[1]} channels; {MAX_FIELDS} are allowed')
        return {f'data.{number}': table[:, number] for number in range(table.shape[1])}
    if msgtype.startswith('audio_common_msgs/msg/AudioData'):  # one channel, 16 bits little endian; full scale is 1
        return {'data': np.frombuffer(getattr(value, 'audio', value).data.tobytes(), '<i2') / 32768.0}
    found: dict[str, AnyArray] = {}
    _collect(value, '', found)
    return found


def _read_bag(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    """Yield the one frame of a bag: the topics that the mapping names, each with its time.

    Times are those of the headers, or of logging where there are none, from the first message of the bag on.
    """
    columns_of_streams = [column for stream in mapping.streams.values() for column in stream.columns]
    wanted = {*columns_of_streams, *mapping.numbers(), *mapping.texts()}
    topics: dict[str, _Topic] = {}
    first_ns = -1
    seen: dict[str, Any] = {}

    def chosen(connection: Any) -> bool:
        seen[connection.topic] = connection
        return any(fnmatch.fnmatchcase(connection.topic, name.rpartition('/')[0] or name) for name in wanted)

    for message in read_foreign(path, chosen):
        if message.topic not in topics:
            topics[message.topic] = _Topic(message.topic, seen[message.topic], place)
        stamp_ns = topics[message.topic].add(message, take)
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
            f"'{place}' has no topic that the mapping names ({', '.join(sorted(wanted))}); it has "
            f"{', '.join(sorted(seen)) or 'none'}; write columns as topic and field, such as '/wrench/wrench.force.x'"
        )
    yield TableFrame(place, tuple(columns), partial(columns_of, columns, place), clocks=clocks)


class _Topic:
    """The messages of one topic as columns, read by the definition that the bag stores, or else that of ROS 2."""

    def __init__(self, name: str, connection: Any, place: str) -> None:
        self._types, self._msgtype, self._name, self._place = message_types(connection), connection.msgtype, name, place
        if self._msgtype not in self._types.types:
            raise InvalidData(
                f"'{place}': the messages of '{name}' are {self._msgtype}, whose definition is neither in the bag nor "
                'of ROS 2 itself; record it as MCAP, which stores definitions, or republish it as a standard message'
            )
        self._rows: list[Rows] = []
        self._stamps_ns: list[int] = []
        self._counts: list[int] = []

    def add(self, message: RawMessage, take: Take) -> int:
        """Add a message, and return its time."""
        where = f"'{self._place}': message {len(self._rows)} of '{self._name}'"
        try:
            value = self._types.deserialize_cdr(message.data, self._msgtype)
            rows = _rows_of(value, self._msgtype)
        except BROKEN as error:
            raise InvalidData(f'{where} is damaged: {error}; record it again') from error
        if self._rows and rows.keys() != self._rows[0].keys():
            other = ', '.join(sorted(rows.keys() ^ self._rows[0].keys())[:5])
            raise InvalidData(f'{where} has other fields than the first: {other}')
        self._rows.append(rows)
        self._counts.append(max((len(array) for array in rows.values()), default=0))
        take(10 * len(rows) + sum(len(array) for array in rows.values()))  # small arrays take more than their values
        stamp = getattr(getattr(value, 'header', None), 'stamp', None)
        stamped_ns = stamp.sec * NANOSECONDS + stamp.nanosec if stamp else 0
        self._stamps_ns.append(stamped_ns or message.log_ns)
        return self._stamps_ns[-1]

    def columns(self) -> dict[str, AnyArray]:
        """Return all columns, (n,) each."""
        return {name: np.concatenate([rows[name] for rows in self._rows]) for name in self._rows[0]}

    def time_s(self, first_ns: int) -> Array:
        """Return the time of each row; the samples of one message lie evenly between it and the next."""
        stamps_s = (np.array(self._stamps_ns) - first_ns) / NANOSECONDS
        counts = np.array(self._counts)
        usual = float(np.median(np.diff(stamps_s))) if len(stamps_s) > 1 else 0.0
        steps_s = np.diff(stamps_s, append=stamps_s[-1] + usual)
        within = np.concatenate([np.arange(count) / max(count, 1) for count in counts])
        times: Array = np.repeat(stamps_s, counts) + np.repeat(steps_s, counts) * within
        return times


# --------------------
# The kinds of files.

BAG = 'bag'
READERS: Mapping[str, Callable[[Path, str, TableMapping, Take], Iterator[TableFrame]]] = {
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
    BAG: _read_bag,
}
OTHER_KINDS = {'.bag': 'is a bag of ROS 1; convert it: rosbags-convert --src FILE.bag --dst FOLDER'}
# Libraries that a kind of file needs: module, what it reads, and the extra of this package that brings it.
HDF5 = ('h5py', 'HDF5 files', 'hdf5')
PARQUET = ('pyarrow.parquet', 'Parquet files', 'parquet')
# What `texture import` is given a mapping for, and the kinds of files which that means.
MAPPED: Mapping[str, Sequence[str]] = {'table': tuple(kind for kind in READERS if kind != BAG), 'bag': (BAG, '.bag')}


# --------------------
# The clock of rows: their rate, and the place of each on a grid of it.

SIGNIFICANT = 4  # digits of an estimated rate: the resolution of time stamps allows no more
ROUND_RATE = 1e-3  # a rate that is so near to one of two digits is taken for that one
GAP = 1.5  # steps of time longer than so many sampling intervals are gaps, whose samples count as lost
CLEAR = 0.25  # intervals between the longest step without a loss and the shortest with one
SAME_TIME = 0.1  # rows nearer than this share of an interval have one time
BURST_RATIO, BURST_DUTY, BURST_SHARE, LONGEST_BURST_S = 5.0, 0.25, 0.2, 1.0
MIN_BURSTS = 4
MODULI = tuple(2.0**bits / unit for bits in (16, 24, 31, 32) for unit in (1.0, 1e3, 1e6, 1e9))
RESET_ROWS = 5  # times that stay behind for longer are those of another run
MAX_LEFT_OUT = 0.1  # share of the rows
PLAUSIBLE_HZ = (5.0, 200_000.0)
LIKELY_HZ = (20.0, 20_000.0)
LONGEST_SLIDE_S = 1800.0
TIMES = '; look at the column of time, its unit and `slides` in the mapping'


class ClockFault(ValueError):
    """Times of which no grid can be made: the row at which that is seen, and why."""

    def __init__(self, row: int, reason: str) -> None:
        super().__init__(reason)
        self.row = row


def unwrapped(times: Array) -> Array:
    """Return times of a counter that rolls over at 2^16, 2^24, 2^31 or 2^32 of some unit as ones that go on."""
    steps = np.diff(times)
    back, forward = steps[steps < 0], steps[steps > 0]
    if not len(back) or not len(forward):
        return times
    for modulus in MODULI:
        usual = float(forward[forward < modulus / 2].mean()) if (forward < modulus / 2).any() else math.inf
        far = back[back < -modulus / 2] + modulus
        near = usual * (20.0 if modulus > 1000 * usual else 1.75)
        if times.max() < modulus and times.min() >= 0 and len(far) and (far > 0).all() and (far <= near).all():
            return np.asarray(np.unwrap(times, period=modulus))
    return times


def burst_step_s(steps: Array) -> float:
    """Return the step of time that begins a burst of rows that were stamped at once, as of a buffer; 0 without."""
    ordered = np.sort(steps[steps >= 0])
    total = float(ordered.sum())
    if len(ordered) < 2 * MIN_BURSTS or not total > 0:
        return 0.0
    floor = 1e-6 * total / len(ordered)
    ratios = np.maximum(ordered[1:], floor) / np.maximum(ordered[:-1], floor)
    place = int(ratios.argmax()) + 1
    small, large = ordered[:place], ordered[place:]
    if ratios[place - 1] < BURST_RATIO or len(small) < BURST_SHARE * len(ordered) or len(large) < MIN_BURSTS:
        return 0.0
    regular = np.median(large) <= LONGEST_BURST_S and np.quantile(large, 0.75) <= 3.0 * np.quantile(large, 0.25)
    return float(large[0]) if regular and small.sum() < BURST_DUTY * total else 0.0


def estimated_rate_hz(slides: Sequence[Array], burst_s: float) -> float:
    """Return the rate of the rows of slides in spite of jitter and gaps, of four digits; NaN without steps of time."""
    if burst_s:
        counted, periods = zip(*(_bursts(times, burst_s)[1:] for times in slides if len(times)), strict=True)
        counts, steps = np.concatenate([one[:-1] for one in counted]), np.concatenate(periods)
    else:
        steps = np.concatenate([np.diff(times) for times in slides])
        counts = np.ones(len(steps))
    counts, steps = counts[steps > 0], steps[steps > 0]
    if not len(steps):
        return math.nan
    usual = steps < 1.75 * np.median(steps)
    if not burst_s:
        usual &= steps > 0.25 * np.median(steps)  # rows that are there twice
    rate_hz = float(counts[usual].sum() / steps[usual].sum())
    simple = float(f'{rate_hz:.2g}')
    return simple if abs(rate_hz / simple - 1.0) < ROUND_RATE else float(f'{rate_hz:.{SIGNIFICANT}g}')


def _bursts(times: Array, burst_s: float) -> tuple[AnyArray, AnyArray, Array]:
    """Return the first row of each burst, its number of rows, and the steps of time between bursts."""
    starts = np.flatnonzero(np.concatenate(([True], np.diff(times) >= burst_s)))
    return starts, np.diff(np.append(starts, len(times))), np.diff(times[starts])


def on_grid(
    samples: AnyArray, times: Array, rate_hz: float, burst_s: float = 0.0
) -> tuple[AnyArray, AnyArray, Counter[str]]:
    """Return which rows of a slide are samples, (n,), the place of each on a grid, and counts of what is left out.

    Jitter of the times is that of the host that stamped them, and not of the device that sampled. ClockFault where the
    times contradict the rate, go back, or lack more samples than there are.
    """
    kept = _in_order(times)
    out = int((~kept).sum())
    counts = Counter({'rows out of order': out} if out else {})
    longest = max((edge.stop - edge.start for edge in _runs(~kept)), default=0)
    if out > MAX_LEFT_OUT * len(times) or longest > RESET_ROWS:
        row = int(np.argmax(np.diff(times) < 0)) + 1
        raise ClockFault(
            row, f'time goes back from {times[row - 1]:.9g} to {times[row]:.9g} s, and {out} of {len(times)} rows are '
            'out of order; where the file holds several runs, write slides: {by: pause}, or cut them by a column; a '
            'counter is only unwrapped at 2^16, 2^24, 2^31 or 2^32',
        )  # fmt: skip
    rows = np.flatnonzero(kept)
    if burst_s:
        index, dropped = _burst_places(times[rows], samples[rows], rate_hz, burst_s)
        reason = 'rows of incomplete bursts'
    else:
        index, dropped = _places(times[rows], samples[rows], rate_hz)
        reason = 'repeated rows'
    counts |= {reason: int(dropped.sum())} if dropped.any() else {}
    rows, index = rows[~dropped], index[~dropped]
    # Of a row or two behind a gap at an end nobody knows whether the gap or their time is wrong.
    apart = np.flatnonzero(np.diff(index) > 1)
    low = max((place + 1 for place in apart[apart < 2]), default=0)
    high = min((place + 1 for place in apart[apart >= len(index) - 3]), default=len(index))
    if high - low < len(index) and high > low:
        counts['rows alone at the end of a slide'] = len(index) - (high - low)
        rows, index = rows[low:high], index[low:high]
    left_out = len(times) - len(rows)
    if left_out > MAX_LEFT_OUT * len(times):
        row = int(np.argmax(dropped))
        raise ClockFault(
            row, f'{left_out} of {len(times)} rows have the time of another one or come in incomplete bursts; filter '
            'them (`rows: {column: value}`), or give `rate_hz` in place of the column of time',
        )  # fmt: skip
    # The grid must agree with the clock as a whole.
    lost = int(index[-1] - index[0] + 1 - len(index)) if len(index) else 0
    seconds = float(times[rows[-1]] - times[rows[0]]) if len(rows) else 0.0
    if lost > len(rows):
        row = rows[1 + int(np.argmax(np.diff(index)))]
        raise ClockFault(
            row, f'by the usual step the rate is {rate_hz:g} Hz and {lost} samples are lost next to {len(rows)} rows, '
            f'by rows and duration it is {len(rows) / max(seconds, 1e-9):.4g} Hz{TIMES}, or give `rate_hz` in place '
            'of the column of time',
        )  # fmt: skip
    if len(index) and abs((index[-1] - index[0]) - seconds * rate_hz) > 3.0 + 0.03 * (index[-1] - index[0]) + (
        2.0 * burst_s * rate_hz if burst_s else 0.0
    ):
        raise ClockFault(
            0, f'{len(rows)} rows and {lost} lost samples at {rate_hz:g} Hz take other than the {seconds:.4g} s of '
            f'their times, which are too irregular{TIMES}, or give `rate_hz` in place of the column of time',
        )  # fmt: skip
    counts |= {'samples': len(index), 'lost': lost}
    return rows, index - (index[0] if len(index) else 0), counts


def _in_order(times: Array) -> AnyArray:
    """Return the rows, as a mask, of the longest sequence in which times do not go back."""
    kept = np.ones(len(times), dtype=bool)
    if not (np.diff(times) < 0).any():
        return kept
    ends: list[float] = []  # by length, the least time at which a sequence of it ends, and its row
    rows: list[int] = []
    previous = []
    for row, time_s in enumerate(times.tolist()):
        length = bisect_right(ends, time_s)
        previous.append(rows[length - 1] if length else -1)
        ends[length : length + 1], rows[length : length + 1] = [time_s], [row]
    kept[:] = False
    row = rows[-1]
    while row >= 0:
        kept[row] = True
        row = previous[row]
    # Of two rows that only contradict each other nobody knows which one is wrong.
    for row in np.flatnonzero(~kept).tolist():
        near = slice(max(0, row - 1000), row + 1001)
        earlier = np.arange(near.start, near.start + len(times[near])) < row
        partners = np.flatnonzero(kept[near] & np.where(earlier, times[near] > times[row], times[near] < times[row]))
        if len(partners) == 1:
            kept[near.start + partners[0]] = False
    return kept


def _runs(mask: AnyArray) -> list[slice]:
    """Return the stretches of a mask that are true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return [slice(*edge) for edge in edges.reshape(-1, 2).tolist()]


def _places(times: Array, samples: AnyArray, rate_hz: float) -> tuple[AnyArray, AnyArray]:
    """Return the place of each row on the grid, and which rows are dropped as there twice, (n,) each."""
    times, dropped = times.copy(), np.zeros(len(times), dtype=bool)
    unlike: list[int] = []
    steps = np.diff(times) * rate_hz
    for row in np.flatnonzero(steps < SAME_TIME).tolist():
        if np.array_equal(samples[row], samples[row + 1], equal_nan=True):
            dropped[row + 1] = True  # written twice
        elif row + 1 < len(steps) and GAP <= steps[row + 1] < 2.0 + GAP:
            times[row + 1] += 0.5 * (times[row + 2] - times[row + 1])  # of a coarse clock
        else:
            dropped[[row, row + 1]] = True  # nobody knows which one is it
            unlike.append(row)
    if len(unlike) > max(2, 0.01 * len(times)):
        raise ClockFault(
            unlike[0], f'{len(unlike)} times come twice with other values: of a coarse clock, or of several sensors; '
            'choose rows (`rows: {column: value}`), or give `rate_hz` in place of the column of time',
        )  # fmt: skip
    kept = np.flatnonzero(~dropped)
    steps = np.diff(times[kept]) * rate_hz
    # A late row is followed by a short step, a loss is not.
    pairs = steps + np.append(steps[1:], np.inf)
    missing = np.where((steps > GAP) & (pairs > 1.0 + GAP), np.rint(steps) - 1, 0).astype(np.int64)
    index = np.zeros(len(times), dtype=np.int64)
    index[kept] = np.concatenate(([0], np.cumsum(1 + np.maximum(missing, 0))))[: len(kept)]
    # Losses are those that stand out: whole steps, and longer than any that is none.
    large = missing > 0
    uneven = np.abs(steps[large] - np.rint(steps[large])).mean() > 0.2 if large.sum() > 0.1 * len(steps) else False
    kinds = np.unique(steps[~large].round(6))
    coarse = float(np.diff(kinds).min()) if 1 < len(kinds) < 12 else 0.0  # resolution of the clock
    if uneven or (large.any() and steps[large].min() - steps[~large].max(initial=1.0) < CLEAR + coarse):
        raise ClockFault(
            0, f'the steps of time are too irregular for a rate of {rate_hz:g} Hz: losses cannot be told from '
            f'jitter, and by rows and duration it is '
            f'{len(times) / max(times[-1] - times[0], 1e-9):.4g} Hz; give `rate_hz` in place of the column of time',
        )  # fmt: skip
    return index, dropped


def _burst_places(times: Array, samples: AnyArray, rate_hz: float, burst_s: float) -> tuple[AnyArray, AnyArray]:
    """Return the place of each row on the grid, and which rows of incomplete bursts are dropped, (n,) each."""
    starts, counts, periods = _bursts(times, burst_s)
    burst = np.repeat(np.arange(len(starts)), counts)
    within = np.arange(len(times)) - starts[burst]
    inside = np.diff(burst) == 0
    twins = inside & np.all((samples[1:] == samples[:-1]) | np.isnan(samples[1:] + samples[:-1]), axis=1)
    if twins.sum() > 0.5 * inside.sum() and np.any(samples != samples[0]):
        raise ClockFault(1, 'most rows are there twice, with one time and the same values; save each row once')
    size, usual = int(np.median(counts)), float(np.median(periods))
    if (counts[1:-1] == size).mean() > 0.8:
        # Bursts of one size: nobody knows which row one lacks or has twice, so it is left out as a whole.
        whole = (counts == size)[burst]
        number = np.concatenate(([0], np.cumsum(np.maximum(1, np.rint(periods / usual))))).astype(np.int64)
        return number[burst] * size + within, ~whole
    missing = np.rint(periods * rate_hz - counts[:-1])
    missing = np.where((periods > 1.75 * usual) & (missing > 0), missing, 0).astype(np.int64)
    index = np.arange(len(times)) + np.concatenate(([0], np.cumsum(missing)))[burst]
    # As many rows as time has passed, whatever the sizes: where rows were lost within bursts, the count wanders.
    first = index[starts].astype(float)
    seconds = times[starts] - times[0]
    rest = first - np.polyval(np.polyfit(seconds, first, 1), seconds)
    if np.abs(rest).max() > 1.5:
        raise ClockFault(
            0, f'rows come in bursts of {counts.min()} to {counts.max()}, and their number does not follow the time; '
            'losses within them cannot be placed; give `rate_hz` in place of the column of time',
        )  # fmt: skip
    return index, np.zeros(len(times), dtype=bool)


# --------------------
# The strict step: a frame gives clock, streams, labels, slides and conditions, or is refused.

STATE_S = 0.1  # a state so often where a condition changes along a slide
SAME_RATE = 1.05  # files of one stream may differ by this factor
SAME_TIME_S = 1e-9
WIDE = 100  # columns name_1 … name_n beyond this are hardly channels
MAX_SLIDES = 20_000  # of one file
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

    def leave_out(self, reason: str, count: int, *examples: str) -> None:
        """Count what is left out, with the first places."""
        if count:
            self.left_out[reason] += count
            self.examples[reason] += examples[: EXAMPLES - len(self.examples[reason])]

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
                for session, named, streams, conditions in FrameSlides(mapping, frame, fields, report).slides():
                    bags.write(session, named, streams, conditions)
            if path.is_dir() or path.suffix == '.mcap':
                cut = is_cut_off(path)
                report.leave_out('bags were cut off, and end with their last whole part', int(cut), f"'{place}'; see "
                                 'mcap recover')  # fmt: skip
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
    for path in paths:
        place = path.name if path == source else path.relative_to(source).as_posix()
        fields = template_fields(mapping.files, place)
        if fields is None or _kind(path) not in (*kinds, *OTHER_KINDS):
            report.leave_out('files have other names or endings', 1, f"'{place}'")
            continue
        report.files += 1
        yield path, place, fields
    if not report.files:
        raise InvalidData(
            f"no file in '{source}' has the form '{mapping.files}' and one of the endings {', '.join(kinds)}; "
            'give the folder that holds them, or correct `files` in the mapping'
        )


def _kind(path: Path) -> str:
    return BAG if is_bag(path) else path.suffix.lower()


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
        self._check_rows()
        streams = [self._stream(name, params) for name, params in mapping.streams.items()]
        # Slides are cut by the rows of the stream that corresponds to the column at which they end.
        by = mapping.slides.column
        same = [one for one in streams if by and by not in self._fields and one.group == self._group(by)]
        self._reference = max(same or streams[:1], key=lambda one: len(one.rows))
        self._spans = self._cut()
        self._streams = [self._rated(one) for one in streams]
        self._reference = next(one for one in self._streams if one.name == self._reference.name)

    def slides(self) -> Iterator[tuple[str, ExplorationState, SlideStreams, Conditions]]:
        """Yield what `SlideBags.write` takes."""
        params, short, inside = self._mapping.slides, 0, 0
        reference, times = self._reference, self._reference.at_s()
        for number, span in enumerate(self._spans, 1):
            skip, drop = (round(seconds * reference.rate_hz) for seconds in (params.start_s, params.end_s))
            rows = slice(span.start + skip, max(span.start + skip, span.stop - drop))
            inside += max(0, span.stop - span.start)
            count = (rows.stop - rows.start) * reference.per_row
            if count < 2 or count / (reference.rate_hz * reference.per_row) < params.min_s - 1e-9:
                short += span.stop - span.start
                self._report.leave_out(
                    'slides are too short', 1, f"'{self._place}', row {self._line(span.start)}: {count} samples"
                )
                continue
            if number > MAX_SLIDES:
                raise InvalidData(f"'{self._place}' has more than {MAX_SLIDES} slides; split it")
            yield self._slide(times, rows, number)
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
        none = np.logical_and.reduce([np.isnan(self._columns.numbers[column]) for column in self._chosen[name]])
        if not others:
            return np.zeros(group[1], dtype=bool)
        blank: AnyArray = none & np.logical_or.reduce([np.isfinite(column) for column in others])
        steps = np.diff(np.flatnonzero(~blank))
        if not self._mapping.streams[name].time.column and len(steps) and np.ptp(steps):
            blank[:] = False  # by no clock and no pattern can their places be known
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
            told = dict(self._columns.reasons)
            if count and not told:
                told[self._line(int(found.argmax()))] = 'no finite number'
            reasons = [f'row {line}, {reason}' for line, reason in told.items()]
            if not length or count > MAX_LEFT_OUT * length:
                raise InvalidData(
                    f"'{self._place}' has {count} malformed rows of {length}, first "
                    f'{(reasons or ["no row at all"])[0]}; at most {100 * MAX_LEFT_OUT:g} % are taken; look at the '
                    'columns and at `format` in the mapping'
                )
            self._report.leave_out('malformed rows', count, *(f"'{self._place}', {reason}" for reason in reasons))

    def _stream(self, name: str, params: StreamColumns) -> Stream:
        names, group = self._chosen[name], self._group(self._chosen[name][0])
        self._check_width(name, params, names, group[1])
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
        kept, time_s = ~self._blank(name), None
        column = params.time.column or self._frame.clocks.get(names[0], '')
        if column:
            raw = self._columns.numbers[column]
            if len(raw) != len(samples):
                raise InvalidData(f"'{self._place}': column '{column}' has {len(raw)} rows, '{name}' {len(samples)}")
            raw = _with_places(raw, kept)
            kept &= np.isfinite(raw)
            unit = TIME_UNITS[params.time.unit if params.time.column else 's']
            time_s = unwrapped(raw[kept]) * unit
        rows = np.flatnonzero(kept)
        self._report.channels.setdefault(name, channels)
        if self._report.channels[name] != channels and len(self._report.channels[name]) != len(channels):
            raise InvalidData(
                f"'{self._place}': '{name}' has {len(channels)} channels, {len(self._report.channels[name])} in the "
                'files before; give each sensor a mapping'
            )
        return Stream(name, params, channels, samples[rows], rows, time_s, group, per_row)

    def _check_width(self, name: str, params: StreamColumns, names: Sequence[str], rows: int) -> None:
        """Refuse a row that looks like a window, or an array that lies on its side, unless the mapping tells."""
        numbered = all(re.fullmatch(r'.*?\d+', one) for one in names)
        if not params.samples_per_row and len(names) > 8 and (len(names) > rows or (numbered and len(names) > WIDE)):
            raise InvalidData(
                f"'{self._place}': the stream '{name}' has {len(names)} columns, {names[0]} … {names[-1]}, and {rows} "
                f'rows; write samples_per_row: {len(names)} if a row holds that many consecutive samples of one '
                'channel (slides: {by: row} if it is a window), samples_per_row: 1 if the columns are channels, or '
                'format: {transpose: true} if the array lies on its side'
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
            ahead = np.lib.stride_tricks.sliding_window_view(
                np.append(times[1:], np.full(RESET_ROWS, times[-1])), RESET_ROWS + 1
            )
            reset = (ahead < times[:-1, None]).all(axis=1)
            changes = np.flatnonzero((np.diff(times) >= params.pause_s) | reset) + 1
        elif params.by == 'time':
            if times is not None and (np.diff(times) < 0).any():
                row = int(np.argmax(np.diff(times) < 0)) + 1
                raise InvalidData(self._fault(reference, row, 'time goes back; slides by time need one that goes on'))
            rate_hz = reference.params.rate_hz / reference.per_row or self._frame.rate_hz
            since = times - times[0] if times is not None else reference.rows / max(rate_hz, MIN_HZ)
            number = np.floor(since / params.length_s + 1e-9)
            changes = np.flatnonzero(np.diff(number)) + 1
            whole = float(since[-1]) + float(np.median(np.diff(since))) if count > 1 else 0.0
            count = (
                count
                if whole >= (number[-1] + 1) * params.length_s * (1 - 1e-6)
                else int((changes if len(changes) else [0])[-1])
            )
        found = [slice(first, last) for first, last in pairwise([0, *changes[changes < count].tolist(), count])]
        if keys is None:
            return found
        found = [span for span in found if _slides_at(str(keys[span.start]), params.values)]
        if not found:
            raise InvalidData(
                f"'{self._place}': column '{params.column}' has none of the values "
                f'{", ".join(params.values) or "but empty"}; it has {", ".join(np.unique(keys)[:5].tolist())}'
            )
        return found

    def _rated(self, stream: Stream) -> Stream:
        """Return a stream with the rate of its rows: as stated, else by its times, which must agree."""
        name, params, per_row = stream.name, stream.params, stream.per_row
        measured, burst_s = self._frame.rate_hz, 0.0
        if stream.time_s is not None:
            parts = [stream.time_s]
            if stream.group == self._reference.group:
                edges = [
                    (self._reference.rows[one.start], self._reference.rows[one.stop - 1])
                    for one in self._spans
                    if one.stop > one.start
                ]
                places = [(np.searchsorted(stream.rows, a), np.searchsorted(stream.rows, b, 'right')) for a, b in edges]
                parts = [stream.time_s[a:b] for a, b in places] or parts
            parts = [part for part in parts if len(part) > 1] or [stream.time_s]
            burst_s = burst_step_s(np.concatenate([np.diff(part) for part in parts]))
            measured = per_row * estimated_rate_hz(parts, burst_s)
            self._refuse_mixed(stream, parts, burst_s)
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

    def _refuse_mixed(self, stream: Stream, parts: Sequence[Array], burst_s: float) -> None:
        """Refuse times that come again where an unused column differs between their rows, as the name of a sensor."""
        whole = np.concatenate(parts)
        if len(np.unique(whole)) > 0.9 * len(whole) and not (np.diff(whole) < 0).sum() > MAX_LEFT_OUT * len(whole):
            return
        used = {*self._columns.numbers, *self._columns.texts}
        for name in [one for one in self._frame.names if one not in used][:40]:
            texts = self._frame.read([], [name]).texts[name]
            texts = texts[stream.rows] if len(texts) == stream.group[1] else texts
            values, codes = np.unique(texts, return_inverse=True)
            if len(texts) != len(stream.rows) or not 2 <= len(values) <= len(texts) / 4:
                continue
            _, places = np.unique(stream.at_s(), return_inverse=True)
            if len(np.unique(places.astype(np.int64) * len(values) + codes)) == len(texts):
                raise InvalidData(
                    f"'{self._place}': each time occurs once for each value of '{name}' "
                    f'({", ".join(values[:5].tolist())}), so the signals of several sensors or runs alternate; choose '
                    f"one by rows: {{{name}: {values[0]}}}, or cut slides at '{name}'"
                )

    def _aligned(self, name: str) -> AnyArray:
        """Return the texts of a column at the rows of the reference: of another clock, the last one until then."""
        texts = self._columns.texts[name]
        if self._group(name) == self._reference.group:
            return texts[self._reference.rows]
        clock, times = self._frame.clocks.get(name), self._reference.time_s
        if clock is None or times is None:
            raise InvalidData(
                f"'{self._place}': column '{name}' has {len(texts)} rows, as no stream has; name one of the same length"
            )
        held = np.searchsorted(self._columns.numbers[clock], times + SAME_TIME_S, 'right') - 1
        return np.where(held >= 0, texts[np.maximum(held, 0)], '')

    def _value(self, name: str, rows: slice, kind: str) -> str:
        """Return the one value that a column has during a slide, the last one before it where it has none."""
        if name in self._fields:
            return str(self._fields[name])
        texts = self._aligned(name)
        inside = np.flatnonzero(texts[rows] != '') + rows.start
        before = np.flatnonzero(texts[: rows.start] != '')
        if not len(inside):
            if not len(before):
                raise InvalidData(f"'{self._place}': column '{name}' has no value during a slide; name another")
            return str(texts[before[-1]])
        first = str(texts[inside[0]])
        if inside[0] > rows.start and len(before) and texts[before[-1]] != first:
            inside, first = np.append(before[-1], inside), str(texts[before[-1]])
        other = inside[texts[inside] != first]
        if len(other):
            raise InvalidData(
                f"'{self._place}', row {self._line(self._reference.rows[other[0]])}, column '{name}': the "
                f"{kind} changes from '{first}' to '{texts[other[0]]}' within a slide; let slides end "
                f"where '{name}' changes "
                '(`slides: {by: column}`)'
            )
        return first

    def _slide(self, times: Array, rows: slice, number: int) -> tuple[str, ExplorationState, SlideStreams, Conditions]:
        label, reference = self._mapping.label, self._reference
        code = label.value or self._value(label.column, rows, 'label')
        surface = checked_label(label.names.get(code, code))
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
        conditions = self._conditions(group_rows, begin_s, end_s)
        for place, name in enumerate(CONDITION_UNITS, 1):
            known = [state[place] for state in conditions if math.isfinite(state[place])]
            if known:
                self._report.conditions[surface, name].append(self._plausible(name, float(np.mean(known))))
        self._report.slides[surface] += 1
        named = ExplorationState(0, f'{self._place}/{number}', self._mapping.motion, Phase.SLIDE, surface=surface)
        return session, named, streams, conditions

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
                rows, index, counts = on_grid(samples, stream.time_s[first:last], stream.rate_hz, stream.burst_s)
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

    def _conditions(self, group_rows: tuple[int, int], begin_s: float, end_s: float) -> Conditions:
        """Return what holds from 0 on, and every 0.1 s after if a condition changes along the slide."""
        tracks = {name: self._track(name, group_rows, begin_s, end_s) for name in CONDITION_UNITS}
        changing = any(len(values) > 1 and np.ptp(values) > 0 for _, values in tracks.values())
        count = max(1, round((end_s - begin_s) / STATE_S)) if changing else 1
        edges = begin_s + STATE_S * np.arange(count + 1) if changing else np.array([begin_s, math.inf])
        edges[-1] = math.inf
        means = [[_mean(*tracks[name], a, b) for name in CONDITION_UNITS] for a, b in pairwise(edges)]
        return [(start, *mean) for start, mean in zip((edges[:-1] - begin_s).tolist(), means, strict=True)]

    def _track(self, name: str, group_rows: tuple[int, int], begin_s: float, end_s: float) -> tuple[Array, Array]:
        """Return times and known values of a condition in SI units, (n,) each; a force and a speed without sign."""
        quantity = self._mapping.conditions.get(name, Quantity())
        factor = CONDITION_UNITS[name].get(quantity.unit, 1.0)
        if quantity.column in self._fields or not quantity.column:
            text = self._fields[quantity.column] if quantity.column else quantity.value or 'nan'
            try:
                values, times = np.array([float(text)]), np.array([begin_s])
            except ValueError as error:
                raise InvalidParameter(
                    f"'{self._place}': '{quantity.column}' is '{text}' in its name; a number is needed there"
                ) from error
        else:
            times = np.empty(0)
            values, group = self._columns.numbers[quantity.column], self._group(quantity.column)
            if group == self._reference.group:
                low, high = np.searchsorted(self._reference.rows, group_rows)
                rows = self._reference.rows[low:high]
                times, values = self._reference.at_s()[low:high], values[rows]
            else:
                clock = self._frame.clocks.get(quantity.column)
                if clock is None:
                    raise InvalidData(
                        f"'{self._place}': column '{quantity.column}' has {len(values)} rows, as no stream has; name "
                        'one of the same length'
                    )
                times = self._columns.numbers[clock]
                first, last = np.searchsorted(times, (begin_s - SAME_TIME_S, end_s - SAME_TIME_S))
                first = max(0, first - 1) if first == last else first  # the last value holds
                times, values = times[first:last], values[first:last]
        times, values = times[np.isfinite(values)], values[np.isfinite(values)] * factor
        negative = name != 'direction' and len(values) and values.mean() < 0
        return times, -values if negative else values


def _with_places(times: Array, kept: AnyArray) -> Array:
    """Return times in which malformed rows that stand for a sample, as the step around them shows, have its time."""
    times = times.copy()
    steps = np.diff(times[kept & np.isfinite(times)])
    usual = float(np.median(steps)) if len(steps) else math.nan
    for run in _runs(kept & np.isnan(times)):
        before, after = run.start - 1, run.stop
        if before >= 0 and after < len(times):
            step = (times[after] - times[before]) / (after - before)
            if abs((step / usual - 1.0) * (after - before)) < 0.5:
                times[run] = times[before] + step * np.arange(1, after - before)
    return times


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
