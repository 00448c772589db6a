# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read and write bags (MCAP) of the suite's messages, of any origin."""

from __future__ import annotations

import io
import logging
import os
import re
import shutil
import sqlite3
import struct
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from functools import cache, partial
from itertools import accumulate, pairwise
from pathlib import Path
from typing import IO, Any, BinaryIO, NamedTuple, cast
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from texture_core.config import (
    MB,
    PARSE_ERRORS,
    FileRefused,
    folder,
    open_regular,
    parse_yaml,
    read_bounded,
    read_text,
    writing,
)
from texture_core.errors import InvalidData, InvalidParameter, MissingLibrary, TextureError
from texture_core.types import (
    DATA_CLASSES,
    NANOSECONDS,
    QUALITIES,
    RESTARTED,
    Array,
    ExplorationRequest,
    ExplorationState,
    MessageCodec,
    Phase,
    Quality,
    TactileSignal,
    checked_label,
)

try:
    import lz4.frame
    from rosbags.interfaces import (
        Connection,
        MessageDefinitionFormat,
        Nodetype,
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )
    from rosbags.rosbag2 import (
        CompressionFormat,
        CompressionMode,
        Reader,
        ReaderError,
        StoragePlugin,
        Writer,
        reader,
        storage_mcap,
        storage_sqlite3,
    )
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    from rosbags.typesys.store import Typestore

    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
except ModuleNotFoundError as error:  # rosbags brings the others
    raise MissingLibrary('rosbags', 'bags', 'bags') from error

# --------------------
# Which files of a bag are opened: regular ones, and an MCAP file without its end, of a recorder that was killed, as if
# it ended behind its last whole chunk.

MAX_METADATA_BYTES = 100_000  # of metadata.yaml: a file of 600 parts
MAX_UNPACKED_BYTES, MAX_RATIO = 200 * MB, 100  # of a bag or what is held at once; ratio of unpacked to packed size
MAX_MESSAGE_BYTES = 4 * MB  # of one of others, whose elements of a byte take 150 each as objects
SQLITE = b'SQLite format 3\0'
# The tables and indices of a bag by SQLite: no views, no computed columns.
PLAIN_SQL = re.compile(r'CREATE (TABLE|INDEX) \w+\s*(ON \w+\s*)?\([^()]*\)')
MESSAGE, CHUNK = 0x05, 0x06
CHUNK_CHECKSUM_AT = 33  # from the beginning of the record of a chunk
CHUNK_HEAD = struct.Struct('<QQQI')  # start and end time, size of what it unpacks to, checksum
RECORD_HEAD = struct.Struct('<BQ')
MAGIC = b'\x89MCAP0\r\n'
# The end of a file: the footer with the place of the summary, which is 0 if there is none, and its checksum; the magic.
END = b'\x02' + (20).to_bytes(8, 'little') + bytes(20) + MAGIC
FOOTER_BYTES, CHECKSUM_FROM_END = len(END), 12


def _check_unpacked(unpacked: int, size: int) -> None:
    most = max(MAX_UNPACKED_BYTES, MAX_RATIO * size)
    if unpacked > most:
        raise FileRefused(
            f'it unpacks from {size / MB:.3g} MB to more than the {most / MB:.0f} MB that are allowed; cut or split it'
        )


def _check_held(size: int, what: str) -> int:
    if size > MAX_UNPACKED_BYTES:
        raise FileRefused(
            f'it has {what} of {size / MB:.0f} MB; at most {MAX_UNPACKED_BYTES // MB} MB are read at once'
        )
    return size


def _unpack_zstd(data: bytes, size: int) -> bytes:
    return zstd.ZstdDecompressor().decompress(data, _check_held(size, 'a chunk') + 1)


def _unpack_lz4(data: bytes, size: int) -> bytes:
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, _check_held(size, 'a chunk') + 1))


# rosbags unpacks whatever comes; here it stops at what a chunk declares. Nor does it parse, channel by channel, which
# quality of service was offered: to read needs none.
storage_mcap.DECOMPRESSORS |= {'zstd': _unpack_zstd, 'lz4': _unpack_lz4}
for module in (reader, storage_mcap, storage_sqlite3):
    vars(module)['parse_qos'] = lambda _offered: []


