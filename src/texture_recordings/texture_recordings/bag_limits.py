"""Limits for bags of any origin where rosbags has none: what unpacks, how often, and which files are opened at all.

An MCAP file without its end, of a recorder that was killed, is opened as if it ended behind its last whole chunk.

rosbags unpacks first and compares afterwards, when a chunk of a kilobyte may have filled the memory; it believes the
index of an MCAP file, in which a chunk may stand a hundred thousand times; and what an SQLite file computes is not
bounded by its size.
"""

from __future__ import annotations

import io
import logging
import re
import struct
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import IO, Any, BinaryIO
from zlib import crc32

import apsw
from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
from rosbags.rosbag2 import ReaderError, reader, storage_mcap, storage_sqlite3

from texture_core.files import MB, Budget, FileRefused, open_regular, read_text, unpacked_limit
from texture_core.signal import TactileSignal

if sys.version_info >= (3, 14):
    from compression.zstd import ZstdDecompressor, ZstdError
else:
    from backports.zstd import ZstdDecompressor, ZstdError

MAX_METADATA_BYTES = 100_000  # of metadata.yaml: a file of 600 parts
# Each record in a chunk becomes objects of 150 bytes, however little it takes in the file.
RECORDS_AT_LEAST = 16
PACKED_RECORD_BYTES = 8
CHUNK = 0x06
CHUNK_HEAD = struct.Struct('<QQQI')  # start and end time, size of what it unpacks to, checksum
CHUNK_CHECKSUM_AT = 33  # from the beginning of the record of a chunk
RECORD_HEAD = struct.Struct('<BQ')
MAGIC = b'\x89MCAP0\r\n'
# The end of a file: the footer with the place of the summary, which is 0 if there is none, and its checksum; the magic.
END = b'\x02' + (20).to_bytes(8, 'little') + bytes(20) + MAGIC
FOOTER_BYTES, CHECKSUM_FROM_END = len(END), 12
# Signals are read in 10 µs each, other messages in 25 µs, and each becomes objects of up to 1.5 kB; a bag of 5 MB may
# hold so many signals, or a third of it of other messages, and larger ones another for every 8 bytes.
SIGNALS_AT_LEAST, OTHERS_COUNT = 200_000, 3
SHORT_BYTES, TEXTS_BYTES = 512, 64  # of other messages; longer ones may hold a text, which takes 1 µs, in each 8 bytes
SMALL_BAG_BYTES, SIGNAL_BYTES = 5 * MB, 8
# Windows are cut from time that was sampled, however few samples that takes. Signals of the suite take 1 kB/s or more.
RECORDED_AT_LEAST_S, BYTES_PER_S = 3600.0, 300
# SQLite counts its own steps; reading a row three times takes fewer than a hundred, and a row 30 bytes or more.
MAX_STEPS = 10_000_000
STEPS_PER_BYTE = 4
STEPS_AT_ONCE = 100_000
MAX_TABLES = 100
COMPUTED = re.compile(r'\bAS\s*\(|\bVIEW\b|\bVIRTUAL\b|\bTRIGGER\b', re.IGNORECASE)


class CheckedPath(type(Path())):  # type: ignore[misc]
    """A path from which only regular files are read, whoever opens them; files of text are short.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = CheckedPath(folder, 'metadata.yaml')
    ...     _ = Path(path).write_bytes(b'version: 9')
    ...     print(path.read_text())
    version: 9
    """

    def open(self, *_args: Any, **_options: Any) -> IO[Any]:
        """Open the file for reading bytes, an MCAP file without its end up to its last whole chunk."""
        file = open_regular(self)
        if self.suffix != '.mcap' or _has_end(file):
            return file
        end = _end_of_chunks(file)
        logging.getLogger(__name__).warning("'%s' was cut off; it is read up to its last whole chunk", self)
        return io.BufferedReader(_Ended(file, end))

    def read_text(self, encoding: str | None = None, errors: str | None = None) -> str:
        """Return the text of a short file."""
        return read_text(self, MAX_METADATA_BYTES, encoding or 'utf-8')


class _Ended(io.RawIOBase):
    """The first bytes of a file, and the end that it lacks."""

    def __init__(self, file: BinaryIO, length: int) -> None:
        self._file, self._length, self._at = file, length, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._length + len(END)}[whence]
        return self._at

    def readinto(self, buffer: Any) -> int:
        if self._at < self._length:
            self._file.seek(self._at)
            part = self._file.read(min(len(buffer), self._length - self._at))
        else:
            part = END[self._at - self._length :][: len(buffer)]
        buffer[: len(part)] = part
        self._at += len(part)
        return len(part)

    def close(self) -> None:
        self._file.close()
        super().close()


