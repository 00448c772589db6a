"""Data classes of texture_core to messages and back: field by field of the same name, the time in the header."""

from __future__ import annotations

import array
import typing
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

import numpy as np
from std_msgs.msg import Header
from texture_msgs import msg
from texture_msgs.action import Explore

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_core.estimates import RoughnessEstimate, TextureEstimate
from texture_core.exploration import ExplorationRequest, ExplorationState, Phase
from texture_core.features import FeatureVector
from texture_core.ros.time import to_ns, to_stamp
from texture_core.signal import TactileSignal

MESSAGES: Mapping[type, type] = {
    ExplorationState: msg.ExplorationState,
    FeatureVector: msg.FeatureVector,
    TextureEstimate: msg.TextureEstimate,
    RoughnessEstimate: msg.RoughnessEstimate,
}
DATA_CLASSES = {message: cls for cls, message in MESSAGES.items()}
STAMPS = ('stamp_ns', 'start_ns')  # the field that stands in the header
Convert = Callable[[Any], Any] | None  # None: the same on both sides


def to_msg(value: Any) -> Any:
    """Return the message of a data class of texture_core."""
    if isinstance(value, TactileSignal):
        return _signal_to_msg(value)
    stamp, fields = _plan(type(value))
    values = {name: wire(getattr(value, name)) if wire else getattr(value, name) for name, wire, _ in fields}
    if isinstance(value, ExplorationState):
        values['phase_name'] = value.phase.value
    header = Header(stamp=to_stamp(getattr(value, stamp)), frame_id=value.frame_id)
    return MESSAGES[type(value)](header=header, **values)


def from_msg(message: Any) -> Any:
    """Return the data class of a message of texture_msgs.

    Raises
    ------
    InvalidData
        If the message contradicts itself.
    """
    if isinstance(message, msg.TactileSignal):
        return _signal_from_msg(message)
    cls = DATA_CLASSES[type(message)]
    stamp, fields = _plan(cls)
    values = {name: unwire(getattr(message, name)) if unwire else getattr(message, name) for name, _, unwire in fields}
    values[stamp] = to_ns(message.header.stamp)
    values['frame_id'] = message.header.frame_id
    return cls(**values)


def _signal_to_msg(signal: TactileSignal) -> msg.TactileSignal:
    message = msg.TactileSignal(
        header=Header(stamp=to_stamp(signal.stamp_ns), frame_id=signal.frame_id),
        sensor=signal.sensor,
        channels=list(signal.channels),
        units=list(signal.units),
        sampling_rate_hz=float(signal.sampling_rate_hz),
        first_sample=signal.first_sample,
    )
    # An array.array is taken as it is; a list would be checked element by element.
    message.samples = array.array('f', np.ascontiguousarray(signal.samples, dtype=np.float32).tobytes())
    return message


def _signal_from_msg(message: msg.TactileSignal) -> TactileSignal:
    channels = tuple(message.channels)
    flat = np.array(message.samples, dtype=np.float32)
    if not channels or len(flat) % len(channels):
        raise InvalidData(
            f"signal message of '{message.sensor}' has {len(flat)} samples for {len(channels)} channels; "
            'a multiple of the number of channels is needed'
        )
    return TactileSignal(
        stamp_ns=to_ns(message.header.stamp),
        sensor=message.sensor,
        channels=channels,
        units=tuple(message.units),
        sampling_rate_hz=message.sampling_rate_hz,
        first_sample=message.first_sample,
        samples=flat.reshape(-1, len(channels)),
        frame_id=message.header.frame_id,
    )


def _phase(code: int) -> Phase:
    phases = tuple(Phase)
    if code >= len(phases):
        allowed = ', '.join(f'{phase.code} ({phase.value})' for phase in phases)
        raise InvalidData(f'exploration state has the phase {code}; allowed are {allowed}')
    return phases[code]


def _doubles(values: Array) -> array.array[float]:
    return array.array('d', np.ascontiguousarray(values, dtype=np.float64).tobytes())


# By the type of a field: to the message, and back.
CONVERT: Mapping[Any, tuple[Convert, Convert]] = {
    float: (float, None),
    tuple[str, ...]: (list, tuple),
    tuple[float, ...]: (partial(array.array, 'd'), tuple),
    Array: (_doubles, partial(np.array, dtype=np.float64)),
    Phase: (lambda phase: phase.code, _phase),
}


@cache
def _plan(cls: type) -> tuple[str, tuple[tuple[str, Convert, Convert], ...]]:
    """Return which field is the time, and each other one with what it becomes."""
    types = typing.get_type_hints(cls)
    [stamp] = [name for name in STAMPS if types.pop(name, None)]
    types.pop('frame_id')  # stands in the header, too
    return stamp, tuple((name, *CONVERT.get(kind, (None, None))) for name, kind in types.items())


def request_from_msg(goal: Any) -> ExplorationRequest:
    """Return the request in a goal of the action or a request of the service: both have the same fields."""
    return ExplorationRequest(**{name: getattr(goal, name) for name in ExplorationRequest.__dataclass_fields__})


def request_to_msg(request: ExplorationRequest, kind: Any = Explore.Goal) -> Any:
    """Return a goal of the action, or of another `kind` with the same fields."""
    return kind(**{name: getattr(request, name) for name in ExplorationRequest.__dataclass_fields__})
