"""The signal with its slope and its bend, in one array: what features of shape are made of."""

from __future__ import annotations

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import Windows


def differences(windows: Windows) -> Array:
    """Return the zero-mean signal, its steps from sample to sample, and their steps, ended by zeros: (..., 3, n)."""
    return windows.shared('differences', lambda: _differences(windows.centred_rows))


def squares(windows: Windows) -> Array:
    """Return the squares of `differences`."""
    return windows.shared('squares', lambda: np.square(differences(windows)))


def _differences(rows: Array) -> Array:
    orders = np.zeros((*rows.shape[:-1], 3, rows.shape[-1]))
    signal, slope, bend = orders[..., 0, :], orders[..., 1, :], orders[..., 2, :]
    signal[...] = rows
    np.subtract(rows[..., 1:], rows[..., :-1], out=slope[..., :-1])
    np.subtract(slope[..., 1:-1], slope[..., :-2], out=bend[..., :-2])
    return orders
