"""The simulated sensors by name: the `sensor` of a scene."""

from __future__ import annotations

from collections.abc import Mapping

from texture_drivers.biotac.tables import LAYOUTS as BIOTACS
from texture_drivers.tsf85.tables import LAYOUTS as TSF85S
from texture_simulation.sensors import anyskin, biotac, daq, papillarray, pvdf, tsf85
from texture_simulation.sensors.model import SensorKind

SENSORS: Mapping[str, SensorKind] = {
    'tsf85': tsf85.tsf85_kind(TSF85S['tsf85']),  # 28 taxels at 60 Hz, dynamic channel at 1 kHz
    'tsf85_3x4': tsf85.tsf85_kind(TSF85S['tsf85_3x4']),  # 12 taxels at 25 Hz, dynamic channel at 1 kHz
    'daq': daq.KIND,  # 4 PVDF films and 4 strain gauges at 2.5 kHz
    'biotac': biotac.biotac_kind(BIOTACS['biotac']),  # PAC at 2.2 kHz, 19 electrodes, pressure, temperature at 100 Hz
    'pvdf': pvdf.KIND,  # film at 4096 Hz with leaking charge, force at 64 Hz
    'anyskin': anyskin.KIND,  # field at 5 magnetometers, 100 Hz
    'papillarray': papillarray.KIND,  # force and displacement of 9 pillars, 500 Hz
}
