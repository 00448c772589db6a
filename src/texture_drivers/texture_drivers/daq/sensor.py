"""The data acquisition finger as a sensor of the suite: all its channels on 'signal'."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.errors import InvalidParameter
from texture_core.parameters import from_mapping, param
from texture_core.plain_data import safe_repr
from texture_drivers.daq import tables
from texture_drivers.framed_stream import FramedStream
from texture_drivers.params import SensorParams
from texture_drivers.serial_sensor import SerialSensor
from texture_drivers.settings import read_settings
from texture_drivers.stream_decoder import StreamDecoder

DEFAULT_SETTINGS = 'daq'


@dataclass(frozen=True)
class DaqChannel:
    """What is wired to one input of the converter: sample = gain · count + offset."""

    name: str = param('', 'Sets the name of the channel, which must be unique in the file.')
    unit: str = param('V', 'Sets the unit of the published samples.')
    gain: float = param(1.0, 'Sets the factor from counts to the unit; a larger value gives larger samples.')
    offset: float = param(0.0, 'Sets the value of 0 counts in the unit, which is added to every sample.')


@dataclass(frozen=True)
class DaqSettings:
    """Parameters of the analogue-to-digital converter."""

    baud: int = param(
        tables.BAUD,
        'Sets the baud rate of a real UART in bit/s; a USB device ignores it. It must equal that of the device.',
        low=9600,
        high=12_000_000,
    )
    rate_hz: float = param(
        tables.RATE_HZ,
        'Sets the nominal sampling rate of every channel; it must equal that of the device.',
        unit='Hz',
        low=1.0,
        high=1e5,
    )


def daq(params: SensorParams, now_ns: Callable[[], int] = time.time_ns) -> SerialSensor:
    """Return the sensor; its settings are `config/sensors/daq.yaml` unless `params.config` says otherwise."""
    settings, channels = load_daq(params.config or DEFAULT_SETTINGS)
    decoder = StreamDecoder([stream(settings.rate_hz, channels)], params.frame_id)
    return SerialSensor(params, now_ns, decoder, baud=settings.baud)


def load_daq(config: str) -> tuple[DaqSettings, list[DaqChannel]]:
    """Return the converter and its channels; see `texture_drivers.settings.load_settings`.

    Raises
    ------
    InvalidParameter
        If the channels are missing, or two have one name.
    """
    content = read_settings(config)
    listed = content.pop('channels', None)
    if not isinstance(listed, list) or not listed:
        raise InvalidParameter(f'settings {config} have the `channels` {safe_repr(listed)}; list one for each input')
    channels = [from_mapping(DaqChannel, item, f'settings {config}, channel {i + 1}') for i, item in enumerate(listed)]
    if len({channel.name for channel in channels} - {''}) < len(channels):
        raise InvalidParameter(f'settings {config}: give each channel a `name` of its own')
    return from_mapping(DaqSettings, content, f'settings {config}'), channels


def stream(rate_hz: float, channels: Sequence[DaqChannel]) -> FramedStream:
    """Return what the device sends, as the line understands it."""
    return FramedStream(
        topic=tables.TOPIC,
        kind=tables.KIND,
        sensor=tables.SENSOR,
        rate_hz=rate_hz,
        channels=tuple(channel.name for channel in channels),
        units=tuple(channel.unit for channel in channels),
        gains=np.array([channel.gain for channel in channels]),
        offsets=np.array([channel.offset for channel in channels]),
    )