class CheckedPath(type(Path())):  # type: ignore[misc]
    """A path from which only regular files are read; files of text are short."""

    def open(self, *_args: Any, **_options: Any) -> IO[Any]:
        """Open an MCAP file for reading bytes, one without its end up to its last whole chunk."""
        file = _Records(cast('io.BufferedReader', open_regular(self, None)).detach())
        if not MAGIC.startswith(file.read(len(MAGIC))):
            raise FileRefused('it is no MCAP file, whatever its name; give one that a recorder wrote')
        small = file.seek(0, io.SEEK_END) < 50 * MB  # a larger one takes as much memory anyway
        whole = _has_end(file)
        if whole and not small:
            return file
        end = _end_of_chunks(file)
        if whole:
            return file
        if not end:
            raise FileRefused(
                'it was cut off before its first part was complete, so nothing of it can be read; record it again'
            )
        logging.getLogger(__name__).warning("'%s' was cut off; it has nothing behind its last whole chunk", self)
        return cast('IO[Any]', _Ended(file, end))

    def read_text(self, encoding: str | None = None) -> str:
        """Return the text of a short file."""
        return read_text(self, MAX_METADATA_BYTES, encoding or 'utf-8')


class _Records(io.BufferedReader):
    """A file of records: a hole in it takes no space on the disk, and may be declared as a record, or as many."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Return the next bytes."""
        content = super().read(_check_held(size or 0, 'a record') if size is not None else size)
        if size == 1 and content == b'\0':
            raise FileRefused('it has a record of kind 0, which there is not in MCAP')
        return content


