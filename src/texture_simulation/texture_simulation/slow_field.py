"""What changes slowly from place to place: reckoned at some points of a way and interpolated between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from texture_core.arrays import AnyArray, Array

MAX_POINTS = 16  # from one reckoned point to the next


def interpolated_field(field: Callable[[Array, Array], AnyArray], x_m: Array, y_m: Array, within_m: float) -> AnyArray:
    """Return a field at places along ways, (..., n), straight between places that are `within_m` apart or nearer.

    Between places h apart, a wave of wave number k is wrong by at most (k·h)²/8 of its amplitude.

    Parameters
    ----------
    field
        Takes and returns arrays of equal shape.
    x_m, y_m : (..., n)
        n at least 1.
    within_m
        Largest distance of the places at which the field is computed.

    Returns
    -------
    (..., n)
        In the unit of the field.
    """
    n_points = x_m.shape[-1]
    longest_m = np.abs(np.diff(x_m)).max(initial=0.0) + np.abs(np.diff(y_m)).max(initial=0.0)
    every = MAX_POINTS if longest_m * MAX_POINTS <= within_m else max(1, int(within_m / longest_m))
    if every == 1 or n_points <= every:
        return field(x_m, y_m)
    knots = np.append(np.arange(0, n_points - 1, every), n_points - 1)
    values = field(x_m.take(knots, axis=-1), y_m.take(knots, axis=-1))
    points = np.arange(n_points)
    left = np.minimum(points // every, len(knots) - 2)
    share = (points - knots[left]) / (knots[left + 1] - knots[left])
    rise = np.diff(values)
    return np.asarray(values.take(left, axis=-1) + rise.take(left, axis=-1) * share)
