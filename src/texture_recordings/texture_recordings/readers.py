# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Thin readers: a file of anybody gives frames of named columns, or is refused before it takes much memory."""

from __future__ import annotations

import csv
import dataclasses
import fnmatch
import io
import math
import os
import re
import struct
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import chain, islice, product
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.config import MB, Arrays, library, open_regular, read_array, unknown_name
from texture_core.errors import InvalidData, TextureError, UnknownName
from texture_core.types import MAX_HZ, NANOSECONDS, AnyArray, Array
from texture_recordings.bags import MAX_FIELDS, is_bag, message_types, read_foreign
from texture_recordings.mapping import FileFormat, TableMapping, template_fields

MAX_FILE_BYTES = 1000 * MB
MAX_VALUES = 8_000_000  # of 8 bytes, of one file; a larger file may have as many as it has bytes
EXAMPLES = 3
RANGE = re.compile(r'(\D*)(\d{1,9})-(?:\1)?(\d{1,9})')
MAX_RANGE = 10_000
TRIAL = 'trial'  # number of the first axis of arrays (n_trials, n_samples, n_channels)
MAX_ARRAYS = 50_000  # data sets of an HDF5 file
MOST_COLUMNS = 10  # that a message names
MAX_CHANNELS = 10_000  # more are samples: the array lies on its side
MAX_TEXT_BYTES = 64 * MB  # read at once from an HDF5 file
MAX_TEXT = 200  # characters of a cell that is shown or a label

Take = Callable[[float], None]  # asks for a number of values; InvalidData beyond the limit of the file


@dataclass(frozen=True, eq=False)
class TableFrame:
    """Columns that belong together, by name: (n,) numbers or texts, or () for what holds for all rows."""

    place: str
    columns: Mapping[str, AnyArray]
    rate_hz: float = 0.0
    clocks: Mapping[str, str] = field(default_factory=dict)  # column → column of its times, s
    lines: AnyArray | None = None  # number in the file of each row
    junk: AnyArray | None = None  # rows with something that is no number
    reasons: Mapping[int, str] = field(default_factory=dict)  # of the first such rows, by number in the file
    gaps: AnyArray | None = None  # rows with a condition that is no number
    gap_reasons: Mapping[int, str] = field(default_factory=dict)

    def __getitem__(self, name: str) -> AnyArray:
        """Return a column; UnknownName with the nearest if there is none."""
        if name not in self.columns:
            error = unknown_name(name, self.columns, 'column', MOST_COLUMNS)
            by_row = 'arrays (n_windows, n_samples, n_channels) have it; of (n_windows, n_samples) write slides: '
            hint = f'; {by_row}{{by: row}} and `samples_per_row`' if name == TRIAL else ''
            raise UnknownName(f'{error}{hint}')
        return self.columns[name]

    def numbers(self, name: str) -> Array:
        """Return a column as numbers, NaN where there is none."""
        array = self[name]
        if array.dtype.kind in 'biuf':
            return np.where(np.isfinite(array), array, np.nan).astype(np.float64)
        if array.dtype.kind not in 'OUS':
            raise InvalidData(f"column '{name}' holds {array.dtype}; numbers are needed, name another")
        return np.array([number_of(text) for text in self.texts(name).ravel().tolist()]).reshape(array.shape)

    def texts(self, name: str) -> AnyArray:
        """Return a column as texts, '' where there is none; 3.0 is meant as 3."""
        array = self[name]
        if array.dtype.kind == 'S':
            array = np.char.decode(array, 'utf-8', 'replace')
        elif array.dtype.kind == 'f':
            known = np.isfinite(array)
            whole = np.array_equal(array[known], np.round(array[known]))
            array = np.where(known, np.where(known, array, 0.0).astype(np.int64 if whole else float).astype(str), '')
        return array if array.dtype.kind == 'O' else array.astype(str).astype(object)


def chosen(wanted: Sequence[str], names: Sequence[str], other: Mapping[str, str]) -> list[str]:
    """Return the columns that names, patterns such as 'taxel*' and ranges such as '0-8' mean, in their order.

    Patterns leave out columns that have another key of the mapping; named ones are refused, but those of conditions: a
    force may be a channel, too.
    """
    found = []
    for name in wanted:
        match = RANGE.fullmatch(name)
        meant = [name]
        if name not in names and match and 0 <= int(match[3]) - int(match[2]) < MAX_RANGE:
            meant = [f'{match[1]}{number}' for number in range(int(match[2]), int(match[3]) + 1)]
        elif name not in names and len(name) <= 100:
            meant = [one for one in names if one and one not in other and fnmatch.fnmatchcase(one, name)] or [name]
        if unknown := [one for one in meant if one not in names]:
            raise unknown_name(unknown[0], names, 'column', MOST_COLUMNS)
        if twice := [one for one in meant if other.get(one, 'conditions') != 'conditions']:
            raise InvalidData(
                f"column '{twice[0]}' is a channel under `columns` and is the column under `{other[twice[0]]}`; remove "
                'it from one of them'
            )
        found += meant
    return found


