"""Vibration power, weighted as the Pacinian receptors of the skin weight it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import Windows
from texture_features.spectra.line_spectrum import at_reference_speed, line_spectrum, without_force

OCTAVES_A_DB = 0.1 / np.log10(2.0)  # of power


@dataclass(frozen=True)
class PacinianPower:
    """Logarithm of Σ (amplitude / threshold amplitude)² over the lines of the spectrum.

    The threshold is that of the Pacinian channel in two straight lines: it falls by 12 dB an octave up to `best_hz`
    and rises by `slope_above_db` beyond; 1 at its best. A tone of amplitude a at `best_hz` gives log(a²/2).

    Source: Bensmaia & Hollins 2005, "Pacinian representations of fine surface texture"; slope and best frequency
    after Bolanowski et al. 1988. The straight lines are an approximation.
    """

    of_signal: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    points: int = param(128, 'Samples of a segment; lines are rate / points apart.', low=4, high=16384)
    best_hz: float = param(250.0, 'Frequency of the lowest threshold.', unit='Hz', low=1.0, high=10_000.0)
    slope_below_db: float = param(12.0, 'Fall of the threshold below it, dB an octave.', low=0.0, high=100.0)
    slope_above_db: float = param(12.0, 'Rise of the threshold above it, dB an octave.', low=0.0, high=100.0)
    rate_of_change: bool = param(True, 'The signal is the rate of change of what touches.')
    at_speed_m_s: float = param(0.0, 'Weigh as if felt at this speed; 0: as felt.', unit='m/s', low=0.0, high=10.0)
    force_exponent: float = param(0.0, 'Divide the power by force to this exponent; 2/3: Hertz.', low=0.0, high=4.0)
    floor: float = param(1e-20, 'Power added before the logarithm, unit².', low=1e-300, high=1e300)

    def __call__(self, windows: Windows) -> Array:
        """Return the log power."""
        densities, hertz = line_spectrum(windows, self.points, self.rate_of_change)
        octaves = np.log2(at_reference_speed(hertz, windows, self.at_speed_m_s) / self.best_hz)
        below, above = OCTAVES_A_DB * self.slope_below_db, OCTAVES_A_DB * self.slope_above_db
        weights = np.exp2(np.minimum(below * octaves, -above * octaves))  # 1 / threshold²
        power = np.add.reduce(densities * weights, axis=-1, keepdims=True) * hertz[0]
        return without_force(np.log(power + self.floor), windows, self.force_exponent)
