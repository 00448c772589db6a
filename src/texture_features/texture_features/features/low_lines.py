"""The lowest lines of a fine spectrum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import Windows
from texture_features.spectra.line_spectrum import line_spectrum


@dataclass(frozen=True)
class LowLines:
    """Logarithm of the power spectral density at the lowest lines of long segments: where ridges and grids show.

    `log_bands` with as many bands would be as fine everywhere, and noisier where fineness does not help.
    """

    of_signal: ClassVar[bool] = True

    lines: int = param(32, 'Number of lines, from the first above 0 Hz.', low=1, high=512)
    points: int = param(128, 'Samples of a segment; lines are rate / points apart.', low=4, high=16384)
    floor: float = param(1e-20, 'Density added before the logarithm, unit²/Hz.', low=1e-300, high=1e300)

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the line, from 1."""
        return tuple(str(line + 1) for line in range(self._count))

    @property
    def _count(self) -> int:
        return min(self.lines, self.points // 2)

    def __call__(self, windows: Windows) -> Array:
        """Return log(mean density + floor)."""
        densities, _ = line_spectrum(windows, self.points, rate_of_change=False)
        return np.log(densities[..., : self._count] + self.floor)