@contextmanager
def placed(place: str) -> Iterator[None]:
    """Begin the sentence of what is refused within a `with` block with its place."""
    try:
        yield
    except (InvalidData, UnknownName) as error:
        sentence = str(error)
        between = ' ' if sentence.startswith('it ') else ', ' if sentence.startswith('row ') else ': '
        raise InvalidData(f"'{place}'{between}{sentence.removeprefix('it ')}") from error


def frames(path: Path, place: str, mapping: TableMapping) -> Iterator[TableFrame]:
    """Yield the frames of a file; InvalidData with its place, whatever is wrong with it."""
    with placed(place):
        if kind_of(path) in OTHER_KINDS:
            raise InvalidData(OTHER_KINDS[kind_of(path)])
        try:
            if path.is_dir():
                size = sum(one.stat().st_size for one in path.iterdir() if one.is_file())
            else:
                with open_regular(path, MAX_FILE_BYTES) as file:
                    if file.read(len(LFS)) == LFS:
                        raise InvalidData('it is a pointer of Git LFS and has no data; run: git lfs pull')
                    size = file.seek(0, io.SEEK_END)
            taken, most = 0.0, max(MAX_VALUES, size)

            def take(count: float) -> None:
                nonlocal taken
                taken += count
                if taken > most:
                    raise InvalidData(
                        f'it declares more than {most / 1e6:.0f} million values in {size / MB:.3g} MB; at most that '
                        'many are read, split it or save what the mapping needs'
                    )

            yield from READERS[kind_of(path)](path, place, mapping, take)
        except TextureError:
            raise
        except Exception as error:  # whatever a library raises, which depends on the byte that is wrong
            reason = (str(error) or type(error).__name__)[:300]
            again = 'it may have been cut off: copy or save it again'
            if 'Object arrays' in reason:
                again = 'save its arrays as numbers, slides of unequal length as an array each (`tables` names them)'
            raise InvalidData(f'it cannot be read: {reason}; {again}') from error


# ---- text files

# How files begin that are no texts.
OTHER_FILES = {b'\x1f\x8b': 'gzip', b'PK\x03\x04': 'ZIP or Excel', b'\xd0\xcf\x11\xe0': 'Excel', b'\xff\xfe': 'UTF-16'}
DELIMITERS = (',', ';', '\t', '|', ' ')
BLOCK_ROWS = 20_000  # which are parsed at once
NO_TEXT = frozenset(('nan', 'na', 'n/a', '#n/a', 'null'))  # 'none' may be a label
BLANK = frozenset(('', 'nan', 'na', 'null', 'none'))
NO_WORD = NO_TEXT | BLANK | {'inf', '-inf', '+inf'}
WORD = re.compile(r'[^\W\d_]')
DATE = re.compile(r'\d{1,4}([-/.])\d\d?\1\d{1,4}|\d\d?:\d\d')  # or a time of the day
THOUSANDS = {sign: re.compile(rf'[+-]?[1-9]\d{{0,2}}({re.escape(sign)}\d{{3}})+') for sign in '.,'}
FEW_THOUSANDS = 3  # cells with a point: fewer may be decimals by chance
NUMERIC = 0.9  # share of numbers in a column of numbers


