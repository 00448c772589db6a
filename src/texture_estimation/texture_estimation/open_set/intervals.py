"""Intervals of conditions and arcs of directions that slides cover."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from texture_features.slide_conditions import Interval

# Of the slides, at either end of a range: with a hundred slides or more, one odd slide does not widen it.
ODD_SHARE = 0.01
FULL_CIRCLE: Interval = (-math.pi, math.pi)


def covered_arcs(directions_rad: Iterable[float], gap_rad: float) -> tuple[Interval, ...]:
    """Return the arcs that directions cover when gaps of at most `gap_rad` between neighbours count as covered.

    Parameters
    ----------
    directions_rad
        Any angles.
    gap_rad
        Largest gap that is bridged.
    """
    ordered = sorted({math.remainder(direction, math.tau) for direction in directions_rad})
    if not ordered:
        return ()
    turned = [*ordered[1:], ordered[0] + math.tau]
    ends = [place for place, (one, other) in enumerate(zip(ordered, turned, strict=True)) if other - one > gap_rad]
    if not ends:
        return (FULL_CIRCLE,)
    starts = [ordered[(end + 1) % len(ordered)] for end in (ends[-1], *ends[:-1])]
    return tuple(
        (start, ordered[end] if ordered[end] >= start else ordered[end] + math.tau)
        for start, end in zip(starts, ends, strict=True)
    )


def joint_interval(trained: Interval | None, added: Interval | None) -> Interval | None:
    """Return the range of the training with that of added slides; None if the training knew none."""
    if trained is None or added is None:
        return trained
    return min(trained[0], added[0]), max(trained[1], added[1])


def interval_of(means: Iterable[Iterable[float]]) -> Interval | None:
    """Return the range of the means of slides without the odd slides; None if no slide has a known one."""
    known = [own for slide in means for own in [[mean for mean in slide if math.isfinite(mean)]] if own]
    if not known:
        return None
    low = np.quantile([min(own) for own in known], ODD_SHARE, method='lower')
    high = np.quantile([max(own) for own in known], 1.0 - ODD_SHARE, method='higher')
    return float(low), float(high)


def is_beyond(value: float, interval: Interval | None, margin: float) -> bool:
    """Return whether a value lies outside an interval widened by a relative margin; False for an unknown one.

    Parameters
    ----------
    value
        NaN if not known.
    interval
        None if not known.
    margin
        Relative, at both ends.

    Returns
    -------
    bool
    """
    if interval is None or math.isnan(value):
        return False
    low, high = interval
    return not low / (1.0 + margin) <= value <= high * (1.0 + margin)
