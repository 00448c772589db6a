"""Find and read recordings: rosbag2 folders with MCAP inside, which `ros2 bag` opens too; no ROS is needed."""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import apsw
import yaml
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.typesys.base import TypesysError

from texture_core.errors import InvalidData
from texture_core.plain_data import parse_yaml
from texture_core.signal import TactileSignal
from texture_recordings.bag_limits import CheckedPath, MessageLimit, check_index, check_storage, messages_budget
from texture_recordings.cdr import MESSAGES, TYPES, SignalDecoder, decode
from texture_recordings.topic_names import connections_below, topic_names

if sys.version_info >= (3, 14):
    from compression.zstd import ZstdError
else:
    from backports.zstd import ZstdError

# What the reader raises, depending on which byte of a file is wrong.
BROKEN = (
    ReaderError, TypesysError, ZstdError, apsw.Error, yaml.YAMLError, OSError, EOFError, struct.error, RuntimeError,
    ValueError, LookupError, TypeError, AttributeError, AssertionError, MemoryError, OverflowError,
)  # fmt: skip


class RawMessage(NamedTuple):
    """One message as it lies in a bag.

    Examples
    --------
    >>> message = RawMessage('/signal', 'texture_msgs/msg/TactileSignal', 7, b'')
    >>> message.topic, message.log_ns
    ('/signal', 7)
    """

    topic: str
    msgtype: str
    log_ns: int
    data: bytes


def is_bag(path: Path) -> bool:
    """Say whether something looks like a bag: a folder with metadata.yaml or that was cut off, or an MCAP file."""
    whole = (path / 'metadata.yaml').is_file() or (path.is_file() and path.suffix == '.mcap')
    return whole or _cut_off_file(path) is not None


def _cut_off_file(path: Path) -> Path | None:
    """Return the one file of a bag whose recorder could not write the metadata."""
    if not path.is_dir() or os.path.lexists(path / 'metadata.yaml'):
        return None
    files = list(path.glob('*.mcap'))
    return files[0] if len(files) == 1 else None


