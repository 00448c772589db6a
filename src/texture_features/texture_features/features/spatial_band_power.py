"""Power density in bands of spatial frequency, independent of the speed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidParameter
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.welch_spectrum import force_normalised, welch_spectrum

# A band is at least so wide: one beyond the lines takes part of the last.
MIN_LINES = 1e-3


@dataclass(frozen=True)
class SpatialBandPower:
    """Logarithm of the mean density in bands of waves per metre, f / speed; longest waves first.

    Bands are equally wide in octaves. Choose waves that the sensor reaches at every speed: from v / high_hz to
    v / low_hz. Of a band beyond half the sampling rate the nearest line is taken. NaN if the speed is unknown or not
    above 0.

    Examples
    --------
    >>> def slide(speed_m_s: float) -> WindowBatch:  # over a grating with a pitch of 1 mm
    ...     wave = np.sin(2 * np.pi * speed_m_s / 1e-3 * np.arange(2000) / 2000.0)
    ...     return WindowBatch(wave[:, None], 2000.0, np.array(speed_m_s))
    >>> [int(SpatialBandPower(rate_of_change=False)(slide(speed_m_s)).argmax()) + 1 for speed_m_s in (0.1, 0.2, 0.3)]
    [2, 2, 2]
    """

    per_channel: ClassVar[bool] = True

    bands: int = param(4, 'Sets the number of spatial frequency bands; more bands resolve finer.', low=1, high=128)
    longest_m: float = param(
        2e-3, 'Sets the longest wavelength, which is the lower edge of the first band.', unit='m', low=1e-6, high=1.0
    )
    shortest_m: float = param(
        4.5e-4, 'Sets the shortest wavelength, which is the upper edge of the last band.', unit='m', low=1e-6, high=1.0
    )
    points: int = param(
        128, 'Length of an FFT segment in samples; FFT bins are rate / points apart.', low=8, high=16384
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
        1e-20, 'Sets the spatial power density added before the logarithm, in unit² m.', low=1e-300, high=1e300
    )

    def __post_init__(self) -> None:
        if not self.shortest_m < self.longest_m:
            raise InvalidParameter(
                f'waves from {self.shortest_m} m to {self.longest_m} m came; the longest must be longer'
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the band, from 1."""
        return tuple(str(band + 1) for band in range(self.bands))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(mean density + floor) of each band."""
        densities, hertz = welch_spectrum(windows, self.points, self.rate_of_change)
        speed = windows.moving_m_s[..., None, None, None]
        # Line n, from 0, stands for the stretch from n to n + 1; edges are in lines, too.
        edges = _edges_1_m(self) * (speed / hertz[0]) - 0.5
        low = np.minimum(np.maximum(edges[..., :-1, :], 0.0), len(hertz) - 1.0)
        high = np.minimum(np.maximum(edges[..., 1:, :], low + MIN_LINES), len(hertz))
        line = _numbers(len(hertz) + 1)
        inside = np.minimum(np.maximum(line, low), high)
        share = inside[..., 1:] - inside[..., :-1]
        mean = np.add.reduce(share * densities[..., None, :], axis=-1) / (high - low)[..., 0]
        # Density per wave per metre: the same power on a stretch that is speed times narrower.
        return force_normalised(np.log(mean * speed[..., 0] + self.floor), windows, self.force_exponent)


@lru_cache(maxsize=64)
def _numbers(count: int) -> Array:
    numbers = np.arange(count, dtype=np.float64)
    numbers.flags.writeable = False
    return numbers


@lru_cache(maxsize=64)
def _edges_1_m(feature: SpatialBandPower) -> Array:
    """Return the edges of the bands in waves per metre, (bands + 1, 1)."""
    edges: Array = np.asarray(
        np.geomspace(1.0 / feature.longest_m, 1.0 / feature.shortest_m, feature.bands + 1), dtype=np.float64
    )[:, None]
    edges.flags.writeable = False
    return edges
