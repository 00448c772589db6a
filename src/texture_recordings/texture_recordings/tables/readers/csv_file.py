"""Text tables: CSV, TSV and the like, row by row; a malformed row is counted and leaves a hole."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.errors import InvalidData
from texture_core.files import FileRefused, open_regular
from texture_recordings.tables.mapping import FileFormat, TableMapping
from texture_recordings.tables.table import EXAMPLES, Columns, MalformedRow, Table, check_size

DELIMITERS = (',', ';', '\t', '|', ' ')
MAX_LINE = 1_000_000  # characters; a longer line is cut and thereby malformed
MAX_COLUMNS = 10_000
MAX_TEXT = 200  # characters of a cell that is shown or a label
BLOCK_ROWS = 20_000
Line = tuple[int, str]  # its number in the file, from 1


def read_csv(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    """Yield the one table of a text file."""
    form = mapping.format
    with _lines(path, place, form) as lines:
        _, first = next(lines, (0, ''))
        delimiter = form.delimiter or _delimiter(first)
        cells = _cells(first, delimiter)
    if not first or len(cells) > MAX_COLUMNS:
        raise InvalidData(f"'{place}' has {len(cells) if first else 'no'} columns; 1 to {MAX_COLUMNS} are needed")
    names = cells if form.header else [str(number) for number in range(len(cells))]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InvalidData(f"'{place}' has the column '{twice}' twice; give each column a name of its own")
    yield Table(place, names, partial(_read, path, place, replace(form, delimiter=delimiter), names))


def _read(path: Path, place: str, form: FileFormat, names: Sequence[str], *wanted: Sequence[str]) -> Columns:
    numbers, texts = wanted
    place_of = {name: names.index(name) for name in dict.fromkeys((*numbers, *texts))}
    blocks: list[_Block] = []
    malformed: list[MalformedRow] = []
    values = 0
    with _lines(path, place, form) as lines:
        if form.header:
            next(lines, None)
        while rows := list(islice(lines, BLOCK_ROWS)):
            block = _Block.read(rows, form, len(names), {name: place_of[name] for name in numbers})
            block.texts = {name: block.column(place_of[name]) for name in texts}
            malformed += block.malformed[: EXAMPLES - len(malformed)]
            values += len(rows) * len(place_of)
            check_size(values, place)
            block.cells = []
            blocks.append(block)
    if not blocks:
        raise InvalidData(f"'{place}' has no rows below the names of its columns; choose files with samples")
    return Columns(
        {name: np.concatenate([block.numbers[name] for block in blocks]) for name in numbers},
        {name: _filled(np.concatenate([block.texts[name] for block in blocks])) for name in texts},
        np.concatenate([block.rows for block in blocks]),
        malformed,
    )


class _Block:
    """Some rows: cells by row, None for a row with another number of cells."""

    def __init__(self, rows: Sequence[Line], delimiter: str, width: int) -> None:
        self.rows = np.array([number for number, _ in rows])
        self.cells: list[list[str] | None] = []
        self.numbers: dict[str, Array] = {}
        self.texts: dict[str, AnyArray] = {}
        self.malformed: list[MalformedRow] = []
        for number, line in rows:
            cells = _cells(line, delimiter)
            self.cells.append(cells if len(cells) == width else None)
            if len(cells) != width:
                self._note(number, 'all', f'{len(cells)} cells, {width} are needed')

    @classmethod
    def read(cls, rows: Sequence[Line], form: FileFormat, width: int, numbers: Mapping[str, int]) -> _Block:
        block = cls(rows, form.delimiter, width)
        for name, place in numbers.items():
            block.numbers[name] = block._parsed(name, place, form.decimal)
        block.malformed.sort(key=lambda row: row.row)
        return block

    def column(self, place: int) -> AnyArray:
        """Return the texts of a column, None for malformed rows."""
        return np.array(
            [None if cells is None else cells[place][:MAX_TEXT].strip().replace('\0', '') for cells in self.cells],
            dtype=object,
        )

    def _parsed(self, name: str, place: int, decimal: str) -> Array:
        cells = ['nan' if cells is None else cells[place] for cells in self.cells]
        if decimal != '.':
            cells = [cell.replace(decimal, '.') for cell in cells]
        try:
            values = np.array(list(map(float, cells)))
        except ValueError:
            values = np.array([_number(cell) for cell in cells])
        for index in np.flatnonzero(~np.isfinite(values))[:EXAMPLES].tolist():
            if self.cells[index] is not None:
                self._note(int(self.rows[index]), name, f"'{cells[index][:40]}' is no finite number")
        values[~np.isfinite(values)] = np.nan
        return values

    def _note(self, row: int, column: str, reason: str) -> None:
        if len(self.malformed) < BLOCK_ROWS // 100:
            self.malformed.append(MalformedRow(row, column, reason))


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float('nan')


def _filled(texts: AnyArray) -> AnyArray:
    """Return texts in which a malformed row has the one before it: no border is seen there."""
    known = np.array([text is not None for text in texts])
    if not known.any():
        return np.full(len(texts), '', dtype=str)
    last = np.maximum.accumulate(np.where(known, np.arange(len(texts)), -1))
    last[last < 0] = int(np.argmax(known))
    filled: AnyArray = texts[last].astype(str)
    return filled


@contextmanager
def _lines(path: Path, place: str, form: FileFormat) -> Iterator[Iterator[Line]]:
    """Give the lines that are neither empty nor comments, each with its number."""
    try:
        with open_regular(path) as opened, io.TextIOWrapper(opened, 'utf-8-sig', 'replace', newline=None) as text:
            yield _kept(text, form)
    except (OSError, FileRefused) as error:
        raise InvalidData(f"'{place}' cannot be read: {error}; give a text file") from error


def _kept(text: io.TextIOWrapper, form: FileFormat) -> Iterator[Line]:
    for number, line in enumerate(iter(partial(text.readline, MAX_LINE), ''), 1):
        bare = line.rstrip('\r\n')
        if number > form.skip_rows and bare.strip() and not (form.comment and bare.startswith(form.comment)):
            yield number, bare


def _delimiter(line: str) -> str:
    counts = {delimiter: line.count(delimiter) for delimiter in DELIMITERS}
    return next((delimiter for delimiter in DELIMITERS[:-1] if counts[delimiter]), ' ' if counts[' '] else ',')


def _cells(line: str, delimiter: str) -> list[str]:
    if delimiter == ' ':
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
    except csv.Error:
        return []
