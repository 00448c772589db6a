# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sensors by name; a custom one is 'module:Class'."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

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

# How a sensor is made: from its parameters and a clock, ns since the epoch of the stamps. Opens nothing yet.
MakeSensor = Callable[[SensorParams, Callable[[], int]], Sensor]


SENSORS: Mapping[str, MakeSensor] = {
    'tsf85': Tsf85,  # Robotiq TSF-85 / CoRo fingertip
    'tsf85_pair': partial(Tsf85, fingers=(0, 1)),  # both fingers; topics finger0/signal and so on
    'tsf85_3x4': partial(Tsf85, layout=TSF85S['tsf85_3x4']),  # its prototype: 3 rows of 4 taxels at 25 Hz
    'biotac': BioTac,  # SynTouch BioTac, 19 electrodes
    'biotac_sp': partial(BioTac, layout=BIOTACS['biotac_sp']),  # 24 electrodes
    'biotac_hand': partial(BioTac, fingers=(0, 1, 2)),  # all places of a board; topics finger0/signal and so on
    'daq': daq,  # 4 PVDF films and 4 strain gauges at 2.5 kHz, Jamali & Sammut 2010
    'pvdf': pvdf,  # PVDF film and force sensor, Hu et al. 2014
    'anyskin': AnySkin,  # AnySkin and ReSkin: 5 magnetometers under a magnetic skin
    'sound_card': SoundCard,  # contact microphone or accelerometer on a sound card
}
