"""Level of the surface in bands of spatial frequency: what it is, whatever the speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidParameter
from texture_core.parameters import param
from texture_features.feature import Windows
from texture_features.line_spectrum import line_spectrum, without_force


@dataclass(frozen=True)
class SpatialLevel:
    """Logarithm of the mean density in bands of waves per metre, f / speed; longest waves first.

    Bands are equally wide in octaves. Choose waves that the sensor reaches at every speed: from v / high_hz to
    v / low_hz. Of a band beyond half the sampling rate the nearest line is taken. NaN if the speed is unknown.
    """

    of_signal: ClassVar[bool] = True

    bands: int = param(4, 'Number of bands.', low=1, high=128)
    longest_m: float = param(2e-3, 'Longest wave.', unit='m', low=1e-6, high=1.0)
    shortest_m: float = param(4.5e-4, 'Shortest wave.', unit='m', low=1e-6, high=1.0)
    points: int = param(128, 'Samples of a segment; lines are rate / points apart.', low=8, high=16384)
    rate_of_change: bool = param(True, 'The signal is the rate of change of what touches.')
    force_exponent: float = param(0.0, 'Divide the power by force to this exponent; 2/3: Hertz.', low=0.0, high=4.0)
    floor: float = param(1e-20, 'Density added before the logarithm, unit² m.', low=1e-300, high=1e300)

    def __post_init__(self) -> None:
        if not self.shortest_m < self.longest_m:
            raise InvalidParameter(
                f'spatial_level has waves from {self.shortest_m} m to {self.longest_m} m; the longest must be longer'
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the band, from 1."""
        return tuple(str(band + 1) for band in range(self.bands))

    def __call__(self, windows: Windows) -> Array:
        """Return log(mean density + floor) of each band."""
        densities, hertz = line_spectrum(windows, self.points, self.rate_of_change)
        speed = np.asarray(windows.speed_m_s)[..., None, None]
        edges = np.geomspace(1.0 / self.longest_m, 1.0 / self.shortest_m, self.bands + 1)
        # Line n (from 1) stands for the stretch from n - 1/2 to n + 1/2 lines.
        at = np.clip(edges * (speed / hertz[0]) - 0.5, 0.0, len(hertz) - 1.0)
        at[..., 1:] = np.minimum(np.maximum(at[..., 1:], at[..., :-1] + 1e-3), len(hertz))
        lines = np.diff(at, axis=-1)
        power = np.diff(_up_to(densities, np.broadcast_to(at, (*densities.shape[:-1], self.bands + 1))), axis=-1)
        # Density per wave per metre: the same power on a stretch that is speed times narrower.
        return without_force(np.log(np.maximum(power / lines, 0.0) * speed + self.floor), windows, self.force_exponent)


def _up_to(densities: Array, at: Array) -> Array:
    """Return the sum of densities, (..., n_lines), up to fractions of lines, (..., n_places)."""
    total = np.zeros((*densities.shape[:-1], densities.shape[-1] + 1))
    np.cumsum(densities, axis=-1, out=total[..., 1:])
    known = np.isfinite(at)  # an unknown speed gives NaN in the end
    low = np.minimum(np.where(known, at, 0.0).astype(np.intp), densities.shape[-1] - 1)
    below = np.take_along_axis(total, low, axis=-1)
    summed: Array = below + (at - low) * np.take_along_axis(densities, low, axis=-1)
    return summed
