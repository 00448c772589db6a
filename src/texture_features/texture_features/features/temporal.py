# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Features of the signal over time: moments, Hjorth parameters, differences; speed, force, friction; time stretch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.config import param
from texture_core.types import AnyArray, Array, Samples
from texture_features.windows import (
    FLOOR,
    Feature,
    WindowBatch,
    centred,
    first_difference,
    floor_param,
    mean_weights,
    power,
)

# --------------------
# The signal with its first and second difference, in one array.


def signal_differences(windows: WindowBatch) -> Array:
    """Return the zero-mean signal, its steps from sample to sample and their steps, ended by zeros, in one array."""
    return windows.shared('differences', lambda: _differences(windows.centred_rows))


def _differences(rows: Array) -> Array:
    powers = np.zeros((*rows.shape[:-1], 3, 3, rows.shape[-1]))
    orders = powers[..., 0, :, :]
    slope = orders[..., 1, :]
    orders[..., 0, :] = rows
    np.subtract(rows[..., 1:], rows[..., :-1], out=slope[..., :-1])
    np.subtract(slope[..., 1:-1], slope[..., :-2], out=orders[..., 2, :-2])
    np.square(orders, out=powers[..., 1, :, :])
    np.abs(orders, out=powers[..., 2, :, :])
    return powers


# --------------------
# Force of the finger.


@dataclass(frozen=True)
class Force(Feature):
    """Mean force of the finger normal to the surface in the window, N; NaN if the exploration does not report it.

    Examples
    --------
    >>> Force()(WindowBatch(np.zeros((5, 1)), rate_hz=100.0, force_n=np.array(1.5))).item()
    1.5
    """

    per_channel: ClassVar[bool] = False

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the force."""
        return np.asarray(windows.force_n, dtype=np.float64)[..., None, None]


# --------------------
# Friction of the surface under the finger.

LEAST_N = 0.1  # normal force by which is divided at least


@dataclass(frozen=True)
class Friction(Feature):
    """Mean tangential over mean normal force in the window; NaN if the arm does not measure the tangential force.

    The ratio of the means: noise of the force sensor averages out before the division.

    Examples
    --------
    >>> samples = np.zeros((5, 1))
    >>> pressed, dragged = np.array(2.0), np.array(0.5)
    >>> Friction()(WindowBatch(samples, rate_hz=100.0, force_n=pressed, tangential_force_n=dragged)).item()
    0.25
    """

    per_channel: ClassVar[bool] = False

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the ratio."""
        ratio: Array = np.asarray(windows.tangential_force_n) / np.maximum(windows.force_n, LEAST_N)
        return ratio[..., None, None]


# --------------------
# Hjorth's parameters: activity, mobility and complexity.

# Far below any deviation, far above the smallest number: 0 / 0 becomes 0.
HJORTH_TINY = 1e-150


@dataclass(frozen=True)
class Hjorth(Feature):
    """Activity (power), mobility (mean frequency) and complexity (bandwidth) of each channel.

    Examples
    --------
    >>> time_s = np.arange(1000) / 1000.0
    >>> tone = WindowBatch(np.sin(2 * np.pi * 40.0 * time_s)[:, None], rate_hz=1000.0)
    >>> Hjorth(log_activity=False)(tone)[0].round(2).tolist()  # ½, 2 sin(π · 40 / 1000), and 1 of a tone
    [0.5, 0.25, 1.0]
    """

    log_activity: bool = param(True, 'Returns the logarithm of the activity instead of the activity itself.')

    @property
    def names(self) -> tuple[str, ...]:
        """Activity, mobility, complexity."""
        return ('log_activity' if self.log_activity else 'activity', 'mobility', 'complexity')

    def __call__(self, windows: WindowBatch) -> Array:
        """Return activity, mobility and complexity."""
        values = hjorth(windows.centred_rows)
        if self.log_activity:
            values[..., 0] = np.log(values[..., 0] + FLOOR)
        return values


def hjorth(rows: Array) -> Array:
    """Return activity, mobility per sample step, and complexity; the latter two are 0 for a constant row.

    Source: Hjorth 1970; Kaboli et al. 2015, eq. 1 to 3.
    """
    slope = first_difference(rows)
    second_difference = first_difference(slope)
    powers = np.empty((3, *rows.shape[:-1]))
    powers[0] = power(rows)
    powers[1] = power(slope)
    powers[2] = power(second_difference)
    # The mean of the steps is known from the first and the last sample.
    drift = (rows[..., -1] - rows[..., 0]) / slope.shape[-1]
    powers[1] -= drift * drift
    drift = (slope[..., -1] - slope[..., 0]) / second_difference.shape[-1]
    powers[2] -= drift * drift
    roots = np.sqrt(np.maximum(powers, 0.0, out=powers))
    mobility = roots[1:] / (roots[:2] + HJORTH_TINY)
    powers[1] = mobility[0]
    powers[2] = mobility[1] / (mobility[0] + HJORTH_TINY)
    return powers.transpose((*range(1, powers.ndim), 0))


