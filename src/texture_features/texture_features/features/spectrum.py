"""The whole spectrum, point by point."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.catalogue import find
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.spectrum import long_densities

SCALES: Mapping[str, Callable[[Array, float], Array]] = {
    'log': lambda density, floor: np.log(density + floor),
    'power': lambda density, floor: density,
    'magnitude': lambda density, floor: np.sqrt(density),
}


@dataclass(frozen=True)
class Spectrum:
    """Power spectral density at equal steps up to half the sampling rate, its square root or its logarithm.

    Meant for a learner that begins with principal components. A window shorter than 2 · `points` is padded with zeros;
    of a longer one the mean over segments of that length, half overlapping, is taken.

    Source: Hu et al. 2014, section 4.1 (12 288 points there).

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 100.0 * np.arange(1000) / 1000.0)[:, None]
    >>> spectrum = Spectrum(points=500)(WindowBatch(tone, rate_hz=1000.0))  # at 1, 2, … 500 Hz
    >>> int(spectrum[0].argmax()) + 1
    100
    """

    per_channel: ClassVar[bool] = True

    points: int = param(
        12288,
        'Sets the number of frequency bins k · rate / (2 · points), k from 1; more bins resolve finer.',
        low=2,
        high=1 << 19,
    )
    scale: str = param(
        'log',
        "Sets what is given of the power density: its logarithm 'log', 'power' itself, or its square root 'magnitude'.",
        choices=tuple(SCALES),
    )
    floor: float = param(
        1e-20,
        'Power density added before the logarithm, so that silence gives a finite value, unit²/Hz.',
        low=1e-300,
        high=1e300,
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the frequency, from 1."""
        return tuple(str(point + 1) for point in range(self.points))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(density + floor), the density, or its square root."""
        density = long_densities(windows.rows, windows.rate_hz, self.points)
        return find(SCALES, self.scale, 'scale of the spectrum')(density, self.floor)
