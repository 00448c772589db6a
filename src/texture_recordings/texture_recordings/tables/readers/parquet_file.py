"""Parquet files: columns by name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidData
from texture_core.files import open_regular
from texture_recordings.optional_library import library
from texture_recordings.tables.mapping import TableMapping
from texture_recordings.tables.readers.arrays import table_columns
from texture_recordings.tables.table import Columns, Table, check_size

BROKEN = (OSError, ValueError, KeyError, TypeError, NotImplementedError, OverflowError, MemoryError)


def read_parquet(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    """Yield the one table of a Parquet file."""
    parquet = library('pyarrow.parquet', 'Parquet files', 'parquet')
    try:
        with open_regular(path) as opened:
            file = parquet.ParquetFile(opened)
            names = [name for name in file.schema_arrow.names if _is_plain(file.schema_arrow.field(name).type)]
            yield Table(place, names, partial(_read, file, place))
    except BROKEN as error:
        raise InvalidData(f"'{place}' cannot be read as Parquet: {error}; save it again") from error


def _is_plain(kind: Any) -> bool:
    types = library('pyarrow', 'Parquet files', 'parquet').types
    checks = (types.is_integer, types.is_floating, types.is_boolean, types.is_string, types.is_dictionary)
    return any(check(kind) for check in (*checks, types.is_large_string, types.is_timestamp))


def _read(file: Any, place: str, numbers: Sequence[str], texts: Sequence[str]) -> Columns:
    names = list(dict.fromkeys((*numbers, *texts)))
    check_size(file.metadata.num_rows * len(names), place)
    parts: dict[str, list[AnyArray]] = {name: [] for name in names}
    values = 0
    try:
        for batch in file.iter_batches(columns=names):
            values += batch.num_rows * len(names)
            check_size(values, place)
            for name in names:
                parts[name].append(_array(batch.column(name)))
    except BROKEN as error:
        raise InvalidData(f"'{place}' cannot be read as Parquet: {error}; save it again") from error
    if not values:
        raise InvalidData(f"'{place}' has no rows; choose files with samples")
    return table_columns({name: np.concatenate(each) for name, each in parts.items()}, place, numbers, texts)


def _array(column: Any) -> AnyArray:
    types = library('pyarrow', 'Parquet files', 'parquet').types
    if types.is_timestamp(column.type):
        return np.asarray(column.to_numpy(zero_copy_only=False)).astype('datetime64[ns]').astype(np.int64)
    array = np.asarray(column.to_numpy(zero_copy_only=False))
    return np.array(['' if value is None else str(value) for value in array]) if array.dtype == object else array
