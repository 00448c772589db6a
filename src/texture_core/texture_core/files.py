"""Open and read files of any origin: regular files only, and never more of them than a limit.

What a header or a directory says of a size is not believed: bytes are counted while they are read.
"""

from __future__ import annotations

import errno
import math
import os
import stat
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import IO, Any, BinaryIO, Protocol, TypeVar

import numpy as np

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidParameter

MB = 1_000_000
# What compressed content may unpack to: 16 MB, and ten times the size of the file. Models and data sets reach 4 times.
UNPACKED_BYTES = 16 * MB
UNPACKED_TIMES = 10
MAX_MEMBERS = 20_000
BLOCK_BYTES = 1 << 18
KINDS: Mapping[str, Callable[[int], bool]] = {
    'a folder': stat.S_ISDIR,
    'a named pipe': stat.S_ISFIFO,
    'a socket': stat.S_ISSOCK,
    'a device': lambda mode: stat.S_ISCHR(mode) or stat.S_ISBLK(mode),
}
HEADERS: Mapping[tuple[int, int], Callable[..., tuple[tuple[int, ...], bool, np.dtype[Any]]]] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
MAX_HEADER_CHARACTERS = 10_000
LAST_CHARACTER = 0x10FFFF  # of Unicode; NumPy keeps 32 bits for each and compares none
# What NumPy raises at a header that is no literal, is cut off or is nested without end.
BROKEN_HEADER = (
    ValueError, TypeError, SyntaxError, tokenize.TokenError, EOFError, RecursionError, MemoryError, OverflowError,
)  # fmt: skip
BROKEN_ARCHIVE = (
    zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OverflowError, LookupError,
)  # fmt: skip


T = TypeVar('T')


class Readable(Protocol):
    """What bytes come from."""

    def read(self, size: int, /) -> bytes:
        """Return at most so many bytes, b'' at the end."""


class FileRefused(ValueError):
    """A file that is not read: of a kind or size that is not allowed. The sentence begins with 'it'."""


class Budget:
    """How many bytes may still come out of one file."""

    def __init__(self, most_bytes: int) -> None:
        self._most, self._left = most_bytes, most_bytes

    def spend(self, count: int) -> None:
        """Subtract bytes; FileRefused if fewer are left.

        Raises
        ------
        FileRefused
            If fewer are left.
        """
        self._left -= count
        if self._left < 0:
            raise FileRefused(
                f'it unpacks to more than {self._most / MB:.3g} MB, which is the limit for a file of its size'
            )

    @property
    def left(self) -> int:
        """Bytes that may still come."""
        return self._left


def unpacked_limit(file_bytes: int) -> int:
    """Return how many bytes a compressed file may unpack to."""
    return UNPACKED_BYTES + UNPACKED_TIMES * file_bytes


def open_regular(path: str | Path) -> BinaryIO:
    """Open a regular file for reading, without waiting.

    A device is not even opened: opening a serial line may reset what is connected to it. Since the path may lead to
    another file a moment later, what was opened is examined as well.

    Raises
    ------
    OSError
        If there is no such file, or it may not be read.
    FileRefused
        If it is a folder, a device, a named pipe or a socket, also behind a symbolic link.
    """
    _check_regular(os.stat(path).st_mode)  # noqa: PTH116  # the same call as below, on a path
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    try:
        _check_regular(os.fstat(number).st_mode)
        return os.fdopen(number, 'rb')
    except BaseException:
        os.close(number)
        raise


def read_bounded(path: str | Path, most_bytes: int) -> bytes:
    """Return the bytes of a regular file.

    Raises
    ------
    OSError, FileRefused
        If it cannot be opened, see `open_regular`, or is larger than `most_bytes`.
    """
    with open_regular(path) as file:
        return take_all(file, most_bytes)


