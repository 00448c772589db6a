"""Logarithm of the variance of the steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch, centred, first_difference, power


@dataclass(frozen=True)
class LogDifferenceVariance:
    """Logarithm of the variance of the steps from sample to sample of each channel.

    Examples
    --------
    >>> zigzag = np.array([[0.0], [2.0], [0.0], [2.0], [0.0]])  # steps of 2 and -2: variance 4
    >>> np.exp(LogDifferenceVariance()(WindowBatch(zigzag, rate_hz=100.0))).round(6).item()
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
        """Return log(variance of the steps + floor)."""
        return np.log(power(centred(first_difference(windows.rows))) + self.floor)[..., None]
