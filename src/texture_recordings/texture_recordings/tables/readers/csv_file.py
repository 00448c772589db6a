"""Text tables: CSV, TSV and the like, row by row; a malformed row is counted and leaves a hole."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.errors import InvalidData
from texture_recordings.tables.mapping import TableMapping
from texture_recordings.tables.readers.csv_cells import Line, fill_gaps, likely_delimiter, open_lines, split_cells
from texture_recordings.tables.table import EXAMPLES, Columns, MalformedRow, Table, check_size
from texture_recordings.tables.table_columns import FileFormat

MAX_COLUMNS = 10_000
MAX_TEXT = 200  # characters of a cell that is shown or a label
BLOCK_ROWS = 20_000


def read_csv(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    """Yield the one table of a text file."""
    form = mapping.format
    with open_lines(path, place, form) as lines:
        _, first = next(lines, (0, ''))
        delimiter = form.delimiter or likely_delimiter(first)
        cells = split_cells(first, delimiter)
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
    with open_lines(path, place, form) as lines:
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
        {name: fill_gaps(np.concatenate([block.texts[name] for block in blocks])) for name in texts},
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
            cells = split_cells(line, delimiter)
            self.cells.append(cells if len(cells) == width else None)
            if len(cells) != width:
                self._note(number, 'all', f'{len(cells)} cells, {width} are needed')

    @classmethod
    def read(cls, rows: Sequence[Line], form: FileFormat, width: int, numbers: Mapping[str, int]) -> _Block:
        block = cls(rows, form.delimiter, width)
        for name, place in numbers.items():
            block.numbers[name] = block._parsed(name, place, form.decimal)
        block._blank_headings(tuple(numbers.values()))
        block.malformed.sort(key=lambda row: row.row)
        return block

    def _blank_headings(self, places: Sequence[int]) -> None:
        """Leave the texts of rows out that hold words alone where numbers belong: names or units, written again.

        Their texts are none of a sample, and a slide must not end at them.
        """
        if not self.numbers:
            return
        wordy = np.logical_and.reduce([np.isnan(values) for values in self.numbers.values()])
        for index in np.flatnonzero(wordy).tolist():
            cells = self.cells[index]
            if cells is not None and all(_is_word(cells[place]) for place in places):
                self.cells[index] = None

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


def _is_word(cell: str) -> bool:
    """Return whether a cell is neither empty nor a number, which NaN is, too."""
    try:
        float(cell)
    except ValueError:
        return bool(cell)
    return False


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float('nan')