# --------------------
# Logarithm of the variance of the steps.

QUANTISED = 'unit²; 1/12 is right for signals quantised to integers'


@dataclass(frozen=True)
class LogDifferenceVariance(Feature):
    """Logarithm of the variance of the steps from sample to sample of each channel.

    Examples
    --------
    >>> zigzag = np.array([[0.0], [2.0], [0.0], [2.0], [0.0]])  # steps of 2 and -2: variance 4
    >>> np.exp(LogDifferenceVariance()(WindowBatch(zigzag, rate_hz=100.0))).round(6).item()
    4.0
    """

    floor: float = floor_param(unit=QUANTISED)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(variance of the steps + floor)."""
        return np.log(power(centred(first_difference(windows.rows))) + self.floor)[..., None]


# --------------------
# Logarithm of the variance.


@dataclass(frozen=True)
class LogVariance(Feature):
    """Logarithm of the variance of each channel.

    Examples
    --------
    >>> np.exp(LogVariance()(WindowBatch(np.array([[1.0], [5.0]]), rate_hz=100.0))).round(6).item()
    4.0
    """

    floor: float = floor_param(unit=QUANTISED)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(variance + floor)."""
        return np.log(power(windows.centred_rows) + self.floor)[..., None]


# --------------------
# Mean of the signal.


@dataclass(frozen=True)
class ChannelMean(Feature):
    """Mean of each channel. It may depend on how a surface was mounted.

    Examples
    --------
    >>> ChannelMean()(WindowBatch(np.array([[1.0, 10.0], [3.0, 30.0]]), rate_hz=100.0))[:, 0].tolist()
    [2.0, 20.0]
    """

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the mean."""
        rows = windows.rows
        levels: Array = np.add.reduce(rows, axis=-1) / rows.shape[-1]
        return levels[..., None]


# --------------------
# Log power, skewness and log kurtosis of the signal and of its first and second difference.

VALUES = ('log_power', 'log_amplitude', 'skewness', 'log_kurtosis')
# Far below any power, far above the smallest number: nothing over nothing becomes 0 or 1.
MOMENTS_TINY = 1e-150
LEAST_AMPLITUDE = 1e-10  # added before a logarithm; it is squared where a power is meant


@dataclass(frozen=True)
class Moments(Feature):
    """Log mean square, log mean amplitude, skewness and log kurtosis of the signal, its steps and their steps.

    A spectrum holds the mean squares and nothing of the rest: whether a surface pushes more than it pulls, and whether
    it hits rarely and hard or often and softly.

    Examples
    --------
    >>> spikes = np.zeros((100, 1))
    >>> spikes[::10] = 1.0  # rare and upwards
    >>> values = dict(zip(Moments().names, Moments()(WindowBatch(spikes, rate_hz=100.0))[0].round(2).tolist()))
    >>> values['signal_skewness']  # (1 - 2p) / √(p (1 - p)) with p = 0.1
    2.67
    """

    @property
    def names(self) -> tuple[str, ...]:
        """Value of the signal, of its slope and of its bend."""
        return tuple(f'{order}_{value}' for value in VALUES for order in ('signal', 'difference', 'second_difference'))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the values; skewness and log kurtosis of a constant signal are 0."""
        orders = signal_differences(windows)
        n_samples = orders.shape[-1]
        means = orders[..., 1:, :, :] @ mean_weights(n_samples)  # of squares and amplitudes
        square = means[..., 0, :]
        # A product for each row: no arrays of third and fourth powers.
        products = (orders[..., :2, :, :].swapaxes(-3, -2) @ orders[..., 1, :, :, None])[..., 0] / n_samples
        skewness = products[..., 0] / (square * np.sqrt(square) + MOMENTS_TINY)
        kurtosis = (products[..., 1] + MOMENTS_TINY) / (square * square + MOMENTS_TINY)
        means += ((LEAST_AMPLITUDE * LEAST_AMPLITUDE,), (LEAST_AMPLITUDE,))
        logs = np.log(means, out=means).reshape(*square.shape[:-1], 6)
        return np.concatenate((logs, skewness, np.log(kurtosis)), axis=-1)


# --------------------
# Speed of the finger.


