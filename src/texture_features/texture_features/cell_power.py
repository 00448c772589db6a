"""Power of vibration in short cells of time, against that of the sensor's noise."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_coeffs, savgol_filter, welch

from texture_core.arrays import Array, Samples

# What follows a cubic over the time to smooth over is the load, and its leaking away, not vibration.
SMOOTH_S, SMOOTH_ORDER = 0.05, 3
SMOOTHED_CELLS = 11
REST_QUANTILE = 0.1
# Means of 50 samples scatter by 20 %: the lowest tenth of them, rest being about half of all, ends at 0.8 of the mean.
REST_OVER_QUANTILE = 1.25
# Samples that do not change at all are no measure of the noise.
LEAST_REST, TINY = 1e-9, 1e-300
SPECTRUM_S = 0.25
# What a vibration channel senses, and the powers of the speed with which the amplitude of one and the same wave of a
# texture then grows: films that hold their charge and hydrophones feel the force, differentiating channels its change.
# Below the corner of its high-pass a change grows as the square of the speed, above as the speed; most waves pass both.
SENSES: Mapping[str, tuple[float, ...]] = {'force': (0.0,), 'change': (1.5,), 'either': (0.0, 0.5, 1.0, 1.5)}
SPEEDS = np.linspace(0.0, 1.0, 41)


def cell_power(fast: Samples, rate_hz: float, cell_s: float, smooth_s: float = SMOOTH_S) -> tuple[float, Array]:
    """Return the length of a cell in s, and the power of the vibration in each, (n_cells, n_channels).

    What changes over longer than `smooth_s` is no vibration, what is not finite has none, and a cell in which a channel
    stands at the end of its range is NaN.
    """
    width = max(1, round(cell_s * rate_hz))
    count, smoothed = len(fast) // width, _smoothed(rate_hz, smooth_s)
    if len(fast) <= smoothed:
        return width / rate_hz, np.empty((0, fast.shape[1]))
    known = np.isfinite(fast)
    lowest = np.where(known, fast, np.inf).min(axis=0)
    highest = np.where(known, fast, -np.inf).max(axis=0)
    at_end = ((fast <= lowest) | (fast >= highest))[: count * width].reshape(count, width, -1).all(axis=1)
    vibration = _centred(fast)
    vibration -= savgol_filter(vibration, smoothed, SMOOTH_ORDER, axis=0)
    vibration[~known] = 0.0
    power: Array = np.square(vibration[: count * width]).reshape(count, width, -1).mean(axis=1)
    power[at_end] = np.nan
    return width / rate_hz, power


def rest_power(powers: Array) -> Array:
    """Return the power of each channel at rest, (n_channels,), above 0, from the quietest tenth of the recording."""
    known = np.isfinite(powers)
    share = uniform_filter1d(known.astype(float), SMOOTHED_CELLS, axis=0)
    smooth = uniform_filter1d(np.where(known, powers, 0.0), SMOOTHED_CELLS, axis=0) / np.maximum(share, 1e-3)
    smooth[share < 0.5] = np.inf
    quiet = REST_OVER_QUANTILE * np.quantile(smooth, REST_QUANTILE, axis=0, method='lower')
    quiet[np.isinf(quiet)] = smooth.min(axis=0)[np.isinf(quiet)]
    rest: Array = np.maximum(np.maximum(quiet, LEAST_REST * np.where(known, powers, 0.0).max(axis=0)), TINY)
    return rest


def growth(fast: Samples, rate_hz: float, rest: Array, senses: str = 'either', smooth_s: float = SMOOTH_S) -> Array:
    """Return how the power of vibration grows with the speed, from its spectrum at steady speed.

    At a share of the speed all frequencies of a texture are lower by that share, and fewer of them are vibration.

    Parameters
    ----------
    fast : (n_samples, n_channels)
        At steady speed.
    rest : (n_channels,)
        Power of each channel at rest.
    senses
        One of `SENSES`.
    smooth_s
        What changes over longer is no vibration.

    Returns
    -------
    (n_ways, n_speeds)
        Power at `SPEEDS`, shares of the steady speed, in that at steady speed; a row for each way it may be.
    """
    length = min(len(fast), max(2, round(SPECTRUM_S * rate_hz)))
    frequency_hz, density = welch(_centred(fast), rate_hz, nperseg=length, detrend='linear', axis=0)
    passed = _passed(frequency_hz, rate_hz, smooth_s)
    noise = 1.0 / max(float(passed.mean()) * rate_hz / 2, TINY)  # white
    texture = np.maximum(density / rest - noise, 0.0).sum(axis=1)
    power = _passed(SPEEDS[:, None] * frequency_hz, rate_hz, smooth_s) @ texture
    shares = power / power[-1] if power[-1] > 0 else SPEEDS**2
    table: Array = SPEEDS ** (2.0 * np.array(SENSES[senses])[:, None]) * shares
    return table


def _smoothed(rate_hz: float, smooth_s: float) -> int:
    """Return over how many samples the smooth part is taken: odd, and enough for its order."""
    return max(2 * round(0.5 * smooth_s * rate_hz) + 1, SMOOTH_ORDER + 2)


def _centred(fast: Samples) -> Samples:
    known = np.where(np.isfinite(fast), fast, np.nan)
    some = np.isfinite(known).any(axis=0)
    middle = np.nanmedian(np.where(some, known, 0.0), axis=0)
    centred: Samples = np.nan_to_num(known - middle)
    return centred


def _passed(frequency_hz: Array, rate_hz: float, smooth_s: float) -> Array:
    """Return the share of power at frequencies that is not taken for the smooth part."""
    kernel = savgol_coeffs(_smoothed(rate_hz, smooth_s), SMOOTH_ORDER)
    turns = np.arange(len(kernel)) - len(kernel) // 2
    grid_hz = np.linspace(0.0, rate_hz / 2, 512)
    answer = 1.0 - np.cos(2 * np.pi * grid_hz[:, None] * turns / rate_hz) @ kernel
    passed: Array = np.interp(frequency_hz, grid_hz, np.square(answer))
    return passed
