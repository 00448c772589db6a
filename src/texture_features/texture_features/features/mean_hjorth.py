"""Hjorth's parameters, averaged over the channels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.features.hjorth import Hjorth


@dataclass(frozen=True)
class MeanHjorth:
    """Means over the channels of activity (or its logarithm), mobility and complexity: what `hjorth` gives for each.

    Source: Kaboli et al. 2015, eq. 6 (with `log_activity` off, and of a BioTac's slow channels the electrodes alone).

    Examples
    --------
    >>> samples = np.array([[1.0, 10.0], [-1.0, -10.0]])  # powers of 1 and 100
    >>> MeanHjorth(log_activity=False)(WindowBatch(samples, rate_hz=100.0))[0, 0].item()
    50.5
    """

    per_channel: ClassVar[bool] = False

    log_activity: bool = param(True, 'Averages the logarithm of the activity instead of the activity itself.')
    floor: float = param(
        1e-20, 'Power added before the logarithm, so that silence gives a finite value, unit².', low=1e-300, high=1e300
    )

    omit: str = param(
        '', "Sets which channels are left out of the means, by their names, such as 'tdc tac pdc'; empty: none."
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Activity, mobility, complexity."""
        return self._per_channel.names

    @property
    def _per_channel(self) -> Hjorth:
        return Hjorth(self.log_activity, self.floor)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the means."""
        values = self._per_channel(windows)
        if self.omit:
            values = values[..., windows.without(self.omit), :]
        means: Array = np.add.reduce(values, axis=-2, keepdims=True) / values.shape[-2]
        return means
