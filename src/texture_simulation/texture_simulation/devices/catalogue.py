"""The emulated device of each sensor; a sensor without one reads no device."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from texture_simulation.devices.anyskin import EmulatedAnySkin
from texture_simulation.devices.biotac import EmulatedBioTac
from texture_simulation.devices.daq import EmulatedDaq
from texture_simulation.devices.device import EmulatedDevice
from texture_simulation.devices.papillarray import EmulatedPapillArray
from texture_simulation.devices.pvdf import EmulatedPvdf
from texture_simulation.devices.tsf85 import EmulatedTsf85

DEVICES: Mapping[str, Callable[[Path, np.random.Generator], EmulatedDevice]] = {
    'tsf85': EmulatedTsf85,
    'tsf85_pair': EmulatedTsf85,
    'tsf85_3x4': EmulatedTsf85,
    'biotac': EmulatedBioTac,
    'biotac_sp': EmulatedBioTac,
    'biotac_hand': partial(EmulatedBioTac, serials=('BT-0', 'BT-1', 'BT-2')),
    'daq': EmulatedDaq,
    'pvdf': EmulatedPvdf,
    'anyskin': EmulatedAnySkin,
    'papillarray': EmulatedPapillArray,
    'papillarray_pair': partial(EmulatedPapillArray, arrays=2),
}
