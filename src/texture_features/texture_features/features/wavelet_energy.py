"""Energy of the signal at each scale of a wavelet transform."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch

# Scaling filter of Daubechies' wavelet with four vanishing moments: Daubechies 1992, table 6.1, to double precision.
DB4 = np.array([
    0.23037781330885523, 0.7148465705525415, 0.6308807679295904, -0.02798376941698385,
    -0.18703481171888114, 0.030841381835986965, 0.032883011666982945, -0.010597401784997278,
])  # fmt: skip
# The wavelet filter is the scaling filter backwards with alternating signs.
FILTERS = np.stack((DB4, DB4[::-1] * np.array([1.0, -1.0] * 4)), axis=1)


@dataclass(frozen=True)
class WaveletEnergy:
    """Logarithm of the mean power in each octave of Daubechies' wavelet 'db4', the finest first, and in the rest.

    Octave k reaches about from rate / 2^(k+1) to rate / 2^k. A window is continued periodically, after its last sample
    is repeated where their number is odd. Octaves that a window is too short for hold no power.

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 350.0 * np.arange(1024) / 1000.0)[:, None]  # in the first octave, 250 to 500 Hz
    >>> int(WaveletEnergy()(WindowBatch(tone, rate_hz=1000.0)).argmax()) + 1
    1
    """

    per_channel: ClassVar[bool] = True

    octaves: int = param(
        6, 'Sets the number of octaves of the wavelet transform; more reach lower frequencies.', low=1, high=20
    )
    floor: float = param(
        1e-20, 'Power added before the logarithm, so that silence gives a finite value, unit².', low=1e-300, high=1e300
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the octave, from 1, and 'rest' for what lies below the last."""
        return (*(str(octave + 1) for octave in range(self.octaves)), 'rest')

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(power + floor)."""
        rows = windows.centred_rows
        return np.log(wavelet_energies(rows, self.octaves) / rows.shape[-1] + self.floor)


def wavelet_energies(rows: Array, octaves: int) -> Array:
    """Return the sum of squares of the coefficients of each octave, the finest first, and of the rest.

    Parameters
    ----------
    rows : (..., n_samples)
    octaves
        How often the rows are halved.

    Returns
    -------
    (..., octaves + 1)
        Their sum is that of the squared rows, as long as the length can be halved.
    """
    energies = np.zeros((*rows.shape[:-1], octaves + 1))
    for octave in range(octaves):
        if rows.shape[-1] == 1:
            break
        both = _halve(rows)
        detail = both[..., 1]
        energies[..., octave] = np.add.reduce(detail * detail, axis=-1)
        rows = np.ascontiguousarray(both[..., 0])
    energies[..., -1] = np.add.reduce(rows * rows, axis=-1)
    return energies


def _halve(rows: Array) -> Array:
    """Return the two halves of the spectrum of rows at half the rate, (..., ceil(n_samples / 2), 2)."""
    half = (rows.shape[-1] + 1) // 2
    taps = np.minimum((2 * np.arange(half)[:, None] + np.arange(len(DB4)) - 3) % (2 * half), rows.shape[-1] - 1)
    halves: Array = np.take(rows, taps, axis=-1) @ FILTERS
    return halves
