"""The skin sticks, is stretched, and jumps after."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.effects.protocols import BatchShape, TrajectoryFilter
from texture_simulation.trajectory import Trajectory

CATCH_UP_S = 4e-3  # time constant of the jump
FORGOTTEN = 8.0  # time constants after which nothing of a skid is left


@dataclass(frozen=True)
class Skids:
    """Now and then the skin stays where it is for a moment while the finger goes on, then catches up.

    A cheap stand-in for stick-slip, for slides of which some went wrong.
    """

    per_s: float = param(
        0.5,
        'Sets how often the skin sticks and jumps; a higher rate disturbs more slides.',
        unit='1/s',
        low=0.0,
        high=20.0,
    )
    length_s: float = param(0.05, 'Sets how long the skin sticks before it jumps.', unit='s', low=1e-3, high=1.0)

    def start_path(self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape) -> TrajectoryFilter:
        """Return what lets the skin lag behind the finger."""
        length, kept = max(1, round(self.length_s * rate_hz)), math.exp(-1 / (CATCH_UP_S * rate_hz))
        since = np.full(batch_shape, 10**9)  # points since the last skid began
        held = [np.zeros(batch_shape), np.zeros(batch_shape)]  # where
        farthest = length + FORGOTTEN * CATCH_UP_S * rate_hz

        def lag(path: Trajectory) -> Trajectory:
            nonlocal since
            count = len(path)
            begins = rng.random((*batch_shape, count)) < self.per_s / rate_hz * (path.force_n > 0)
            if not begins.any() and not (since < farthest).any():
                since = since + count
                return path
            number = np.arange(count)
            last = np.maximum.accumulate(np.where(begins, number, -1), axis=-1)
            age = number - np.where(last >= 0, last, -since[..., None])
            # Where the finger is when the skin comes loose is what it catches up with from then on.
            weight = np.where(age < length, 1.0, kept ** np.maximum(age - length + 1.0, 0.0))
            skin = [_lagging(place, hold, last, weight) for place, hold in zip((path.x_m, path.y_m), held, strict=True)]
            for i, place in enumerate((path.x_m, path.y_m)):
                end = last[..., -1]
                began = np.take_along_axis(place, np.maximum(end, 0)[..., None], axis=-1)[..., 0]
                held[i] = np.where(end >= 0, began, held[i])
            since = age[..., -1] + 1
            return Trajectory(skin[0], skin[1], path.force_n)

        return lag


def _lagging(place_m: Array, held_m: Array, last: Array, weight: Array) -> Array:
    """Return where the skin is: `weight` of the way back to where the last skid began, (..., n)."""
    began = np.take_along_axis(place_m, np.maximum(last, 0), axis=-1)
    began = np.where(last >= 0, began, held_m[..., None])
    lagging: Array = place_m + weight * (began - place_m)
    return lagging
