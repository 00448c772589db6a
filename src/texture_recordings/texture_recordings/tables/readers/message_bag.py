"""Bags of standard messages: each number of a message is a column, such as '/wrench/wrench.force.x'."""

from __future__ import annotations

import fnmatch
import struct
from collections.abc import Iterator, Mapping
from functools import cache, partial
from pathlib import Path

import numpy as np
from rosbags.interfaces import Connection
from rosbags.serde import SerdeError
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from texture_core.arrays import AnyArray, Array
from texture_core.errors import InvalidData
from texture_core.signal import NANOSECONDS
from texture_recordings.bags import RawMessage, read_foreign
from texture_recordings.cdr import typestore
from texture_recordings.tables.mapping import CONDITION_UNITS, TableMapping
from texture_recordings.tables.readers.arrays import table_columns
from texture_recordings.tables.readers.message_columns import RULES, Rows, one_row
from texture_recordings.tables.table import Table, check_size

TIME = 'time'
BROKEN = (SerdeError, struct.error, UnicodeDecodeError, ValueError, IndexError, AssertionError, KeyError)
# Not among the messages of ROS 2 itself. Definitions in bags are not used: they would become code.
AUDIO: Mapping[str, str] = {
    'audio_common_msgs/msg/AudioData': 'uint8[] data',
    'audio_common_msgs/msg/AudioDataStamped': 'std_msgs/Header header\nAudioData audio',
}


def read_message_bag(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    """Yield the one table of a bag: the topics that the mapping names, each with its time.

    Times are those of the headers, or of logging where there are none, from the first message of the bag on.
    """
    wanted = wanted_columns(mapping)
    topics: dict[str, _Topic] = {}
    first_ns, values = -1, 0
    for message in read_foreign(path, partial(_is_wanted, wanted)):
        topic = topics.setdefault(message.topic, _Topic(message.topic, message.msgtype, place))
        stamp_ns = topic.add(message)
        first_ns = stamp_ns if first_ns < 0 else first_ns
        values += topic.width
        check_size(values, place)
    columns: dict[str, AnyArray] = {}
    clocks: dict[str, str] = {}
    for name, topic in topics.items():
        clock = f'{name}/{TIME}'
        columns[clock] = topic.time_s(first_ns)
        for field, array in topic.columns().items():
            columns[f'{name}/{field}'] = array
            clocks[f'{name}/{field}'] = clock
    if not columns:
        raise InvalidData(
            f"'{place}' has no topic that the mapping names ({', '.join(sorted(wanted))}); write columns as topic and "
            "field, such as '/wrench/wrench.force.x'"
        )
    yield Table(place, tuple(columns), partial(table_columns, columns, place), clocks=clocks)


def wanted_columns(mapping: TableMapping) -> set[str]:
    """Return the names and patterns of all columns that a mapping uses."""
    names = [column for stream in mapping.streams.values() for column in stream.columns]
    names += [stream.time.column for stream in mapping.streams.values()]
    names += [mapping.label.column, mapping.session, mapping.slides.column]
    names += [getattr(mapping.conditions, name).column for name in CONDITION_UNITS]
    return set(filter(None, names))


def _is_wanted(wanted: set[str], connection: Connection) -> bool:
    topic = connection.topic
    return any(fnmatch.fnmatchcase(topic, name.rpartition('/')[0] or name) for name in wanted)


@cache
def _types() -> Typestore:
    store = typestore()
    for name, definition in AUDIO.items():
        store.register(get_types_from_msg(definition, name))
    return store


class _Topic:
    """The messages of one topic as columns."""

    def __init__(self, name: str, msgtype: str, place: str) -> None:
        if msgtype not in _types().types:
            raise InvalidData(
                f"'{place}': the messages of '{name}' are {msgtype}, which are none of ROS 2 itself; republish them as "
                'std_msgs/msg/Float32MultiArray, geometry_msgs/msg/WrenchStamped or the like'
            )
        self._name, self._msgtype, self._place = name, msgtype, place
        self._rows: list[Rows] = []
        self._stamps_ns: list[int] = []
        self._counts: list[int] = []
        self.width = 0

    def add(self, message: RawMessage) -> int:
        """Add a message, and return its time."""
        try:
            value = _types().deserialize_cdr(message.data, self._msgtype)
            rows = RULES.get(self._msgtype, one_row)(value)
        except BROKEN as error:
            raise InvalidData(
                f"'{self._place}': message {len(self._rows)} of '{self._name}' is damaged: {error}; record it again"
            ) from error
        if self._rows and rows.keys() != self._rows[0].keys():
            raise InvalidData(
                f"'{self._place}': message {len(self._rows)} of '{self._name}' has other fields than the first: "
                f'{", ".join(sorted(rows.keys() ^ self._rows[0].keys())[:5])}'
            )
        self._rows.append(rows)
        self._counts.append(max((len(array) for array in rows.values()), default=0))
        self.width = sum(len(array) for array in rows.values())
        stamp = getattr(getattr(value, 'header', None), 'stamp', None)
        stamped_ns = stamp.sec * NANOSECONDS + stamp.nanosec if stamp else 0
        self._stamps_ns.append(stamped_ns or message.log_ns)
        return self._stamps_ns[-1]

    def columns(self) -> dict[str, AnyArray]:
        """Return all columns, (n,) each."""
        names = self._rows[0]
        return {name: np.concatenate([rows[name] for rows in self._rows]) for name in names}

    def time_s(self, first_ns: int) -> Array:
        """Return the time of each row; the samples of one message lie evenly between it and the next."""
        stamps_s = (np.array(self._stamps_ns) - first_ns) / NANOSECONDS
        counts = np.array(self._counts)
        steps_s = np.diff(stamps_s, append=stamps_s[-1] + _usual(np.diff(stamps_s)))
        within = np.concatenate([np.arange(count) / max(count, 1) for count in counts])
        times: Array = np.repeat(stamps_s, counts) + np.repeat(steps_s, counts) * within
        return times


def _usual(steps_s: Array) -> float:
    return float(np.median(steps_s)) if len(steps_s) else 0.0