class _Ended:
    """A file up to its last whole chunk, behind which it has the end that it lacks."""

    def __init__(self, file: BinaryIO, length: int) -> None:
        self._file, self._length = file, length
        self.tell, self.close = file.tell, file.close

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place; from the end on, to where the end that is lacking begins."""
        if whence == io.SEEK_END:
            return self._file.seek(self._length)
        return self._file.seek(offset, whence)

    def read(self, size: int = -1) -> bytes:
        """Return the next bytes."""
        return END if self._file.tell() == self._length else self._file.read(size)


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
        if crc32(file.read(max(0, size - summary))[:-CHECKSUM_FROM_END]) != checksum:
            raise FileRefused('its index was altered: the checksum differs')
    file.seek(0)
    return True


def _end_of_chunks(file: BinaryIO) -> int:
    """Return where the last whole chunk of an MCAP file ends, 0 if none is whole and no message is outside of one.

    Power that fails may leave a chunk of the right length.
    """
    size = file.seek(0, io.SEEK_END)
    chunks, unpacked, messages = [], 0, False
    at = end = len(MAGIC)
    while at + RECORD_HEAD.size <= size:
        file.seek(at)
        kind, length = RECORD_HEAD.unpack(file.read(RECORD_HEAD.size))
        at += RECORD_HEAD.size + length
        if at > size or not kind:
            break
        if kind == CHUNK:
            unpacked += int.from_bytes(file.read(CHUNK_HEAD.size)[16:24], 'little')
            _check_unpacked(unpacked, size)
            chunks.append((at - length, length))
        messages |= kind == MESSAGE
        end = at
    while chunks and not _is_whole(file, *chunks[-1]):
        end = chunks.pop()[0] - RECORD_HEAD.size
    file.seek(0)
    return end if chunks or messages else 0


def _is_whole(file: BinaryIO, at: int, length: int) -> bool:
    file.seek(at)
    content = file.read(length)
    try:
        _, _, size, checksum = CHUNK_HEAD.unpack_from(content)
        packed = CHUNK_HEAD.size + 4 + int.from_bytes(content[CHUNK_HEAD.size :][:4], 'little')
        kind = content[CHUNK_HEAD.size + 4 : packed].decode()
        storage_mcap.decompress(content[packed + 8 :], kind, size, checksum)
    except (ReaderError, ValueError, EOFError, struct.error, RuntimeError, zstd.ZstdError):
        return False
    return True


# --------------------
# Data classes of texture_core to the bytes ROS 2 sends and records (CDR), and back, without ROS.
#
# The message definitions are read from the .msg files of texture_msgs, so they exist once.

MESSAGES: Mapping[str, type] = {
    f'texture_msgs/msg/{cls.__name__}': cls for cls in DATA_CLASSES if cls is not ExplorationRequest
}
TYPES: Mapping[type, str] = {cls: name for name, cls in MESSAGES.items()}


@cache
def typestore() -> Typestore:
    """Return the message types of ROS 2 Jazzy and of the suite."""
    store = get_typestore(Stores.ROS2_JAZZY)
    directory = folder('texture_msgs', 'msg')
    definitions = sorted(directory.glob('*.msg'))
    if not definitions:
        raise InvalidData(f"no message definitions in '{directory}'; build or source the workspace first")
    for path in definitions:
        store.register(get_types_from_msg(path.read_text(encoding='utf-8'), f'texture_msgs/msg/{path.stem}'))
    return store


# Of a message of others; rosbags makes code for each element of an array of fixed length.
MAX_DEFINITION_CHARACTERS, MAX_FIELDS, MAX_DEPTH = 100_000, 2000, 20


def message_types(connection: Connection | None = None) -> Typestore:
    """Return message types by the definition that a bag stores for a connection, else those of ROS 2."""
    definition = connection.msgdef if connection else None
    if connection and definition and definition.format is MessageDefinitionFormat.MSG:
        typestore = get_typestore(Stores.EMPTY)
        if len(definition.data) > MAX_DEFINITION_CHARACTERS:
            raise InvalidData(
                f'the definition of {connection.msgtype} has {len(definition.data)} characters; at most '
                f'{MAX_DEFINITION_CHARACTERS} are read, republish it as a standard message'
            )
        parsed = get_types_from_msg(definition.data, connection.msgtype)
        # Constants and defaults are left out: of a file nothing but names, as the grammar allows them, becomes code.
        types = {name: fields for name, (_, fields, *_) in parsed.items()}
        _check_size(types, connection.msgtype)
        typestore.register({name: ([], fields) for name, fields in types.items()})
        return typestore
    return get_typestore(Stores.ROS2_JAZZY)


def _check_size(types: Mapping[str, Sequence[Any]], msgtype: str) -> None:
    """Refuse types that contain themselves, or more values than are read by the fixed lengths of their arrays."""

    def count(kind: Nodetype, part: Any) -> int:
        if kind is Nodetype.BASE:
            return 1
        if kind is Nodetype.NAME:
            return values.get(part, 1)
        inner, length = part
        if kind is Nodetype.ARRAY and not length:
            raise InvalidData(f'{msgtype} has an array of 0 elements, which take no bytes; republish it without')
        return count(*inner) * (length if kind is Nodetype.ARRAY else 1)

    # A message is one value and those of its fields; it has settled after as many rounds as messages are nested.
    values = dict.fromkeys(types, 1)
    for _ in range(MAX_DEPTH):
        found = {name: 1 + sum(count(*field) for _, field in fields) for name, fields in types.items()}
        if found == values:
            break
        values = found
    else:
        raise InvalidData(f'{msgtype} contains itself, or messages nested deeper than {MAX_DEPTH}; republish it flat')
    if max(values.values()) > MAX_FIELDS:
        raise InvalidData(
            f'{msgtype} has {max(values.values())} values by the lengths of its arrays; at most {MAX_FIELDS} are read, '
            'republish those that are needed'
        )


CODEC = MessageCodec(
    lambda name: typestore().types[name],
    {
        tuple[float, ...]: (partial(np.array, dtype=np.float64), lambda values: tuple(values.tolist())),
        Array: (partial(np.ascontiguousarray, dtype=np.float64), None),
        NDArray[np.float32]: (lambda samples: np.ascontiguousarray(samples, dtype=np.float32).ravel(), None),
    },
)


def encode(value: Any) -> bytes:
    """Return a data class of texture_core as CDR."""
    return bytes(typestore().serialize_cdr(CODEC.to_message(value), TYPES[type(value)]))


def decode(raw: bytes, msgtype: str) -> Any:
    """Return the data class in the CDR of a message of texture_msgs; arrays are views of `raw`."""
    try:
        return CODEC.from_message(typestore().deserialize_cdr(raw, msgtype), MESSAGES[msgtype])
    except (SerdeError, struct.error, UnicodeDecodeError, ValueError, IndexError, AssertionError) as error:
        raise InvalidData(f'{len(raw)} bytes came as a {msgtype}, which they are not: {error}') from error


# --------------------
# The names of the topics of a sensor in a bag.

EXPLORATION = 'exploration'


def short_name(topic: str) -> str:
    """Return the last part of a topic's name: 'signal' of '/left/signal'."""
    return topic.rsplit('/', 1)[-1]


