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
class BioTacScales:
    """Parameters that convert the counts of a BioTac to units."""

    pac_pa: float = param(
        0.37,
        'Sets the dynamic pressure (PAC) of one count; a larger value scales the pressures up.',
        unit='Pa',
        low=1e-3,
        high=10.0,
    )
    pac_baseline: float = param(
        2030.0,
        'Sets the PAC count without vibration, which is subtracted before scaling.',
        unit='count',
        low=0.0,
        high=FULL_SCALE,
    )
    pdc_pa: float = param(
        36.5,
        'Sets the static pressure (PDC) of one count; a larger value scales the pressures up.',
        unit='Pa',
        low=1.0,
        high=1000.0,
    )
    pdc_baseline: float = param(
        0.0,
        'Sets the PDC count without load, which is subtracted before scaling; measure it on your own sensor.',
        unit='count',
        low=0.0,
        high=FULL_SCALE,
    )
    electrode_v: float = param(
        3.3 / FULL_SCALE,
        'Sets the electrode voltage of one count; a larger value scales the voltages up.',
        unit='V',
        low=1e-5,
        high=0.1,
    )


def to_physical(
    samples: Samples, channels: Sequence[str], scales: BioTacScales | None = None
) -> tuple[Samples, list[str]]:
    """Return samples in physical units, and the unit of each channel.

    Parameters
    ----------
    samples : (n_samples, n_channels) counts
    channels
        Names, as in a signal.
    scales
        Offsets and factors of the channels; None takes those of the manual.

    Returns
    -------
    (n_samples, n_channels), and 'Pa', 'V' or 'count' for each channel
    """
    scales = scales or BioTacScales()
    known = {PAC: (scales.pac_baseline, scales.pac_pa, 'Pa'), 'pdc': (scales.pdc_baseline, scales.pdc_pa, 'Pa')}
    electrode, other = (0.0, scales.electrode_v, 'V'), (0.0, 1.0, UNIT)
    rows = [known.get(name, electrode if name.startswith('electrode') else other) for name in channels]
    baseline, size, units = zip(*rows, strict=True)
    return (np.asarray(samples, dtype=np.float64) - baseline) * size, list(units)
