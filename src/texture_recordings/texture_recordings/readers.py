# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Thin readers: a file of anybody gives frames of named columns, or is refused before it takes much memory."""

from __future__ import annotations

import codecs
import csv
import dataclasses
import fnmatch
import io
import math
import re
import struct
import warnings
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.config import MB, library, open_regular, unknown_name
from texture_core.errors import InvalidData, MissingLibrary
from texture_core.types import MAX_HZ, NANOSECONDS, AnyArray, Array
from texture_recordings.bags import RawMessage, is_bag, message_types, read_foreign
from texture_recordings.mapping import FileFormat, TableMapping, template_fields

MAX_FILE_BYTES = 1000 * MB
MAX_VALUES = 8_000_000  # of 8 bytes, of one file; a larger file may have as many as it has bytes
EXAMPLES = 3
RANGE = re.compile(r'(\D*)(\d{1,9})-(?:\1)?(\d{1,9})')
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
    outside: Sequence[int] = ()  # lines above the first sample or below the last one, such as units or sums


@dataclass(frozen=True, eq=False)
class TableFrame:
    """Columns that belong together, by name, with what holds for all their rows."""

    place: str
    names: Sequence[str]
    read: Callable[[Sequence[str], Sequence[str]], Columns]
    fields: Mapping[str, str] = field(default_factory=dict)
    rate_hz: float = 0.0
    clocks: Mapping[str, str] = field(default_factory=dict)  # column → column of its times, s
    peek: Callable[[Sequence[str]], Mapping[str, AnyArray]] | None = None  # the first texts of columns
    trials: int = 0  # of arrays (n_trials, n_samples, n_channels)

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
    kind = kind_of(path)
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
NO_TEXT = frozenset(('nan', 'na', 'n/a', '#n/a', 'null'))  # 'none' may be a label
EDGE_ROWS = 20  # at the top and the end of a file, which may be units, sums or a row that was cut off
THOUSANDS = re.compile(r'[+-]?[1-9]\d{0,2}(,\d{3})+')
FEW_ROWS = 5
PEEK_ROWS = 2000


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
    if len(names) > MAX_CHANNELS:
        raise InvalidData(f"'{place}' has {len(names)} columns; at most {MAX_CHANNELS} are read, split it")
    if form.header and _are_samples(names):
        raise InvalidData(
            f"'{place}': the first row is {', '.join(names[:3])[:60]}, which are numbers and no names; write "
            'format: {header: false}, or skip fewer rows'
        )
    timed = all(stream.time.column for stream in mapping.streams.values())

    def peek(wanted: Sequence[str]) -> Mapping[str, AnyArray]:
        with _lines(path, form) as lines:
            rows = [_row(_cells(line, form.delimiter), len(names)) for _, line in islice(lines, 1, PEEK_ROWS)]
        return {name: np.array([row[names.index(name)] for row in rows if row]) for name in wanted}

    yield TableFrame(place, names, partial(_csv_columns, path, place, form, names, take, timed), peek=peek)


def _are_samples(names: Sequence[str]) -> bool:
    """Return whether the names of columns are numbers, and not such that count up."""
    values = np.array([number_of(name) for name in names])
    plain = all(name.isdigit() for name in names) and (np.diff(values) == 1).all()
    return bool(np.isfinite(values).all()) and not plain