def connections_below(path: Path, connections: list[Connection], namespace: str | None) -> list[Connection]:
    """Return the connections of the suite's messages in a namespace, and those of the diagnostics."""
    if not connections:
        return []
    ours = [c for c in connections if c.msgtype in MESSAGES]
    if not ours:
        named = ', '.join(sorted({c.msgtype for c in connections}))
        raise InvalidData(
            f"the bag '{path}' holds {named}; messages of texture_msgs are needed, record the suite's topics"
        )
    for connection in ours:
        if connection.digest and connection.digest != typestore().hash_rihs01(connection.msgtype):
            raise InvalidData(
                f"the bag '{path}' was recorded with another definition of {connection.msgtype}; record it again"
            )
    names = topic_names(c.topic for c in ours)
    namespaces = {topic: topic.removesuffix(name).rstrip('/') or '/' for topic, name in names.items()}
    found = sorted(set(namespaces.values()))
    if namespace is None and len(found) > 1:
        raise InvalidData(f"the bag '{path}' has the namespaces {', '.join(found)}; name one of them (--namespace)")
    prefix = found[0] if namespace is None else '/' + namespace.strip('/')
    if prefix not in found:
        raise InvalidData(f"the bag '{path}' has no namespace '{prefix}'; it has {', '.join(found)}")
    common = [c for c in connections if c.topic == '/diagnostics']
    return [c for c in ours if namespaces[c.topic] == prefix] + common


def topic_names(topics: Iterable[str]) -> dict[str, str]:
    """Return the name of each topic below its namespace, which is the folder of its explorer.

    Several fingers of one explorer stream on 'finger0/signal' and so on; a topic without an explorer above it belongs
    to the folder in which it is.
    """
    given = list(topics)
    explorers = {_folder(topic) for topic in given if short_name(topic) == EXPLORATION}
    names = {}
    for topic in given:
        folder = _folder(topic)
        while folder and folder not in explorers:
            folder = _folder(folder)
        names[topic] = topic.removeprefix(f'{folder}/') if folder in explorers else short_name(topic)
    return names


def _folder(topic: str) -> str:
    return topic.rpartition('/')[0]


# --------------------
# Find and read recordings: rosbag2 folders with MCAP inside, which `ros2 bag` opens too; no ROS is needed.


BagPaths = str | Path | Iterable[str | Path]


class RawMessage(NamedTuple):
    """One message as stored in a bag."""

    topic: str
    msgtype: str
    log_ns: int
    data: bytes


def is_bag(path: Path) -> bool:
    """Return whether something looks like a bag: a folder with metadata.yaml or that was cut off, or an MCAP file."""
    whole = (path / 'metadata.yaml').is_file() or (path.is_file() and path.suffix == '.mcap')
    return whole or _cut_off_file(path) is not None


def _cut_off_file(path: Path) -> Path | None:
    """Return the one file of a bag without whole metadata, or whose metadata leave out how it is stored."""
    if not path.is_dir():
        return None
    if os.path.lexists(path / 'metadata.yaml'):
        try:
            if _metadata(path).get('storage_identifier'):
                return None
        except (OSError, FileRefused):
            return None
    files = list(path.glob('*.mcap'))
    return files[0] if len(files) == 1 else None


def _metadata(path: Path) -> dict[str, Any]:
    """Return what metadata.yaml states of a bag, nothing if it is damaged."""
    content = read_bounded(path / 'metadata.yaml', MAX_METADATA_BYTES)
    try:
        facts: dict[str, Any] = parse_yaml(content.decode())['rosbag2_bagfile_information']
        return facts if facts['relative_file_paths'] else {}
    except PARSE_ERRORS:
        return {}


def is_cut_off(path: Path) -> bool:
    """Return whether a file of a bag has no end, as that of a recorder that was killed."""
    for one in path.glob('*.mcap') if path.is_dir() else [path]:
        with open_regular(one, None) as file:
            if not _has_end(file):
                return True
    return False


def find_bags(paths: BagPaths) -> list[Path]:
    """Return the bags of all `paths`, or of one, in the order given."""
    found = [bag for path in ([paths] if isinstance(paths, str | Path) else paths) for bag in bags_in(path)]
    if not found:
        raise InvalidData('no bag was given; name one or more bags, or a folder of bags')
    return found


def bags_in(path: str | Path) -> list[Path]:
    """Return the bag at `path`, or those in the folder there, by name."""
    path = Path(path)
    found = [path] if is_bag(path) else sorted(filter(is_bag, path.glob('*')))
    if not found:
        raise InvalidData(_no_bag(path))
    return found


def _no_bag(path: Path) -> str:
    if not path.exists():
        return f"there is no bag '{path}'; give the folder that was recorded or imported"
    if path.is_dir() and next(path.glob('*.mcap'), None):
        return f"the bag '{path}' has no metadata.yaml, its recording was cut off; give its .mcap files one by one"
    return f"'{path}' is not a bag; a folder with metadata.yaml and an .mcap file, or a folder of such bags, is needed"


