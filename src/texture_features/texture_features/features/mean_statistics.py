"""Mean, power and shape statistics of the signal, averaged over the channels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch, power


@dataclass(frozen=True)
class ChannelMeanStatistics:
    """Waveform statistics of slow channels, independent of the taxel; no speed is needed.

    Means over the channels of: level; log variance; rise, the last quarter of the window less the first; its absolute
    value; share of the samples above the mean; skewness.

    Examples
    --------
    >>> rising = np.linspace(0.0, 1.0, 100)[:, None] * np.ones(2)
    >>> values = dict(zip(ChannelMeanStatistics.names, ChannelMeanStatistics()(WindowBatch(rising, 100.0))[0]))
    >>> round(float(values['mean']), 2), round(float(values['rise']), 2), round(float(values['share_above']), 2)
    (0.5, 0.76, 0.5)
    """

    per_channel: ClassVar[bool] = False
    names: ClassVar[tuple[str, ...]] = ('mean', 'log_variance', 'rise', 'absolute_rise', 'share_above', 'skewness')

    floor: float = param(
        1e-4, 'Sets the power added to the variance before logarithm and split, in unit².', low=1e-300, high=1e300
    )

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
        skewness = cubes / (variance + self.floor) ** 1.5
        values = np.stack([level, np.log(variance + self.floor), rise, np.abs(rise), above, skewness], axis=-1)
        mean: Array = np.add.reduce(values, axis=-2, keepdims=True) / values.shape[-2]
        return mean
