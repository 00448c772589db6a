"""How much the surface, as measured, changes within a short way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.welch_spectrum import force_normalised, welch_spectrum


@dataclass(frozen=True)
class SpatialVariation:
    """Logarithm of the mean square difference between places `lag_m` apart along the way of the finger.

    In nerves the rougher surface makes neighbouring fibres differ more; here one channel meets the places one after
    the other, lag_m / speed apart in time. The mean square is 2·∫ S(f)·(1 - cos(2πf·lag_m/speed)) df, so that no lag
    has to be a whole number of samples. NaN if the speed is unknown or not above 0.

    Source: Lieber & Bensmaia 2019; Connor & Johnson 1992.

    Examples
    --------
    >>> wave = np.sin(2 * np.pi * 100.0 * np.arange(1280) / 1280.0)[:, None]  # at 0.1 m/s: waves of 1 mm
    >>> window = WindowBatch(wave, 1280.0, np.array(0.1))
    >>> half, whole = (SpatialVariation(lag_m=lag_m, rate_of_change=False)(window).item() for lag_m in (5e-4, 1e-3))
    >>> np.exp(half).round(1).item(), whole < half - 3  # (2 · amplitude)² / 2; places a wave apart are alike
    (2.0, True)
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    lag_m: float = param(
        5e-4,
        'Sets the distance on the surface between the two compared points; longer lags compare coarser texture.',
        unit='m',
        low=1e-6,
        high=1.0,
    )
    points: int = param(
        128, 'Length of an FFT segment in samples; FFT bins are rate / points apart.', low=4, high=16384
    )
    rate_of_change: bool = param(
        True, 'Whether the signal is the time derivative of the contact quantity; if so it is integrated.'
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
        """Return the log mean square difference."""
        densities, hertz = welch_spectrum(windows, self.points, self.rate_of_change)
        phase = 2.0 * np.pi * hertz * (self.lag_m / windows.moving_m_s[..., None, None])
        power = 2.0 * np.add.reduce(densities * (1.0 - np.cos(phase)), axis=-1, keepdims=True) * hertz[0]
        return force_normalised(np.log(power + self.floor), windows, self.force_exponent)
