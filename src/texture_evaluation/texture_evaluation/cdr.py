"""Data classes of texture_core to the bytes ROS 2 sends and records (CDR), and back, without ROS.

The message definitions are read from the .msg files of texture_msgs, so they exist once.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from texture_core.errors import InvalidData
from texture_core.estimates import RoughnessEstimate, TextureEstimate
from texture_core.exploration import ExplorationState, Phase
from texture_core.features import FeatureVector
from texture_core.resources import folder
from texture_core.signal import NANOSECONDS, TactileSignal

MESSAGES: Mapping[str, type] = {
    f'texture_msgs/msg/{cls.__name__}': cls
    for cls in (TactileSignal, ExplorationState, FeatureVector, TextureEstimate, RoughnessEstimate)
}
TYPES: Mapping[type, str] = {cls: name for name, cls in MESSAGES.items()}
# Where a field is not the same thing on both sides, by its name.
TO_WIRE: Mapping[str, Callable[[Any], Any]] = {
    'phase': lambda phase: phase.value,
    'channels': list,
    'names': list,
    'labels': list,
    'samples': lambda samples: np.ascontiguousarray(samples, dtype=np.float32).ravel(),
    'values': lambda values: np.ascontiguousarray(values, dtype=np.float64),
    'probabilities': lambda values: np.array(values, dtype=np.float64),
}
FROM_WIRE: Mapping[str, Callable[[Any], Any]] = {
    'phase': Phase,
    'channels': tuple,
    'names': tuple,
    'labels': tuple,
    'probabilities': lambda values: tuple(values.tolist()),
}
STAMPS = {'stamp_ns', 'start_ns'}


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


def encode(value: Any) -> bytes:
    """Return a data class of texture_core as CDR."""
    types = typestore().types
    given = {item.name: getattr(value, item.name) for item in fields(value)}
    seconds, nanoseconds = divmod(next(given.pop(name) for name in STAMPS if name in given), NANOSECONDS)
    header = types['std_msgs/msg/Header'](
        stamp=types['builtin_interfaces/msg/Time'](sec=int(seconds), nanosec=int(nanoseconds)),
        frame_id=given.pop('frame_id', ''),
    )
    wired = {name: TO_WIRE[name](content) if name in TO_WIRE else content for name, content in given.items()}
    msgtype = TYPES[type(value)]
    return bytes(typestore().serialize_cdr(types[msgtype](header=header, **wired), msgtype))


def decode(raw: bytes, msgtype: str) -> Any:
    """Return the data class in the CDR of a message of texture_msgs; arrays are views of `raw`.

    Raises
    ------
    InvalidData
        If the bytes are not such a message, or it contradicts itself.
    """
    try:
        return _data_class(typestore().deserialize_cdr(raw, msgtype), MESSAGES[msgtype])
    except (SerdeError, struct.error, UnicodeDecodeError, ValueError, IndexError, AssertionError) as error:
        raise InvalidData(f'{len(raw)} bytes came as a {msgtype}, which they are not: {error}') from error


def _data_class(message: Any, cls: type) -> Any:
    stamp_ns = message.header.stamp.sec * NANOSECONDS + message.header.stamp.nanosec
    values: dict[str, Any] = {}
    for name in _names(cls):
        if name in STAMPS:
            values[name] = stamp_ns
        elif name == 'frame_id':
            values[name] = message.header.frame_id
        else:
            content = getattr(message, name)
            values[name] = FROM_WIRE[name](content) if name in FROM_WIRE else content
    if cls is TactileSignal:
        values['samples'] = values['samples'].reshape(-1, len(values['channels']))
    return cls(**values)


@cache
def _names(cls: type) -> tuple[str, ...]:
    return tuple(item.name for item in fields(cls))


class SignalDecoder:
    """Decode the signals of one stream fast: its batches differ in stamp, index and samples only."""

    def __init__(self) -> None:
        self._head = b''
        self._like: TactileSignal | None = None

    def decode(self, raw: bytes) -> TactileSignal:
        """Return the signal in the CDR of a TactileSignal; `samples` is a view of `raw`."""
        tail = STAMP_END + len(self._head)
        if self._like is None or raw[STAMP_END:tail] != self._head or not raw.startswith(LITTLE_ENDIAN):
            return self._learn(raw)
        seconds, nanoseconds = STAMP.unpack_from(raw, len(LITTLE_ENDIAN))
        first, length = INDEX_AND_LENGTH.unpack_from(raw, tail)
        columns = len(self._like.channels)
        if length % columns or len(raw) < tail + INDEX_AND_LENGTH.size + 4 * length:
            return self._learn(raw)
        samples = np.frombuffer(raw, '<f4', length, tail + INDEX_AND_LENGTH.size)
        like = self._like
        return TactileSignal(
            seconds * NANOSECONDS + nanoseconds, like.sensor, like.channels, like.unit, like.sampling_rate_hz,
            first, samples.reshape(-1, columns), like.frame_id,
        )  # fmt: skip

    def _learn(self, raw: bytes) -> TactileSignal:
        signal: TactileSignal = decode(raw, TYPES[TactileSignal])
        # The samples are the last field: what stands before them, without the stamp, is common to the stream.
        tail = len(raw) - 4 * signal.samples.size - INDEX_AND_LENGTH.size
        self._head, self._like = raw[STAMP_END:tail], signal
        return signal


LITTLE_ENDIAN = b'\x00\x01'
STAMP = struct.Struct('<2xiI')
STAMP_END = 12
INDEX_AND_LENGTH = struct.Struct('<QI')
