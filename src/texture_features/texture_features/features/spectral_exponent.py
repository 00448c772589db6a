"""How fast the spectrum falls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.welch_spectrum import at_reference_speed, welch_spectrum

TINY = 1e-300


@dataclass(frozen=True)
class SpectralExponent:
    """Exponent s of the power spectral density 1/f^s, by least squares in double logarithms.

    A power law keeps its exponent when the finger goes faster; where the spectrum of a surface is none, the same waves
    of the surface must be looked at: `at_speed_m_s` moves the band with the speed. 0 if fewer than two lines lie in it.

    Source: Toscani & Metzger 2022.

    Examples
    --------
    >>> walk = np.cumsum(np.random.default_rng(0).standard_normal((100_000, 1)), axis=0)  # its density falls as 1/f²
    >>> round(SpectralExponent(low_hz=20.0, high_hz=100.0)(WindowBatch(walk, rate_hz=1000.0)).item(), 1)
    2.0
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    points: int = param(
        128, 'Length of an FFT segment in samples; FFT bins are rate / points apart.', low=4, high=16384
    )
    low_hz: float = param(
        60.0, 'Lower edge of the frequency band in which the exponent is fitted.', unit='Hz', low=0.0, high=1e6
    )
    high_hz: float = param(
        420.0, 'Upper edge of the frequency band in which the exponent is fitted.', unit='Hz', low=0.0, high=1e6
    )
    rate_of_change: bool = param(
        False, 'Whether the signal is the time derivative of the contact quantity; adds 2 to the exponent.'
    )
    at_speed_m_s: float = param(
        0.0,
        'Speed for which the band is given; it scales with the speed. 0: the band is fixed.',
        unit='m/s',
        low=0.0,
        high=10.0,
    )
    floor: float = param(
        1e-20,
        'Power density added before the logarithm, so that silence gives a finite value, unit²/Hz.',
        low=1e-300,
        high=1e300,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return s."""
        densities, hertz = welch_spectrum(windows, self.points, self.rate_of_change)
        measured = at_reference_speed(hertz, windows, self.at_speed_m_s)
        within = (measured >= self.low_hz) * (
            measured <= self.high_hz
        ) + 0.0 * measured  # NaN where the speed is unknown
        logs = np.log(hertz)
        middle = (within @ logs) / (np.add.reduce(within, axis=-1) + TINY)
        weights = within * (logs - middle[..., None])
        fall = np.add.reduce(weights * np.log(densities + self.floor), axis=-1)
        exponent: Array = -fall / (weights @ logs + TINY)
        return exponent[..., None]
