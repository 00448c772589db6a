"""Contact intervals from channels whose mean follows the load."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from texture_core.arrays import Array, Samples

# Between these shares of the load its change is drawn as a line, out to where it began and ended.
LOW, HIGH = 0.2, 0.8
# A channel follows the load if it changes by such a share of the one that changes most.
FOLLOWS = 0.1
# A finger is pressed on, and let go, so much within such a time, or the channels drift.
CHANGES, CHANGE_S = 0.5, 0.4
# A load is believed if it changes by so many times its own scatter from sample to sample.
OVER_SCATTER = 20.0


@dataclass(frozen=True)
class ContactInterval:
    """One contact, s from the first sample: begins to be pressed, is pressed, is let go, is free.

    Times before the first and after the last sample are -inf and inf.

    Examples
    --------
    >>> ContactInterval(1.0, 1.1, 3.0, 3.1).shifted(0.5)
    ContactInterval(press_start_s=1.5, press_end_s=1.6, release_start_s=3.5, release_end_s=3.6)
    """

    press_start_s: float
    press_end_s: float
    release_start_s: float
    release_end_s: float

    def shifted(self, by_s: float) -> ContactInterval:
        """Return the same contact, reckoned from a time before."""
        return ContactInterval(
            self.press_start_s + by_s, self.press_end_s + by_s, self.release_start_s + by_s, self.release_end_s + by_s
        )


def find_contacts(levels: Samples, rate_hz: float, vibration: Array) -> list[ContactInterval]:
    """Return the contacts in their order; none without a clear load.

    Parameters
    ----------
    levels : (n_samples, n_channels)
        Channels of which some follow the load, in whatever direction; what is not finite counts as no change.
    rate_hz
        Their sampling rate.
    vibration : (n_samples,)
        How much the finger vibrates at the same times: it tells which of the two levels is contact.

    Returns
    -------
    list of ContactInterval
        Times in s from the first sample.
    """
    if len(levels) < 3:
        return []
    near = max(1, round(0.5 * CHANGE_S * rate_hz))
    load = _load(levels, vibration, near)
    high = load > 0.5 * load.max()
    if not high.any() or high.all():
        return []
    full, steps = float(np.median(load[high])), np.abs(np.diff(load, prepend=load[0]))
    if full <= OVER_SCATTER * max(float(np.median(steps[high])), float(np.median(steps[~high]))):
        return []
    edges = np.flatnonzero(np.diff(np.concatenate(([0], high, [0])).astype(int))).reshape(-1, 2)
    return [
        _contact_interval(load / full, first, last - 1, rate_hz)
        for first, last in edges.tolist()
        if _sudden(load / full, first - 1, near) and _sudden(load / full, last - 1, near)
    ]


def _load(levels: Samples, vibration: Array, near: int) -> Array:
    """Return the common change of the channels, (n_samples,), about 0 without contact.

    The finger vibrates more in contact than without. What knocks, within `near` samples, while it is pressed on and let
    go belongs to neither.
    """
    middle = np.nanmedian(np.where(np.isfinite(levels), levels, np.nan), axis=0, keepdims=True)
    centred = np.nan_to_num(np.where(np.isfinite(levels), levels - middle, 0.0))
    _, vectors = np.linalg.eigh(centred.T @ centred)
    weights = vectors[:, -1]
    # Channels saturate one after the other: those that follow the load count alike, or the strongest tell its end late.
    load: Array = centred @ np.where(np.abs(weights) > FOLLOWS * np.abs(weights).max(), np.sign(weights), 0.0)
    upper = load > 0.5 * (load.min() + load.max())
    still = maximum_filter1d(upper, near) == minimum_filter1d(upper, near)
    high, low = vibration[upper & still], vibration[~upper & still]
    if len(high) and len(low) and np.median(high) < np.median(low):
        load = -load
    return load - np.quantile(load, 0.05)


def _sudden(load: Array, before: int, near: int) -> bool:
    """Return whether a load passes one half after sample `before` suddenly, or there is no sample beyond."""
    if before < 0 or before == len(load) - 1:
        return True
    return abs(float(load[min(before + 1 + near, len(load) - 1)] - load[max(before - near, 0)])) > CHANGES


def _contact_interval(load: Array, first: int, last: int, rate_hz: float) -> ContactInterval:
    """Return the contact that is above one half from sample `first` to sample `last`."""
    ends = _line(load, last)
    count = len(load) - 1
    begins = [count - place for place in _line(load[::-1], count - first)]
    return ContactInterval(begins[1] / rate_hz, begins[0] / rate_hz, ends[0] / rate_hz, ends[1] / rate_hz)


def _line(load: Array, last: int) -> tuple[float, float]:
    """Return where a load that is above one half up to sample `last` begins to fall and is gone, in samples.

    Both infinite if it is so to the end; where it passes one half if it never falls far.
    """
    if last == len(load) - 1:
        return math.inf, math.inf
    above = np.flatnonzero(load[: last + 1] > HIGH)
    below = np.flatnonzero(load[last:] < LOW)
    if not len(above) or not len(below):
        return float(last), float(last + 1)
    high, low = _crossing(load, int(above[-1]), HIGH), _crossing(load, last + int(below[0]) - 1, LOW)
    step = (low - high) / (HIGH - LOW)
    return high - step * (1.0 - HIGH), low + step * LOW


def _crossing(load: Array, before: int, level: float) -> float:
    drop = float(load[before] - load[before + 1])
    return before + (float(load[before]) - level) / drop if drop > 0 else float(before)
