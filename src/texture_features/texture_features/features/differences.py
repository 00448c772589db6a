"""The signal with its first and second difference, in one array."""

from __future__ import annotations

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch


def signal_differences(windows: WindowBatch) -> Array:
    """Return the zero-mean signal, its steps from sample to sample, and their steps, ended by zeros: (..., 3, n).

    Returns
    -------
    (..., n_channels, 3, n_samples)
        In the unit of the signal; differences are per sample step.
    """
    return windows.shared('differences', lambda: _differences(windows.centred_rows))


def squares(windows: WindowBatch) -> Array:
    """Return the squares of `signal_differences`.

    Returns
    -------
    (..., n_channels, 3, n_samples)
        In the square of the unit of the signal.
    """
    return windows.shared('squares', lambda: np.square(signal_differences(windows)))


def _differences(rows: Array) -> Array:
    orders = np.zeros((*rows.shape[:-1], 3, rows.shape[-1]))
    signal, slope, second_difference = orders[..., 0, :], orders[..., 1, :], orders[..., 2, :]
    signal[...] = rows
    np.subtract(rows[..., 1:], rows[..., :-1], out=slope[..., :-1])
    np.subtract(slope[..., 1:-1], slope[..., :-2], out=second_difference[..., :-2])
    return orders
