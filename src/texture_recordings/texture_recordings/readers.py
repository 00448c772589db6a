# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Thin readers: a file of anybody gives frames of named columns, or is refused before it takes much memory."""

from __future__ import annotations

import csv
import dataclasses
import fnmatch
import io
import math
import re
import struct
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.config import MB, Arrays, library, open_regular, read_array, unknown_name
from texture_core.errors import InvalidData, MissingLibrary
from texture_core.types import MAX_HZ, NANOSECONDS, AnyArray, Array
from texture_recordings.bags import is_bag, message_types, read_foreign
from texture_recordings.mapping import FileFormat, TableMapping, template_fields

MAX_FILE_BYTES = 1000 * MB
MAX_VALUES = 8_000_000  # of 8 bytes, of one file; a larger file may have as many as it has bytes
EXAMPLES = 3
RANGE = re.compile(r'(\D*)(\d{1,9})-(?:\1)?(\d{1,9})')
MAX_RANGE = 10_000
TRIAL = 'trial'  # number of the first axis of arrays (n_trials, n_samples, n_channels)
MAX_ARRAYS = 50_000  # data sets of an HDF5 file
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
    read: Callable[..., Columns]  # takes names of numbers and of texts, and how many of the first rows; all by default
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
    kind = kind_of(path)
    if kind in OTHER_KINDS:
        raise InvalidData(f"'{place}' {OTHER_KINDS[kind]}")
    with _reading(place):
        if path.is_dir():
            size = sum(one.stat().st_size for one in path.iterdir() if one.is_file())
        else:
            with open_regular(path, MAX_FILE_BYTES) as file:
                size = file.seek(0, io.SEEK_END)
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


@contextmanager
def _reading(place: str) -> Iterator[None]:
    """Refuse a file whatever a library raises, which depends on the byte that is wrong."""
    try:
        yield
    except (InvalidData, MissingLibrary):
        raise
    except Exception as error:
        reason = (str(error) or type(error).__name__)[:300]
        raise InvalidData(f"'{place}' cannot be read: {reason}; save it again") from error


def _guarded(read: Callable[..., Columns], place: str, *wanted: Any) -> Columns:
    with _reading(place):
        return read(*wanted)


# ---- text files

Line = tuple[int, str]  # its number in the file, from 1, and its text with the end of the line
NO_TEXT = frozenset(('nan', 'na', 'n/a', '#n/a', 'null'))  # 'none' may be a label
BLANK = frozenset(('', 'nan', 'na', 'null', 'none'))
THOUSANDS = re.compile(r'[+-]?[1-9]\d{0,2}(,\d{3})+')
NUMERIC = 0.9  # share of numbers in a column of numbers


