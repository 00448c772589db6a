"""How fast the spectrum falls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import Windows
from texture_features.spectra.line_spectrum import at_reference_speed, line_spectrum

TINY = 1e-300


@dataclass(frozen=True)
class SpectralExponent:
    """Exponent s of the power spectral density 1/f^s, by least squares in double logarithms.

    A power law keeps its exponent when the finger goes faster; where the spectrum of a surface is none, the same waves
    of the surface must be looked at: `at_speed_m_s` moves the band with the speed. 0 if fewer than two lines lie in it.

    Source: Toscani & Metzger 2022.
    """

    of_signal: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    points: int = param(128, 'Samples of a segment; lines are rate / points apart.', low=4, high=16384)
    low_hz: float = param(60.0, 'Lower end of the band.', unit='Hz', low=0.0, high=1e6)
    high_hz: float = param(420.0, 'Upper end of the band.', unit='Hz', low=0.0, high=1e6)
    rate_of_change: bool = param(False, 'The signal is the rate of change of what touches: adds 2 to the exponent.')
    at_speed_m_s: float = param(
        0.0, 'The band holds at this speed and moves with it; 0: it stands.', unit='m/s', low=0.0, high=10.0
    )
    floor: float = param(1e-20, 'Density added before the logarithm, unit²/Hz.', low=1e-300, high=1e300)

    def __call__(self, windows: Windows) -> Array:
        """Return s."""
        densities, hertz = line_spectrum(windows, self.points, self.rate_of_change)
        felt = at_reference_speed(hertz, windows, self.at_speed_m_s)
        within = (felt >= self.low_hz) * (felt <= self.high_hz) + 0.0 * felt  # NaN where the speed is unknown
        logs = np.log(hertz)
        middle = (within @ logs) / (np.add.reduce(within, axis=-1) + TINY)
        weights = within * (logs - middle[..., None])
        fall = np.add.reduce(weights * np.log(densities + self.floor), axis=-1)
        exponent: Array = -fall / (weights @ logs + TINY)
        return exponent[..., None]
