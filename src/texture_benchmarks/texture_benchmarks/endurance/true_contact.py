"""True force and true contact of the finger during the slide of an exploration, as the emulators report them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.finger_state import FingerState

# A datagram holds for so long at most: an emulator that was frozen reports nothing, and its finger stands still.
MAX_HOLD_S = 0.05


@dataclass(frozen=True)
class TrueContact:
    """True force and contact between the first and the last state of the phase SLIDE.

    Parameters
    ----------
    slide_s
        Length of the slide.
    observed_s
        How much of it is covered by datagrams of the emulator.
    mean_force_n, max_force_n
        True force, weighted by time; the highest one of the whole exploration, with approach and lift.
    longest_loss_s
        The longest time in the slide for which the true force stayed below the lowest force that counts as contact.
    """

    slide_s: float
    observed_s: float
    mean_force_n: float
    max_force_n: float
    longest_loss_s: float


NO_CONTACT = TrueContact(0.0, 0.0, math.nan, math.nan, 0.0)


def true_contact(fingers: Sequence[FingerState], slide_ns: tuple[int, int] | None, min_contact_n: float) -> TrueContact:
    """Return what the finger truly did.

    Parameters
    ----------
    fingers
        All datagrams of the exploration, in the order of time.
    slide_ns
        First and last time of the phase SLIDE on CLOCK_MONOTONIC; None if it was not reached.
    min_contact_n
        A lower true force is no contact.

    Returns
    -------
    TrueContact
        Force in N and the times without contact.
    """
    if not fingers:
        return NO_CONTACT
    times_s, forces_n = np.array([(finger.time_ns * 1e-9, finger.force_n) for finger in fingers]).T
    max_force_n = float(forces_n.max())
    if slide_ns is None:
        return TrueContact(0.0, 0.0, math.nan, max_force_n, 0.0)
    begin_s, end_s = (time_ns * 1e-9 for time_ns in slide_ns)
    inside = (times_s >= begin_s) & (times_s <= end_s)
    if inside.sum() < 2:
        return TrueContact(end_s - begin_s, 0.0, math.nan, max_force_n, 0.0)
    times_s, forces_n = times_s[inside], forces_n[inside]
    holds_s = np.minimum(np.diff(times_s, append=end_s), MAX_HOLD_S)
    observed_s = float(holds_s.sum())
    mean_n = float(holds_s @ forces_n) / observed_s if observed_s > 0 else math.nan
    lost = ~(forces_n >= min_contact_n)  # written so that NaN is no contact
    return TrueContact(end_s - begin_s, observed_s, mean_n, max_force_n, _longest_run_s(lost, holds_s))


def _longest_run_s(lost: AnyArray, holds_s: Array) -> float:
    """Return the longest time for which a condition held without interruption."""
    total_s = np.concatenate([[0.0], np.cumsum(holds_s * lost)])
    # What had been added up when the condition was last false is taken off.
    at_rest = np.maximum.accumulate(np.where(np.concatenate([[True], ~lost]), total_s, 0.0))
    return float((total_s - at_rest).max())
