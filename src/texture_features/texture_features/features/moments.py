"""Log power, skewness and log kurtosis of the signal and of its first and second difference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch, mean_weights
from texture_features.features.differences import signal_differences, squares

VALUES = ('log_power', 'log_amplitude', 'skewness', 'log_kurtosis')
# Far below any power, far above the smallest number: nothing over nothing becomes 0 or 1.
TINY = 1e-150


@dataclass(frozen=True)
class Moments:
    """Log mean square, log mean amplitude, skewness and log kurtosis of the signal, its steps and their steps.

    A spectrum holds the mean squares and nothing of the rest: whether a surface pushes more than it pulls, and whether
    it hits rarely and hard or often and softly.

    Examples
    --------
    >>> spikes = np.zeros((100, 1))
    >>> spikes[::10] = 1.0  # rare and upwards
    >>> values = dict(zip(Moments().names, Moments()(WindowBatch(spikes, rate_hz=100.0))[0].round(2).tolist()))
    >>> values['signal_skewness']  # (1 - 2p) / √(p (1 - p)) with p = 0.1
    2.67
    """

    per_channel: ClassVar[bool] = True

    floor: float = param(
        1e-10, 'Amplitude added before a logarithm; it is squared where a power is meant.', low=1e-140, high=1e100
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Value of the signal, of its slope and of its bend."""
        return tuple(f'{order}_{value}' for value in VALUES for order in ('signal', 'difference', 'second_difference'))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the values; skewness and log kurtosis of a constant signal are 0."""
        signals, powers = signal_differences(windows), squares(windows)
        mean = mean_weights(signals.shape[-1])
        square = powers @ mean
        values = (
            np.log(square + self.floor * self.floor),
            np.log(np.abs(signals) @ mean + self.floor),
            ((powers * signals) @ mean) / (square * np.sqrt(square) + TINY),
            np.log(((powers * powers) @ mean + TINY) / (square * square + TINY)),
        )
        return np.concatenate(values, axis=-1)
