"""BioTac counts in pascals and volts, by nominal scales: good for orders of magnitude, not for metrology.

Sources: BioTac Product Manual V20/V21 for the pressures, as quoted in the literature (not seen by us); 12 bits over the
0 to 3.3 V of the 2011 leaflet for the electrodes (its resolution of 3.2 mV would be that of 10 bits). Temperatures stay
in counts: the thermistor is not linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Samples
from texture_core.parameters import param
from texture_drivers.biotac.tables import FULL_SCALE, PAC, UNIT


@dataclass(frozen=True)
class Scales:
    """Size of a count, and the count that means zero."""

    pac_pa: float = param(0.37, 'Dynamic pressure of a count.', unit='Pa', low=1e-3, high=10.0)
    pac_rest: float = param(2030.0, 'PAC without vibration.', unit='count', low=0.0, high=FULL_SCALE)
    pdc_pa: float = param(36.5, 'Static pressure of a count.', unit='Pa', low=1.0, high=1000.0)
    pdc_rest: float = param(0.0, 'PDC without load; measure yours.', unit='count', low=0.0, high=FULL_SCALE)
    electrode_v: float = param(3.3 / FULL_SCALE, 'Voltage of a count of an electrode.', unit='V', low=1e-5, high=0.1)


def to_physical(samples: Samples, channels: Sequence[str], scales: Scales | None = None) -> tuple[Samples, list[str]]:
    """Return samples in physical units, and the unit of each channel.

    Parameters
    ----------
    samples : (n_samples, n_channels) counts
    channels
        Names, as in a signal.

    Returns
    -------
    (n_samples, n_channels), and 'Pa', 'V' or 'count' for each channel
    """
    scales = scales or Scales()
    known = {PAC: (scales.pac_rest, scales.pac_pa, 'Pa'), 'pdc': (scales.pdc_rest, scales.pdc_pa, 'Pa')}
    electrode, other = (0.0, scales.electrode_v, 'V'), (0.0, 1.0, UNIT)
    rows = [known.get(name, electrode if name.startswith('electrode') else other) for name in channels]
    rest, size, units = zip(*rows, strict=True)
    return (np.asarray(samples, dtype=np.float64) - rest) * size, list(units)
