"""Files of anybody as tables: CSV, NumPy, MATLAB, HDF5, Parquet, sound, and bags of standard messages.

The libraries that read them believe what a file says of its size. So a child process reads, with a limit of memory and
of time, and no reader has limits of its own.
"""

from __future__ import annotations

import csv
import fnmatch
import importlib
import io
import json
import math
import os
import re
import resource
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import islice
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import AnyArray, Array
from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidData
from texture_core.files import MB, FileRefused, open_regular
from texture_core.signal import MAX_HZ
from texture_recordings.optional_library import library
from texture_recordings.tables.mapping import FileFormat, NameTemplate, TableMapping

MAX_FILE_BYTES = 1000 * MB
MEMORY_BYTES = 1000 * MB  # beyond what the interpreter takes, and `MEMORY_TIMES` the size of the file
MEMORY_TIMES = 4
DEADLINE_S, DEADLINE_BYTES = 10.0, 5 * MB  # for each of so many bytes; the machine may be busy
MAX_VALUES = 50_000_000  # of one table: 400 MB
EXAMPLES = 5
RANGE = re.compile(r'(\D*)(\d{1,9})-\1(\d{1,9})')
MAX_RANGE = 10_000
TRIAL = 'trial'  # number of the first axis of arrays (n_trials, n_samples, n_channels)
MAX_CHANNELS = 10_000  # more are samples: the array lies on its side
DELIMITERS = (',', ';', '\t', '|', ' ')
BLOCK_ROWS = 20_000  # of a text file, which are parsed at once
MAX_TEXT = 200  # characters of a cell that is shown or a label


@dataclass(frozen=True)
class MalformedRow:
    """A row that cannot be read, for a sentence.

    Examples
    --------
    >>> print(MalformedRow(17, 'force', "'n/a' is no finite number"))
    row 17, column 'force': 'n/a' is no finite number
    """

    row: int
    column: str
    reason: str

    def __str__(self) -> str:
        return f"row {self.row}, column '{self.column}': {self.reason}"


@dataclass(frozen=True, eq=False)
class Columns:
    """What was read of a table.

    Parameters
    ----------
    numbers
        By name: (n,) float64, NaN where a row is malformed.
    texts
        By name: (n,) texts.
    rows
        Number in the file of each row, from 1, for sentences; None if rows count from 0.
    malformed
        The first rows that are malformed.
    """

    numbers: Mapping[str, Array]
    texts: Mapping[str, NDArray[np.str_]]
    rows: AnyArray | None = None
    malformed: Sequence[MalformedRow] = ()

    def row(self, index: int) -> int:
        """Return the number in the file of a row."""
        return index if self.rows is None or index >= len(self.rows) else int(self.rows[index])


@dataclass(frozen=True, eq=False)
class Table:
    """Columns that belong together.

    Parameters
    ----------
    place
        File, and array in it, for sentences.
    names
        Columns that there are.
    read
        Called with the names of the columns that are numbers, and of those that are texts.
    fields
        Values that hold for the whole table, by name: from the names of file and array.
    rate_hz
        Sampling rate if the file states it, else 0.
    clocks
        Name of the column of time by the name of a column, where the file states that.

    Examples
    --------
    >>> table = Table('a.csv', ('t', 'taxel1', 'taxel2'), read=lambda numbers, texts: Columns({}, {}))
    >>> table.chosen(['taxel*'])
    ['taxel1', 'taxel2']
    """

    place: str
    names: Sequence[str]
    read: Callable[[Sequence[str], Sequence[str]], Columns]
    fields: Mapping[str, str] = field(default_factory=dict)
    rate_hz: float = 0.0
    clocks: Mapping[str, str] = field(default_factory=dict)

    def chosen(self, wanted: Sequence[str]) -> list[str]:
        """Return the columns that names, patterns such as 'taxel*' and ranges such as '0-8' mean, in their order.

        Raises
        ------
        InvalidData
            If one means none, with the nearest name.
        """
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


# ---- the process that reads ------------------------------------------------------------------------------------------


