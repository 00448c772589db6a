"""HDF5 files: data sets by their path. Links into other files, virtual and external data are refused."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidData
from texture_core.files import Budget, FileRefused, open_regular
from texture_recordings.optional_library import library
from texture_recordings.tables.mapping import TableMapping
from texture_recordings.tables.readers.arrays import tables_of
from texture_recordings.tables.table import Table, budget_of

MAX_DATASETS, MAX_DEPTH = 20_000, 20
BROKEN = (OSError, ValueError, RuntimeError, KeyError, TypeError, OverflowError, MemoryError)


def read_hdf5(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    """Yield the tables of an HDF5 file."""
    yield from _tables(path, place, mapping, reverse=False)


def read_matlab_hdf5(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    """Yield the tables of a MATLAB file of version 7.3, which is HDF5 with all dimensions in reverse order.

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
        If it is no such file, is damaged, or holds more than the limit.
    """
    yield from _tables(path, place, mapping, reverse=True)


def _tables(path: Path, place: str, mapping: TableMapping, *, reverse: bool) -> Iterator[Table]:
    h5py = library('h5py', 'HDF5 files', 'hdf5')
    try:
        open_regular(path).close()
        with h5py.File(path, 'r') as file:
            budget = budget_of(path.stat().st_size)
            names = list(_datasets(h5py, file, '', 0))
            if len(names) > MAX_DATASETS:
                raise FileRefused(f'it has {len(names)} data sets; {MAX_DATASETS} are allowed')

            def load(name: str) -> AnyArray:
                array = _array(h5py, file[name], budget)
                return array.T if reverse else array

            yield from tables_of(names, load, place, mapping)
    except BROKEN as error:
        raise InvalidData(f"'{place}' cannot be read as HDF5: {error}; save it again") from error


def _datasets(h5py: Any, group: Any, prefix: str, depth: int) -> Iterator[str]:
    if depth > MAX_DEPTH:
        raise FileRefused(f'it is nested more than {MAX_DEPTH} deep')
    for name in group:
        if prefix == '' and name == '#refs#':  # how MATLAB keeps cells and objects
            continue
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        member = group[name]
        if isinstance(member, h5py.Group):
            yield from _datasets(h5py, member, f'{prefix}{name}/', depth + 1)
        elif isinstance(member, h5py.Dataset):
            yield f'{prefix}{name}'


def _array(h5py: Any, dataset: Any, budget: Budget) -> AnyArray:
    if dataset.is_virtual or dataset.external:
        raise FileRefused(f"its data set '{dataset.name}' lies in another file; copy it into this one")
    dtype = dataset.dtype
    if h5py.check_string_dtype(dtype) is not None and dtype.kind == 'O':
        budget.spend(dataset.size * 1000)
        return np.array(dataset.asstr(errors='replace')[()]).astype('U100')
    if dtype.kind not in 'biufS' and not (dtype.names and all(dtype[part].kind in 'biuf' for part in dtype.names)):
        raise FileRefused(f"its data set '{dataset.name}' holds {dtype}; plain numbers or texts are needed")
    budget.spend(dataset.size * max(dtype.itemsize, 8))
    budget_of_chunk = math.prod(dataset.chunks or (0,)) * dtype.itemsize
    if budget_of_chunk > 2 * max(dataset.size * dtype.itemsize, 1 << 20):
        raise FileRefused(f"its data set '{dataset.name}' has chunks larger than itself")
    return np.asarray(dataset[()])