def _csv_columns(  # noqa: PLR0917 – bound one after the other
    path: Path, place: str, form: FileFormat, names: Sequence[str], take: Take, timed: bool,
    numbers: Sequence[str], texts: Sequence[str],
) -> Columns:  # fmt: skip
    at = {name: number for number, name in enumerate(names)}
    blocks: list[dict[str, AnyArray]] = []
    reasons: dict[int, str] = {}
    first: list[list[str] | None] = []
    last: list[list[str] | None] = []
    with _lines(path, form) as lines:
        if form.header:
            next(lines, None)
        while block := list(islice(lines, BLOCK_ROWS)):
            take(len(block) * (len(numbers) + 2 * len(texts)))
            rows = [_row(_cells(line, form.delimiter), len(names)) for _, line in block]
            read: dict[str, AnyArray] = {'': np.array([number for number, _ in block])}
            _refuse_repeated_names(rows, names, block, place, timed=timed)
            if not blocks and form.delimiter == ',':
                _refuse_split_decimals(rows, names, place)
            junk = np.array([row is None for row in rows])
            found = {
                block[index][0]: f"column 'all': {len(_cells(block[index][1], form.delimiter))} cells, {len(names)} "
                'are needed' for index in np.flatnonzero(junk)[:EXAMPLES].tolist()
            }  # fmt: skip
            for name in numbers:
                read[f'number {name}'] = values = _parsed(rows, at[name], form.decimal)
                if form.decimal == ',':
                    _refuse_thousands(rows, at[name], f"'{place}', column '{name}'")
                for index in np.flatnonzero(np.isnan(values)).tolist():
                    cell = rows[index][at[name]] if rows[index] else ''
                    if cell.lower() in BLANK:
                        continue
                    junk[index] = True
                    if len(found) < 2 * EXAMPLES:
                        reason = f"column '{name}': '{cell[:40]}' is not a finite number"
                        if form.decimal == '.' and math.isfinite(number_of(cell.replace(',', '.'))):
                            reason += "; if commas are decimal, write format: {decimal: ','}"
                        found.setdefault(block[index][0], reason)
            reasons |= dict(sorted(found.items())[: EXAMPLES - len(reasons)])
            # A row without any number, such as names or units that a logger wrote again, is none of a sample: its texts
            # are none of a sample, too, and a slide must not end at them.
            empty = junk & np.logical_and.reduce([np.isnan(read[f'number {name}']) for name in numbers])
            for name in texts:
                read[f'text {name}'] = np.array(
                    [
                        None if row is None or left_out else _text(row[at[name]])
                        for row, left_out in zip(rows, empty, strict=True)
                    ]
                )
            blocks.append({**read, 'junk': junk, 'empty': empty})
            first, last = first or rows[:EDGE_ROWS], [*last, *rows][-EDGE_ROWS:]
    if not blocks:
        raise InvalidData(f"'{place}' has no rows below the names of its columns; choose files with samples")
    whole = {key: np.concatenate([read[key] for read in blocks]) for key in blocks[0]}
    begin, end = _edges(first, last, whole['empty'], form.decimal, timed=timed, cut=_is_cut(path, last))
    inside, outside = slice(begin, end), [*whole[''][:begin].tolist(), *whole[''][end:].tolist()]
    return Columns(
        {name: whole[f'number {name}'][inside] for name in numbers},
        {name: _without_gaps(whole[f'text {name}'][inside]) for name in texts},
        whole[''][inside], whole['junk'][inside],
        {line: reason for line, reason in reasons.items() if line not in outside}, outside,
    )  # fmt: skip


def _edges(
    first: Sequence[list[str] | None],
    last: Sequence[list[str] | None],
    empty: AnyArray,
    decimal: str,
    *,
    timed: bool,
    cut: bool,
) -> tuple[int, int]:
    """Return which rows are samples, without rows such as units at the top and sums at the end.

    Such a row has no number in any column that is read, or, where no time tells, a text in a column of numbers.
    """
    count = len(empty)
    whole = [row for row in (*first, *last) if row]
    if not whole or empty.sum() > 0.5 * count:
        return 0, count

    def is_number(cell: str) -> bool:
        return math.isfinite(number_of(cell.replace(decimal, '.')))

    numeric = [at for at in range(len(whole[0])) if sum(is_number(row[at]) for row in whole) > 0.7 * len(whole)]

    def odd(row: list[str] | None) -> bool:
        cells = [row[at] for at in numeric] if row else []
        return any(cell.lower() not in BLANK and cell[:1].isalpha() and not is_number(cell) for cell in cells)

    begin, end = 0, count - cut
    few = 0 if timed else FEW_ROWS
    while begin < min(len(first), count) and (empty[begin] or (begin < few and odd(first[begin]))):
        begin += 1
    while end > max(begin, count - len(last)) and (
        empty[end - 1] or (count - end < few and odd(last[end - 1 - count]))
    ):
        end -= 1
    return begin, end