@dataclass(frozen=True)
class Speed(Feature):
    """Mean speed of the finger along the surface in the window, m/s; NaN if the exploration does not report it.

    Examples
    --------
    >>> Speed()(WindowBatch(np.zeros((5, 1)), rate_hz=100.0, speed_m_s=np.array(0.05))).item()
    0.05
    """

    per_channel: ClassVar[bool] = False

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the speed."""
        return np.asarray(windows.speed_m_s, dtype=np.float64)[..., None, None]


# --------------------
# How much the signal changes within a short time.

LAG_S = 0.002  # at least one sample; a longer one compares lower frequencies


@dataclass(frozen=True)
class TemporalVariation(Feature):
    """Logarithm of the mean absolute difference of the signal with itself 2 ms later.

    In nerves the rougher surface makes the response of each fibre vary more in time; here the channel takes the place
    of a fibre.

    Source: Lieber & Bensmaia 2019; Lieber, Xia, Weber & Bensmaia 2017.

    Examples
    --------
    >>> ramp = WindowBatch(0.5 * np.arange(100.0)[:, None], rate_hz=1000.0)  # 0.5 a sample; 2 ms are two samples
    >>> round(TemporalVariation()(ramp).item(), 6)
    0.0
    """

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(mean `|s(t + lag) - s(t)|`)."""
        rows = windows.rows
        lag = min(max(1, round(LAG_S * windows.rate_hz)), rows.shape[-1] - 1)
        steps = np.abs(rows[..., lag:] - rows[..., : rows.shape[-1] - lag])
        mean: Array = np.add.reduce(steps, axis=-1, keepdims=True) / steps.shape[-1]
        return np.log(mean + FLOOR)


# --------------------
# Time stretch: what a signal would have been at another speed.

# A finger that hardly moves gives no information on another speed, and must not need endless samples.
LARGEST_FACTOR = 10.0


@dataclass(frozen=True)
class Stretched(Feature):
    """A feature of windows that are first brought to one speed; itself a feature.

    A window of n samples at speed v becomes one of n · v / `to_m_s` samples at the same rate: the surface passes as it
    would at that speed. What then lies above half the rate is left out, not folded back. The feature gets the
    speed after stretching. A window whose speed is unknown or not above 0 stays as it is; no window becomes more than
    ten times as long or as short.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.D.4.
    """

    feature: Feature
    to_m_s: float

    @property
    def per_channel(self) -> bool:  # type: ignore[override]
        """As the feature defines it."""
        return self.feature.per_channel

    @property
    def per_pair(self) -> bool:
        """As the feature defines it."""
        return getattr(self.feature, 'per_pair', False)

    @property
    def names(self) -> tuple[str, ...]:
        """Those of the feature."""
        return self.feature.names

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the values of the feature."""
        groups = windows.shared(('stretched', self.to_m_s), lambda: self._cut(windows))
        parts = list(groups.values())
        extracted = [self.feature(part) for _, part in parts]
        values = np.empty((*windows.samples.shape[:-2], *extracted[0].shape[-2:]))
        for (chosen, _), block in zip(parts, extracted, strict=True):
            values[chosen] = block
        return values

    def _cut(self, windows: WindowBatch) -> dict[int, tuple[AnyArray, WindowBatch]]:
        """Return the windows in groups of one stretched length, each with where it comes from."""
        leading = windows.samples.shape[:-2]
        speed, force = (np.broadcast_to(values, leading) for values in (windows.speed_m_s, windows.force_n))
        lengths = stretched_lengths(speed, windows.samples.shape[-2], self.to_m_s)
        groups = {}
        for length in np.unique(lengths).tolist():
            chosen = lengths == length
            factor = windows.samples.shape[-2] / length
            samples = resample(windows.samples[chosen], length)
            stretched = WindowBatch(
                samples, windows.rate_hz, speed[chosen] * factor, force[chosen], channels=windows.channels
            )
            groups[length] = (chosen, stretched)
        return groups


def stretched_lengths(speed_m_s: Array, n_samples: int, to_m_s: float) -> AnyArray:
    """Return how many samples windows have after stretching, (...)."""
    speed = np.asarray(speed_m_s, dtype=np.float64)
    moving = speed > 0  # False for NaN
    factor = np.clip(np.where(moving, speed, to_m_s) / to_m_s, 1.0 / LARGEST_FACTOR, LARGEST_FACTOR)
    lengths: AnyArray = np.maximum(1, np.rint(n_samples * factor)).astype(np.intp)
    return np.where(n_samples > 1, lengths, 1)


def resample(samples: Samples, length: int) -> Samples:
    """Return the band-limited signal through the samples at `length` equal steps over the same time.

    The line from the first to the last sample is taken out before the Fourier transform, which sees the signal as
    periodic, and put back after it.
    """
    n_samples = samples.shape[-2]
    if length == n_samples:
        return samples
    rows = np.ascontiguousarray(samples.swapaxes(-1, -2))
    first = rows[..., :1]
    rise = rows[..., -1:] - first
    waves = np.fft.rfft(rows - first - rise * (np.arange(n_samples) / n_samples))
    bins = min(n_samples, length) // 2 + 1
    steps = np.fft.irfft(waves[..., :bins], length) * (length / n_samples)
    return (steps + first + rise * (np.arange(length) / length)).swapaxes(-1, -2)