def read_text(path: str | Path, most_bytes: int, encoding: str = 'utf-8') -> str:
    """Return the text in a regular file; see `read_bounded`, UnicodeDecodeError (a ValueError) if it is no text.

    Parameters
    ----------
    path
        Path of the file.
    most_bytes
        Largest allowed size in bytes.
    encoding
        Encoding of the text.

    Returns
    -------
    str
        The whole text.
    """
    return read_bounded(path, most_bytes).decode(encoding)


@contextmanager
def writing(path: str | Path, other: str = 'file') -> Iterator[None]:
    """Say in one sentence, within a `with` block, that a file or folder cannot be written.

    Parameters
    ----------
    path
        What the block writes.
    other
        What to name instead, such as 'folder'.

    Raises
    ------
    InvalidParameter
        If the block raises OSError.
    """
    try:
        yield
    except OSError as error:
        raise InvalidParameter(f"'{path}' cannot be written: {error.strerror}; name another {other}") from error


def take_all(file: Readable, most_bytes: int) -> bytes:
    """Return what a stream still holds; FileRefused if that is more than `most_bytes`.

    Raises
    ------
    FileRefused
        If it holds more than is allowed.
    """
    parts, count = [], 0
    while part := file.read(BLOCK_BYTES):
        count += len(part)
        if count > most_bytes:
            raise FileRefused(f'it has more than {most_bytes / MB:.3g} MB, which is the limit for such a file')
        parts.append(part)
    return b''.join(parts)


def read_array(file: Readable, budget: Budget, *, records: bool = False) -> AnyArray:
    """Return the array in a stream of NumPy's format (.npy); nothing in it is run.

    Memory is taken as the values come, and not as the header claims. Each value counts as 8 bytes at least, since
    it will be computed with as such. With `records`, records of plain numbers are read, too.

    Parameters
    ----------
    file
        Stream at the beginning of the array.
    budget
        Bytes that may still be taken; what is read is subtracted.
    records
        Whether records are allowed.

    Returns
    -------
    (...)
        Array of the shape that the file states.

    Raises
    ------
    FileRefused
        If it is no such array, its values do not follow, or they are more than the budget allows.
    """
    shape, fortran, dtype = _array_header(file, records)
    n_bytes = math.prod(shape) * dtype.itemsize
    budget.spend(max(n_bytes, math.prod(shape) * 8))
    content = bytearray()
    while len(content) < n_bytes:
        part = file.read(min(BLOCK_BYTES, n_bytes - len(content)))
        if not part:
            raise FileRefused(f'it promises an array of shape {shape}, whose values are cut off')
        content += part
    characters = np.frombuffer(content, np.dtype(np.uint32).newbyteorder(dtype.byteorder)) if dtype.kind == 'U' else ()
    if np.max(characters, initial=0) > LAST_CHARACTER:
        raise FileRefused('it promises texts, and holds what are no characters')
    return np.frombuffer(content, dtype).reshape(shape, order='F' if fortran else 'C')


