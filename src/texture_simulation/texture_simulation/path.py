# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How a finger moves in a simulation: trajectories, tracks, filters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from texture_core.types import NANOSECONDS, AnyArray, Array, FingerState

# --------------------
# Linear filters that go on from block to block, for one signal or many at once.


@lru_cache(maxsize=64)
def _steady(sections: bytes) -> Array:
    """Return the state of sections, (n_sections, 2), that 1 has passed."""
    return np.asarray(signal.sosfilt_zi(np.frombuffer(sections).reshape(-1, 6)))


class Filter:
    """Second-order sections along the last axis."""

    def __init__(self, sections: Array, *, settled: bool = False) -> None:
        self._sections = sections
        self._settled = settled
        self._state: Array | None = None

    def __call__(self, values: Array) -> Array:
        """Return the next values, (..., n), filtered."""
        if not values.shape[-1]:
            return values
        if self._state is None:
            self._state = np.zeros((len(self._sections), *values.shape[:-1], 2))
            if self._settled:
                shape = (len(self._sections), *[1] * (values.ndim - 1), 2)
                self._state = _steady(self._sections.tobytes()).reshape(shape) * values[..., :1]
        filtered, self._state = signal.sosfilt(self._sections, values, axis=-1, zi=self._state)
        return np.asarray(filtered, dtype=np.float64)


# --------------------
# What changes slowly from place to place: reckoned at some points of a way and interpolated between them.

MAX_POINTS = 16  # from one reckoned point to the next


def interpolated_field(field: Callable[[Array, Array], AnyArray], x_m: Array, y_m: Array, within_m: float) -> AnyArray:
    """Return a field at places along ways, (..., n), straight between places at most `within_m` from each other.

    Between places h apart, a wave of wave number k is wrong by at most (k·h)²/8 of its amplitude.
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
    fraction = (points - knots[left]) / (knots[left + 1] - knots[left])
    rise = np.diff(values)
    return np.asarray(values.take(left, axis=-1) + rise.take(left, axis=-1) * fraction)


# --------------------
# Where a finger goes over a surface, finely sampled.


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Places and forces at consecutive times of a constant rate; of one slide, or of many at once."""

    x_m: Array
    y_m: Array
    force_n: Array

    def __len__(self) -> int:
        return int(self.x_m.shape[-1])

    def moved(self, x_m: float | Array, y_m: float | Array) -> Trajectory:
        """Return the same path starting elsewhere; (..., 1) for many."""
        return Trajectory(self.x_m + x_m, self.y_m + y_m, self.force_n)

    def at(self, indices: NDArray[np.intp] | slice) -> Trajectory:
        """Return some of its points."""
        return Trajectory(self.x_m[..., indices], self.y_m[..., indices], self.force_n[..., indices])


def straight(start: tuple[float, float, float], end: tuple[float, float, float], n_points: int) -> Trajectory:
    """Return `n_points` on the way from (x, y, force) to another, the start left out and the end included."""
    fractions = np.arange(1, n_points + 1) / n_points
    return Trajectory(*(first + (last - first) * fractions for first, last in zip(start, end, strict=True)))


def before_first(path: Trajectory) -> tuple[Array, Array]:
    """Return x and y before the first of at least one point, (..., 1) each: as far from it as the second is."""
    x_m, y_m = (2 * place[..., :1] - place[..., :2][..., -1:] for place in (path.x_m, path.y_m))
    return x_m, y_m


# --------------------
# The path of a finger as it happens, from what the arm reports about it.

STALE_S = 0.2  # an arm silent for longer has stopped
JUMP_M_S = 3.0  # what moves faster than this was put elsewhere, it did not slide


class FingerTrack:
    """Follow a finger: extrapolate its newest state, and join what comes without steps."""

    def __init__(self) -> None:
        self.newest: FingerState | None = None
        self._at = (0.0, 0.0, 0.0)  # x, y, force at the end of the path so far

    @property
    def touching(self) -> bool:
        """Whether the path so far ends on the surface."""
        return self._at[2] > 0.0

    def update(self, state: FingerState) -> None:
        """Take note of a state; one older than the newest is passed over."""
        if self.newest is None or state.time_ns >= self.newest.time_ns:
            self.newest = state

    def advance(self, until_ns: int, n_points: int, rate_hz: float) -> Trajectory:
        """Return the next `n_points` of the path, the last one at `until_ns`.

        Between two calls speed and change of force are constant; an arm that was repositioned leaves no trace of the
        way there.
        """
        end = self._expected(until_ns)
        travelled_m = max(abs(end[0] - self._at[0]), abs(end[1] - self._at[1]))
        if travelled_m > JUMP_M_S * n_points / rate_hz:
            self._at = (end[0], end[1], self._at[2])
        path = straight(self._at, end, n_points)
        self._at = end
        return path

    def _expected(self, time_ns: int) -> tuple[float, float, float]:
        """Return x, y and force at a time."""
        state = self.newest
        if state is None:
            return self._at
        ahead_s = (time_ns - state.time_ns) / NANOSECONDS
        force_n = max(0.0, state.force_n)
        if ahead_s > STALE_S:
            return self._at[0], self._at[1], force_n
        return state.x_m + state.vx_m_s * ahead_s, state.y_m + state.vy_m_s * ahead_s, force_n


# --------------------
# Steady sliding: how fast, how hard, which way; and the way it is.

Number = float | Array


@dataclass(frozen=True, eq=False)
class SimulatedSlide:
    """What is wanted of a slide, or of each of many slides."""

    speed_m_s: Number
    force_n: Number
    duration_s: float
    direction_rad: Number = 0.0
    radius_m: float = 0.0
    start_x_m: Number = 0.0
    start_y_m: Number = 0.0

    def steady_path(self, speed_m_s: Array, force_n: Array, n_points: int, rate_hz: float) -> Trajectory:
        """Return the way at a constant speed, (..., n_points) points; speed and force are (..., 1)."""
        time_s = np.arange(1, n_points + 1) / rate_hz
        path = trajectory_along(speed_m_s * time_s, np.broadcast_to(force_n, (*force_n.shape[:-1], n_points)), self)
        start_x_m, start_y_m = (np.asarray(at, dtype=np.float64)[..., None] for at in (self.start_x_m, self.start_y_m))
        return path.moved(start_x_m, start_y_m)


def trajectory_along(travelled_m: Array, force_n: Array, sliding: SimulatedSlide) -> Trajectory:
    """Return the path with given ways along a line or a circle, (..., n)."""
    direction = np.asarray(sliding.direction_rad, dtype=np.float64)[..., None]
    radius_m = sliding.radius_m
    if not radius_m:
        return Trajectory(travelled_m * np.cos(direction), travelled_m * np.sin(direction), force_n)
    heading = direction + travelled_m / radius_m
    x_m = radius_m * (np.sin(heading) - np.sin(direction))
    y_m = radius_m * (np.cos(direction) - np.cos(heading))
    return Trajectory(x_m, y_m, force_n)
