"""Power of vibration in short cells of time, against that of the sensor's noise."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_coeffs, savgol_filter

from texture_core.arrays import AnyArray, Array, Samples

# What follows a cubic over the time to smooth over is the load, and its leaking away, not vibration.
SMOOTH_S, SMOOTH_ORDER = 0.05, 3
SMOOTHED_CELLS = 11
REST_QUANTILE = 0.1
# Means of 50 samples scatter by 20 %: the lowest tenth of them, rest being about half of all, ends at 0.8 of the mean.
REST_OVER_QUANTILE = 1.25
# Samples that do not change at all are no measure of the noise.
MIN_REST, TINY = 1e-9, 1e-300


def cell_power(fast: Samples, rate_hz: float, cell_s: float, smooth_s: float = SMOOTH_S) -> tuple[float, Array]:
    """Return the length of a cell in s, and the power of the vibration in each, (n_cells, n_channels).

    What changes over longer than `smooth_s` is no vibration, what is not finite has none, and a cell in which a channel
    stands at the end of its range is NaN.

    Parameters
    ----------
    fast : (n_samples, n_channels)
        Vibration.
    rate_hz
        Its sampling rate.
    cell_s
        Wanted length of a cell, s; it is rounded to whole samples.
    smooth_s
        Time over which a change counts as vibration, s.

    Returns
    -------
    float
        Length of a cell, s.
    (n_cells, n_channels)
        Mean square of the vibration, in the square of its unit; no cell for a very short recording.
    """
    width = max(1, round(cell_s * rate_hz))
    count = len(fast) // width
    if len(fast) <= _smoothed(rate_hz, smooth_s):
        return width / rate_hz, np.empty((0, fast.shape[1]))
    known = np.isfinite(fast)
    lowest = np.where(known, fast, np.inf).min(axis=0)
    highest = np.where(known, fast, -np.inf).max(axis=0)
    at_end = ((fast <= lowest) | (fast >= highest))[: count * width].reshape(count, width, -1).all(axis=1)
    power: Array = np.square(highpass(fast, rate_hz, smooth_s)[: count * width]).reshape(count, width, -1).mean(axis=1)
    power[at_end] = np.nan
    return width / rate_hz, power


def highpass(fast: Samples, rate_hz: float, smooth_s: float = SMOOTH_S) -> Samples:
    """Return the samples without what changes over longer than `smooth_s`; 0 for what is not finite.

    Parameters
    ----------
    fast : (n_samples, n_channels)
        Vibration.
    rate_hz
        Its sampling rate.
    smooth_s
        Time over which a change counts as vibration, s.

    Returns
    -------
    (n_samples, n_channels)
        In the unit of the samples.
    """
    vibration = median_centred(fast)
    smoothed = _smoothed(rate_hz, smooth_s)
    if len(fast) > smoothed:
        vibration -= savgol_filter(vibration, smoothed, SMOOTH_ORDER, axis=0)
    vibration[~np.isfinite(fast)] = 0.0
    return vibration


def baseline_power(powers: Array) -> Array:
    """Return the power of each channel at rest, (n_channels,), above 0, from the quietest tenth of the recording.

    Parameters
    ----------
    powers : (n_cells, n_channels)
        Power of the vibration in each cell; NaN where it is unknown.

    Returns
    -------
    (n_channels,)
        In the unit of `powers`.
    """
    known = np.isfinite(powers)
    share = uniform_filter1d(known.astype(float), SMOOTHED_CELLS, axis=0)
    smooth = uniform_filter1d(np.where(known, powers, 0.0), SMOOTHED_CELLS, axis=0) / np.maximum(share, 1e-3)
    smooth[share < 0.5] = np.inf
    quiet = REST_OVER_QUANTILE * np.quantile(smooth, REST_QUANTILE, axis=0, method='lower')
    quiet[np.isinf(quiet)] = smooth.min(axis=0)[np.isinf(quiet)]
    rest: Array = np.maximum(np.maximum(quiet, MIN_REST * np.where(known, powers, 0.0).max(axis=0)), TINY)
    return rest


def _smoothed(rate_hz: float, smooth_s: float) -> int:
    """Return over how many samples the smooth part is taken: odd, and enough for its order."""
    return max(2 * round(0.5 * smooth_s * rate_hz) + 1, SMOOTH_ORDER + 2)


def median_centred(fast: Samples) -> Samples:
    """Return the samples about the median of each channel; 0 for what is not finite.

    Parameters
    ----------
    fast : (n_samples, n_channels)

    Returns
    -------
    (n_samples, n_channels)
        In the unit of the samples.
    """
    known = np.where(np.isfinite(fast), fast, np.nan)
    some = np.isfinite(known).any(axis=0)
    middle = np.nanmedian(np.where(some, known, 0.0), axis=0)
    about: Samples = np.nan_to_num(known - middle)
    return about


def highpass_gain(frequency_hz: AnyArray, rate_hz: float, smooth_s: float) -> Array:
    """Return the share of power at frequencies that is not taken for the smooth part.

    Parameters
    ----------
    frequency_hz : (n,)
        Frequencies from 0 to half the sampling rate.
    rate_hz
        Sampling rate.
    smooth_s
        Time over which a change counts as vibration, s.

    Returns
    -------
    (n,)
        Power behind the high-pass filter over that before it.
    """
    grid_hz, passed = _highpass_response(rate_hz, smooth_s)
    share: Array = np.interp(frequency_hz, grid_hz, passed)
    return share


@lru_cache(maxsize=8)
def _highpass_response(rate_hz: float, smooth_s: float) -> tuple[Array, Array]:
    """Return frequencies up to half the rate, and the share of power passed at each."""
    kernel = savgol_coeffs(_smoothed(rate_hz, smooth_s), SMOOTH_ORDER)
    turns = np.arange(len(kernel)) - len(kernel) // 2
    grid_hz = np.asarray(np.linspace(0.0, rate_hz / 2, 512), dtype=np.float64)
    answer = 1.0 - np.cos(2 * np.pi * grid_hz[:, None] * turns / rate_hz) @ kernel
    passed: Array = np.square(answer)
    return grid_hz, passed
