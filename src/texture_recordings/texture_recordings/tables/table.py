"""A table: columns of one length, or of several clocks, in a file."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import AnyArray, Array
from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidData
from texture_core.files import Budget, unpacked_limit
from texture_recordings.tables.mapping import TableMapping

MAX_VALUES = 50_000_000  # of one table: 400 MB
MAX_BYTES = 8 * MAX_VALUES
EXAMPLES = 5
RANGE = re.compile(r'(\D*)(\d+)-\1(\d+)')
MAX_RANGE = 10_000


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
            for one in meant:
                if one not in known:
                    raise InvalidData(f"'{self.place}': {unknown_name(one, self.names, 'column')}")
            if not meant:
                raise InvalidData(f"'{self.place}': {unknown_name(name, self.names, 'column')}")
            found += meant
        return found


class TableReader(Protocol):
    """Opens a file as tables."""

    def __call__(self, path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
        """Yield the tables of a file.

        Parameters
        ----------
        path
            The file.
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
            If it is no file of its kind, is damaged, or holds more than the limit.
        """


def check_size(values: int, place: str) -> None:
    """Raise an error if a table has more values than are read at once.

    Raises
    ------
    InvalidData
        If they are too many.
    """
    if values > MAX_VALUES:
        raise InvalidData(f"'{place}' has more than {MAX_VALUES // 1_000_000} million values; split it into files")


def budget_of(file_bytes: int) -> Budget:
    """Return how many bytes may come out of a compressed file: those of one table, or ten times its size."""
    return Budget(max(MAX_BYTES, unpacked_limit(file_bytes)))


def _meant(name: str, names: Sequence[str]) -> list[str]:
    match = RANGE.fullmatch(name)
    if match and 0 <= int(match[3]) - int(match[2]) < MAX_RANGE:
        return [f'{match[1]}{number}' for number in range(int(match[2]), int(match[3]) + 1)]
    return [one for one in names if fnmatch.fnmatchcase(one, name)] if len(name) <= 100 else []
