"""Mean distance of the signal from its mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch


@dataclass(frozen=True)
class MeanAmplitude:
    """Mean of the absolute, zero-mean signal of each channel, in its unit: the plainest measure of how it vibrates.

    Source: Jamali & Sammut 2010, section VI (the baseline there).

    Examples
    --------
    >>> MeanAmplitude()(WindowBatch(np.array([[1.0], [5.0]]), rate_hz=100.0)).item()  # each is 2 from the mean
    2.0
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    logarithm: bool = param(False, 'Returns the logarithm instead of the amplitude itself.')
    floor: float = param(
        1e-10,
        'Amplitude added before the logarithm, so that silence gives a finite value, unit.',
        low=1e-300,
        high=1e300,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return mean |s - mean(s)|, or its logarithm."""
        rows = np.abs(windows.centred_rows)
        amplitudes: Array = np.add.reduce(rows, axis=-1, keepdims=True) / rows.shape[-1]
        return np.log(amplitudes + self.floor) if self.logarithm else amplitudes