def _is_cut(path: Path, last: Sequence[list[str] | None]) -> bool:
    """Return whether the last number of a file has fewer digits than those before, and the line has no end."""
    with open_regular(path) as opened:
        opened.seek(-1, io.SEEK_END)
        ended = opened.read() in (b'\n', b'\r', b'\0')
    digits = [len(row[-1].partition('.')[2]) for row in last if row]
    return not ended and len(digits) > 5 and len(set(digits[:-1])) == 1 and digits[-1] < digits[0]


def _text(cell: str) -> str:
    return '' if cell.lower() in NO_TEXT else cell[:MAX_TEXT].replace('\0', '')


def _refuse_repeated_names(
    rows: Sequence[list[str] | None], names: Sequence[str], block: Sequence[Line], place: str, *, timed: bool
) -> None:
    """Refuse a file of which a part has other columns, or of which parts follow each other without any time."""
    known = frozenset(names)
    for (line, _), row in zip(block, rows, strict=True):
        if not row or known.isdisjoint(row) or any(math.isfinite(number_of(cell)) for cell in row):
            continue
        again = [cell.lstrip('\ufeff') for cell in row]
        if again != list(names) and len(known.intersection(again)) > 0.3 * len(names):
            raise InvalidData(
                f"'{place}', row {line}: names of columns come again, and are {', '.join(again[:5])} from there on; "
                'split the file there'
            )
        if again == list(names) and not timed:
            raise InvalidData(
                f"'{place}', row {line}: the names of the columns come again, so another recording may begin there; "
                'split the file, or name the column of time'
            )


def _refuse_split_decimals(rows: Sequence[list[str] | None], names: Sequence[str], place: str) -> None:
    """Refuse columns that hold the decimals of the column before, as of commas that are decimal and delimiters."""
    for at in range(1, len(names)):
        pairs = [(row[at - 1], row[at]) for row in rows if row]
        widths = {len(cell) for _, cell in pairs}
        if len(pairs) < 10 or len(widths) > 1 or max(widths) < 2:
            continue
        digits = all(cell.isdigit() and before.lstrip('+-').isdigit() for before, cell in pairs)
        counts = all(one[1] <= other[1] for one, other in pairwise(pairs))
        if digits and not counts and any(cell.startswith('0') for _, cell in pairs):
            raise InvalidData(
                f"'{place}': the column '{names[at]}' holds digits such as {pairs[0][1]}, so commas may be decimal as "
                'well as between columns; save it with another delimiter'
            )


