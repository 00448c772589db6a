"""Mean distance of the signal from its mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import Windows


@dataclass(frozen=True)
class MeanAmplitude:
    """Mean of the absolute, zero-mean signal of each channel, in its unit: the plainest measure of how it vibrates.

    Source: Jamali & Sammut 2010, section VI (the baseline there).
    """

    of_signal: ClassVar[bool] = True

    @property
    def names(self) -> tuple[str, ...]:
        """One value without a name of its own."""
        return ('',)

    def __call__(self, windows: Windows) -> Array:
        """Return mean |s - mean(s)|."""
        rows = np.abs(windows.centred_rows)
        amplitudes: Array = np.add.reduce(rows, axis=-1) / rows.shape[-1]
        return amplitudes[..., None]