class TableFiles:
    """Read tables in a child process that has limits; use it in a `with` block.

    The child reads one file after another. What it was asked for it sends as plain bytes, so that nothing which a file
    may do to it reaches this process.
    """

    def __enter__(self) -> TableFiles:
        self._child: subprocess.Popen[bytes] | None = None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def tables(self, kind: str, path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
        """Yield the tables of a file; each can be read until the next one is asked for.

        Parameters
        ----------
        kind
            One of `READERS`.
        path
            The file, or the folder of a bag.
        place
            Its name for sentences.
        mapping
            Says how the file is read and what is wanted of it.

        Yields
        ------
        Table
            Its columns are read when asked for.

        Raises
        ------
        InvalidData
            If it is no file of its kind, is damaged, or takes more memory or time than the limit.
        """
        size = _checked_size(path, place)
        if self._child is None:
            self._begin()
        self._left_s = DEADLINE_S * max(1.0, size / DEADLINE_BYTES)
        self._memory = MEMORY_BYTES + MEMORY_TIMES * size
        try:
            reply = self._ask((kind, str(path), place, mapping, self._memory), place)
            while facts := reply.get('table'):
                yield Table(read=partial(self._columns, place), **facts)
                reply = self._ask(None, place)
        except GeneratorExit:
            self._end()  # in the middle of a file: the child would take what comes next for an answer
            raise

    def _columns(self, place: str, numbers: Sequence[str], texts: Sequence[str]) -> Columns:
        reply = self._ask((list(numbers), list(texts)), place)
        read: dict[str, dict[str, AnyArray]] = {'numbers': {}, 'texts': {}, 'rows': {}}
        for group, name, kind in reply['arrays']:
            read[group][name] = np.frombuffer(self._receive(place), np.dtype(kind))
        malformed = [MalformedRow(**row) for row in reply['malformed']]
        return Columns(read['numbers'], read['texts'], read['rows'].get(''), malformed)

    def _begin(self) -> None:
        self._connection, theirs = Pipe()
        code = f'from texture_recordings.tables.tables import serve; serve({theirs.fileno()})'
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

    def _ask(self, request: object, place: str) -> Any:
        with suppress(OSError):  # it has ended: the answer says why
            self._connection.send(request)
        reply = json.loads(self._receive(place))
        if reply.get('ready'):  # libraries are loaded; only now the time of the file begins
            reply = json.loads(self._receive(place))
        if 'refused' in reply:
            raise InvalidData(reply['refused'])
        return reply

    def _receive(self, place: str) -> bytes:
        child, began_s = self._child, time.monotonic()
        assert child is not None
        timer = threading.Timer(self._left_s, child.kill)
        timer.start()
        try:
            return self._connection.recv_bytes()
        except (EOFError, OSError):
            late = time.monotonic() - began_s >= self._left_s
            code = self._end()
            reason = (
                'it takes longer to read than a file of its size may'
                if late
                else f'the process that reads it ended with code {code}, having at most {self._memory / MB:.0f} MB'
            )
            raise InvalidData(f"'{place}' was refused: {reason}; save it again, or split it") from None
        finally:
            timer.cancel()
            self._left_s -= time.monotonic() - began_s


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
    """Read files as asked for over an inherited connection, until it ends: the work of the child process.

    Parameters
    ----------
    number
        File descriptor of the connection.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, whose end is ours
    connection = Connection(number)
    while True:
        try:
            request = connection.recv()
        except EOFError:
            return
        try:
            _serve_file(connection, request)
            reply = {}
        except InvalidData as error:
            reply = {'refused': str(error)}
        except MemoryError:
            reply = {'refused': _refusal(request[2], f'it takes more than {request[4] / MB:.0f} MB of memory to read')}
        # Whatever a library raises, which depends on the byte that is wrong, is said of the file.
        except Exception as error:
            reply = {'refused': _refusal(request[2], str(error) or type(error).__name__)}
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        connection.send_bytes(json.dumps(reply).encode())


def _refusal(place: str, reason: str) -> str:
    return f"'{place}' cannot be read: {reason[:300]}; save it again"


def _serve_file(connection: Connection, request: tuple[str, str, str, TableMapping, int]) -> None:
    kind, path, place, mapping, memory = request
    for name, files, extra in LIBRARIES.get(kind, ()):
        library(name, files, extra)
    connection.send_bytes(b'{"ready": true}')
    taken = int(Path('/proc/self/statm').read_text(encoding='ascii').split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + memory, resource.RLIM_INFINITY))
    for table in READERS[kind](Path(path), place, mapping):
        facts = {key: getattr(table, key) for key in ('place', 'fields', 'rate_hz', 'clocks')}
        connection.send_bytes(json.dumps({'table': {**facts, 'names': list(table.names)}}).encode())
        while wanted := connection.recv():
            _send(connection, table.read(*wanted), place)


def _send(connection: Connection, columns: Columns, place: str) -> None:
    texts = {name: np.array(texts, dtype=str) for name, texts in columns.texts.items()}
    for array in texts.values():
        array.tolist()  # raises an error at what are no characters
    arrays = [('numbers', name, np.ascontiguousarray(array)) for name, array in columns.numbers.items()]
    arrays += [('texts', name, array) for name, array in texts.items()]
    arrays += [('rows', '', columns.rows)] if columns.rows is not None else []
    if sum(array.nbytes for _, _, array in arrays) > 8 * MAX_VALUES:
        raise InvalidData(f"'{place}' has more than {MAX_VALUES // 1_000_000} million values; split it into files")
    facts = {
        'arrays': [(group, name, array.dtype.str) for group, name, array in arrays],
        'malformed': [asdict(row) for row in columns.malformed],
    }
    connection.send_bytes(json.dumps(facts).encode())
    for _, _, array in arrays:
        connection.send_bytes(array.tobytes())


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
    malformed: list[MalformedRow] = []
    with _lines(path, form) as lines:
        if form.header:
            next(lines, None)
        while block := list(islice(lines, BLOCK_ROWS)):
            cells = [_cells(line, form.delimiter) for _, line in block]
            rows = [row if len(row) == len(names) else None for row in cells]
            found = [
                MalformedRow(number, 'all', f'{len(row)} cells, {len(names)} are needed')
                for (number, _), row in zip(block, cells, strict=True)
                if len(row) != len(names)
            ]
            read: dict[str, AnyArray] = {'': np.array([number for number, _ in block])}
            for name in numbers:
                read[f'number {name}'] = values = _parsed(rows, at[name], form.decimal)
                found += [
                    MalformedRow(block[index][0], name, f"'{row[at[name]][:40]}' is no finite number")
                    for index in np.flatnonzero(np.isnan(values)).tolist()
                    if (row := rows[index])
                ]
            malformed += sorted(found, key=lambda row: row.row)[: EXAMPLES - len(malformed)]
            rows = _without_headings(rows, [at[name] for name in numbers])
            for name in texts:
                read[f'text {name}'] = np.array([row and row[at[name]][:MAX_TEXT].replace('\0', '') for row in rows])
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


@contextmanager
def _lines(path: Path, form: FileFormat) -> Iterator[Iterator[Line]]:
    """Give the lines that are neither empty nor comments, each with its number."""
    with open_regular(path) as opened, io.TextIOWrapper(opened, 'utf-8-sig', 'replace', newline=None) as text:
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


def _without_headings(rows: Sequence[list[str] | None], places: Sequence[int]) -> list[list[str] | None]:
    """Return None for rows that hold words alone where numbers belong: names or units, which a logger wrote again.

    Their texts are none of a sample, and a slide must not end at them.
    """
    return [
        None if row and places and all(row[place] and math.isnan(_number(row[place], 0.0)) for place in places) else row
        for row in rows
    ]


def _number(cell: str, if_nan: float = math.nan) -> float:
    """Return a number, NaN for what is none; NaN that is written so becomes `if_nan`."""
    try:
        number = float(cell)
    except ValueError:
        return math.nan
    return if_nan if math.isnan(number) else number


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
    form = NameTemplate(template)
    groups: dict[str, tuple[dict[str, str], dict[str, str]]] = {}
    for name in names:
        parts = name.split('/')
        table, rest = '/'.join(parts[: form.depth]), '/'.join(parts[form.depth :])
        fields = form.match(table)
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
    """Return columns as numbers and texts.

    Parameters
    ----------
    columns
        By name, (n,) each.
    place
        File, and array in it, for sentences.
    numbers, texts
        Names of the columns.

    Returns
    -------
    Columns
        NaN for numbers that are not finite.

    Raises
    ------
    InvalidData
        If numbers are asked for where texts are.
    """
    read, malformed = {}, []
    for name in numbers:
        array = columns[name]
        if array.dtype.kind not in 'biuf':
            raise InvalidData(f"'{place}': column '{name}' holds {array.dtype}; numbers are needed, name another")
        read[name] = array.astype(np.float64)
        bad = ~np.isfinite(read[name])
        malformed += [
            MalformedRow(index, name, 'is no finite number') for index in np.flatnonzero(bad)[:EXAMPLES].tolist()
        ]
        read[name][bad] = np.nan
    malformed.sort(key=lambda row: row.row)
    return Columns(read, {name: _texts(columns[name]) for name in texts}, None, malformed[:EXAMPLES])


def _texts(array: AnyArray) -> AnyArray:
    if array.dtype.kind == 'S':
        return np.char.decode(array, 'utf-8', 'replace')
    if array.dtype.kind == 'f' and np.array_equal(array, np.round(array)):  # 3.0 is meant as 3
        return array.astype(np.int64).astype(str)
    return array.astype(str)


def _read_bag(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    module = importlib.import_module('texture_recordings.tables.message_bag')  # which needs this one
    yield from module.read_message_bag(path, place, mapping)


class TableReader(Protocol):
    """Opens a file as tables, in the child process; whatever it raises is said of the file."""

    def __call__(self, path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
        """Yield the tables of a file, see `TableFiles.tables`."""


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
    BAG: _read_bag,
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
    BAG: (('texture_recordings.tables.message_bag', 'bags', 'bag'),),
}
# What `texture import` is given a mapping for, and the kinds of files which that means.
MAPPED: Mapping[str, Sequence[str]] = {'table': tuple(kind for kind in READERS if kind != BAG), 'bag': (BAG,)}