def read_named(
    path: str | Path, namespace: str | None = None, start_ns: int | None = None, stop_ns: int | None = None
) -> Iterator[tuple[str, RawMessage]]:
    """Yield every message of a bag in the order of its log times, undecoded, with the name of its topic."""
    return _read(Path(path), lambda connection, name: True, namespace, start_ns, stop_ns)


def read_bag(
    path: str | Path, topics: Iterable[str] | None = None, namespace: str | None = None
) -> Iterator[tuple[str, int, Any]]:
    """Yield (topic, log time in ns, data class of texture_core) in the order of log times.

    Only messages of the suite are read. Topics are named as below their namespace, 'signal' for '/left/signal' and
    'finger0/signal' for the first of several fingers, in `topics` as in the answer; samples are views of the bytes
    read.
    """
    wanted = None if topics is None else set(topics)

    def chosen(connection: Connection, name: str) -> bool:
        return connection.msgtype in MESSAGES and (wanted is None or name in wanted)

    for name, message in _read(Path(path), chosen, namespace):
        try:
            value = decode(message.data, message.msgtype)
        except InvalidData as error:
            raise InvalidData(f"the bag '{path}' is damaged: {error}; record it again") from error
        yield name, message.log_ns, value


def topics_in(path: str | Path, namespace: str | None = None) -> list[str]:
    """Return the names of the topics of the suite in a bag, below their namespace, sorted."""
    names: set[str] = set()

    def note(connection: Connection, name: str) -> bool:
        names.update([name] if connection.msgtype in MESSAGES else [])
        return False

    for _ in _read(Path(path), note, namespace):
        pass  # no connection is chosen, so no message comes: `note` has seen them all
    return sorted(names)


def read_foreign(path: str | Path, chosen: Callable[[Connection], bool]) -> Iterator[RawMessage]:
    """Yield messages of a bag that the suite did not record, undecoded, in the order of their log times."""
    found = _read(Path(path), lambda connection, name: chosen(connection), foreign=True)
    return (message for _, message in found)


def _read(
    path: Path,
    chosen: Callable[[Connection, str], bool],
    namespace: str | None = None,
    start_ns: int | None = None,
    stop_ns: int | None = None,
    *,
    foreign: bool = False,
) -> Iterator[tuple[str, RawMessage]]:
    if not is_bag(path):
        raise InvalidData(_no_bag(path))
    try:
        checked = CheckedPath(_cut_off_file(path) or path)
        files = _files(checked)
        more = {file.name for file in path.glob('*') if file.suffix in ('.mcap', '.db3')} - {
            file.name for file in files
        }
        if foreign and path.is_dir() and more:
            raise FileRefused(f'{", ".join(sorted(more)[:3])} is not listed in its metadata.yaml; ros2 bag reindex')
        for file in files:
            with open_regular(file, None) as opened:
                if opened.read(len(SQLITE)) == SQLITE:
                    _check_database(file)
        with Reader(checked) as bag:
            _check_chunks(bag)
            candidates = bag.connections if foreign else connections_below(path, bag.connections, namespace)
            names = topic_names(c.topic for c in bag.connections if c.msgtype in MESSAGES)
            connections = [c for c in candidates if chosen(c, names.get(c.topic, c.topic))]
            if not connections or not bag.message_count:
                return
            missing = sum(connection.msgcount for connection in connections)
            for connection, log_ns, data in bag.messages(connections, start_ns, stop_ns):
                missing -= 1
                if foreign and len(data) > MAX_MESSAGE_BYTES:
                    raise FileRefused(
                        f"it has a message of {len(data) / MB:.3g} MB on '{connection.topic}'; at most "
                        f'{MAX_MESSAGE_BYTES // MB} MB are read'
                    )
                name = names.get(connection.topic, connection.topic)
                yield name, RawMessage(connection.topic, connection.msgtype, log_ns, data)
            if missing and start_ns is None and stop_ns is None:
                raise FileRefused(
                    f'{missing} of its messages are missing; record it again, or remove metadata.yaml and use the rest'
                )
    except TextureError:
        raise
    except FileRefused as error:
        raise InvalidData(f"the bag '{path}' cannot be read: {error}") from error
    except Exception as error:  # whatever the reader raises, which depends on the byte that is wrong
        raise InvalidData(
            f"the bag '{path}' cannot be read, it is damaged or cut off: {error}; record it again"
        ) from error


