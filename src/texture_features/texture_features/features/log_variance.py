"""Logarithm of the variance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch, power


@dataclass(frozen=True)
class LogVariance:
    """Logarithm of the variance of each channel.

    Examples
    --------
    >>> np.exp(LogVariance()(WindowBatch(np.array([[1.0], [5.0]]), rate_hz=100.0))).round(6).item()
    4.0
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    floor: float = param(
        1e-20,
        'Sets the power added before the logarithm, in unit²; 1/12 is right for signals quantised to integers.',
        low=1e-300,
        high=1e300,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(variance + floor)."""
        return np.log(power(windows.centred_rows) + self.floor)[..., None]
