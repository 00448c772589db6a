"""Arrays of NumPy: .npz and .npy; Python objects in them are refused, so nothing in a file is run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from texture_core.errors import InvalidData
from texture_core.files import Archive, open_regular, read_array
from texture_recordings.tables.mapping import TableMapping
from texture_recordings.tables.readers.arrays import tables_of
from texture_recordings.tables.table import Table, budget_of


def read_npz(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    """Yield the tables of an .npz file."""
    try:
        with open_regular(path) as opened, Archive(opened) as archive:
            archive.budget = budget_of(path.stat().st_size)
            members = {name.removesuffix('.npy'): name for name in archive.names if name.endswith('.npy')}
            yield from tables_of(
                tuple(members), lambda name: archive.array(members[name], records=True), place, mapping
            )
    except (OSError, ValueError, KeyError) as error:
        raise InvalidData(f"'{place}' cannot be read as arrays of NumPy: {error}; save it again") from error


def read_npy(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    """Yield the one table of an .npy file, whose columns count from 0."""
    try:
        with open_regular(path) as opened:
            array = read_array(opened, budget_of(path.stat().st_size), records=True)
    except (OSError, ValueError) as error:
        raise InvalidData(f"'{place}' cannot be read as an array of NumPy: {error}; save it again") from error
    yield from tables_of([''], lambda _: array, place, mapping)
