# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Features of arrays of taxels: spatial bands and variation, means over taxels, correlation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from texture_core.config import param
from texture_core.errors import InvalidParameter
from texture_core.types import Array
from texture_features.features.spectral import WelchPower, spatial_log_bands, welch_spectrum
from texture_features.windows import FLOOR, Feature, WindowBatch, centred, floor_param, power

# --------------------
# Mean, power and shape statistics of the signal, averaged over the channels.

LEAST_VARIANCE = 1e-4  # added to the variance, in unit²: far below the noise of any array


@dataclass(frozen=True)
class ChannelMeanStatistics(Feature):
    """Waveform statistics of slow channels, independent of the taxel; no speed is needed.

    Means over the channels of: level; log variance; rise, the last quarter of the window less the first; its absolute
    value; share of the samples above the mean; skewness.

    Examples
    --------
    >>> rising = np.linspace(0.0, 1.0, 100)[:, None] * np.ones(2)
    >>> feature = ChannelMeanStatistics()
    >>> values = dict(zip(feature.names, feature(WindowBatch(rising, 100.0))[0]))
    >>> round(float(values['mean']), 2), round(float(values['rise']), 2), round(float(values['share_above']), 2)
    (0.5, 0.76, 0.5)
    """

    per_channel: ClassVar[bool] = False

    @property
    def names(self) -> tuple[str, ...]:
        """What is averaged."""
        return ('mean', 'log_variance', 'rise', 'absolute_rise', 'share_above', 'skewness')

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the six means."""
        rows, centred = windows.rows, windows.centred_rows
        n_samples = rows.shape[-1]
        quarter = max(1, n_samples // 4)
        level = np.add.reduce(rows, axis=-1) / n_samples
        variance = power(centred)
        rise = (np.add.reduce(rows[..., -quarter:], axis=-1) - np.add.reduce(rows[..., :quarter], axis=-1)) / quarter
        above = np.count_nonzero(centred > 0.0, axis=-1) / n_samples
        cubes = np.add.reduce(centred**3, axis=-1) / n_samples
        skewness = cubes / (variance + LEAST_VARIANCE) ** 1.5
        values = np.stack([level, np.log(variance + LEAST_VARIANCE), rise, np.abs(rise), above, skewness], axis=-1)
        return np.add.reduce(values, axis=-2, keepdims=True) / values.shape[-2]


# --------------------
# Which taxels change together: correlations of the differences, whatever the level and the share of each.

MOST_CORRELATION = 0.98  # beyond, the transform of a correlation would grow without bound


@dataclass(frozen=True)
class DifferenceCorrelation(Feature):
    """Correlations between the channels' differences over some lags, Fisher-transformed; one for each pair of channels.

    Levels and their shares depend on how a finger is mounted and was tared that day. Which channels change together
    while a surface passes, over a short and over a longer lag, changes less from day to day. The mean difference, which
    is drift, is left out. n channels give n (n - 1) / 2 pairs: meant for arrays of some twenty taxels.

    Source: Fisher 1915 for the transform, arctanh.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> noise = np.cumsum(10.0 * rng.standard_normal((400, 2)), axis=0)
    >>> samples = np.stack([noise[:, 0], noise[:, 0] + 7.0, noise[:, 1]], axis=1)  # two that move together, and another
    >>> values = DifferenceCorrelation(lags=[1])(WindowBatch(samples, rate_hz=100.0))[:, 0]
    >>> np.abs(values).round(1).tolist()  # a and b, a and c, b and c
    [2.3, 0.0, 0.0]
    """

    per_channel: ClassVar[bool] = False
    per_pair: ClassVar[bool] = True

    lags: list[int] = param(  # noqa: RUF009 – it gives a field
        [1, 4],
        'Lags of the differences in samples, at most a quarter of the window; longer ones compare slower changes.',
        low=1,
        high=10_000,
    )
    floor: float = param(
        0.1,
        'Variance added to that of each difference, in unit²: channels that hardly change, as those quantised '
        'to integers, are not correlated by their noise.',
        low=1e-300,
        high=1e300,
    )

    def __post_init__(self) -> None:
        if not self.lags or len(set(self.lags)) < len(self.lags):
            raise InvalidParameter(f'the lags of difference_correlation are {self.lags}; one or more are needed, once')

    @property
    def names(self) -> tuple[str, ...]:
        """The lags."""
        return tuple(map(str, self.lags))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the transformed correlations, (..., n_pairs, n_lags)."""
        rows = windows.rows
        first, second = np.triu_indices(rows.shape[-2], 1)
        found = []
        for longest in self.lags:
            lag = max(1, min(longest, rows.shape[-1] // 4))
            changes = centred(rows[..., lag:] - rows[..., :-lag]) if rows.shape[-1] > lag else np.zeros_like(rows)
            # The same product for one window as for many: no other rounding live than offline.
            covariance = changes @ changes.swapaxes(-1, -2) / changes.shape[-1]
            deviation = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1) + self.floor)
            correlation = covariance[..., first, second] / (deviation[..., first] * deviation[..., second])
            found.append(np.arctanh(np.clip(correlation, -MOST_CORRELATION, MOST_CORRELATION)))
        return np.stack(found, axis=-1)