def _check_chunks(bag: Reader) -> None:
    """Refuse a bag whose chunks unpack to too much, in all or at one time: those that overlap are held together."""
    for storage in getattr(bag.storage, 'storages', [bag.storage]):
        chunks = [
            (c.message_start_time, c.message_end_time, c.uncompressed_size) for c in getattr(storage, 'chunks', ())
        ]
        _check_unpacked(sum(size for _, _, size in chunks), storage.path.stat().st_size)
        changes = [(begin, size) for begin, _, size in chunks]
        changes += [(max(begin, end) + 1, -size) for begin, end, size in chunks]
        for held in accumulate(size for _, size in sorted(changes)):
            _check_held(held, 'chunks of one time')


def _check_database(path: Path) -> None:
    """Refuse a bag by SQLite that computes what is read from it, or has a message that is too large."""
    if {*'?#%'} & {*str(path)}:
        raise FileRefused(f"its path '{path}' has one of ?, # and %, by which SQLite finds another file; rename it")
    with closing(sqlite3.connect(f'file:{path}?immutable=1', uri=True)) as database:
        for name, sql in database.execute('SELECT name, sql FROM sqlite_master'):
            if sql and not PLAIN_SQL.fullmatch(sql):
                raise FileRefused(f"'{name}' in it is none of the plain tables of a bag, and may compute without end")
        _check_held(database.execute('SELECT max(length(data)) FROM messages').fetchone()[0] or 0, 'a message')


def _files(path: Path) -> list[Path]:
    """Return the files of a bag."""
    if not path.is_dir():
        return [path]
    facts = _metadata(path)
    if not facts:
        raise FileRefused('its metadata.yaml is damaged; make it again: ros2 bag reindex')
    mode = str(facts.get('compression_mode', '')).lower()
    if mode in {'file', 'message'}:
        raise FileRefused(f'it is compressed by {mode}, and storage alone is read so; unpack it by ros2 bag convert')
    # As rosbags finds them: next to the metadata, whatever folder the entry names.
    files = [path / Path(str(name)).name for name in facts['relative_file_paths']]
    if missing := [file.name for file in files if not file.exists()]:
        raise FileRefused(f"its file '{missing[0]}' is missing; copy it there, or use the rest: ros2 bag reindex")
    return files


# --------------------
# Whether streams of samples arrive without gaps.


class Continuity:
    """Count lost samples and restarts of streams, from the running index of their batches."""

    def __init__(self) -> None:
        self.samples: Counter[str] = Counter()
        self.lost: Counter[str] = Counter()
        self.restarts: Counter[str] = Counter()
        self._next: dict[str, int] = {}

    @property
    def losses(self) -> str:
        """What was lost, in words, '' if nothing; losses in a restart, which numbers from 0, are unknown."""
        lost, restarts = self.lost.total(), self.restarts.total()
        unknown = f'unknown losses in {restarts} restart{"s" if restarts > 1 else ""} of {RESTARTED}'
        known = f'{lost} samples lost (or slides that a replay left out)'  # which number their samples likewise
        return ', and '.join(filter(None, (known * bool(lost), unknown * bool(restarts))))

    def update(self, stream: str, signal: TactileSignal) -> None:
        """Take the next batch of a stream; an index that goes back is a restart of its driver, not a loss."""
        if stream.endswith('_baseline'):  # the level of a tare, which has no index
            return
        jump = signal.first_sample - self._next.get(stream, signal.first_sample)
        self.samples[stream] += len(signal.samples)
        self.lost[stream] += max(0, jump)
        self.restarts[stream] += jump < 0
        self._next[stream] = signal.next_sample


# --------------------
# Write recordings: rosbag2 folders with MCAP inside, which `ros2 bag` opens too; no ROS is needed.

OTHER_PLACE = 'folder, or free some space'  # if one cannot be written
FOREVER = QosTime(2147483647, 4294967295)


def _offered(quality: Quality) -> Qos:
    reliability = QosReliability.RELIABLE if quality.reliable else QosReliability.BEST_EFFORT
    durability = QosDurability.TRANSIENT_LOCAL if quality.latched else QosDurability.VOLATILE
    keep, lively = QosHistory.KEEP_LAST, QosLiveliness.AUTOMATIC
    return Qos(keep, quality.depth, reliability, durability, FOREVER, FOREVER, lively, FOREVER, False)


