"""Rows with times onto an even grid: jitter is measured, gaps become jumps of the running index."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import AnyArray, Array

SIGNIFICANT = 4  # digits of an estimated rate: the resolution of time stamps allows no more
ROUND_RATE = 1e-3  # a rate that is so near to one of two digits is taken for that one


@dataclass(frozen=True, eq=False)
class GridRows:
    """Samples of one slide on an even grid.

    Parameters
    ----------
    samples : (n, n_channels)
        NaN for bad ones.
    index : (n,)
        Place of each on the grid from 0; it jumps where samples were lost.
    jitter_s : (m,)
        By how much steps of time differ from the sampling interval, gaps left out.
    gaps, lost
        Number of gaps, and of samples lost in them.
    disordered
        Number of rows left out because their time does not come after that of all rows before.

    Examples
    --------
    >>> rows = on_grid(np.zeros((4, 1)), np.array([0.0, 0.01, 0.05, 0.06]), 100.0, gap=1.75, interpolated=False)
    >>> rows.index.tolist(), rows.gaps, rows.lost
    ([0, 1, 5, 6], 1, 3)
    """

    samples: Array
    index: NDArray[np.int64]
    jitter_s: Array
    gaps: int = 0
    lost: int = 0
    disordered: int = 0


def estimated_rate_hz(time_s: Array) -> float:
    """Return the rate of rows in spite of jitter and gaps, of four digits; NaN if no two times follow each other.

    Parameters
    ----------
    time_s : (n,)
        Time of each row, NaN where it is unknown.

    Examples
    --------
    >>> estimated_rate_hz(np.array([0.0, 0.011, 0.019, 0.03, 0.53, 0.54]))
    100.0
    """
    steps = np.diff(_spread(time_s[np.isfinite(time_s)]))
    steps = steps[steps > 0]
    if not len(steps):
        return float('nan')
    usual = steps[steps < 1.75 * np.median(steps)]
    rate_hz = 1.0 / float(usual.mean())
    simple = float(f'{rate_hz:.2g}')
    return simple if abs(rate_hz / simple - 1.0) < ROUND_RATE else float(f'{rate_hz:.{SIGNIFICANT}g}')


def on_grid(samples: Array, time_s: Array | None, rate_hz: float, *, gap: float, interpolated: bool) -> GridRows:
    """Return the rows of one slide on a grid that begins with its first row.

    Parameters
    ----------
    samples : (n, n_channels)
        Rows in their order; NaN for bad values.
    time_s : (n,)
        Time of each row, NaN where it is unknown; None: rows are evenly spaced.
    rate_hz
        Rate of the grid.
    gap
        Steps longer than so many intervals are gaps.
    interpolated
        Whether samples are interpolated at the times of the grid; else they are taken as evenly spaced between gaps.

    Returns
    -------
    GridRows
        Rows whose time comes after that of all before.
    """
    if time_s is None or len(samples) < 2:
        return GridRows(samples, np.arange(len(samples)), np.empty(0))
    times = _known(time_s) if interpolated else _spread(_known(time_s))
    later = np.concatenate(([True], times[1:] > np.maximum.accumulate(times)[:-1]))
    samples, times = samples[later], times[later]
    steps = np.diff(times) * rate_hz
    gaps = steps > gap
    missing = np.where(gaps, np.maximum(np.rint(steps) - 1, 0), 0).astype(np.int64)
    jitter = (steps[~gaps] - 1.0) / rate_hz
    disordered = int((~later).sum())
    if not interpolated:
        index = np.concatenate(([0], np.cumsum(1 + missing)))
        return GridRows(samples, index, jitter, int(gaps.sum()), int(missing.sum()), disordered)
    parts = [
        _interpolated(samples[rows], (times[rows] - times[0]) * rate_hz)
        for rows in np.split(np.arange(len(times)), np.flatnonzero(gaps) + 1)
    ]
    index = np.concatenate([own for own, _ in parts])
    lost = int(index[-1] + 1 - len(index)) if len(index) else 0
    return GridRows(np.concatenate([x for _, x in parts]), index, jitter, int(gaps.sum()), lost, disordered)


def repaired(rows: GridRows, longest: int) -> tuple[GridRows, int]:
    """Return rows whose holes of bad samples, up to `longest` of them, are interpolated, and how many samples that are.

    Holes at the edges of the slide and beside lost samples stay.
    """
    bad = np.logical_or.reduce(np.isnan(rows.samples), axis=1)
    if not longest or not bad.any() or bad.all():
        return rows, 0
    edges = np.flatnonzero(np.diff(np.concatenate(([0], bad, [0])).astype(int))).reshape(-1, 2)
    fill = np.zeros(len(bad), dtype=bool)
    for first, last in edges.tolist():
        inside = first > 0 and last < len(bad)
        if inside and last - first <= longest and rows.index[last] - rows.index[first - 1] == last - first + 1:
            fill[first:last] = True
    samples = rows.samples.copy()
    for channel in samples.T:
        channel[fill] = np.interp(rows.index[fill], rows.index[~bad], channel[~bad])
    return GridRows(samples, rows.index, rows.jitter_s, rows.gaps, rows.lost, rows.disordered), int(fill.sum())


def _known(time_s: Array) -> Array:
    """Return times in which an unknown one lies between its neighbours."""
    known = np.isfinite(time_s)
    if known.all() or not known.any():
        return time_s if known.any() else np.arange(len(time_s), dtype=np.float64)
    rows = np.arange(len(time_s))
    filled: Array = np.interp(rows, rows[known], time_s[known])
    return filled


def _spread(times: Array) -> Array:
    """Return times in which rows of one time are spread to the next: of a coarse clock, or of samples in batches."""
    starts = np.flatnonzero(np.concatenate(([True], times[1:] != times[:-1])))
    if len(starts) == len(times) or len(starts) < 2:
        return times
    counts = np.diff(np.append(starts, len(times)))
    steps = np.diff(times[starts]) / counts[:-1]
    steps = np.append(steps, steps[-1])
    within = np.arange(len(times)) - np.repeat(starts, counts)
    forward = np.where(steps > 0, steps, 0.0)  # a time that goes back tells nothing
    spread: Array = np.repeat(times[starts], counts) + within * np.repeat(forward, counts)
    return spread


def _interpolated(samples: Array, place: Array) -> tuple[AnyArray, Array]:
    grid = np.arange(np.ceil(place[0] - 1e-6), np.floor(place[-1] + 1e-6) + 1)
    values = np.stack([np.interp(grid, place, channel) for channel in samples.T], axis=1)
    return grid.astype(np.int64), values