def find_bags(paths: Iterable[str | Path]) -> list[Path]:
    """Return the bags among `paths`, each a bag or a folder of bags, in the order given and by name.

    Raises
    ------
    InvalidData
        If one is missing or neither.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        inside = [path] if is_bag(path) else sorted(filter(is_bag, path.glob('*')))
        if not inside:
            raise InvalidData(_no_bag(path))
        found += inside
    if not found:
        raise InvalidData('no bag was given; name one or more bags, or a folder of bags')
    return found


def _no_bag(path: Path) -> str:
    if not path.exists():
        return f"there is no bag '{path}'; give the folder that was recorded or imported"
    if path.is_dir() and next(path.glob('*.mcap'), None):
        return f"the bag '{path}' has no metadata.yaml, its recording was cut off; give its .mcap files one by one"
    return f"'{path}' is no bag; a folder with metadata.yaml and an .mcap file, or a folder of such bags, is needed"


def read_raw(
    path: str | Path, namespace: str | None = None, start_ns: int | None = None, stop_ns: int | None = None
) -> Iterator[RawMessage]:
    """Yield every message of a bag in the order of its log times, undecoded.

    Parameters
    ----------
    path
        The bag.
    namespace
        Only topics of this namespace; None if the bag has but one.
    start_ns, stop_ns
        Only messages logged from `start_ns` to before `stop_ns`.

    Yields
    ------
    RawMessage
        Topic, type, log time in ns and bytes.

    Raises
    ------
    InvalidData
        If there is no bag, it is damaged or foreign, or has several namespaces and none was named.
    """
    return (message for _, message in read_named(path, namespace, start_ns, stop_ns))


def read_named(
    path: str | Path, namespace: str | None = None, start_ns: int | None = None, stop_ns: int | None = None
) -> Iterator[tuple[str, RawMessage]]:
    """Yield what `read_raw` yields, each with the name of its topic below its namespace, 'signal' or 'finger0/signal'.

    Parameters
    ----------
    path, namespace, start_ns, stop_ns
        As of `read_raw`.

    Yields
    ------
    (str, RawMessage)
        Name below the namespace, and the message.

    Raises
    ------
    InvalidData
        As `read_raw` does.
    """
    return _read(Path(path), lambda connection, name: True, namespace, start_ns, stop_ns)


def read_bag(
    path: str | Path,
    topics: Iterable[str] | None = None,
    namespace: str | None = None,
    start_ns: int | None = None,
    stop_ns: int | None = None,
) -> Iterator[tuple[str, int, Any]]:
    """Yield (topic, log time in ns, data class of texture_core) in the order of log times.

    Only messages of the suite are read. Topics are named as below their namespace, 'signal' for '/left/signal' and
    'finger0/signal' for the first of several fingers, in `topics` as in the answer; samples are views of the bytes
    read. The other arguments are those of `read_raw`.

    Parameters
    ----------
    path
        The bag.
    topics
        Names of the topics to read below their namespace; None for all.
    namespace
        Only topics of this namespace; None if the bag has but one.
    start_ns, stop_ns
        Only messages logged from `start_ns` to before `stop_ns`.

    Yields
    ------
    (str, int, object)
        Name of the topic below its namespace, log time in ns, and data class.

    Raises
    ------
    InvalidData
        If there is no bag, or it is damaged.
    """
    wanted = None if topics is None else set(topics)
    signals: dict[str, SignalDecoder] = {}

    def chosen(connection: Connection, name: str) -> bool:
        return connection.msgtype in MESSAGES and (wanted is None or name in wanted)

    for name, message in _read(Path(path), chosen, namespace, start_ns, stop_ns):
        try:
            if message.msgtype == TYPES[TactileSignal]:
                value: Any = signals.setdefault(message.topic, SignalDecoder()).decode(message.data)
            else:
                value = decode(message.data, message.msgtype)
        except InvalidData as error:
            raise InvalidData(f"the bag '{path}' is damaged: {error}; record it again") from error
        yield name, message.log_ns, value


def topics_in(path: str | Path, namespace: str | None = None) -> list[str]:
    """Return the names of the topics of the suite in a bag, below their namespace, sorted.

    Parameters
    ----------
    path, namespace
        As of `read_raw`.

    Raises
    ------
    InvalidData
        As `read_raw` does.
    """
    names: set[str] = set()

    def note(connection: Connection, name: str) -> bool:
        names.update([name] if connection.msgtype in MESSAGES else [])
        return False

    for _ in _read(Path(path), note, namespace, None, None):
        pass  # no connection is chosen, so no message comes: `note` has seen them all
    return sorted(names)


def read_foreign(path: str | Path, chosen: Callable[[Connection], bool]) -> Iterator[RawMessage]:
    """Yield messages of a bag that the suite did not record, undecoded, in the order of their log times.

    Parameters
    ----------
    path
        The bag.
    chosen
        Says of a connection whether its messages are wanted.

    Raises
    ------
    InvalidData
        If there is no bag or it is damaged.
    """
    found = _read(Path(path), lambda connection, name: chosen(connection), None, None, None, foreign=True)
    return (message for _, message in found)


def _read(
    path: Path,
    chosen: Callable[[Connection, str], bool],
    namespace: str | None,
    start_ns: int | None,
    stop_ns: int | None,
    *,
    foreign: bool = False,
) -> Iterator[tuple[str, RawMessage]]:
    if not is_bag(path):
        raise InvalidData(_no_bag(path))
    try:
        checked = CheckedPath(_cut_off_file(path) or path)
        files = _files(checked)
        for file in files:
            check_storage(file)
        budget, limit = messages_budget(files), MessageLimit(files)
        with Reader(checked) as reader:
            for storage in getattr(reader.storage, 'storages', [reader.storage]):
                if hasattr(storage, 'chunks'):
                    check_index(storage)
            own = reader.connections if foreign else connections_below(path, reader.connections, namespace)
            names = topic_names(c.topic for c in reader.connections if c.msgtype in MESSAGES)
            connections = [c for c in own if chosen(c, names.get(c.topic, c.topic))]
            if not connections or not reader.message_count:
                return
            missing = sum(connection.msgcount for connection in connections)
            for connection, log_ns, data in reader.messages(connections, start_ns, stop_ns):
                missing -= 1
                budget.spend(len(data))
                limit.spend(len(data), connection.msgtype == TYPES[TactileSignal])
                name = names.get(connection.topic, connection.topic)
                yield name, RawMessage(connection.topic, connection.msgtype, log_ns, data)
            if missing and start_ns is None and stop_ns is None:
                raise ReaderError(f'{missing} of its messages are missing')
    except BROKEN as error:
        raise InvalidData(
            f"the bag '{path}' cannot be read, it is damaged or cut off: {error}; record it again"
        ) from error


def _files(path: Path) -> list[Path]:
    """Return the files of a bag; one of `BROKEN` is raised if it may as a whole unpack to anything."""
    if not path.is_dir():
        return [path]
    facts = parse_yaml((path / 'metadata.yaml').read_text(encoding='utf-8'))['rosbag2_bagfile_information']
    if str(facts.get('compression_mode') or 'none').lower() != 'none':
        raise ReaderError('it is compressed as a whole; let `ros2 bag convert` make it MCAP, which compresses inside')
    # As rosbags finds them: beside the metadata, wherever the entry says that they were.
    return [path / Path(str(name)).name for name in facts['relative_file_paths']]
