"""Bags of standard messages: each number of a message is a column, such as '/wrench/wrench.force.x'."""

from __future__ import annotations

import dataclasses
import fnmatch
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

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
from texture_recordings.tables.tables import Table, table_columns

MAX_FIELDS = 2000  # of one message
Rows = Mapping[str, AnyArray]  # name → values of one message, (n,) each; n > 1 where it holds consecutive samples


def one_row(value: Any) -> Rows:
    """Return every number and text of a message by its path, such as 'wrench.force.x' or 'data.3'."""
    found: dict[str, AnyArray] = {}
    _collect(value, '', found)
    return found


def _collect(value: Any, path: str, found: dict[str, AnyArray]) -> None:
    if len(found) > MAX_FIELDS:
        raise ValueError(f'it has more than {MAX_FIELDS} numbers')
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            if field.name not in ('header', '__msgtype__'):
                _collect(getattr(value, field.name), f'{path}.{field.name}' if path else field.name, found)
    elif isinstance(value, (np.ndarray, Sequence)) and not isinstance(value, str):
        if len(value) > MAX_FIELDS:
            raise ValueError(f"'{path}' has {len(value)} numbers; {MAX_FIELDS} are allowed")
        for number, part in enumerate(value):
            _collect(part, f'{path}.{number}', found)
    else:
        found[path] = np.array([value])


def _joints(value: Any) -> Rows:
    """Return position, velocity and effort by the names of the joints."""
    kinds = ('position', 'velocity', 'effort')
    return {
        f'{kind}.{joint}': np.array([number])
        for kind in kinds
        for joint, number in zip(value.name, getattr(value, kind), strict=False)
    }


def _multi_array(value: Any) -> Rows:
    """Return a row of numbers; consecutive rows if the layout has two dimensions, (n_samples, n_channels)."""
    shape = [dim.size for dim in value.layout.dim]
    data = value.data[value.layout.data_offset :]
    table = data.reshape(shape) if len(shape) == 2 else data[None]
    if table.shape[1] > MAX_FIELDS:
        raise ValueError(f'it has {table.shape[1]} channels; {MAX_FIELDS} are allowed')
    return {f'data.{number}': table[:, number] for number in range(table.shape[1])}


def _audio(value: Any) -> Rows:
    """Return the samples of sound of one channel, 16 bits little endian; full scale is 1."""
    data = getattr(value, 'audio', value).data
    return {'data': np.frombuffer(data.tobytes(), '<i2') / 32768.0}


RULES: Mapping[str, Callable[[Any], Rows]] = {
    'sensor_msgs/msg/JointState': _joints,
    'std_msgs/msg/Float32MultiArray': _multi_array,
    'std_msgs/msg/Float64MultiArray': _multi_array,
    'audio_common_msgs/msg/AudioData': _audio,
    'audio_common_msgs/msg/AudioDataStamped': _audio,
}


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
    first_ns = -1
    for message in read_foreign(path, partial(_is_wanted, wanted)):
        topic = topics.setdefault(message.topic, _Topic(message.topic, message.msgtype, place))
        stamp_ns = topic.add(message)
        first_ns = stamp_ns if first_ns < 0 else first_ns
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
