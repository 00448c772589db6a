"""How much the signal changes within a short time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch


@dataclass(frozen=True)
class TemporalVariation:
    """Logarithm of the mean absolute difference of the signal with itself `lag_s` later.

    In nerves the rougher surface makes the response of each fibre vary more in time; here the channel takes the place
    of a fibre.

    Source: Lieber & Bensmaia 2019; Lieber, Xia, Weber & Bensmaia 2017.

    Examples
    --------
    >>> ramp = WindowBatch(0.5 * np.arange(100.0)[:, None], rate_hz=1000.0)  # 0.5 a sample; 2 ms are two samples
    >>> round(TemporalVariation()(ramp).item(), 6)
    0.0
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    lag_s: float = param(
        0.002,
        'Sets the time lag between the compared samples, at least one sample; a longer one compares lower frequencies.',
        unit='s',
        low=0.0,
        high=10.0,
    )
    floor: float = param(
        1e-20,
        'Difference added before the logarithm, so that silence gives a finite value, unit.',
        low=1e-300,
        high=1e300,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(mean |s(t + lag) - s(t)|)."""
        rows = windows.rows
        lag = min(max(1, round(self.lag_s * windows.rate_hz)), rows.shape[-1] - 1)
        steps = np.abs(rows[..., lag:] - rows[..., : rows.shape[-1] - lag])
        mean: Array = np.add.reduce(steps, axis=-1, keepdims=True) / steps.shape[-1]
        return np.log(mean + self.floor)
