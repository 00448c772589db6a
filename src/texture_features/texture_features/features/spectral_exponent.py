"""How fast the spectrum falls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import Windows
from texture_features.line_spectrum import line_spectrum


@dataclass(frozen=True)
class SpectralExponent:
    """Exponent s of the power spectral density 1/f^s, by least squares in double logarithms.

    A power law keeps its exponent when the finger goes faster. 0 if fewer than two lines lie in the band.

    Source: Toscani & Metzger 2022.
    """

    of_signal: ClassVar[bool] = True

    points: int = param(128, 'Samples of a segment; lines are rate / points apart.', low=4, high=16384)
    low_hz: float = param(60.0, 'Lower end of the band.', unit='Hz', low=0.0, high=1e6)
    high_hz: float = param(420.0, 'Upper end of the band.', unit='Hz', low=0.0, high=1e6)
    rate_of_change: bool = param(False, 'The signal is the rate of change of what touches: adds 2 to the exponent.')
    floor: float = param(1e-20, 'Density added before the logarithm, unit²/Hz.', low=1e-300, high=1e300)

    @property
    def names(self) -> tuple[str, ...]:
        """One value without a name of its own."""
        return ('',)

    def __call__(self, windows: Windows) -> Array:
        """Return s."""
        densities, hertz = line_spectrum(windows, self.points, self.rate_of_change)
        within = (hertz >= self.low_hz) & (hertz <= self.high_hz)
        octaves = np.log(hertz[within])
        if len(octaves) < 2:
            return np.zeros((*densities.shape[:-1], 1))
        weights = octaves - octaves.mean()
        weights /= weights @ weights
        logs = np.log(densities[..., within] + self.floor)
        slope: Array = np.add.reduce(logs * weights, axis=-1, keepdims=True)
        return -slope
