"""Vibration power, weighted as the Pacinian receptors of the skin weight it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.welch_spectrum import at_reference_speed, force_normalised, welch_spectrum

OCTAVES_PER_DB = 0.1 / np.log10(2.0)  # of power


@dataclass(frozen=True)
class PacinianPower:
    """Logarithm of Σ (amplitude / threshold amplitude)² over the lines of the spectrum.

    The threshold is that of the Pacinian channel in two straight lines: it falls by 12 dB an octave up to `best_hz`
    and rises by `slope_above_db` beyond; 1 at its best. A tone of amplitude a at `best_hz` gives log(a²/2).

    Source: Bensmaia & Hollins 2005, "Pacinian representations of fine surface texture"; slope and best frequency
    after Bolanowski et al. 1988. The straight lines are an approximation.

    Examples
    --------
    >>> time_s = np.arange(1280) / 1280.0
    >>> tones = np.sin(2 * np.pi * np.array([60.0, 250.0]) * time_s[:, None])
    >>> low, best = PacinianPower(rate_of_change=False)(WindowBatch(tones, rate_hz=1280.0))[:, 0].tolist()
    >>> np.exp(best).round(1).item(), round((best - low) * 10 / np.log(10))  # a²/2, and some 12 dB · log2(250 / 60)
    (0.5, 24)
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    points: int = param(
        128, 'Length of an FFT segment in samples; FFT bins are rate / points apart.', low=4, high=16384
    )
    best_hz: float = param(
        250.0, 'Frequency at which the detection threshold is lowest.', unit='Hz', low=1.0, high=10_000.0
    )
    slope_below_db: float = param(
        12.0, 'Sets the slope of the threshold below that frequency, in dB per octave.', low=0.0, high=100.0
    )
    slope_above_db: float = param(
        12.0, 'Sets the slope of the threshold above that frequency, in dB per octave.', low=0.0, high=100.0
    )
    rate_of_change: bool = param(
        True, 'Whether the signal is the time derivative of the contact quantity; if so it is integrated.'
    )
    at_speed_m_s: float = param(
        0.0,
        'Reference speed to which frequencies are scaled before weighting; 0: no scaling.',
        unit='m/s',
        low=0.0,
        high=10.0,
    )
    force_exponent: float = param(
        0.0,
        'Exponent of the force by which the power is divided; 2/3 for Hertzian contact, 0 for none.',
        low=0.0,
        high=4.0,
    )
    floor: float = param(
        1e-20, 'Power added before the logarithm, so that silence gives a finite value, unit².', low=1e-300, high=1e300
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the log power."""
        densities, hertz = welch_spectrum(windows, self.points, self.rate_of_change)
        octaves = np.log2(at_reference_speed(hertz, windows, self.at_speed_m_s) / self.best_hz)
        below, above = OCTAVES_PER_DB * self.slope_below_db, OCTAVES_PER_DB * self.slope_above_db
        weights = np.exp2(np.minimum(below * octaves, -above * octaves))  # 1 / threshold²
        power = np.add.reduce(densities * weights, axis=-1, keepdims=True) * hertz[0]
        return force_normalised(np.log(power + self.floor), windows, self.force_exponent)