class Archive:
    """The members of a zip file, such as .npz or .skops, read within a limit that all share.

    The limit is that of `unpacked_limit`, and it is the bytes that come out which count, however often and under
    whatever names the same ones are stored.

    Parameters
    ----------
    file
        Open file; stays with the caller.

    Raises
    ------
    FileRefused
        If it is no zip file, or has more members than any file of this suite.
    """

    def __init__(self, file: IO[bytes]) -> None:
        size = file.seek(0, os.SEEK_END)
        self.budget = Budget(unpacked_limit(size))
        try:
            self._zip = zipfile.ZipFile(file)
        except (*BROKEN_ARCHIVE, ValueError) as error:
            raise FileRefused(f'it is no archive that can be read: {error}') from error
        members = self._zip.infolist()
        if len(members) > MAX_MEMBERS:
            raise FileRefused(f'it has {len(members)} members; {MAX_MEMBERS} are allowed')
        self.names = tuple(dict.fromkeys(member.filename for member in members))

    def __enter__(self) -> Archive:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._zip.close()

    def read(self, name: str, most_bytes: int | None = None) -> bytes:
        """Return a member; FileRefused if it is damaged or larger than the limit allows, KeyError if there is none."""
        most = self.budget.left if most_bytes is None else min(most_bytes, self.budget.left)
        return self._of_member(name, lambda member: self._whole(member, most))

    def array(self, name: str, *, records: bool = False) -> AnyArray:
        """Return the array in a member, see `read_array`; KeyError if there is no such member.

        Returns
        -------
        (...)
            Array of the shape that the member states.
        """
        return self._of_member(name, lambda member: read_array(member, self.budget, records=records))

    def _whole(self, member: _Counted, most_bytes: int) -> bytes:
        content = take_all(member, most_bytes)
        self.budget.spend(len(content))
        return content

    def _of_member(self, name: str, use: Callable[[_Counted], T]) -> T:
        info = self._zip.getinfo(name)
        _check_compression(info)
        try:
            with self._zip.open(info) as opened:
                member = _Counted(opened)
                result = use(member)
                rest = member.read(1)  # the checksum is compared at the end
        except BROKEN_ARCHIVE as error:
            raise FileRefused(f"its member '{name}' is damaged: {error}") from error
        if rest or member.count != info.file_size:
            raise FileRefused(f"its member '{name}' has not the {info.file_size} bytes that its directory states")
        return result


def _check_compression(info: zipfile.ZipInfo) -> None:
    # Other methods take gigabytes for a few bytes, and no file of this suite has them.
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise FileRefused(f"its member '{info.filename}' is compressed by method {info.compress_type}; use 'deflate'")


class _Counted:
    """What comes out of a member of an archive, counted."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.count = 0

    def read(self, size: int) -> bytes:
        """Return at most so many bytes, b'' at the end."""
        part = self._file.read(size)
        self.count += len(part)
        return part


class Arrays:
    """The arrays of an .npz file by name, read one at a time within one limit; see `Archive`."""

    def __init__(self, file: IO[bytes]) -> None:
        self._archive = Archive(file)
        self._members = {name.removesuffix('.npy'): name for name in self._archive.names if name.endswith('.npy')}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arrays."""
        return tuple(self._members)

    def __contains__(self, name: str) -> bool:
        return name in self._members

    def __getitem__(self, name: str) -> AnyArray:
        """Return an array; KeyError if there is none of this name, FileRefused if it is damaged or too large."""
        return self._archive.array(self._members[name])


def _check_regular(mode: int) -> None:
    if stat.S_ISREG(mode):
        return
    kind = next((name for name, holds in KINDS.items() if holds(mode)), 'something else')
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    raise FileRefused(f'it is {kind}; a regular file is needed')


def _array_header(file: Readable, records: bool) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    try:
        version = np.lib.format.read_magic(file)  # type: ignore[no-untyped-call]
        if version not in HEADERS:
            raise FileRefused(f'it is an array of format {version}; {", ".join(map(str, HEADERS))} are known')
        shape, fortran, dtype = HEADERS[version](file, max_header_size=MAX_HEADER_CHARACTERS)
    except FileRefused:
        raise
    except BROKEN_HEADER as error:
        raise FileRefused(f'it has no array header that can be read: {type(error).__name__}: {error}') from error
    if dtype.hasobject:
        raise FileRefused('it is an array of Python objects, which would run code; plain numbers or texts are needed')
    if dtype.kind not in 'biufcUS' and not (records and _is_record(dtype)):
        raise FileRefused(f'it is an array of {dtype}; plain numbers or texts are needed')
    if not dtype.itemsize or any(type(length) is not int or length < 0 for length in shape):
        raise FileRefused(f'it promises an array of shape {shape} of {dtype}, which there is not')
    return shape, fortran, dtype


def _is_record(dtype: np.dtype[Any]) -> bool:
    """Return whether a type is a record of plain numbers."""
    return bool(dtype.names) and all(dtype[name].kind in 'biuf' for name in dtype.names or ())
