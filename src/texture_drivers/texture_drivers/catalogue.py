# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sensors by name; a custom one is 'module:Class'."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from texture_core.config import find
from texture_core.types import Sensor
from texture_drivers.anyskin import AnySkin
from texture_drivers.biotac import LAYOUTS as BIOTACS
from texture_drivers.biotac import BioTac
from texture_drivers.daq import daq
from texture_drivers.pvdf import pvdf
from texture_drivers.sensor import SensorParams
from texture_drivers.sound_card import SoundCard
from texture_drivers.tsf85 import LAYOUTS as TSF85S
from texture_drivers.tsf85 import Tsf85


@dataclass(frozen=True)
class SensorEntry:
    """A sensor of the suite. Pages and `texture list sensors` show its text: what it is, channels and rates."""

    # From its parameters and a clock, ns since the epoch of the stamps; opens nothing yet
    make: Callable[[SensorParams, Callable[[], int]], Sensor]
    about: str

    def __call__(self, params: SensorParams, now_ns: Callable[[], int]) -> Sensor:
        """Make the sensor, as a class of the user is called."""
        return self.make(params, now_ns)


SENSORS: Mapping[str, SensorEntry] = {
    'tsf85': SensorEntry(Tsf85, 'Robotiq TSF-85: vibration and IMU at 1000 Hz, 28 taxels at 60 Hz'),
    'tsf85_pair': SensorEntry(partial(Tsf85, fingers=(0, 1)), 'both fingers of a TSF-85: topics finger0/signal, …'),
    'tsf85_3x4': SensorEntry(
        partial(Tsf85, layout=TSF85S['tsf85_3x4']),
        'TSF-85 prototype of the papers: vibration at 1000 Hz, 12 taxels at 25 Hz',
    ),
    'biotac': SensorEntry(BioTac, 'SynTouch BioTac: PAC at 2200 Hz, 19 electrodes, PDC, TAC and TDC at 100 Hz'),
    'biotac_sp': SensorEntry(
        partial(BioTac, layout=BIOTACS['biotac_sp']), 'BioTac SP: PAC at 2200 Hz, 24 electrodes at 81.5 Hz'
    ),
    'biotac_hand': SensorEntry(
        partial(BioTac, fingers=(0, 1, 2)), 'three BioTacs on a board: topics finger0/signal, …'
    ),
    'daq': SensorEntry(daq, '4 PVDF films and 4 strain gauges at 2500 Hz, or other ADC channels'),
    'pvdf': SensorEntry(pvdf, 'PVDF film at 4096 Hz, force sensor at 64 Hz'),
    'anyskin': SensorEntry(AnySkin, 'AnySkin or ReSkin: 5 magnetometers (15 channels) at 100 to 400 Hz'),
    'sound_card': SensorEntry(SoundCard, 'contact microphone or accelerometer: 1 to 8 channels at 16 kHz (8 to 192)'),
}


def make_sensor(params: Any, clock: Callable[[], int]) -> Sensor:
    """Return the sensor that parameters of the sensor node name; nothing is opened."""
    return find(SENSORS, params.sensor, 'sensor')(params, clock)