# Of topics that the suite does not publish, or under a standard name. Late subscribers get all that is latched.
LATCHED = Quality(100, reliable=True, latched=True)
COMMON: Mapping[str, Quality] = {
    '/diagnostics': Quality(100, reliable=True, latched=False),
    '/parameter_events': Quality(1000, reliable=True, latched=False),
    '/rosout': Quality(1000, reliable=True, latched=True),
    '/tf_static': LATCHED,
}


def refuse_existing(path: str | Path) -> None:
    """Refuse a path for a new bag where something exists."""
    if Path(path).exists():
        raise InvalidData(f"'{path}' exists already; a bag is never overwritten, name another or remove it")


@contextmanager
def new_folder(path: Path) -> Iterator[None]:
    """Make a folder for what a `with` block writes into it, and remove it if that ends with an error."""
    if path.exists():
        raise InvalidParameter(f"'{path}' exists already; nothing is overwritten, name another folder or remove it")
    try:
        with writing(path, OTHER_PLACE):
            path.mkdir(parents=True)
            yield
    except BaseException:
        shutil.rmtree(path, ignore_errors=True)
        raise


class BagWriter:
    """Write a new bag; use it in a `with` block, at the end of which the bag is complete."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._connections: dict[tuple[str, str], Connection] = {}
        self.qualities: dict[str, Quality] = {}  # of topics that are none of the suite, as they were offered
        refuse_existing(self.path)
        self._writer = Writer(self.path, version=8, storage_plugin=StoragePlugin.MCAP)
        self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writing(path, OTHER_PLACE):
            self._writer.open()
        storage: Any = self._writer.storage
        self._storage = storage
        # rosbags writes 0 for the checksum of a chunk, so that a whole chunk would look like one that the disk
        # has in part: the checksum is written over it.
        self._close_chunk = self._storage.close_chunk
        self._storage.close_chunk = self._close_with_checksum

    def write(self, topic: str, value: Any, log_ns: int) -> None:
        """Write a data class of texture_core as received at `log_ns`."""
        self.write_raw(RawMessage(topic, TYPES[type(value)], log_ns, encode(value)))

    def write_raw(self, message: RawMessage) -> None:
        """Write a message that is CDR already."""
        key = message.topic, message.msgtype
        if key not in self._connections:
            self._connections[key] = self._connect(*key)
        with writing(self.path, OTHER_PLACE):
            self._writer.write(self._connections[key], message.log_ns, message.data)

    def flush(self) -> None:
        """Bring to the disk what was written: it can be read whatever happens to this process or machine."""
        with writing(self.path, OTHER_PLACE):
            if self._storage.chunk.msgs:
                self._storage.close_chunk()
            self._storage.bio.flush()
            os.fsync(self._storage.bio.fileno())

    def close(self) -> None:
        """Complete the bag."""
        # Of a disk that is full the file is closed without what is waiting for it.
        with writing(self.path, OTHER_PLACE), closing(self._storage.bio.raw):
            self._writer.close()
        with writing(self.path, OTHER_PLACE), self._storage.path.open('r+b') as file:
            file.seek(-FOOTER_BYTES, os.SEEK_END)
            file.seek(int.from_bytes(file.read(FOOTER_BYTES)[9:17], 'little'))
            checksum = crc32(file.read()[:-CHECKSUM_FROM_END])
            file.seek(-CHECKSUM_FROM_END, os.SEEK_END)
            file.write(checksum.to_bytes(4, 'little'))

    def _close_with_checksum(self) -> None:
        file, checksum = self._storage.bio, crc32(self._storage.chunk.bio.getbuffer())
        at = file.tell() + CHUNK_CHECKSUM_AT
        self._close_chunk()
        file.seek(at)
        file.write(checksum.to_bytes(4, 'little'))
        file.seek(0, os.SEEK_END)

    def _connect(self, topic: str, msgtype: str) -> Connection:
        name = topic if topic.startswith('/') else f'/{topic}'
        known = LATCHED if name.endswith('_baseline') else COMMON.get(name, QUALITIES.get(short_name(name)))
        quality = known or self.qualities.get(name)
        # For `ros2 bag play`, which offers what was offered when it was recorded.
        qos = [_offered(quality)] if quality else []
        return self._writer.add_connection(name, msgtype, typestore=typestore(), offered_qos_profiles=qos)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


# --------------------
# Slides of others, which have no log times and mostly no stamps: these are made up.

START_NS, PAUSE_NS = 1_000_000_000 * NANOSECONDS, NANOSECONDS  # where the first slide begins, and between two of them
BATCH_S = 0.1
DELAY_NS = 100_000  # a batch is logged this long after its last sample
MAX_BAGS = 500

# By topic: all samples of a slide, and their places on the grid, (n,).
SlideStreams = Mapping[str, tuple[TactileSignal, NDArray[Any]]]


def slide_batches(
    signal: TactileSignal, index: NDArray[Any], start_ns: int, *, batch_s: float = BATCH_S
) -> Iterator[TactileSignal]:
    """Yield the samples of a slide in batches; each loss begins a new one."""
    rate_hz, first = signal.sampling_rate_hz, signal.first_sample
    step = max(1, round(batch_s * rate_hz))
    borders = {0, *(np.flatnonzero(np.diff(index) != 1) + 1).tolist(), len(index)}
    for begin, end in pairwise(sorted(borders)):
        for row in range(begin, end, step):
            place, part = int(index[row]), signal.samples[row : min(row + step, end)].astype(np.float32)
            stamp_ns = start_ns + round(place / rate_hz * NANOSECONDS)
            yield replace(signal, stamp_ns=stamp_ns, first_sample=first + place, samples=part)


class SlideBags:
    """Bags below a folder, written slide by slide; use it in a `with` block, where an error removes them again.

    Each slide begins a second after the one before, in whatever bag that is, so slides keep their order over all bags.
    Without a folder nothing is written.
    """

    def __init__(self, out: str | Path | None) -> None:
        self._out = None if out is None else Path(out)
        self._makes_out = self._out is not None and not self._out.exists()
        self._open = ExitStack()
        self._open.push(self._remove)
        self._bags: dict[str, BagWriter] = {}
        self._next: Counter[tuple[str, str]] = Counter()
        self._now_ns = START_NS

    @property
    def paths(self) -> list[Path]:
        """Paths of the bags in the order in which they were begun."""
        return [bag.path for bag in self._bags.values()]

    def write(self, session: str, states: Sequence[ExplorationState], streams: SlideStreams) -> None:
        """Write a slide, whose stamps count from 0, and its end into the bag of a session."""
        bag = self._bag(session)
        if bag is None:
            return
        messages: list[tuple[int, str, Any]] = []
        end_ns = 1
        for topic, (signal, index) in streams.items():
            numbered = replace(signal, first_sample=self._next[session, topic])
            for batch in slide_batches(numbered, index, self._now_ns):
                messages.append((batch.end_ns + DELAY_NS, topic, batch))
                self._next[session, topic] = batch.next_sample
            end_ns = max(end_ns, round(float(index[-1] + 1) / signal.sampling_rate_hz * NANOSECONDS))
        ends = [replace(states[-1], stamp_ns=end_ns, phase=phase) for phase in (Phase.LIFT, Phase.DONE)]
        for state, after in pairwise([*states, *ends[states[-1].phase is Phase.LIFT :], ends[-1]]):
            at_ns, steady_s = self._now_ns + state.stamp_ns, max(0, after.stamp_ns - state.stamp_ns) / NANOSECONDS
            # Before the first batch that it covers, and after those before it.
            log_ns = at_ns + DELAY_NS * (2 * (state.stamp_ns > 0) + (state.phase is Phase.DONE))
            stamped = replace(state, stamp_ns=at_ns, steady_s=steady_s, progress=state.stamp_ns / end_ns)
            messages.append((log_ns, EXPLORATION, stamped))
        for log_ns, topic, value in sorted(messages, key=lambda message: message[0]):
            bag.write(topic, value, log_ns)
        self._now_ns += end_ns + PAUSE_NS

    def _bag(self, session: str) -> BagWriter | None:
        if session not in self._bags:
            name = checked_label(session)
            if not name or name.startswith('.') or len(self._bags) >= MAX_BAGS:
                raise InvalidData(
                    f"no bag can be named '{name}' as the {len(self._bags) + 1}th; at most {MAX_BAGS} bags with plain "
                    'names are made, choose another `session`'
                )
            if self._out is None:
                return None
            self._out.mkdir(parents=True, exist_ok=True)
            self._bags[session] = self._open.enter_context(BagWriter(self._out / name))
        return self._bags[session]

    def __enter__(self) -> SlideBags:
        return self

    def __exit__(self, *error: Any) -> None:
        self._open.__exit__(*error)

    def _remove(self, error: type[BaseException] | None, *_: object) -> None:
        """Remove the bags, which are closed, and a new folder after an error; also after one of closing them."""
        for path in self.paths if error else ():
            shutil.rmtree(path, ignore_errors=True)
        if error and self._out and self._makes_out:
            with suppress(OSError):  # another import may have written there
                self._out.rmdir()
