"""Hjorth's parameters: activity, mobility and complexity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import Windows, power, ratio, slopes


@dataclass(frozen=True)
class Hjorth:
    """Activity (power), mobility (mean frequency) and complexity (bandwidth) of each channel."""

    of_signal: ClassVar[bool] = True

    log_activity: bool = param(True, 'Give the logarithm of the activity.')
    floor: float = param(1e-20, 'Power added before the logarithm, unit².', low=1e-300, high=1e300)

    @property
    def names(self) -> tuple[str, ...]:
        """Activity, mobility, complexity."""
        return ('log_activity' if self.log_activity else 'activity', 'mobility', 'complexity')

    def __call__(self, windows: Windows) -> Array:
        """Return activity, mobility and complexity."""
        values = hjorth(windows.centred_rows)
        if self.log_activity:
            values[..., 0] = np.log(values[..., 0] + self.floor)
        return values


def hjorth(rows: Array) -> Array:
    """Return activity, mobility per sample step, and complexity; the latter two are 0 for a constant row.

    Parameters
    ----------
    rows : (..., n_samples)
        Zero mean.

    Returns
    -------
    (..., 3)

    Source: Hjorth 1970; Kaboli et al. 2015, eq. 1 to 3.
    """
    slope = slopes(rows)
    activity = power(rows)
    slope_power = _step_variance(rows, slope)
    bend_power = _step_variance(slope, slopes(slope))
    values = np.empty((*activity.shape, 3))
    values[..., 0] = activity
    values[..., 1] = np.sqrt(ratio(slope_power, activity))
    values[..., 2] = np.sqrt(ratio(bend_power, slope_power))
    values[..., 2] = ratio(values[..., 2], values[..., 1])
    return values


def _step_variance(rows: Array, steps: Array) -> Array:
    """Return the variance of the steps of rows; their mean is known from the first and the last sample."""
    mean = (rows[..., -1] - rows[..., 0]) / steps.shape[-1]
    return np.maximum(power(steps) - mean * mean, 0.0)
