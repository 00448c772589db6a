"""Relative changes: how much each taxel changes within a window, over the load of all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch, first_difference, power


@dataclass(frozen=True)
class RelativeChanges:
    """Square roots of each channel's standard deviation and of that of its steps, over the load of all channels.

    Two moments of the slow spectrum (Hjorth's activity, and that of the slope) without the level: the deviation counts
    slow changes, the steps fast ones. The load is the sum of the absolute means; a force that presses harder, and lets
    all change by the same factor, changes nothing.

    Examples
    --------
    >>> samples = np.array([[1.0, 9.0], [3.0, 9.0], [1.0, 9.0], [3.0, 9.0]])  # one taxel moves by ±1 under a load of 11
    >>> RelativeChanges()(WindowBatch(samples, rate_hz=100.0)).round(3).tolist()
    [[0.302, 0.414], [0.0, 0.0]]
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('deviation', 'step')

    floor: float = param(1e-9, 'Smallest load, in the unit of the signal; a smaller one is replaced by it.', low=1e-300)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return both roots."""
        rows = windows.rows
        load = np.add.reduce(np.abs(np.add.reduce(rows, axis=-1) / rows.shape[-1]), axis=-1, keepdims=True)
        steps = first_difference(rows)
        steps = steps - np.add.reduce(steps, axis=-1, keepdims=True) / steps.shape[-1]
        deviations = np.sqrt(np.stack([power(windows.centred_rows), power(steps)], axis=-1))
        changes: Array = np.sqrt(deviations / np.maximum(load, self.floor)[..., None])
        return changes
