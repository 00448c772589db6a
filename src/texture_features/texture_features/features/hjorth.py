"""Hjorth's parameters: activity, mobility and complexity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch, first_difference, power

# Far below any deviation, far above the smallest number: 0 / 0 becomes 0.
TINY = 1e-150


@dataclass(frozen=True)
class Hjorth:
    """Activity (power), mobility (mean frequency) and complexity (bandwidth) of each channel.

    Examples
    --------
    >>> time_s = np.arange(1000) / 1000.0
    >>> tone = WindowBatch(np.sin(2 * np.pi * 40.0 * time_s)[:, None], rate_hz=1000.0)
    >>> Hjorth(log_activity=False)(tone)[0, :2].round(2).tolist()  # ½, and 2 sin(π · 40 / 1000)
    [0.5, 0.25]
    """

    per_channel: ClassVar[bool] = True

    log_activity: bool = param(True, 'Returns the logarithm of the activity instead of the activity itself.')
    floor: float = param(
        1e-20, 'Power added before the logarithm, so that silence gives a finite value, unit².', low=1e-300, high=1e300
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Activity, mobility, complexity."""
        return ('log_activity' if self.log_activity else 'activity', 'mobility', 'complexity')

    def __call__(self, windows: WindowBatch) -> Array:
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
    mobility = roots[1:] / (roots[:2] + TINY)
    powers[1] = mobility[0]
    powers[2] = mobility[1] / (mobility[0] + TINY)
    return powers.transpose((*range(1, powers.ndim), 0))