# --------------------
# The load on the whole array: whether it is that of the training, not the surface.


@dataclass(frozen=True)
class LoadLevel(Feature):
    """Logarithm of the mean square over all channels and samples: the load of a tared array, squared.

    For the domain of a model and for its novelty detector, which reject a load outside those of the training
    sessions. Networks and discriminants are trained without it, as it depends on the day.

    Examples
    --------
    >>> level = LoadLevel()(WindowBatch(np.array([[3.0, -5.0], [3.0, -5.0]]), rate_hz=100.0)).item()
    >>> round(float(np.exp(level)), 3)  # (3² + 5²) / 2
    17.0
    """

    per_channel: ClassVar[bool] = False

    floor: float = floor_param()

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(mean square + floor), (..., 1, 1)."""
        mean = np.add.reduce(power(windows.rows), axis=-1, keepdims=True) / windows.samples.shape[-1]
        return np.log(mean + self.floor)[..., None]


# --------------------
# Power density in bands of spatial frequency, independent of the speed.

# A band is at least so wide: one beyond the lines takes part of the last.
MIN_LINES = 1e-3


class OctaveBands:
    """Bands of waves per metre between the longest and the shortest wave, equally wide in octaves."""

    bands: int
    longest_m: float
    shortest_m: float

    def __post_init__(self) -> None:
        if not self.shortest_m < self.longest_m:
            raise InvalidParameter(
                f'waves from {self.shortest_m} m to {self.longest_m} m came; the longest must be longer'
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the band, from 1."""
        return tuple(str(band + 1) for band in range(self.bands))

    @cached_property
    def edges_per_m(self) -> Array:
        """The edges of the bands, waves per metre, (bands + 1,)."""
        edges = np.geomspace(1.0 / self.longest_m, 1.0 / self.shortest_m, self.bands + 1)
        return np.asarray(edges, dtype=np.float64)


