"""Autocorrelation of the power of the signal and of its first difference."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch, mean_weights
from texture_features.features.differences import squares
from texture_features.spectra.spectrum import overlapping

# Of a power squared: far below any, far above the smallest number, so that nothing over nothing is 1.
TINY = 1e-200


@dataclass(frozen=True)
class PowerAutocorrelation:
    """Log of the mean product of the squared signal and itself some samples later, over its mean squared; of steps too.

    0 where the one says nothing of the other, above where bursts last so long, below where they keep such a distance.
    The gain of the sensor changes nothing.

    Examples
    --------
    >>> clicks = np.zeros((400, 1))
    >>> clicks[::12] = 1.0
    >>> feature = PowerAutocorrelation()
    >>> values = dict(zip(feature.names, feature(WindowBatch(clicks, rate_hz=100.0))[0].tolist()))
    >>> values['signal_12'] > 2.0 > -1.5 > values['signal_8']  # clicks are 12 samples apart, never 8
    True
    """

    per_channel: ClassVar[bool] = True

    lags: int = param(
        12, 'Sets the number of lags, taken from 1, 2, 3, 4, 6, 8, 12, 16, 24, … samples.', low=1, high=24
    )
    floor: float = param(
        1e-3,
        'Ratio added before the logarithm, so that a lag without any power gives a finite value.',
        low=1e-12,
        high=1.0,
    )

    @cached_property
    def _lags(self) -> list[int]:
        return [1, *chain.from_iterable((2 << octave, 3 << octave) for octave in range(self.lags // 2))][: self.lags]

    @property
    def names(self) -> tuple[str, ...]:
        """Lag in samples, for the signal and for its steps."""
        return tuple(f'{what}_{lag}' for what in ('signal', 'difference') for lag in self._lags)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the values; 0 for all if the window is not two samples longer than the longest lag."""
        powers = squares(windows)[..., :2, :]
        n_steps = powers.shape[-1] - 1  # one less than samples
        count = n_steps - self._lags[-1]
        if count < 1:
            return np.zeros((*powers.shape[:-2], len(self.names)))
        # The axis of lags in front, where picking some copies whole blocks: a third of the time of doing so behind.
        later = overlapping(powers, count, 1).swapaxes(0, -2)[self._lags].swapaxes(0, -2)
        products = (later @ powers[..., :count, None])[..., 0] / count
        mean = (powers[..., :-1] @ mean_weights(n_steps))[..., None]
        autocorrelations = np.log((products + TINY) / (mean * mean + TINY) + self.floor)
        return autocorrelations.reshape(*powers.shape[:-2], -1)