def _read_csv(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    """Yield the columns of a text file: numbers where the mapping wants them or nine of ten cells are some, or texts.

    A row is malformed if it has other cells than the first one, or a text in a column of samples or times. Such a text
    in a column of a condition alone leaves out that cell. A word in another column of numbers is refused, as rows of
    units and means have one.
    """
    form, parts = mapping.format, list[dict[str, AnyArray]]()
    lines, junk, reasons = list[AnyArray](), list[AnyArray](), dict[int, str]()
    gapped, gap_reasons = list[AnyArray](), dict[int, str]()
    with open_regular(path) as opened:
        # The names of the columns, and those that the mapping wants as numbers.
        rest, delimiter, names = _opened(opened, form)
        numbers, conditions = _wanted(mapping, names, delimiter)
        numeric: dict[str, bool] = {}
        whole_numbers: set[str] = set()
        # Block by block: the cells, what they are, and the rows that are malformed.
        for block in iter(lambda: list(islice(rest, BLOCK_ROWS)), []):
            take(len(block) * (len(names) + len(mapping.texts())))
            rows = [_cells(line, delimiter) for _, line in block]
            rows = [row[:-1] if len(row) == len(names) + 1 and not row[-1] else row for row in rows]
            bad = {row: f"column 'all': {len(cells)} cells, {len(names)} are needed"
                   for row, cells in enumerate(rows) if len(cells) != len(names)}  # fmt: skip
            if not block[-1][1].endswith('\n'):
                bad.setdefault(len(rows) - 1, "column 'all': the line has no end, so it may have been cut off")
            whole = [[''] * len(names) if row in bad else cells for row, cells in enumerate(rows)]
            part: dict[str, AnyArray] = {}
            # By row: the unused column of numbers with a word, and the first condition that is no number.
            words, gaps = dict[int, str](), dict[int, str]()
            for name, cells in zip(names, zip(*whole, strict=True), strict=True):
                text = name in mapping.texts()
                if not text or name in numbers:
                    points = [_with_point(cell) for cell in cells] if form.decimal == ',' else cells
                    values = np.array([number_of(cell) for cell in points])
                    text |= not numeric.setdefault(name, name in numbers or np.isfinite(values).mean() > NUMERIC)
                for row in np.flatnonzero(np.isnan(values)).tolist() if numeric.get(name) else ():
                    if name in conditions and cells[row].lower() not in BLANK:
                        gaps.setdefault(row, _reason(name, cells[row], form))
                    elif name in numbers and cells[row].lower() not in BLANK:
                        bad.setdefault(row, _reason(name, cells[row], form))
                    elif row not in bad and WORD.search(cells[row]) and cells[row].lower() not in NO_WORD:
                        words[row] = name
                _refuse_codes(name, () if text else cells, delimiter)
                if name in numbers:
                    _refuse_thousands(name, cells, form.decimal, whole_numbers)
                part[name] = _texts(cells) if text else values
            numbered = [number for number, _ in block]
            _refuse_other_rows(names, numbered, {row: rows[row] for row in bad}, words)
            left = sorted(gaps.keys() - bad.keys())
            reasons |= {numbered[row]: bad[row] for row in sorted(bad)[: max(0, EXAMPLES - len(reasons))]}
            gap_reasons |= {numbered[row]: gaps[row] for row in left[: max(0, EXAMPLES - len(gap_reasons))]}
            gapped.append(np.isin(np.arange(len(rows)), left))
            lines.append(np.array(numbered))
            junk.append(np.isin(np.arange(len(rows)), list(bad)))
            parts.append(part)
    if not parts:
        raise InvalidData('it has no rows below the names of its columns; choose files with samples')
    columns = {name: np.concatenate([part[name] for part in parts]) for name in names}
    marked = np.concatenate(junk)
    # A malformed row ends no slide: it has the texts of the one before.
    last = np.maximum.accumulate(np.where(marked, np.argmin(marked), np.arange(len(marked))))
    columns = {name: column[last] if column.dtype.kind == 'O' else column for name, column in columns.items()}
    yield TableFrame(
        place, columns, lines=np.concatenate(lines), junk=marked, reasons=reasons, gaps=np.concatenate(gapped),
        gap_reasons=gap_reasons,
    )  # fmt: skip


def _wanted(mapping: TableMapping, names: Sequence[str], delimiter: str) -> tuple[set[str], set[str]]:
    """Return the columns that the mapping wants as numbers, and those of them that are of a condition alone."""
    try:
        samples = {name for one in mapping.streams.values() for name in chosen(one.columns, names, mapping.roles())}
    except UnknownName as error:
        also = f"`delimiter` ('{delimiter}' here) and `skip_rows` under `format`, if the names of columns are others"
        raise InvalidData(f'{error}; see {also}') from error
    needed = {*samples, *mapping.texts(), *(one.time.column for one in mapping.streams.values())}
    return {*samples, *mapping.numbers()}, {*mapping.numbers()} - needed


def _refuse_other_rows(
    names: Sequence[str], numbered: Sequence[int], malformed: Mapping[int, Sequence[str]], words: Mapping[int, str]
) -> None:
    """Refuse rows of names or units: malformed ones with the name of a column, others with a word in unused numbers."""
    for row, cells in malformed.items():
        if {*cells} & {*names}:
            raise InvalidData(
                f'row {numbered[row]}: the names of the columns come again, {", ".join(cells[:5])}, so another '
                'recording may begin there; split the file there'
            )
    for row in sorted(words.keys() - malformed.keys()):
        raise InvalidData(
            f"row {numbered[row]}, column '{words[row]}': a word in a column of numbers that no key uses: the row may "
            f"be one of units or means; remove it, or read texts there by rows: {{{words[row]!r}: '*'}}"
        )


def _opened(opened: Any, form: FileFormat) -> tuple[Iterator[tuple[int, str]], str, list[str]]:
    """Return the lines of rows, the delimiter, and the names of the columns by the first row."""
    if found := [kind for begin, kind in OTHER_FILES.items() if opened.peek(4).startswith(begin)]:
        raise InvalidData(f'it is a file of {found[0]}, whatever its name; unpack it, or save it as CSV in UTF-8')
    if b'\0' in opened.peek():
        raise InvalidData('it is a file of bytes and not of text, whatever its name; save it as CSV in UTF-8')
    rest = _lines(opened, form)
    first = next(rest, (0, ''))
    if '\r' in first[1].rstrip('\r\n'):
        raise InvalidData('it ends lines with CR alone; save it with line ends of Unix or Windows')
    delimiter = form.delimiter or next((one for one in DELIMITERS if one in first[1]), ',')
    names = _names(_cells(first[1], delimiter), form, first[0])
    return rest if form.header else chain([first], rest), delimiter, names


def _names(cells: Sequence[str], form: FileFormat, line: int) -> list[str]:
    """Return the names of the columns by the first row."""
    if cells == ['']:
        raise InvalidData('it is empty, or has comments only; choose files with samples')
    if not cells:
        raise InvalidData('it has no columns; give a text file in UTF-8 with a row for each sample')
    if len(cells) > MAX_CHANNELS:
        raise InvalidData(f'it has {len(cells)} columns; at most {MAX_CHANNELS} are read, split it')
    if not form.header:
        return [str(number) for number in range(len(cells))]
    if twice := [name for name in cells if cells.count(name) > 1]:
        raise InvalidData(f"it has the column '{twice[0]}' twice; give each column a different name")
    if np.isfinite([number_of(name) for name in cells]).all():
        raise InvalidData(
            f'the first row is {", ".join(cells[:3])[:60]}, which are numbers and no names; write '
            f'format: {{header: false}} if they are samples, and format: {{header: false, skip_rows: {line}}} if they '
            'are names: columns then count from 0'
        )
    return list(cells)


def _reason(name: str, cell: str, form: FileFormat) -> str:
    hint = ''
    if DATE.match(cell):
        hint = '; dates are not read: write seconds, as t - t[0], or give `rate_hz` in place of `time`'
    elif form.decimal == ',' and math.isfinite(number_of(cell)):
        hint = '; if points are decimal, leave out `decimal` under `format`'
    elif math.isfinite(number_of(cell.replace(',', '.'))):
        hint = "; if commas are decimal, write format: {decimal: ','}"
    return f"column '{name}': '{cell[:40]}' is not a finite number{hint}"


def _refuse_codes(name: str, cells: Sequence[str], delimiter: str) -> None:
    """Refuse digits that may stand behind a decimal comma, where commas are delimiters, too."""
    digits = [cell for cell in cells if cell]
    padded = delimiter == ',' and any(len(cell) > 1 and cell[0] == '0' for cell in digits)
    if padded and all(map(str.isdigit, digits)) and digits != sorted(digits):
        raise InvalidData(
            f"the column '{name}' holds digits such as {digits[0]}, so commas may be decimal as well as between "
            'columns; save it with another delimiter'
        )


def _refuse_thousands(name: str, cells: Sequence[str], decimal: str, whole: set[str]) -> None:
    """Refuse a column whose signs may separate thousands: three digits follow each, and some cells have none.

    `whole` are the columns of which cells so far had none.
    """
    signed = [cell for cell in cells if (decimal or '.') in cell]
    if any(cell.lstrip('+-').isdigit() for cell in cells):
        whole.add(name)
    if name not in whole or not signed or not all(THOUSANDS[decimal or '.'].fullmatch(cell) for cell in signed):
        return
    if decimal == ',':
        raise InvalidData(
            f"column '{name}': the comma of '{signed[0]}' seems to separate thousands; save numbers without such commas"
        )
    if not decimal and len(signed) >= FEW_THOUSANDS:
        raise InvalidData(
            f"column '{name}': the point of '{signed[0]}' may be decimal or separate thousands, as three digits follow "
            "each one and other cells have none; write format: {decimal: '.'} if it is decimal, or save numbers "
            'without such points'
        )


def _lines(opened: Any, form: FileFormat) -> Iterator[tuple[int, str]]:
    """Yield number, from 1, and text of the lines that are neither empty nor comments; no UTF-8 is of Windows."""
    for number, raw in enumerate(opened, 1):
        try:
            line = raw.decode('utf-8-sig')
        except UnicodeDecodeError:
            line = raw.decode('cp1252', 'replace')
        comment = line.startswith('#') and line[:4].upper() != '#N/A'
        if number > form.skip_rows and line.strip() and not comment:
            yield number, line


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line without blanks around them; none of wrong quotes.

    Each line by itself: a quote that is never closed spoils one row and not the rest of the file.
    """
    line = line.rstrip('\r\n')
    if delimiter == ' ':
        return line.split()
    cells = line.split(delimiter)
    if '"' in line:
        try:
            cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
        except csv.Error:
            cells = []
    return [cell.strip() for cell in cells]


def _with_point(cell: str) -> str:
    return '?' if '.' in cell else cell.replace(',', '.')  # '1.234' may be a thousand


def _texts(cells: Sequence[str]) -> AnyArray:
    return np.array(['' if cell.lower() in NO_TEXT else cell[:MAX_TEXT] for cell in cells], dtype=object)


def number_of(cell: str) -> float:
    """Return the finite number that a cell is, NaN if it is none; Python would read '1_0' as 10."""
    try:
        value = math.nan if '_' in cell else float(cell)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


# ---- files of arrays

LFS = b'version https://git-lfs'


def _read_numpy(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    with open_regular(path) as opened:
        if path.suffix.lower() == '.npy':
            content = read_array(opened)  # nothing in a file is run
            yield from _frames([''], lambda _: content, place, mapping, take)
        else:
            archive = Arrays(opened, max(8 * MAX_VALUES, opened.seek(0, io.SEEK_END)))
            yield from _frames(archive.names, archive.__getitem__, place, mapping, take)


def _read_mat(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    from scipy.io import loadmat, whosmat  # noqa: PLC0415 – recording needs no scipy

    with open_regular(path) as opened:
        if opened.read(19).startswith(b'MATLAB 7.3 MAT-file'):  # HDF5 with all dimensions in reverse order
            yield from _read_hdf5(path, place, mapping, take, matlab=True)
            return
        opened.seek(0)
        found = whosmat(opened)
        if opaque := [name for name, shape, _ in found if shape is None]:
            raise InvalidData(
                f"'{opaque[0]}' is a table, timetable or object, which only MATLAB reads; save arrays there, such as "
                "those of table2struct(timetable2table(T), 'ToScalar', true)"
            )
        take(sum(math.prod(shape) for _, shape, _ in found))
        opened.seek(0)
        content = loadmat(opened, struct_as_record=True)
    arrays = dict(_members({name: value for name, value in content.items() if not name.startswith('__')}))
    take(sum(array.size for array in arrays.values()))
    yield from _frames(tuple(arrays), arrays.__getitem__, place, mapping, lambda _: None)


def _members(values: Mapping[str, Any], prefix: str = '') -> Iterator[tuple[str, AnyArray]]:
    """Yield arrays by their path: members of structs as 'run/acc', elements of arrays of these and cells from 1 on."""
    for name, value in values.items():
        if isinstance(value, np.ndarray) and value.dtype.kind in 'OV':
            for number, one in enumerate(value.ravel(order='F'), 1):
                parts = {part: one[part] for part in value.dtype.names} if value.dtype.names else {str(number): one}
                numbered = f'{number}/' if value.dtype.names and value.size > 1 else ''
                yield from _members(parts, f'{prefix}{name}/{numbered}')
        elif isinstance(value, np.ndarray) and value.dtype.kind in 'biufU':
            yield f'{prefix}{name}', value


def _read_hdf5(
    path: Path, place: str, mapping: TableMapping, take: Take, *, matlab: bool = False
) -> Iterator[TableFrame]:
    h5py = library(*HDF5)
    with open_regular(path) as opened, h5py.File(opened, 'r') as file:
        found: dict[str, Any] = {}

        def note(name: str, member: Any) -> None:
            """Keep a data set; the elements of references, as of cells and arrays of structs of MATLAB, from 1 on."""
            if len(found) > MAX_ARRAYS or name.count('/') > 20:
                raise InvalidData(f'it has more than {MAX_ARRAYS} data sets, or circles of them; split it')
            if isinstance(member, h5py.Group):
                for part, inner in member.items():
                    note(f'{name}/{part}', inner)
            elif h5py.check_ref_dtype(member.dtype) is h5py.Reference:
                take(member.size)
                folder, _, last = name.rpartition('/')
                # Of an array of structs each member has as many references: the number stands before its name.
                in_struct = matlab and folder and 'MATLAB_class' not in member.attrs
                for number, one in enumerate(np.asarray(member[()]).ravel(), 1):
                    if one:
                        note(f'{folder}/{number}/{last}' if in_struct else f'{name}/{number}', file[one])
            elif member.shape is not None and (member.dtype.kind != 'O' or h5py.check_string_dtype(member.dtype)):
                found[name] = member  # no empty one, and no lists

        def visit(name: str, member: Any) -> None:
            if isinstance(member, h5py.Dataset) and not name.startswith('#refs#'):
                note(name, member)

        file.visititems(visit)  # follows no link out of the file, and comes to each data set once

        def load(name: str) -> AnyArray:
            member = found[name]
            texts = h5py.check_string_dtype(member.dtype) is not None and member.dtype.kind == 'O'
            take(math.prod(max(1, length) for length in member.shape or ()) * (4 if texts else 1))
            if matlab and member.attrs.get('MATLAB_empty'):
                return np.empty(0)
            if matlab and member.attrs.get('MATLAB_class') == b'char':
                return np.array(''.join(map(chr, np.asarray(member[()]).ravel().tolist())))
            if texts:
                return _read_texts(member, max(1, MAX_TEXT_BYTES // os.fstat(opened.fileno()).st_size))
            _refuse_hidden(member, f"data set '{name}'")
            array = np.asarray(member[()])
            return array.T if matlab else array

        yield from _frames(list(found), load, place, mapping, lambda _: None)


def _read_texts(member: Any, step: int) -> AnyArray:
    """Return the texts of a data set, of each its beginning, read `step` at a time.

    Many of them may refer to one text as long as the file: all at once would have no limit.
    """
    texts, cells = member.asstr(errors='replace'), np.empty(member.shape, dtype=object)
    if not member.shape:
        cells[()] = texts[()][:MAX_TEXT]
        return cells
    for row in np.ndindex(member.shape[:-1]):
        for begin in range(0, member.shape[-1], step):
            part: tuple[Any, ...] = (*row, slice(begin, begin + step))
            cells[part] = [text[:MAX_TEXT] for text in texts[part]]
    return cells


def _refuse_hidden(member: Any, where: str) -> None:
    """Refuse a data set whose values are elsewhere, were never written (HDF5 reads zeros), or are to be scaled."""
    if member.is_virtual or member.external:
        raise InvalidData(f'{where} lies in another file; copy it into this one')
    counts = (-(-length // size) for length, size in zip(member.shape, member.chunks or (), strict=False))
    wanted = math.prod(counts) if member.chunks else int(member.size > 0)
    if (member.id.get_num_chunks() if member.chunks else int(member.id.get_storage_size() > 0)) < wanted:
        raise InvalidData(f'{where} has parts that were never written; save what was')
    if scaled := {'scale_factor', 'add_offset', '_FillValue', 'missing_value'} & {*member.attrs}:
        raise InvalidData(f'{where} has the attribute {min(scaled)}; save the values that are meant, without it')


def _read_wav(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    from scipy.io import wavfile  # noqa: PLC0415 – recording needs no scipy

    with open_regular(path) as opened, warnings.catch_warnings():
        warnings.simplefilter('ignore')  # chunks that it does not know
        _check_wav(opened)
        rate_hz, samples = wavfile.read(opened)
    if not 0 < rate_hz <= MAX_HZ:
        raise InvalidData(f'it has a sampling rate of {rate_hz} Hz; above 0 and at most {MAX_HZ:g} is allowed')
    if samples.dtype.kind == 'u':
        samples = (samples.astype(np.float64) - 128.0) / 128.0
    elif samples.dtype.kind == 'i':
        samples = samples / -float(np.iinfo(samples.dtype).min)  # full scale is 1
    for frame in _frames([''], lambda _: samples, place, mapping, take):
        yield replace(frame, rate_hz=float(rate_hz))


def _check_wav(file: Any) -> None:
    """Refuse a WAV file that was cut off or written to a pipe, or that holds several sounds."""
    size, sounds = file.seek(0, io.SEEK_END), 0
    file.seek(0)
    order = '>' if file.read(12)[:4] == b'RIFX' else '<'
    while len(head := file.read(8)) == 8:
        name, length = struct.unpack(f'{order}4sI', head)
        begin = file.tell()
        sounds += name == b'data'
        if name == b'fmt ':
            channels, frame_bytes = struct.unpack(f'{order}2xH8xH', file.read(14))
            if not 0 < channels <= MAX_CHANNELS or not frame_bytes or frame_bytes % channels:
                raise InvalidData(
                    f'it declares {channels} channels and {frame_bytes} bytes for a sample of all; from 1 to '
                    f'{MAX_CHANNELS} channels are read, each of as many bytes; save it again as a plain WAV file'
                )
        if name == b'data' and length > size - file.tell():
            raise InvalidData(
                f'it was cut off, or written to a pipe: it declares {length} bytes of sound and has '
                f'{size - file.tell()}; copy or save it again'
            )
        file.seek(begin + length + length % 2)
    if sounds != 1:
        raise InvalidData(f'it has {sounds} chunks of sound, one is needed; save it again as a plain WAV file')
    file.seek(0)


def _read_parquet(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    pyarrow, parquet = library('pyarrow', *PARQUET[1:]), library(*PARQUET)
    types = pyarrow.types
    with open_regular(path) as opened:
        schema = parquet.ParquetFile(opened).schema_arrow
        texts = [one.name for one in schema if types.is_string(one.type) or types.is_large_string(one.type)]
        opened.seek(0)
        file = parquet.ParquetFile(opened, read_dictionary=texts)  # each text once, however many rows have it
        if not file.metadata.num_rows:
            raise InvalidData('it has no rows; choose files with samples')
        columns: dict[str, AnyArray] = {}
        kinds = (
            types.is_timestamp, types.is_duration, types.is_integer, types.is_floating, types.is_boolean,
            types.is_dictionary,
        )  # fmt: skip
        wanted = [one.name for one in schema if one.name in texts or any(is_(one.type) for is_ in kinds)]
        take(file.metadata.num_rows * len(wanted))
        for name, column in zip(wanted, file.read(wanted, use_threads=False).columns, strict=True):
            if types.is_dictionary(column.type):
                one = column.unify_dictionaries().combine_chunks()
                one = one.chunk(0) if hasattr(one, 'chunk') else one
                words = np.array(['', *(str(text)[:MAX_TEXT] for text in one.dictionary.to_pylist())], dtype=object)
                columns[name] = words[1 + np.asarray(one.indices.fill_null(-1))]
            elif types.is_timestamp(column.type) or types.is_duration(column.type):
                one = np.asarray(column.to_numpy())
                columns[name] = one.astype(f'{one.dtype.kind}8[ns]').astype(np.int64)
            else:
                one = np.asarray(column.to_numpy())
                columns[name] = one.astype(np.float64) if one.dtype == object else one  # with gaps
        yield TableFrame(place, columns)


def _frames(
    names: Sequence[str], load: Callable[[str], AnyArray], place: str, mapping: TableMapping, take: Take
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
        raise InvalidData(f"it has no array of the form '{mapping.tables}'; it has {', '.join(names[:5]) or 'none'}")
    for table, (fields, members) in sorted(groups.items(), key=lambda one: natural(one[0])):
        within = f'{place}, {table}' if table else place
        arrays = {}
        for column, name in members.items():
            array = load(name)
            take(array.size * max(1.0, array.dtype.itemsize / 8))
            arrays[column] = np.swapaxes(array, -1, -2) if mapping.format.transpose and array.ndim > 1 else array
        yield TableFrame(
            within, {**_unfolded(arrays, _meant(mapping)), **{key: np.array(text) for key, text in fields.items()}}
        )


def natural(name: str) -> list[tuple[int, str]]:
    """Return the key by which names are in the order of the numbers in them: 'run2' comes before 'run10'."""
    parts = re.split(r'([0-9]+)', name)
    return [(int(part[:MAX_TEXT]) if number % 2 else 0, part) for number, part in enumerate(parts)]


def _unfolded(arrays: Mapping[str, AnyArray], meant: set[str]) -> dict[str, AnyArray]:
    """Return the columns of arrays, (n,) each, or () where there is one value."""
    columns: dict[str, AnyArray] = {}
    trials = next((array.shape[:2] for array in arrays.values() if array.ndim == 3), None)
    # The members of an array of records are arrays, too.
    plain: dict[str, AnyArray] = {}
    for name, array in arrays.items():
        for part in array.dtype.names or ('',):
            plain[_joined(name, part)] = array.squeeze()[part] if part else array
    for name, array in plain.items():
        if array.size == 1:
            columns[name] = array.reshape(())
        elif trials and array.ndim <= 2 and array.size == trials[0]:
            columns[name] = np.repeat(array.ravel(), trials[1])
        elif array.ndim == 1 or (array.ndim == 2 and (1 in array.shape or not array.size)):
            columns[name or '0'] = array.ravel()
        elif array.ndim not in (2, 3) or array.shape[-1] > MAX_CHANNELS:
            if not _is_meant(_joined(name, '0'), meant):
                continue
            raise InvalidData(
                f"'{name}' has the shape {array.shape}; (n_samples, n_channels) is needed, at most "
                f'{MAX_CHANNELS} channels; see `transpose` under `format`'
            )
        else:
            flat = array.reshape(-1, array.shape[-1])
            columns |= {_joined(name, str(number)): flat[:, number] for number in range(flat.shape[1])}
    if trials and TRIAL in columns:
        raise InvalidData(f"'{TRIAL}' is the number of a window here, and an array has this name; give it another")
    if trials:
        columns[TRIAL] = np.repeat(np.arange(trials[0]), trials[1])
    return columns


def _joined(name: str, part: str) -> str:
    return f'{name}.{part}' if name and part else name or part


# ---- bags of messages: each number of a message is a column, such as '/wrench/wrench.force.x'

OTHER_CLOCK_NS = NANOSECONDS  # stamps that differ more from the time of logging are of another clock


def _values(value: Any, path: str, found: dict[str, Any]) -> None:
    """Add every number and text of a message by its path, such as 'wrench.force.x' or 'data.3'."""
    if dataclasses.is_dataclass(value):
        for part in dataclasses.fields(value):
            if part.name not in ('stamp', '__msgtype__'):
                _values(getattr(value, part.name), _joined(path, part.name), found)
    elif isinstance(value, (np.ndarray, Sequence)) and not isinstance(value, str):
        for number, one in enumerate(value[: MAX_FIELDS + 1]):
            _values(one, f'{path}.{number}', found)
    else:
        found[path] = value
    if len(found) > MAX_FIELDS:
        raise InvalidData(f'it has more than {MAX_FIELDS} numbers')


def _fields_of(value: Any, msgtype: str) -> dict[str, Any]:
    """Return the numbers and texts of a message by name."""
    found: dict[str, Any] = {}
    if msgtype == 'sensor_msgs/msg/JointState':  # whose order may differ from bag to bag
        for kind in ('position', 'velocity', 'effort'):
            found |= {f'{kind}.{joint}': one for joint, one in zip(value.name, getattr(value, kind), strict=False)}
    else:
        if sum(axis.size > 1 for axis in getattr(getattr(value, 'layout', None), 'dim', ())) > 1:
            raise InvalidData('its array has several dimensions; republish it flat, or use `SlideDataset.from_arrays`')
        _values(value, '', found)
    return found


def _stamp_ns(stamp: Any, topic: str) -> int:
    """Return the time in a header, ns; 0 if there is none."""
    if stamp is None:
        return 0
    if not all(isinstance(getattr(stamp, part, None), int) for part in ('sec', 'nanosec')):
        raise InvalidData(
            f"'{topic}': header.stamp is {stamp!r:.80}; a builtin_interfaces/msg/Time of whole numbers is needed"
        )
    return int(stamp.sec * NANOSECONDS + stamp.nanosec)


def _read_bag(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    """Yield the one frame of a bag: the topics that the mapping names, each with its time.

    Times are those of the headers, or of logging where there are none, from the first message of the bag on. A device
    clock that differs from that of the recorder is corrected by it.
    """
    wanted = {column for stream in mapping.streams.values() for column in stream.columns}
    meant = _meant(mapping)
    topics = {name.rpartition('/')[0] or name for name in meant}
    kept: dict[str, set[str]] = {}
    names: dict[str, Any] = {}
    seen: dict[str, Any] = {}
    types: dict[str, Any] = {}
    rows: dict[str, list[dict[str, Any]]] = {}
    stamps: dict[str, list[tuple[int, int]]] = {}  # by the device and the recorder, ns

    def is_wanted(connection: Any) -> bool:
        seen[connection.topic] = connection
        return any(fnmatch.fnmatchcase(connection.topic, topic) for topic in topics)

    for message in read_foreign(path, is_wanted):
        name = message.topic
        if name not in types:
            types[name] = _types_of(seen[name])
        before = rows.setdefault(name, [])
        try:
            value = types[name].deserialize_cdr(message.data, message.msgtype)
            found = _fields_of(value, message.msgtype)
        except Exception as error:
            raise InvalidData(f"message {len(before)} of '{name}' cannot be read: {error}; record it again") from error
        fields = names.setdefault(name, found.keys())
        if found.keys() != fields:
            other = ', '.join(sorted(found.keys() ^ fields)[:5])
            raise InvalidData(f"message {len(before)} of '{name}' has other fields than the first: {other}")
        if name not in kept:  # what the mapping names, and what may be codes
            of = {part for part in found if _is_meant(f'{name}/{part}', meant)}
            kept[name] = (
                of | {part for part, one in found.items() if not isinstance(one, (float, np.floating))}
                if of
                else {*found}
            )
        found = {part: one for part, one in found.items() if part in kept[name]}
        take(2 * len(found))  # they take more than their values
        before.append(found)
        stamp_ns = _stamp_ns(getattr(getattr(value, 'header', None), 'stamp', None), name)
        stamps.setdefault(name, []).append((stamp_ns or message.log_ns, message.log_ns))
    if not rows:
        has = ', '.join(sorted(seen)) or 'none'
        fault = f'it has no topic that the mapping names ({", ".join(sorted(wanted))}); it has {has}'
        for name, topic in product(sorted(wanted), seen):
            if re.match(re.escape(topic) + r'(?![\w/])', name):
                fault = f"'{name}' names no field of the topic '{topic}'"
        raise InvalidData(f"{fault}; write columns as topic and field, such as '/wrench/wrench.force.x'")
    times_ns = _by_one_clock({name: np.array(pairs) for name, pairs in stamps.items()})
    begin_ns = next(iter(times_ns.values()))[0]
    columns: dict[str, AnyArray] = {}
    clocks: dict[str, str] = {}
    for name, parts in rows.items():
        clock = f'{name}/time'
        columns[clock] = (times_ns[name] - begin_ns) / NANOSECONDS
        for part, first in parts[0].items():
            values = [one[part] for one in parts]
            columns[f'{name}/{part}'] = np.array(values, dtype=object if isinstance(first, str) else None)
            clocks[f'{name}/{part}'] = clock
    yield TableFrame(place, columns, clocks=clocks)


def _meant(mapping: TableMapping) -> set[str]:
    columns = (column for stream in mapping.streams.values() for column in stream.columns)
    return {*columns, *mapping.numbers(), *mapping.texts()}


def _is_meant(name: str, patterns: Iterable[str]) -> bool:
    """Return whether a name, pattern or range of the mapping means a column."""
    ranges = (RANGE.fullmatch(one) for one in patterns)
    return any(fnmatch.fnmatchcase(name, one) for one in patterns) or any(
        one is not None and name.startswith(one[1]) for one in ranges
    )


def _types_of(connection: Any) -> Any:
    """Return the types of the messages of a topic by the definition that the bag stores, or else that of ROS 2."""
    types, msgtype = message_types(connection), connection.msgtype
    if msgtype.startswith('audio_common_msgs/'):
        raise InvalidData(f"'{connection.topic}' is sound whose messages do not tell the format; give a WAV file")
    if msgtype not in types.types:
        raise InvalidData(
            f"the messages of '{connection.topic}' are {msgtype}, whose definition is neither in the bag "
            'nor of ROS 2 itself; record it as MCAP, which stores definitions, or republish it as a standard message'
        )
    return types


def _by_one_clock(stamps: Mapping[str, AnyArray]) -> dict[str, AnyArray]:
    """Return the times of the messages of each topic, ns: as stamped, or by the recorder's clock if they have several.

    `stamps` are (n, 2), by the device and by the recorder.
    """
    ahead = {name: np.percentile(both[:, 0] - both[:, 1], (5, 50, 95)) for name, both in stamps.items()}
    usual = [middle for _, middle, _ in ahead.values()]
    if max(usual) - min(usual) <= OTHER_CLOCK_NS:
        return {name: both[:, 0] for name, both in stamps.items()}
    for name, (low, middle, high) in ahead.items():
        if high - low > OTHER_CLOCK_NS:
            raise InvalidData(
                f"topic '{name}': the stamps differ from the times of logging, which other topics have, by "
                f'{middle / NANOSECONDS:.4g} s, and that changes by {(high - low) / NANOSECONDS:.3g} s; record topics '
                'with stamps of one clock'
            )
    return {name: both[:, 0] - round(ahead[name][1]) for name, both in stamps.items()}


# ---- the kinds of files

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
OTHER_KINDS = {'.bag': 'it is a bag of ROS 1; convert it: rosbags-convert --src FILE.bag --dst FOLDER'}
# Libraries that a kind of file needs: module, what it reads, and the extra of this package that brings it.
HDF5 = ('h5py', 'HDF5 files', 'hdf5')
PARQUET = ('pyarrow.parquet', 'Parquet files', 'parquet')
# What `texture import` is given a mapping for, and the kinds of files which that means.
MAPPED: Mapping[str, Sequence[str]] = {'table': tuple(kind for kind in READERS if kind != BAG), 'bag': (BAG, '.bag')}


def kind_of(path: Path) -> str:
    """Return the kind of a file by its ending, or that it is a bag."""
    return BAG if is_bag(path) else path.suffix.lower()
