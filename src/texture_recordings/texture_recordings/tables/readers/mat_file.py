"""MATLAB files: numeric arrays, and structs as folders of them; version 7.3 is HDF5.

Version 5 is read here and not by scipy, which believes the dimensions that a file states: a hundred bytes would take
all memory. Source: The MathWorks, "MAT-File Format", version 5.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidData
from texture_core.files import MB, Budget, FileRefused, read_bounded
from texture_recordings.tables.mapping import TableMapping
from texture_recordings.tables.readers.arrays import tables_of
from texture_recordings.tables.readers.hdf5_file import read_matlab_hdf5
from texture_recordings.tables.table import Table, budget_of

HEAD = 128
MAX_FILE_BYTES = 500 * MB
MAX_DEPTH, MAX_ARRAYS = 10, 20_000
MATRIX, COMPRESSED, INT8, INT32 = 14, 15, 1, 5
# Type of stored numbers → NumPy's.
NUMBERS: Mapping[int, str] = {
    1: 'i1', 2: 'u1', 3: 'i2', 4: 'u2', 5: 'i4', 6: 'u4', 7: 'f4', 9: 'f8', 12: 'i8', 13: 'u8', 16: 'u1', 17: 'u2',
}  # fmt: skip
STRUCT, CHARACTERS = 2, 4
NUMERIC = range(6, 16)
COMPLEX = 0x800


def read_mat(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    """Yield the tables of a MATLAB file."""
    try:
        content = read_bounded(path, MAX_FILE_BYTES)
        if content.startswith(b'MATLAB 7.3'):
            yield from read_matlab_hdf5(path, place, mapping)
            return
        arrays = _arrays(content)
    except (OSError, ValueError, LookupError, struct.error, zlib.error) as error:
        raise InvalidData(f"'{place}' cannot be read as a MATLAB file: {error}; save it again with -v7") from error
    yield from tables_of(tuple(arrays), arrays.__getitem__, place, mapping)


@dataclass(frozen=True)
class _Element:
    """A part of the file: its type and its bytes."""

    kind: int
    data: memoryview


def _arrays(content: bytes) -> dict[str, AnyArray]:
    if not content.startswith(b'MATLAB 5') or len(content) < HEAD or content[126:128] not in (b'IM', b'MI'):
        raise FileRefused('it is no MATLAB file of version 5 or 7')
    order = '<' if content[126:128] == b'IM' else '>'
    budget = budget_of(len(content))
    found: dict[str, AnyArray] = {}
    for element in _elements(memoryview(content)[HEAD:], order):
        inner = element
        if element.kind == COMPRESSED:
            [inner] = list(_elements(memoryview(_inflated(element.data, budget)), order))[:1] or [element]
        if inner.kind == MATRIX:
            _collect(inner.data, order, '', found, depth=0)
    return found


def _inflated(data: memoryview, budget: Budget) -> bytes:
    content = zlib.decompressobj().decompress(data, budget.left + 1)
    budget.spend(len(content))
    return content


def _elements(data: memoryview, order: str) -> Iterator[_Element]:
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f'{order}II', data, at)
        if kind >> 16:  # up to four bytes stand in the tag itself
            small = kind >> 16
            if small > 4:
                raise FileRefused(f'it has a short element of {small} bytes')
            yield _Element(kind & 0xFFFF, data[at + 4 : at + 4 + small])
            at += 8
            continue
        if at + 8 + size > len(data):
            raise FileRefused(f'it promises an element of {size} bytes, which is cut off')
        yield _Element(kind, data[at + 8 : at + 8 + size])
        at += 8 + size + (0 if kind == COMPRESSED else -size % 8)


def _collect(
    data: memoryview, order: str, prefix: str, found: dict[str, AnyArray], *, depth: int, name: str = ''
) -> None:
    """Add the numeric arrays of a matrix and what it contains; others are left out."""
    parts = list(_elements(data, order))
    if len(parts) < 3 or depth > MAX_DEPTH or len(found) > MAX_ARRAYS:
        return
    flags = struct.unpack_from(f'{order}I', parts[0].data)[0]
    shape = tuple(np.frombuffer(parts[1].data, f'{order}i4').tolist())
    name = prefix + (name or bytes(parts[2].data).decode('latin-1'))
    kind = flags & 0xFF
    if kind == STRUCT and math.prod(shape) == 1 and len(parts) > 4:
        width = int(np.frombuffer(parts[3].data, f'{order}i4')[0])
        if width <= 0:
            raise FileRefused(f"its struct '{name}' has names of {width} characters")
        names = [bytes(parts[4].data[at : at + width]).split(b'\0')[0] for at in range(0, len(parts[4].data), width)]
        for field, part in zip(names, parts[5:], strict=False):
            if part.kind == MATRIX:
                _collect(part.data, order, f'{name}/', found, depth=depth + 1, name=field.decode('latin-1'))
    elif kind in NUMERIC and not flags & COMPLEX and len(parts) > 3 and parts[3].kind in NUMBERS:
        found[name] = _matrix(parts[3], shape, order, name)
    elif kind == CHARACTERS and len(parts) > 3 and parts[3].kind in NUMBERS and math.prod(shape) == shape[-1]:
        found[name] = np.array([''.join(map(chr, np.frombuffer(parts[3].data, order + NUMBERS[parts[3].kind])[:100]))])


def _matrix(part: _Element, shape: tuple[int, ...], order: str, name: str) -> AnyArray:
    values = np.frombuffer(part.data, order + NUMBERS[part.kind])
    if min(shape, default=0) < 0 or math.prod(shape) != len(values):
        raise FileRefused(f"its array '{name}' of shape {shape} has {len(values)} values")
    return values.reshape(shape, order='F')
