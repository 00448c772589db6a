"""The numbers of standard messages as columns of a table."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray

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