def _has_end(file: BinaryIO) -> bool:
    """Return whether an MCAP file has its end; FileRefused if the checksum of its summary is wrong."""
    size = file.seek(0, io.SEEK_END)
    file.seek(max(0, size - FOOTER_BYTES))
    end = file.read()
    if end[:9] != END[:9] or not end.endswith(MAGIC):
        file.seek(0)
        return False
    summary, checksum = int.from_bytes(end[9:17], 'little'), int.from_bytes(end[-12:-8], 'little')
    if summary and checksum:
        file.seek(min(summary, size))
        if crc32(file.read()[:-CHECKSUM_FROM_END]) != checksum:
            raise FileRefused('its index was altered: the checksum is another')
    file.seek(0)
    return True


def _end_of_chunks(file: BinaryIO) -> int:
    """Return where the last whole chunk of an MCAP file ends; power that fails may leave one of the right length."""
    size = file.seek(0, io.SEEK_END)
    chunks = []
    at = end = len(MAGIC)
    for kind, length, _ in _records(file, size):
        at += RECORD_HEAD.size + length
        if at > size or not kind:
            break
        if kind == CHUNK:
            chunks.append((at - length, length))
        end = at
    while chunks and not _is_whole(file, *chunks[-1]):
        end = chunks.pop()[0] - RECORD_HEAD.size
    file.seek(0)
    return end


def _is_whole(file: BinaryIO, at: int, length: int) -> bool:
    file.seek(at)
    content = file.read(length)
    try:
        _, _, size, checksum = CHUNK_HEAD.unpack_from(content)
        packed = CHUNK_HEAD.size + 4 + int.from_bytes(content[CHUNK_HEAD.size :][:4], 'little')
        kind = content[CHUNK_HEAD.size + 4 : packed].decode()
        storage_mcap.decompress(content[packed + 8 :], kind, size, checksum)
    except (ReaderError, ValueError, struct.error, RuntimeError, ZstdError):
        return False
    return True


def check_storage(path: Path) -> None:
    """Raise FileRefused or OSError unless a file of a bag is a regular one, within the limits."""
    with open_regular(path) as file:
        if path.suffix == '.mcap':
            _check_mcap(file)
        elif path.suffix == '.db3':
            _check_sqlite(path)


def check_index(storage: Any) -> None:
    """Raise FileRefused if the index of an opened MCAP file names a part of the file twice.

    Raises
    ------
    FileRefused
        If it does.
    """
    budget = _budget(Path(storage.path).stat().st_size)
    end = 0
    for chunk in sorted(storage.chunks, key=lambda chunk: int(chunk.chunk_start_offset)):
        if chunk.chunk_start_offset < end:
            raise FileRefused('it has an index in which chunks overlap')
        end = chunk.chunk_start_offset + RECORD_HEAD.size + CHUNK_HEAD.size + chunk.compressed_size
        budget.spend(chunk.uncompressed_size)


def messages_budget(files: Iterable[Path]) -> Budget:
    """Return how many bytes the messages of a bag may have: a damaged or altered file may give the same ones again."""
    return _budget(sum(file.stat().st_size for file in files))


class MessageLimit:
    """How many messages a bag may still have.

    Parameters
    ----------
    files
        Files of the bag.

    Examples
    --------
    >>> limit = MessageLimit([])  # of an empty bag
    >>> for _ in range(SIGNALS_AT_LEAST):
    ...     limit.spend(100, is_signal=True)
    >>> try:
    ...     limit.spend(100, is_signal=True)
    ... except FileRefused as error:
    ...     print(error)
    it has more messages than a bag of 0 MB may hold; split the recording
    """

    def __init__(self, files: Iterable[Path]) -> None:
        self._file_bytes = sum(file.stat().st_size for file in files)
        self._left = SIGNALS_AT_LEAST + max(0, self._file_bytes - SMALL_BAG_BYTES) // SIGNAL_BYTES

    def spend(self, n_bytes: int, is_signal: bool) -> None:
        """Count a message; FileRefused if there are more than the size of the bag allows.

        Raises
        ------
        FileRefused
            If there are more.
        """
        self._left -= 1 if is_signal else OTHERS_COUNT + max(0, n_bytes - SHORT_BYTES) // TEXTS_BYTES
        if self._left < 0:
            raise FileRefused(
                f'it has more messages than a bag of {self._file_bytes / MB:.3g} MB may hold; split the recording'
            )


