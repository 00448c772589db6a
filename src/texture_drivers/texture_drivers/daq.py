# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Eight channels of a data acquisition board on a serial line."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.config import from_mapping, param, safe_repr
from texture_core.errors import InvalidParameter
from texture_drivers.sensor import SensorParams, read_settings
from texture_drivers.serial_line import FramedSensor, FramedStream, baud_param

# --------------------
# Numbers of the data acquisition finger.
#
# The frame layout is of this project (see `texture_core.framing`); rate and channels are of Jamali & Sammut 2010.

TOPIC = 'signal'
SENSOR = 'daq'
KIND = 0x01
RATE_HZ = 2500.0  # after a low-pass of 500 Hz
BAUD = 921600  # in frames of 10 samples, 8 channels at 2.5 kHz are 44 kB/s; 115200 baud carry 11.5 kB/s


# --------------------
# The data acquisition finger as a sensor of the suite: all its channels on 'signal'.

DEFAULT_SETTINGS = 'daq'


@dataclass(frozen=True)
class DaqChannel:
    """What is wired to one input of the converter: sample = gain · count + offset."""

    name: str = param('', 'Name of the channel, which must be unique in the file.')
    unit: str = param('V', 'Unit of the published samples.')
    gain: float = param(1.0, 'Factor from counts to the unit.')
    offset: float = param(0.0, 'Value of 0 counts in the unit, which is added to every sample.')


@dataclass(frozen=True)
class DaqSettings:
    """Parameters of the analogue-to-digital converter."""

    baud: int = baud_param(BAUD)
    rate_hz: float = param(
        RATE_HZ,
        'Nominal sampling rate of every channel; it must equal that of the device.',
        unit='Hz',
        low=1.0,
        high=1e5,
    )


def daq(params: SensorParams, now_ns: Callable[[], int] = time.time_ns) -> FramedSensor:
    """Return the sensor; its settings are `config/sensors/daq.yaml` unless `params.config` names others."""
    settings, channels = load_daq(params.config or DEFAULT_SETTINGS)
    return FramedSensor(params, now_ns, [stream(settings.rate_hz, channels)], baud=settings.baud)


def load_daq(config: str) -> tuple[DaqSettings, list[DaqChannel]]:
    """Return the converter and its channels; see `texture_drivers.sensor.load_settings`."""
    content = read_settings(config)
    listed = content.pop('channels', None)
    if not isinstance(listed, list) or not listed:
        raise InvalidParameter(f'settings {config} have the `channels` {safe_repr(listed)}; list one for each input')
    channels = [from_mapping(DaqChannel, item, f'settings {config}, channel {i + 1}') for i, item in enumerate(listed)]
    if len({channel.name for channel in channels} - {''}) < len(channels):
        raise InvalidParameter(f'settings {config}: give each channel a unique `name`')
    return from_mapping(DaqSettings, content, f'settings {config}'), channels


def stream(rate_hz: float, channels: Sequence[DaqChannel]) -> FramedStream:
    """Return what the device sends, as the line understands it."""
    return FramedStream(
        topic=TOPIC,
        kind=KIND,
        sensor=SENSOR,
        rate_hz=rate_hz,
        channels=tuple(channel.name for channel in channels),
        units=tuple(channel.unit for channel in channels),
        gains=np.array([channel.gain for channel in channels]),
        offsets=np.array([channel.offset for channel in channels]),
    )