@dataclass(frozen=True)
class SpatialBandPower(OctaveBands, WelchPower):
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

    bands: int = param(4, 'Number of spatial frequency bands.', low=1, high=128)
    longest_m: float = param(
        2e-3, 'Longest wavelength, which is the lower edge of the first band.', unit='m', low=1e-6, high=1.0
    )
    shortest_m: float = param(
        4.5e-4, 'Shortest wavelength, which is the upper edge of the last band.', unit='m', low=1e-6, high=1.0
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(mean density + floor) of each band."""
        densities, hertz = welch_spectrum(windows, self.points, self.rate_of_change)
        speed = windows.moving_m_s[..., None, None, None]
        # Line n, from 0, covers the stretch from n to n + 1; edges are also in lines.
        edges = self.edges_per_m[:, None] * (speed / hertz[0]) - 0.5
        low = np.minimum(np.maximum(edges[..., :-1, :], 0.0), len(hertz) - 1.0)
        high = np.minimum(np.maximum(edges[..., 1:, :], low + MIN_LINES), len(hertz))
        line = np.arange(len(hertz) + 1.0)
        inside = np.minimum(np.maximum(line, low), high)
        fraction = inside[..., 1:] - inside[..., :-1]
        mean = np.add.reduce(fraction * densities[..., None, :], axis=-1) / (high - low)[..., 0]
        # Density per wave per metre: the same power on a stretch that is speed times narrower.
        return np.log(mean * speed[..., 0] + FLOOR)


# --------------------
# Power in bands of spatial frequency: the mean over the channels.


@dataclass(frozen=True)
class MeanSpatialBands(OctaveBands, Feature):
    """Mean over the channels of the log mean density in bands of waves per metre, f / speed; longest waves first.

    Bands are equally wide in octaves, over the whole window: a grating of pitch λ is in the band of 1/λ whatever
    the speed. Choose waves that the sensor reaches at every speed v: none shorter than 2 v / rate. Which channel
    measured what is lost, as that depends on how a surface was mounted. NaN if the speed is unknown or 0.

    Examples
    --------
    >>> def slide(speed_m_s: float) -> WindowBatch:  # over a grating with a pitch of 2 mm
    ...     wave = np.sin(2 * np.pi * speed_m_s / 2e-3 * np.arange(1000) / 1000.0)
    ...     return WindowBatch(wave[:, None], 1000.0, np.array(speed_m_s))
    >>> feature = MeanSpatialBands(bands=8)
    >>> strongest = [int(feature(slide(speed_m_s)).argmax()) for speed_m_s in (0.05, 0.1)]
    >>> [bool(feature.edges_per_m[band] < 500.0 < feature.edges_per_m[band + 1]) for band in strongest]
    [True, True]
    """

    per_channel: ClassVar[bool] = False

    bands: int = param(32, 'Number of spatial frequency bands.', low=2, high=512)
    longest_m: float = param(
        33e-3, 'Longest wavelength, which is the lower edge of the first band.', unit='m', low=1e-6, high=1e3
    )
    shortest_m: float = param(
        0.67e-3, 'Shortest wavelength, which is the upper edge of the last band.', unit='m', low=1e-7, high=1e3
    )
    normalised: bool = param(True, 'Subtracts the mean over the bands, which depends mainly on force and speed.')
    floor: float = floor_param('Spatial power density', 'unit² m', 1e-7)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the mean over the channels of log(mean density + floor) of each band."""
        bands = spatial_log_bands(windows, self.edges_per_m, self.floor)
        if self.normalised:
            bands = bands - np.add.reduce(bands, axis=-1, keepdims=True) / bands.shape[-1]
        return np.add.reduce(bands, axis=-2, keepdims=True) / bands.shape[-2]


# --------------------
# How much the surface, as measured, changes within a short distance.


@dataclass(frozen=True)
class SpatialVariation(WelchPower):
    """Logarithm of the mean square difference between places at a distance of `lag_m` along the path of the finger.

    In nerves the rougher surface makes neighbouring fibres differ more; here one channel meets the places one after
    the other, lag_m / speed apart in time. The mean square is 2·∫ S(f)·(1 - cos(2πf·lag_m/speed)) df, so that no lag
    has to be a whole number of samples. NaN if the speed is unknown or not above 0.

    Source: Lieber & Bensmaia 2019; Connor & Johnson 1992.

    Examples
    --------
    >>> wave = np.sin(2 * np.pi * 100.0 * np.arange(1280) / 1280.0)[:, None]  # at 0.1 m/s: waves of 1 mm
    >>> window = WindowBatch(wave, 1280.0, np.array(0.1))
    >>> half, whole = (SpatialVariation(lag_m=lag_m, rate_of_change=False)(window).item() for lag_m in (5e-4, 1e-3))
    >>> np.exp(half).round(1).item(), whole < half - 3  # (2 · amplitude)² / 2; places at a distance of a wave are alike
    (2.0, True)
    """

    lag_m: float = param(
        5e-4,
        'Distance on the surface between the two compared points; longer lags compare coarser texture.',
        unit='m',
        low=1e-6,
        high=1.0,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the log mean square difference."""
        densities, hertz = welch_spectrum(windows, self.points, self.rate_of_change)
        phase = 2.0 * np.pi * hertz * (self.lag_m / windows.moving_m_s[..., None, None])
        power = 2.0 * np.add.reduce(densities * (1.0 - np.cos(phase)), axis=-1, keepdims=True) * hertz[0]
        return np.log(power + FLOOR)