def check_duration(path: Path, signals: Iterable[TactileSignal]) -> None:
    """Raise FileRefused if the signals of a bag stand for much more time than its size can tell of.

    Raises
    ------
    FileRefused
        If they do.
    """
    size = sum(file.stat().st_size for file in (path.iterdir() if path.is_dir() else [path]) if file.is_file())
    seconds: defaultdict[str, float] = defaultdict(float)
    for signal in signals:
        seconds[signal.sensor] += len(signal.samples) / signal.sampling_rate_hz
    most_s = RECORDED_AT_LEAST_S + size / BYTES_PER_S
    longest_s = max(seconds.values(), default=0.0)
    if longest_s > most_s:
        raise FileRefused(
            f'it has {longest_s / 3600:.3g} h of samples, and a bag of {size / MB:.3g} MB may have '
            f'{most_s / 3600:.3g} h; check the sampling rate of its signals'
        )


def _budget(file_bytes: int) -> Budget:
    return Budget(unpacked_limit(file_bytes))


def _check_mcap(file: BinaryIO) -> None:
    size = file.seek(0, 2)
    budget = _budget(size)
    for kind, _, head in _records(file, size):
        if kind == CHUNK and len(head) == CHUNK_HEAD.size:
            budget.spend(CHUNK_HEAD.unpack(head)[2])


def _records(file: BinaryIO, size: int) -> Iterator[tuple[int, int, bytes]]:
    """Yield the kind, the length and the first bytes of each record; what is damaged is left to who reads on."""
    at = len(MAGIC)
    while at + RECORD_HEAD.size <= size:
        file.seek(at)
        head = file.read(RECORD_HEAD.size + CHUNK_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            return
        kind, length = RECORD_HEAD.unpack_from(head)
        yield kind, length, head[RECORD_HEAD.size :]
        at += RECORD_HEAD.size + length


def _check_sqlite(path: Path) -> None:
    """Refuse what computes its content: what is stored is no more than the file holds."""
    connection = apsw.Connection(
        f'file:{path}?immutable=1', flags=apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI
    )  # fmt: skip
    try:
        definitions = connection.execute('SELECT sql FROM sqlite_master LIMIT ?', (MAX_TABLES + 1,)).fetchall()
    finally:
        connection.close()
    if len(definitions) > MAX_TABLES or any(COMPUTED.search(str(sql)) for (sql,) in definitions):
        raise FileRefused('it has tables that are computed, which no bag has')


class _Steps:
    """How many steps of SQLite a connection may still take."""

    def __init__(self, most: int) -> None:
        self._left = most

    def __call__(self) -> bool:
        """Count; True ends the query with an error."""
        self._left -= STEPS_AT_ONCE
        return self._left < 0


def _limit_sqlite(connection: apsw.Connection) -> None:
    size = Path(connection.filename).stat().st_size
    connection.limit(apsw.SQLITE_LIMIT_LENGTH, max(size, MB))
    connection.set_progress_handler(_Steps(MAX_STEPS + STEPS_PER_BYTE * size), STEPS_AT_ONCE)


def _unpacked(decompressor: Any, data: bytes, size: int) -> bytes:
    """Return a chunk that claims to unpack to `size`; one byte more is enough to tell that it does not."""
    if size > unpacked_limit(len(data)):
        raise ReaderError(f'a chunk of {len(data)} bytes claims to unpack to {size}')
    content = bytes(decompressor.decompress(data, max_length=size + 1))
    most = RECORDS_AT_LEAST + len(data) // PACKED_RECORD_BYTES
    if next(islice(_starts(content), most, None), None) is not None:
        raise ReaderError(f'a chunk of {len(data)} bytes unpacks to more than {most} records')
    return content


def _starts(content: bytes) -> Iterator[int]:
    """Yield where the records of a chunk begin."""
    at, end = 0, len(content) - RECORD_HEAD.size
    while at <= end:
        yield at
        at += RECORD_HEAD.size + RECORD_HEAD.unpack_from(content, at)[1]


def _no_quality_of_service(_text: Any) -> list[Any]:
    """Return nothing: the suite reads no quality of service from bags, and reading it takes seconds if it is long."""
    return []


def set_limits() -> None:
    """Set the limits in rosbags and SQLite, for this process."""
    storage_mcap.DECOMPRESSORS.update(
        zstd=lambda data, size: _unpacked(ZstdDecompressor(), data, size),
        lz4=lambda data, size: _unpacked(LZ4FrameDecompressor(), data, size),
    )
    for module in (reader, storage_mcap, storage_sqlite3):
        module.parse_qos = _no_quality_of_service  # type: ignore[attr-defined]
    if _limit_sqlite not in apsw.connection_hooks:
        apsw.connection_hooks.append(_limit_sqlite)


set_limits()
