"""Mean amplitude of the signal, in each reading of that word."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.catalogue import find
from texture_core.parameters import param
from texture_features.feature import WindowBatch

AVERAGED: Mapping[str, Callable[[WindowBatch], Array]] = {
    'deviation': lambda windows: np.abs(windows.centred_rows),
    'magnitude': lambda windows: np.abs(windows.rows),
    'signal': lambda windows: windows.rows,
}


@dataclass(frozen=True)
class MeanAmplitude:
    """Mean amplitude of each channel, in its unit: the plainest measure of how it vibrates.

    The source says "average amplitude of the signal over a fixed window" and "averaging the signals of each sensor",
    which can be read as the mean of |s - mean(s)|, of |s| or of s itself.

    Source: Jamali & Sammut 2010, section VI (the baseline there).

    Examples
    --------
    >>> MeanAmplitude()(WindowBatch(np.array([[1.0], [5.0]]), rate_hz=100.0)).item()  # each is 2 from the mean
    2.0
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    of: str = param(
        'deviation',
        "Sets what is averaged: 'deviation' takes |s - mean(s)|, 'magnitude' takes |s|, 'signal' takes s itself.",
        choices=tuple(AVERAGED),
    )
    logarithm: bool = param(False, 'Returns the logarithm of the absolute amplitude instead of the amplitude itself.')
    floor: float = param(
        1e-10,
        'Amplitude added before the logarithm, so that silence gives a finite value, unit.',
        low=1e-300,
        high=1e300,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the mean, or the logarithm of its absolute value."""
        rows = find(AVERAGED, self.of, 'reading of the amplitude')(windows)
        amplitudes: Array = np.add.reduce(rows, axis=-1, keepdims=True) / rows.shape[-1]
        return np.log(np.abs(amplitudes) + self.floor) if self.logarithm else amplitudes
