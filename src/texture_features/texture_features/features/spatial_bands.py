"""Power in bands of spatial frequency, channel by channel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidParameter
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.spatial_spectrum import mean_subtracted, spatial_log_bands


@dataclass(frozen=True)
class SpatialBands:
    """Logarithm of the mean density in bands of waves per metre, f / speed; longest waves first.

    Bands are equally wide in octaves, over the whole window: a grating of pitch λ stands in the band of 1/λ whatever
    the speed. Choose waves that the sensor reaches at every speed v: none shorter than 2 v / rate. Which channel
    measures what may betray how a surface was mounted; `mean_spatial_bands` does not know it. NaN if the speed is
    unknown or 0.

    Examples
    --------
    >>> def slide(speed_m_s: float) -> WindowBatch:  # over a grating with a pitch of 2 mm
    ...     wave = np.sin(2 * np.pi * speed_m_s / 2e-3 * np.arange(1000) / 1000.0)
    ...     return WindowBatch(wave[:, None], 1000.0, np.array(speed_m_s))
    >>> feature = SpatialBands(bands=8)
    >>> strongest = [int(feature(slide(speed_m_s)).argmax()) for speed_m_s in (0.05, 0.1)]
    >>> [bool(feature.edges_per_m[band] < 500.0 < feature.edges_per_m[band + 1]) for band in strongest]
    [True, True]
    """

    per_channel: ClassVar[bool] = True

    bands: int = param(32, 'Sets the number of spatial frequency bands; more bands resolve finer.', low=2, high=512)
    longest_m: float = param(
        33e-3, 'Sets the longest wavelength, which is the lower edge of the first band.', unit='m', low=1e-6, high=1e3
    )
    shortest_m: float = param(
        0.67e-3, 'Sets the shortest wavelength, which is the upper edge of the last band.', unit='m', low=1e-7, high=1e3
    )
    normalised: bool = param(True, 'Subtracts the mean over the bands, which depends mainly on force and speed.')
    floor: float = param(
        1e-7, 'Sets the spatial power density added before the logarithm, in unit² m.', low=1e-300, high=1e300
    )

    def __post_init__(self) -> None:
        if not self.shortest_m < self.longest_m:
            raise InvalidParameter(
                f'spatial bands have waves from {self.shortest_m} m to {self.longest_m} m; the longest must be longer'
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the band, from 1."""
        return tuple(str(band + 1) for band in range(self.bands))

    @property
    def edges_per_m(self) -> Array:
        """The edges of the bands, waves per metre, (bands + 1,)."""
        edges = np.geomspace(1.0 / self.longest_m, 1.0 / self.shortest_m, self.bands + 1)
        return np.asarray(edges, dtype=np.float64)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(mean density + floor) of each band."""
        bands = spatial_log_bands(windows, self.edges_per_m, self.floor)
        return mean_subtracted(bands) if self.normalised else bands
