"""Data classes of texture_core to the bytes ROS 2 sends and records (CDR), and back, without ROS.

The message definitions are read from the .msg files of texture_msgs, so they exist once.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from texture_core.arrays import Array
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
PHASES = tuple(Phase)
Convert = tuple[Callable[[Any], Any], Callable[[Any], Any]]
# By the type of a field, where it is not the same on both sides: to the wire, and back.
WIRE: Mapping[Any, Convert] = {
    Phase: (lambda phase: phase.code, PHASES.__getitem__),
    tuple[str, ...]: (list, tuple),
    tuple[float, ...]: (lambda values: np.array(values, dtype=np.float64), lambda values: tuple(values.tolist())),
    Array: (lambda values: np.ascontiguousarray(values, dtype=np.float64), lambda values: values),
    NDArray[np.float32]: (lambda samples: np.ascontiguousarray(samples, dtype=np.float32).ravel(), lambda flat: flat),
}
SAME: Convert = (lambda value: value, lambda value: value)
STAMPS = {'stamp_ns', 'start_ns'}


@cache
def typestore() -> Typestore:
    """Return the message types of ROS 2 Jazzy and of the suite.

    Raises
    ------
    InvalidData
        If the message definitions of the suite are not installed.
    """
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
    cls: type = type(value)
    given = {name: to_wire(getattr(value, name)) for name, (to_wire, _) in _fields(cls).items()}
    if isinstance(value, ExplorationState):
        given['phase_name'] = value.phase.value
    seconds, nanoseconds = divmod(next(given.pop(name) for name in STAMPS if name in given), NANOSECONDS)
    header = types['std_msgs/msg/Header'](
        stamp=types['builtin_interfaces/msg/Time'](sec=int(seconds), nanosec=int(nanoseconds)),
        frame_id=given.pop('frame_id', ''),
    )
    return bytes(typestore().serialize_cdr(types[TYPES[cls]](header=header, **given), TYPES[cls]))


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
    for name, (_, from_wire) in _fields(cls).items():
        if name in STAMPS:
            values[name] = stamp_ns
        elif name == 'frame_id':
            values[name] = message.header.frame_id
        else:
            values[name] = from_wire(getattr(message, name))
    if cls is TactileSignal:
        values['samples'] = values['samples'].reshape(-1, len(values['channels']))
    return cls(**values)


@cache
def _fields(cls: type) -> Mapping[str, Convert]:
    """Return what becomes of each field."""
    return {name: WIRE.get(kind, SAME) for name, kind in get_type_hints(cls).items()}


class SignalDecoder:
    """Decode the signals of one stream fast: its batches differ in stamp, index and samples only.

    Examples
    --------
    >>> batch = TactileSignal(5, 'finger', ('pac',), (), 1000.0, 0, np.array([[1.0], [2.0]], dtype=np.float32))
    >>> decoder = SignalDecoder()
    >>> [decoder.decode(encode(batch)).samples[:, 0].tolist() for _ in range(2)]
    [[1.0, 2.0], [1.0, 2.0]]
    """

    def __init__(self) -> None:
        self._head = b''
        self._like: TactileSignal | None = None
        self._heads_left = MAX_HEADS_BYTES

    def decode(self, raw: bytes) -> TactileSignal:
        """Return the signal in the CDR of a TactileSignal; `samples` is a view of `raw`."""
        like, tail = self._like, STAMP_END + len(self._head)
        if like is None or raw[STAMP_END:tail] != self._head or not raw.startswith(LITTLE_ENDIAN):
            return self._decode_first(raw)
        seconds, nanoseconds = STAMP.unpack_from(raw, len(LITTLE_ENDIAN))
        first, length = INDEX_AND_LENGTH.unpack_from(raw, tail)
        columns = len(like.channels)
        if length % columns or len(raw) < tail + INDEX_AND_LENGTH.size + 4 * length:
            return self._decode_first(raw)
        samples = np.frombuffer(raw, '<f4', length, tail + INDEX_AND_LENGTH.size)
        return TactileSignal(
            seconds * NANOSECONDS + nanoseconds, like.sensor, like.channels, like.units, like.sampling_rate_hz,
            first, samples.reshape(-1, columns), like.frame_id,
        )  # fmt: skip

    def _decode_first(self, raw: bytes) -> TactileSignal:
        _check_texts(raw)
        signal: TactileSignal = decode(raw, TYPES[TactileSignal])
        # The samples are the last field: what stands before them, without the stamp, is common to the stream.
        tail = len(raw) - 4 * signal.samples.size - INDEX_AND_LENGTH.size
        self._head, self._like = raw[STAMP_END:tail], signal
        self._heads_left -= len(self._head)
        if self._heads_left < 0:
            raise InvalidData(f"the channels of sensor '{signal.sensor}' change again and again")
        return signal


def _check_texts(raw: bytes) -> None:
    """Raise InvalidData if a TactileSignal has more channels or units than any sensor: a text takes 8 bytes."""
    try:
        at = STAMP_END
        for _ in ('frame', 'sensor'):
            at = _after_text(raw, at)
        for name in ('channels', 'units'):
            (count,) = LENGTH.unpack_from(raw, at)
            if count > MAX_CHANNELS:
                raise InvalidData(f'a signal has {count} {name}; {MAX_CHANNELS} are allowed')
            at += LENGTH.size
            for _ in range(count):
                at = _after_text(raw, at)
    except struct.error:
        pass  # whoever reads on says what is wrong


def _after_text(raw: bytes, at: int) -> int:
    (length,) = LENGTH.unpack_from(raw, at)
    return -(-(at + LENGTH.size + int(length)) // LENGTH.size) * LENGTH.size


LITTLE_ENDIAN = b'\x00\x01'
STAMP = struct.Struct('<2xiI')
STAMP_END = 12
INDEX_AND_LENGTH = struct.Struct('<QI')
LENGTH = struct.Struct('<I')
MAX_CHANNELS = 4096
MAX_HEADS_BYTES = 2_000_000  # a stream says the same of itself all the time, unless its driver is started again