def _refuse_thousands(rows: Sequence[list[str] | None], at: int, where: str) -> None:
    """Refuse commas that separate thousands where they are read as decimal."""
    cells = [row[at] for row in rows if row]
    commas = [cell for cell in cells if ',' in cell]
    if commas and len(commas) < len(cells) and all(THOUSANDS.fullmatch(cell) for cell in commas):
        raise InvalidData(
            f"{where}: the comma of '{commas[0]}' seems to separate thousands; save numbers without such commas"
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
                and not (form.comment and bare.startswith(form.comment) and bare[:4].upper() != '#N/A')
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
    cells = ['nan' if row is None else row[place] for row in rows]
    if decimal != '.':  # '1.234' may be a thousand
        cells = ['?' if '.' in cell else cell.replace(decimal, '.') for cell in cells]
    try:
        values = np.array([math.nan if '_' in cell else float(cell) for cell in cells])
    except ValueError:
        values = np.array([number_of(cell) for cell in cells])
    values[~np.isfinite(values)] = np.nan
    return values


def number_of(cell: str) -> float:
    """Return the number that a cell is, NaN if it is none; Python would read '1_0' as 10."""
    try:
        return math.nan if '_' in cell else float(cell)
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
        take(math.prod(max(1, length) for length in shape) * max(1.0, dtype.itemsize / 8))

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


# The flags of an array of cells (1), structs (2) or objects (3) and its two sizes, by the order of bytes.
NESTED = {
    '<': re.compile(rb'\x06\0\0\0\x08\0\0\0[\1-\3].{3}.{4}\x05\0\0\0\x08\0\0\0(.{8})', re.DOTALL),
    '>': re.compile(rb'\0\0\0\x06\0\0\0\x08.{3}[\1-\3].{4}\0\0\0\x05\0\0\0\x08(.{8})', re.DOTALL),
}


def _unpacked_bytes(file: Any, place: str) -> int:
    """Return how many bytes the variables of a MATLAB file (version 5 to 7) unpack to, without keeping them."""
    file.seek(124)
    order = '<' if file.read(4)[2:] == b'IM' else '>'
    total = arrays = 0
    before = b''
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
                for match in NESTED[order].finditer(before + part):
                    count = math.prod(struct.unpack(f'{order}2i', match[1]))
                    if count > MAX_ARRAYS:
                        raise InvalidData(
                            f"'{place}' declares an array of {count} cells or structs; at most "
                            f'{MAX_ARRAYS} are read, split it'
                        )
                before = part[-64:]
                packed = unpacker.unconsumed_tail if kind == 15 else b''
        file.seek(after)
    from scipy.io import whosmat  # noqa: PLC0415 – recording needs no scipy

    file.seek(0)
    listed = whosmat(file)
    for name, shape, kind in listed:
        if kind != 'sparse' and math.prod(shape) > max(MAX_VALUES, total):
            raise InvalidData(
                f"'{place}' declares {math.prod(shape) / 1e6:.0f} million values of '{name}', and does not contain them"
            )
    nested = any(kind in ('cell', 'struct', 'object') for _, _, kind in listed)
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
            declared = math.prod(max(1, length) for length in member.shape or ())
            take(declared * max(1.0, member.dtype.itemsize / 8) * (4 if texts else 1))
            if matlab and member.attrs.get('MATLAB_empty'):
                return np.empty(0)
            if matlab and member.attrs.get('MATLAB_class') == b'char':
                return np.array(''.join(map(chr, np.asarray(member[()]).ravel().tolist())))
            if not texts:
                array = _scaled(member, np.asarray(member[()]))
                return array.T if matlab else array
            cells = member.asstr(errors='replace')
            if not member.shape:
                return np.array(cells[()][:MAX_TEXT])
            return np.array([text[:MAX_TEXT] for text in np.ravel(cells[()])]).reshape(member.shape)

        yield from _frames(list(found), load, place, mapping)


SCALED = {'scale_factor': 1.0, 'add_offset': 0.0}  # attributes by the CF conventions


def _scaled(member: Any, array: AnyArray) -> AnyArray:
    """Return the values of a data set as its attributes scale them, NaN where none was ever written."""
    if array.dtype.kind not in 'iuf' or not array.size:
        return array
    missing = np.zeros(array.shape, dtype=bool)
    if member.chunks:
        stored = member.id.get_num_chunks()
        if stored < math.prod(-(-length // size) for length, size in zip(member.shape, member.chunks, strict=True)):
            missing[:] = True
            for number in range(stored):
                begin = member.id.get_chunk_info(number).chunk_offset
                missing[tuple(slice(a, a + size) for a, size in zip(begin, member.chunks, strict=True))] = False
    elif not member.id.get_storage_size():
        missing[:] = True
    for name in ('_FillValue', 'missing_value'):
        if name in member.attrs:
            missing |= np.isin(array, np.ravel(member.attrs[name]))
    scale, offset = (float(np.ravel(member.attrs.get(name, plain))[0]) for name, plain in SCALED.items())
    if not missing.any() and (scale, offset) == (1.0, 0.0):
        return array
    return np.where(missing, np.nan, array * scale + offset)


def _check_wav(file: Any, place: str) -> None:
    """Refuse a WAV file that was cut off, or that holds several sounds."""
    size = file.seek(0, io.SEEK_END)
    file.seek(0)
    order = '>' if file.read(12)[:4] == b'RIFX' else '<'
    sounds = 0
    while len(head := file.read(8)) == 8:
        name, length = struct.unpack(f'{order}4sI', head)
        left = size - file.tell()
        if name == b'data' and length == 2**32 - 1:  # of a program that wrote to a pipe
            sounds += 1
            break
        if name == b'data' and length > left:
            raise InvalidData(
                f"'{place}' was cut off: it declares {length} bytes of sound and has {left}; copy it again"
            )
        sounds += name == b'data'
        file.seek(length + length % 2, io.SEEK_CUR)
    if sounds != 1:
        raise InvalidData(f"'{place}' has {sounds} chunks of sound, one is needed; save it again as a plain WAV file")
    file.seek(0)


def _read_wav(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    from scipy.io import wavfile  # noqa: PLC0415 – recording needs no scipy

    with open_regular(path) as opened, warnings.catch_warnings():
        warnings.simplefilter('ignore')  # chunks that it does not know
        _check_wav(opened, place)
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
    listed, numbered = {}, [[*fields.values()] for fields, _ in groups.values()]
    single = mapping.tables and all(len(one) == 1 and one[0].isdigit() for one in numbered)
    ordered = sorted(int(one[0]) for one in numbered) if single else [-1]
    base = ordered[0]  # elements count from 0 or 1
    if base in (0, 1) and ordered == [*range(base, base + len(ordered))]:
        lists = {name: load(name).ravel() for name in names if name not in grouped and '/' not in name}
        listed = {name: array for name, array in lists.items() if len(array) == len(groups)}
    for table, (fields, members) in sorted(groups.items()):
        within = f'{place}, {table}' if table else place
        arrays = {column: _arranged(load(name), mapping.format, within) for column, name in members.items()}
        columns, constants = _unfolded_columns(arrays, within)
        number = int(next(iter(fields.values()))) - base if listed else 0
        of_list = {name: str(array[number])[:MAX_TEXT] for name, array in listed.items()}
        yield TableFrame(
            within, tuple(columns), partial(columns_of, columns, within), {**of_list, **constants, **fields},
            peek=partial(_first_texts, columns),
            trials=max((array.shape[0] for array in arrays.values() if array.ndim == 3), default=0),
        )  # fmt: skip


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
            columns |= _parts(array, name)
        elif array.size == 1:
            constants[name] = str(array.item())[:MAX_TEXT]
        elif trials and array.ndim <= 2 and array.size == trials[0]:
            columns[name] = np.repeat(array.ravel(), trials[1])
        elif array.ndim == 1 or (array.ndim == 2 and (1 in array.shape or not array.size)):
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


def _first_texts(columns: Mapping[str, AnyArray], wanted: Sequence[str]) -> Mapping[str, AnyArray]:
    return {name: _texts(columns[name][:PEEK_ROWS]) for name in wanted}


def _parts(array: AnyArray, name: str) -> dict[str, AnyArray]:
    """Return the members of an array of records as columns, of several values in a row a column for each."""
    found: dict[str, AnyArray] = {}
    rows = array.size if array.size in array.shape else len(array)
    for part in array.dtype.names or ():
        flat = array[part].reshape(rows, -1)
        if flat.shape[1] > MAX_CHANNELS:
            raise InvalidData(f"'{_joined(name, part)}' has {flat.shape[1]} values in a row; split it")
        one = flat.shape[1] == 1
        found |= {_joined(name, part if one else f'{part}.{k}'): flat[:, k] for k in range(flat.shape[1])}
    return found


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
    if array.dtype.kind == 'f':
        known = np.isfinite(array)
        whole = np.array_equal(array[known], np.round(array[known]))  # 3.0 is meant as 3
        return np.where(known, np.where(known, array, 0.0).astype(np.int64 if whole else float).astype(str), '')
    return array.astype(str)


# --------------------
# Bags of messages: each number of a message is a column, such as '/wrench/wrench.force.x'.

MAX_FIELDS = 2000  # of one message
Rows = Mapping[str, AnyArray]  # name → values of one message, (n,) each; n > 1 where it holds consecutive samples
BROKEN = (struct.error, UnicodeDecodeError, ValueError, IndexError, AssertionError, KeyError, TypeError)
TIME, FRAME = 'time', 'header.frame_id'


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


MP3_MESSAGES = 5  # that begin as MP3 does, which plain sound does not
TIME_AXES = frozenset(('sample', 'samples', 'time', 'times', 't', 'frame', 'frames'))
CHANNEL_AXES = frozenset((
    'channel', 'channels', 'taxel', 'taxels', 'sensor', 'sensors', 'axis', 'axes', 'electrode', 'electrodes',
))  # fmt: skip
MP3 = frozenset((0xFBFF - 2**16, 0xFAFF - 2**16, 0xF3FF - 2**16, 0xF2FF - 2**16))  # with which its parts begin
PLANE = frozenset(('height', 'width', 'row', 'rows', 'column', 'columns', 'col', 'cols', 'x', 'y'))


def _by_samples(data: AnyArray, axes: Sequence[Any]) -> AnyArray:
    """Return an array of two dimensions as (n_samples, n_channels), as their labels name them."""
    first, second = (axis.label.strip().lower() for axis in axes)
    table: AnyArray = data.reshape([axis.size for axis in axes])
    if first in TIME_AXES or second in CHANNEL_AXES:
        return table
    if second in TIME_AXES or first in CHANNEL_AXES:
        return table.T
    if {first, second} <= PLANE or len(table) == 1:
        return table.reshape(1, -1)  # a sample of a plane of taxels
    raise InvalidData(
        f"its dimensions are named '{first}' and '{second}', which does not tell samples from channels; republish it "
        "with the labels 'samples' and 'channels'"
    )


def _rows_of(value: Any, msgtype: str) -> Rows:
    """Return the values of a message by name; of sound and of arrays with two dimensions, consecutive rows."""
    if msgtype == 'sensor_msgs/msg/JointState':
        kinds = ('position', 'velocity', 'effort')
        return {
            f'{kind}.{joint}': np.array([number])
            for kind in kinds for joint, number in zip(value.name, getattr(value, kind), strict=False)
        }  # fmt: skip
    if msgtype in ('std_msgs/msg/Float32MultiArray', 'std_msgs/msg/Float64MultiArray'):
        data = value.data[value.layout.data_offset :]
        table = _by_samples(data, value.layout.dim) if len(value.layout.dim) == 2 else data[None]
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

    Times are those of the headers, or of logging where there are none, from the first message of the bag on. A device
    clock that differs from that of the recorder is corrected by it.
    """
    columns_of_streams = [column for stream in mapping.streams.values() for column in stream.columns]
    wanted = {*columns_of_streams, *mapping.numbers(), *mapping.texts()}
    topics: dict[str, _Topic] = {}
    seen: dict[str, Any] = {}

    def chosen(connection: Any) -> bool:
        seen[connection.topic] = connection
        return any(fnmatch.fnmatchcase(connection.topic, name.rpartition('/')[0] or name) for name in wanted)

    for message in read_foreign(path, chosen):
        if message.topic not in topics:
            topics[message.topic] = _Topic(message.topic, seen[message.topic], place)
        topics[message.topic].add(message, take)
    _agree_on_clock(topics.values())
    first_ns = next((topic.first_ns for topic in topics.values()), 0)
    columns: dict[str, AnyArray] = {}
    clocks: dict[str, str] = {}
    for name, topic in topics.items():
        clock = f'{name}/{TIME}'
        columns[clock] = topic.time_s(first_ns)
        if f'{name}/{FRAME}' in wanted:
            columns[f'{name}/{FRAME}'], clocks[f'{name}/{FRAME}'] = topic.frame_ids(), clock
        else:
            topic.refuse_frames()
        for part, array in topic.columns().items():
            columns[f'{name}/{part}'] = array
            clocks[f'{name}/{part}'] = clock
    if not columns:
        raise InvalidData(
            f"'{place}' has no topic that the mapping names ({', '.join(sorted(wanted))}); it has "
            f"{', '.join(sorted(seen)) or 'none'}; write columns as topic and field, such as '/wrench/wrench.force.x'"
        )
    yield TableFrame(place, tuple(columns), partial(columns_of, columns, place), clocks=clocks)


OTHER_CLOCK_NS = NANOSECONDS  # stamps that differ more from the time of logging are of another clock


def _agree_on_clock(topics: Iterable[_Topic]) -> None:
    """Correct the clocks of devices by the times of logging where those of topics differ."""
    ahead = {topic: topic.ahead_ns() for topic in topics}
    usual = [usual_ns for usual_ns, _ in ahead.values()]
    if not usual or max(usual) - min(usual) <= OTHER_CLOCK_NS:
        return
    for topic, (usual_ns, change_ns) in ahead.items():
        if change_ns > OTHER_CLOCK_NS:
            raise InvalidData(
                f'{topic.where}: the stamps differ from the times of logging, which other topics have, by '
                f'{usual_ns / NANOSECONDS:.4g} s, and that changes by {change_ns / NANOSECONDS:.3g} s; record topics '
                'with stamps of one clock'
            )
        topic.shift(-usual_ns)


class _Topic:
    """The messages of one topic as columns, read by the definition that the bag stores, or else that of ROS 2."""

    def __init__(self, name: str, connection: Any, place: str) -> None:
        self._types, self._msgtype, self._name, self._place = message_types(connection), connection.msgtype, name, place
        if self._msgtype not in self._types.types:
            raise InvalidData(
                f"'{place}': the messages of '{name}' are {self._msgtype}, whose definition is neither in the bag nor "
                'of ROS 2 itself; record it as MCAP, which stores definitions, or republish it as a standard message'
            )
        self.where = f"'{place}', topic '{name}'"
        self._rows: list[Rows] = []
        self._stamps_ns: list[int] = []
        self._ahead_ns: list[int] = []  # of the time of logging
        self._counts: list[int] = []
        self._frames: list[str] = []

    @property
    def first_ns(self) -> int:
        """Time of the first message."""
        return self._stamps_ns[0]

    def ahead_ns(self) -> tuple[int, int]:
        """Return by how much stamps are ahead of logging, and by how much that changes."""
        low, usual, high = np.percentile(self._ahead_ns, (5, 50, 95)).tolist()
        return round(usual), round(high - low)

    def shift(self, by_ns: int) -> None:
        """Bring all times forward."""
        self._stamps_ns = [stamp_ns + by_ns for stamp_ns in self._stamps_ns]

    def add(self, message: RawMessage, take: Take) -> None:
        """Add a message."""
        where = f"'{self._place}': message {len(self._rows)} of '{self._name}'"
        try:
            value = self._types.deserialize_cdr(message.data, self._msgtype)
            rows = _rows_of(value, self._msgtype)
        except InvalidData as error:
            raise InvalidData(f'{where}: {error}') from error
        except BROKEN as error:
            raise InvalidData(f'{where} is damaged: {error}; record it again') from error
        audio = self._msgtype.startswith('audio_common_msgs/msg/AudioData') and len(self._rows) == MP3_MESSAGES
        if audio and all(round(32768 * one['data'][0]) in MP3 for one in self._rows if len(one['data'])):
            raise InvalidData(f'{where}: it is MP3 and no plain sound; republish it decoded, in the format wave')
        if self._rows and rows.keys() != self._rows[0].keys():
            other = ', '.join(sorted(rows.keys() ^ self._rows[0].keys())[:5])
            raise InvalidData(f'{where} has other fields than the first: {other}')
        self._rows.append(rows)
        self._counts.append(max((len(array) for array in rows.values()), default=0))
        take(10 * len(rows) + sum(len(array) for array in rows.values()))  # small arrays take more than their values
        stamp = getattr(getattr(value, 'header', None), 'stamp', None)
        stamped_ns = stamp.sec * NANOSECONDS + stamp.nanosec if stamp else 0
        self._stamps_ns.append(stamped_ns or message.log_ns)
        self._ahead_ns.append(self._stamps_ns[-1] - message.log_ns)
        self._frames.append(getattr(getattr(value, 'header', None), 'frame_id', ''))

    def frame_ids(self) -> AnyArray:
        """Return the frame of each row."""
        return np.repeat(np.array(self._frames), self._counts)

    def refuse_frames(self) -> None:
        """Refuse messages of several frames, which are of several sensors."""
        frames = sorted({*self._frames})
        if len(frames) > 1:
            raise InvalidData(
                f'{self.where}: its messages have the frames {", ".join(frames[:4])}, so several sensors may publish '
                f"there; choose one by rows: {{'{self._name}/{FRAME}': '{frames[0]}'}}"
            )

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


def kind_of(path: Path) -> str:
    """Return the kind of a file by its ending, or that it is a bag."""
    return BAG if is_bag(path) else path.suffix.lower()