def _read_csv(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    form = mapping.format
    with open_regular(path) as opened:
        _, first = next(_lines(opened, form), (0, ''))
    form = replace(form, delimiter=form.delimiter or next((one for one in DELIMITERS if one in first), ','))
    cells = _cells(first, form.delimiter)
    if not first or '\0' in first:
        raise InvalidData(f"'{place}' has no columns; give a text file in UTF-8 with a row for each sample")
    names = cells if form.header else [str(number) for number in range(len(cells))]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InvalidData(f"'{place}' has the column '{twice}' twice; give each column a different name")
    if len(names) > MAX_CHANNELS:
        raise InvalidData(f"'{place}' has {len(names)} columns; at most {MAX_CHANNELS} are read, split it")
    values = np.array([number_of(name) for name in names])
    counted = all(name.isdigit() for name in names) and (np.diff(values) == 1).all()
    if form.header and np.isfinite(values).all() and not counted:
        raise InvalidData(
            f"'{place}': the first row is {', '.join(names[:3])[:60]}, which are numbers and no names; write "
            'format: {header: false}, or skip fewer rows'
        )
    yield TableFrame(place, names, partial(_csv_columns, path, place, form, names, take))


def _csv_columns(  # noqa: PLR0917 – bound one after the other
    path: Path, place: str, form: FileFormat, names: Sequence[str], take: Take,
    numbers: Sequence[str], texts: Sequence[str], most: int | None = None,
) -> Columns:  # fmt: skip
    numeric = [name for name in names if name not in texts]
    blocks: list[dict[str, AnyArray]] = []
    reasons: dict[int, str] = {}
    with open_regular(path) as opened:
        lines = islice(_lines(opened, form), int(form.header), None if most is None else most + form.header)
        while block := list(islice(lines, BLOCK_ROWS)):
            take(len(block) * (len(numbers) + 2 * len(texts)))
            cells = [_cells(line, form.delimiter) for _, line in block]
            cells = [row[:-1] if len(row) == len(names) + 1 and not row[-1] else row for row in cells]
            whole = np.array([len(row) == len(names) for row in cells])
            whole[-1] &= block[-1][1].endswith('\n')  # or the row may have been cut off
            rows = [row if good else [''] * len(names) for row, good in zip(cells, whole.tolist(), strict=True)]
            columns = dict(zip(names, zip(*rows, strict=True), strict=True))
            _refuse_commas(columns, numbers, form, place)
            parsed = {name: _parsed(columns[name], form.decimal) for name in {*numeric, *numbers}}
            if not blocks:
                numeric = [name for name in numeric if np.isfinite(parsed[name]).mean() > NUMERIC]
            # A row is malformed if it has other cells than the first one, or a text for a number that is wanted.
            junk, odd = ~whole, ~whole
            found = {
                row: f"column 'all': {len(cells[row])} cells, {len(names)} are needed"
                if len(cells[row]) != len(names)
                else "column 'all': the line has no end, so it may have been cut off"
                for row in np.flatnonzero(junk)[:EXAMPLES].tolist()
            }
            for name, values in parsed.items():
                for row in np.flatnonzero(np.isnan(values)).tolist():
                    cell = columns[name][row]
                    if cell.lower() in BLANK:
                        continue
                    odd[row] |= name in numeric
                    if name in numbers:
                        junk[row] = True
                        if len(found) < 2 * EXAMPLES:
                            found.setdefault(row, _reason(name, cell, form))
            reasons |= {block[row][0]: reason for row, reason in sorted(found.items())[: EXAMPLES - len(reasons)]}
            # A row without any number, such as units that a logger wrote again, is none of a sample: its texts are none
            # of a sample, too, and a slide must not end at them.
            empty = junk & np.logical_and.reduce([np.isnan(parsed[name]) for name in numbers])
            for row in np.flatnonzero(empty).tolist():
                if len({*names} & {*cells[row]}) > 0.3 * len(names):
                    raise InvalidData(
                        f"'{place}', row {block[row][0]}: the names of the columns come again, "
                        f'{", ".join(cells[row][:5])}, so another recording may begin there; split the file there'
                    )
            cleaned = {name: [_text(cell) for cell in columns[name]] for name in texts}
            blocks.append({
                'line': np.array([number for number, _ in block]), 'junk': junk, 'odd': odd, 'empty': empty,
                **{f'number {name}': parsed[name] for name in numbers},
                **{f'text {name}': np.array(cells, dtype=str) for name, cells in cleaned.items()},
            })  # fmt: skip
    if not blocks:
        raise InvalidData(f"'{place}' has no rows below the names of its columns; choose files with samples")
    all_rows = {key: np.concatenate([read[key] for read in blocks]) for key in blocks[0]}
    # Units above the samples and sums below them have a text in a column of numbers, whether that is wanted or not.
    odd, junk = all_rows['odd'], all_rows['junk']
    outside = np.logical_and.accumulate(odd) | np.logical_and.accumulate(odd[::-1])[::-1]
    for row in np.flatnonzero(outside & ~junk)[: EXAMPLES - len(reasons)].tolist():
        reasons[int(all_rows['line'][row])] = 'a text in a column of numbers'
    return Columns(
        {name: np.where(outside, np.nan, all_rows[f'number {name}']) for name in numbers},
        {name: _without_gaps(all_rows[f'text {name}'], all_rows['empty'] | outside) for name in texts},
        all_rows['line'], junk | outside, reasons,
    )  # fmt: skip


def _reason(name: str, cell: str, form: FileFormat) -> str:
    decimal = form.decimal == '.' and math.isfinite(number_of(cell.replace(',', '.')))
    hint = "; if commas are decimal, write format: {decimal: ','}" if decimal else ''
    return f"column '{name}': '{cell[:40]}' is not a finite number{hint}"


def _refuse_commas(columns: Mapping[str, Sequence[str]], numbers: Sequence[str], form: FileFormat, place: str) -> None:
    """Refuse commas that are decimal as well as delimiters, or that separate thousands where they are decimal."""
    before: Sequence[str] = ()
    for name, column in columns.items() if form.delimiter == ',' else ():
        cells = [cell for cell in column if cell]
        digits = len({*map(len, cells)}) == 1 and all(cell.isdigit() for cell in cells) and cells != sorted(cells)
        whole = before and all(cell.lstrip('+-').isdigit() for cell in before)
        if whole and digits and len(cells[0]) > 1 and any(cell[0] == '0' for cell in cells):
            raise InvalidData(
                f"'{place}': the column '{name}' holds digits such as {cells[0]}, so commas may be decimal as "
                'well as between columns; save it with another delimiter'
            )
        before = column
    for name in numbers if form.decimal == ',' else ():
        commas = [cell for cell in columns[name] if ',' in cell]
        if 0 < len(commas) < len(columns[name]) and all(THOUSANDS.fullmatch(cell) for cell in commas):
            raise InvalidData(
                f"'{place}', column '{name}': the comma of '{commas[0]}' seems to separate thousands; save numbers "
                'without such commas'
            )


def _text(cell: str) -> str:
    return '' if cell.lower() in NO_TEXT else cell[:MAX_TEXT]


def _lines(opened: Any, form: FileFormat) -> Iterator[Line]:
    """Yield the lines that are neither empty nor comments; what is no UTF-8 is read as Windows writes it ('m/s²')."""
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


def _parsed(cells: Sequence[str], decimal: str) -> Array:
    if decimal == ',':  # '1.234' may be a thousand
        cells = ['?' if '.' in cell else cell.replace(',', '.') for cell in cells]
    return np.array([number_of(cell) for cell in cells])


def number_of(cell: str) -> float:
    """Return the finite number that a cell is, NaN if it is none; Python would read '1_0' as 10."""
    try:
        value = math.nan if '_' in cell else float(cell)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def _without_gaps(texts: AnyArray, gaps: AnyArray) -> AnyArray:
    """Return texts in which a malformed row has the one before it: no border is seen there."""
    if gaps.all():
        return np.full(len(texts), '')
    last = np.maximum.accumulate(np.where(gaps, -1, np.arange(len(texts))))
    last[last < 0] = int(np.argmin(gaps))
    filled: AnyArray = texts[last]
    return filled


# ---- files of arrays


def _read_numpy(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    with open_regular(path) as opened:
        if path.suffix.lower() == '.npy':
            content = read_array(opened)  # nothing in a file is run
            yield from _frames([''], lambda _: content, place, mapping, take)
        else:
            archive = Arrays(opened, max(8 * MAX_VALUES, opened.seek(0, io.SEEK_END)))
            yield from _frames(archive.names, archive.__getitem__, place, mapping, take)


def _read_mat(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    from scipy.io import loadmat  # noqa: PLC0415 – recording needs no scipy

    with open_regular(path) as opened:
        if opened.read(19).startswith(b'MATLAB 7.3 MAT-file'):  # HDF5 with all dimensions in reverse order
            yield from _read_hdf5(path, place, mapping, take, matlab=True)
            return
        take(_unpacked_bytes(opened) / 8)
        opened.seek(0)
        content = loadmat(opened, struct_as_record=True)
    arrays = dict(_members({name: value for name, value in content.items() if not name.startswith('__')}))
    yield from _frames(tuple(arrays), arrays.__getitem__, place, mapping, lambda _: None)  # they are counted


def _unpacked_bytes(file: Any) -> int:
    """Return how many bytes the variables of a MATLAB file (version 5 to 7) unpack to, without keeping them."""
    file.seek(124)
    order = '<' if file.read(4)[2:] == b'IM' else '>'
    total = 0
    while len(tag := file.read(8)) == 8:
        kind, length = struct.unpack(f'{order}II', tag)
        after = file.tell() + length
        unpacker = zlib.decompressobj()
        while kind == 15 and total < MAX_FILE_BYTES and (packed := file.read(min(after - file.tell(), 1 << 16))):
            while packed:
                total += len(unpacker.decompress(packed, 1 << 20))
                packed = unpacker.unconsumed_tail
        total += 0 if kind == 15 else length
        file.seek(after)
    return total


def _members(values: Mapping[str, Any], prefix: str = '') -> Iterator[tuple[str, AnyArray]]:
    """Yield arrays by their path: members of structs as 'run/acc', elements of arrays of these and cells from 1 on."""
    for name, value in values.items():
        if not isinstance(value, np.ndarray):
            continue
        elements = {str(number): one for number, one in enumerate(value.ravel(order='F'), 1)}
        if value.dtype.names and value.size == 1:
            yield from _members(_record(elements['1']), f'{prefix}{name}/')
        elif value.dtype.names:
            for number, one in elements.items():
                yield from _members(_record(one), f'{prefix}{name}/{number}/')
        elif value.dtype.kind == 'O':
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
            elif h5py.check_ref_dtype(member.dtype) is h5py.Reference:
                take(member.size)
                folder, _, last = name.rpartition('/')
                for number, one in enumerate(np.asarray(member[()]).ravel(), 1):
                    # Of an array of structs each member has as many references: the number stands before its name.
                    in_struct = matlab and folder and 'MATLAB_class' not in member.attrs
                    if one:
                        note(f'{folder}/{number}/{last}' if in_struct else f'{name}/{number}', file[one])
            else:
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
            if texts:
                cells = np.asarray(member.asstr(errors='replace')[()], dtype=object)
                return np.array([text[:MAX_TEXT] for text in cells.ravel()]).reshape(cells.shape)
            _refuse_holes(member, f"'{place}': data set '{name}'")
            array = _scaled(member, np.asarray(member[()]))
            return array.T if matlab else array

        yield from _frames(list(found), load, place, mapping, lambda _: None)


def _refuse_holes(member: Any, where: str) -> None:
    """Refuse a data set of which parts were never written, which HDF5 reads as zeros."""
    if member.chunks:
        counts = (-(-length // size) for length, size in zip(member.shape, member.chunks, strict=True))
        holes = member.id.get_num_chunks() < math.prod(counts)
    else:
        holes = member.size and not member.id.get_storage_size()
    if holes:
        raise InvalidData(f'{where} has parts that were never written; save what was')


def _scaled(member: Any, array: AnyArray) -> AnyArray:
    """Return the values of a data set as its attributes scale them by the CF conventions, NaN where one is missing."""
    given = {key: np.ravel(member.attrs[key]) for key in ('scale_factor', 'add_offset', '_FillValue', 'missing_value')
             if key in member.attrs}  # fmt: skip
    if not given or array.dtype.kind not in 'iuf':
        return array
    missing = np.isin(array, [value for key in ('_FillValue', 'missing_value') for value in given.get(key, ())])
    scaled = array * float(given.get('scale_factor', (1.0,))[0]) + float(given.get('add_offset', (0.0,))[0])
    return np.where(missing, np.nan, scaled)


def _read_wav(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    from scipy.io import wavfile  # noqa: PLC0415 – recording needs no scipy

    with open_regular(path) as opened, warnings.catch_warnings():
        warnings.simplefilter('ignore')  # chunks that it does not know
        _check_wav(opened, place)
        rate_hz, samples = wavfile.read(opened)
    if not 0 < rate_hz <= MAX_HZ:
        raise InvalidData(f"'{place}' has a sampling rate of {rate_hz} Hz; above 0 and at most {MAX_HZ:g} is allowed")
    if samples.dtype.kind == 'u':
        samples = (samples.astype(np.float64) - 128.0) / 128.0
    elif samples.dtype.kind == 'i':
        samples = samples / -float(np.iinfo(samples.dtype).min)  # full scale is 1
    for frame in _frames([''], lambda _: samples, place, mapping, take):
        yield replace(frame, rate_hz=float(rate_hz))


def _check_wav(file: Any, place: str) -> None:
    """Refuse a WAV file that was cut off or written to a pipe, or that holds several sounds."""
    size = file.seek(0, io.SEEK_END)
    file.seek(0)
    order = '>' if file.read(12)[:4] == b'RIFX' else '<'
    sounds = []
    while len(head := file.read(8)) == 8:
        name, length = struct.unpack(f'{order}4sI', head)
        if name == b'data':
            sounds.append(length)
            if length > size - file.tell():
                raise InvalidData(
                    f"'{place}' was cut off, or written to a pipe: it declares {length} bytes of sound and has "
                    f'{size - file.tell()}; copy or save it again'
                )
        file.seek(length + length % 2, io.SEEK_CUR)
    if len(sounds) != 1:
        raise InvalidData(
            f"'{place}' has {len(sounds)} chunks of sound, one is needed; save it again as a plain WAV file"
        )
    file.seek(0)


def _read_parquet(path: Path, place: str, mapping: TableMapping, take: Take) -> Iterator[TableFrame]:
    pyarrow, parquet = library('pyarrow', *PARQUET[1:]), library(*PARQUET)
    types = pyarrow.types
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

    def read(numbers: Sequence[str], texts: Sequence[str], most: int | None = None) -> Columns:
        rows = file.metadata.num_rows
        if not rows:
            raise InvalidData(f"'{place}' has no rows; choose files with samples")
        wanted = list(dict.fromkeys((*numbers, *texts)))
        take(min(rows, most or rows) * (len(wanted) + sum(name in coded for name in texts)))
        if most:
            content = pyarrow.Table.from_batches([next(file.iter_batches(most, columns=wanted))])
        else:
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
        raise InvalidData(
            f"'{place}' has no array of the form '{mapping.tables}'; it has {', '.join(names[:5]) or 'none'}"
        )
    for table, (fields, members) in sorted(groups.items()):
        within = f'{place}, {table}' if table else place
        arrays = {}
        for column, name in members.items():
            array = load(name)
            take(array.size * max(1.0, array.dtype.itemsize / 8))
            arrays[column] = _arranged(array, mapping.format, within)
        columns, constants = _unfolded_columns(arrays, within)
        yield TableFrame(within, tuple(columns), partial(columns_of, columns, within), {**constants, **fields})


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
    # The members of an array of records are arrays, too.
    plain: dict[str, AnyArray] = {}
    for name, array in arrays.items():
        for part in array.dtype.names or ('',):
            plain[_joined(name, part)] = array.squeeze()[part] if part else array
    for name, array in plain.items():
        if array.size == 1:
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


def _joined(name: str, part: str) -> str:
    return f'{name}.{part}' if name and part else name or part


def columns_of(
    columns: Mapping[str, AnyArray], place: str, numbers: Sequence[str], texts: Sequence[str], most: int | None = None
) -> Columns:
    """Return columns, (n,) each, as numbers and texts; NaN for numbers that are not finite."""
    read: dict[str, Array] = {}
    for name in numbers:
        array = columns[name][:most]
        if array.dtype.kind not in 'biuf':
            raise InvalidData(f"'{place}': column '{name}' holds {array.dtype}; numbers are needed, name another")
        read[name] = array.astype(np.float64)
        read[name][~np.isfinite(read[name])] = np.nan
    return Columns(read, {name: _texts(columns[name][:most]) for name in texts})


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
Messages = Mapping[str, Sequence[tuple[Rows, int, int, str]]]  # by topic: values, stamp and time of logging, ns, frame
BROKEN = (struct.error, UnicodeDecodeError, ValueError, IndexError, AssertionError, KeyError, TypeError)
TIME, FRAME = 'time', 'header.frame_id'
AXES = ('samples', 'channels')
OTHER_CLOCK_NS = NANOSECONDS  # stamps that differ more from the time of logging are of another clock


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
    """Return the values of a message by name; of an array of two dimensions, consecutive rows."""
    if msgtype == 'sensor_msgs/msg/JointState':
        kinds = ('position', 'velocity', 'effort')
        return {
            f'{kind}.{joint}': np.array([number])
            for kind in kinds for joint, number in zip(value.name, getattr(value, kind), strict=False)
        }  # fmt: skip
    if msgtype in ('std_msgs/msg/Float32MultiArray', 'std_msgs/msg/Float64MultiArray'):
        axes, table = value.layout.dim, value.data[value.layout.data_offset :][None]
        if len(axes) == 2:
            table = table.reshape([axis.size for axis in axes])
            labels = tuple(axis.label.strip().lower() for axis in axes)
            if labels not in (AXES, AXES[::-1]):
                raise InvalidData(
                    f"its dimensions are named '{labels[0]}' and '{labels[1]}', which does not tell samples from "
                    "channels; republish it with the labels 'samples' and 'channels'"
                )
            table = table if labels == AXES else table.T
        if table.shape[1] > MAX_FIELDS:
            raise ValueError(f'it has {table.shape[1]} channels; {MAX_FIELDS} are allowed')
        return {f'data.{number}': table[:, number] for number in range(table.shape[1])}
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
    messages = _messages(path, place, wanted, take)
    ahead_ns = _clocks_ahead_ns(messages, place)
    begin_ns = next(found[0][1] - ahead_ns[name] for name, found in messages.items())
    columns: dict[str, AnyArray] = {}
    clocks: dict[str, str] = {}
    for name, found in messages.items():
        all_rows, stamps_ns, _, frames = zip(*found, strict=True)
        parts = {part: np.concatenate([rows[part] for rows in all_rows]) for part in all_rows[0]}
        counts = np.array([max(map(len, rows.values()), default=0) for rows in all_rows])
        if f'{name}/{FRAME}' in wanted:
            parts[FRAME] = np.repeat(np.array(frames), counts)
        elif len({*frames}) > 1:
            raise InvalidData(
                f"'{place}', topic '{name}': its messages have the frames {', '.join(sorted({*frames})[:4])}, so "
                f"several sensors may publish there; choose one by rows: {{'{name}/{FRAME}': '{min(frames)}'}}"
            )
        # The samples of one message lie evenly between it and the next.
        times_s = (np.array(stamps_ns) - ahead_ns[name] - begin_ns) / NANOSECONDS
        usual_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.0
        steps_s = np.diff(times_s, append=times_s[-1] + usual_s)
        within = np.concatenate([np.arange(count) / max(count, 1) for count in counts])
        clock = f'{name}/{TIME}'
        columns[clock] = np.repeat(times_s, counts) + np.repeat(steps_s, counts) * within
        columns |= {f'{name}/{part}': array for part, array in parts.items()}
        clocks |= {f'{name}/{part}': clock for part in parts}
    yield TableFrame(place, tuple(columns), partial(columns_of, columns, place), clocks=clocks)


def _messages(path: Path, place: str, wanted: AbstractSet[str], take: Take) -> Messages:
    """Return the messages of the topics that are wanted."""
    messages: dict[str, list[tuple[Rows, int, int, str]]] = {}
    seen: dict[str, Any] = {}
    types: dict[str, Any] = {}

    def chosen(connection: Any) -> bool:
        seen[connection.topic] = connection
        return any(fnmatch.fnmatchcase(connection.topic, name.rpartition('/')[0] or name) for name in wanted)

    for message in read_foreign(path, chosen):
        name, msgtype = message.topic, message.msgtype
        if name not in types:
            types[name] = _types_of(seen[name], place)
        found = messages.setdefault(name, [])
        where = f"'{place}': message {len(found)} of '{name}'"
        try:
            value = types[name].deserialize_cdr(message.data, msgtype)
            rows = _rows_of(value, msgtype)
        except InvalidData as error:
            raise InvalidData(f'{where}: {error}') from error
        except BROKEN as error:
            raise InvalidData(f'{where} is damaged: {error}; record it again') from error
        if found and rows.keys() != found[0][0].keys():
            other = ', '.join(sorted(rows.keys() ^ found[0][0].keys())[:5])
            raise InvalidData(f'{where} has other fields than the first: {other}')
        take(10 * len(rows) + sum(len(array) for array in rows.values()))  # small arrays take more than their values
        header = getattr(value, 'header', None)
        stamp = getattr(header, 'stamp', None)
        stamp_ns = stamp.sec * NANOSECONDS + stamp.nanosec if stamp else 0
        found.append((rows, stamp_ns or message.log_ns, message.log_ns, getattr(header, 'frame_id', '')))
    if not messages:
        raise InvalidData(
            f"'{place}' has no topic that the mapping names ({', '.join(sorted(wanted))}); it has "
            f"{', '.join(sorted(seen)) or 'none'}; write columns as topic and field, such as '/wrench/wrench.force.x'"
        )
    return messages


def _types_of(connection: Any, place: str) -> Any:
    """Return the types of the messages of a topic by the definition that the bag stores, or else that of ROS 2."""
    types, msgtype = message_types(connection), connection.msgtype
    if msgtype.startswith('audio_common_msgs/'):
        raise InvalidData(
            f"'{place}': '{connection.topic}' is sound whose messages do not tell the format; give a WAV file"
        )
    if msgtype not in types.types:
        raise InvalidData(
            f"'{place}': the messages of '{connection.topic}' are {msgtype}, whose definition is neither in the bag "
            'nor of ROS 2 itself; record it as MCAP, which stores definitions, or republish it as a standard message'
        )
    return types


def _clocks_ahead_ns(messages: Messages, place: str) -> dict[str, int]:
    """Return by how much the clock of each topic is ahead of the recorder's; 0 if all topics have one clock."""
    ahead = {name: [stamp_ns - log_ns for _, stamp_ns, log_ns, _ in found] for name, found in messages.items()}
    usual_ns = {name: round(np.median(values)) for name, values in ahead.items()}
    if max(usual_ns.values()) - min(usual_ns.values()) <= OTHER_CLOCK_NS:
        return dict.fromkeys(messages, 0)
    for name, values in ahead.items():
        low, high = np.percentile(values, (5, 95)).tolist()
        if high - low > OTHER_CLOCK_NS:
            raise InvalidData(
                f"'{place}', topic '{name}': the stamps differ from the times of logging, which other topics have, by "
                f'{usual_ns[name] / NANOSECONDS:.4g} s, and that changes by {(high - low) / NANOSECONDS:.3g} s; record '
                'topics with stamps of one clock'
            )
    return usual_ns


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
