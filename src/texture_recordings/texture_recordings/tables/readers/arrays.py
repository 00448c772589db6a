"""Named arrays, as NPZ, MAT and HDF5 files hold them, as tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidData
from texture_recordings.tables.mapping import TableMapping
from texture_recordings.tables.name_template import NameTemplate
from texture_recordings.tables.table import EXAMPLES, Columns, MalformedRow, Table, check_size
from texture_recordings.tables.table_columns import FileFormat

TRIAL = 'trial'  # number of the first axis of arrays (n_trials, n_samples, n_channels)
MAX_COLUMNS = 10_000


def tables_of(
    names: Sequence[str], load: Callable[[str], AnyArray], place: str, mapping: TableMapping
) -> Iterator[Table]:
    """Yield the tables that arrays form.

    Without a template all arrays are one table. With one, an array whose name is of its form is a table whose columns
    count from 0, and arrays of which the first parts of the name are of its form are columns of one table.

    Parameters
    ----------
    names
        Names of the arrays.
    load
        Returns an array.
    place
        File, for sentences.
    mapping
        Says what is a table, and how the axes of arrays are ordered.

    Yields
    ------
    Table
        In the order of the names.

    Raises
    ------
    InvalidData
        If no array is of the form asked for.
    """
    groups = _groups(names, mapping.tables)
    if not groups:
        raise InvalidData(
            f"'{place}' has no array of the form '{mapping.tables}'; it has {', '.join(names[:5]) or 'none'}"
        )
    for table, (fields, members) in sorted(groups.items()):
        within = f'{place}, {table}' if table else place
        arrays = {column: _arranged(load(name), mapping.format, within) for column, name in members.items()}
        columns, constants = _columns(arrays, within)
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


def _columns(arrays: Mapping[str, AnyArray], place: str) -> tuple[dict[str, AnyArray], dict[str, str]]:
    """Return the columns of arrays, (n,) each, and what holds for all rows."""
    columns: dict[str, AnyArray] = {}
    constants: dict[str, str] = {}
    trials = next((array.shape[:2] for array in arrays.values() if array.ndim == 3), None)
    check_size(sum(array.size for array in arrays.values()), place)
    for name, array in arrays.items():
        if array.dtype.names:
            columns |= {_joined(name, part): array[part].ravel() for part in array.dtype.names}
        elif array.size == 1:
            constants[name] = str(array.item())
        elif trials and array.ndim <= 2 and array.size == trials[0]:
            columns[name] = np.repeat(array.ravel(), trials[1])
        else:
            columns |= _unfolded(name, array, place)
    if trials:
        columns[TRIAL] = np.repeat(np.arange(trials[0]), trials[1])
    return columns, constants


def _unfolded(name: str, array: AnyArray, place: str) -> dict[str, AnyArray]:
    if array.ndim > 1 and 1 in array.shape and array.ndim == 2:
        array = array.ravel()
    if array.ndim == 1:
        return {name or '0': array}
    if array.ndim not in (2, 3) or array.shape[-1] > MAX_COLUMNS:
        raise InvalidData(
            f"'{place}': '{name}' has the shape {array.shape}; (n_samples, n_channels) is needed, at most "
            f'{MAX_COLUMNS} channels; see `transpose` under `format`'
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
