"""How a slide was made, as the states of its exploration tell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median

from texture_core.exploration import ExplorationState, Phase
from texture_core.signal import NANOSECONDS
from texture_core.slide_motion import TURNED_RAD, SlideMotion

STRAIGHT = 'linear_slide'  # of other motions, states do not tell all that is needed to make them again


def motion_made(states: Sequence[ExplorationState]) -> SlideMotion | None:
    """Return how a slide was made; None if it was not straight, or its speed, force or direction are unknown.

    Parameters
    ----------
    states
        Of one exploration, in the order of time.
    """
    sliding = [state for state in states if state.phase is Phase.SLIDE and state.motion == STRAIGHT]
    if not sliding:
        return None
    first, last = sliding[0], sliding[-1]
    turned = (math.remainder(state.direction_rad - first.direction_rad, math.tau) for state in sliding)
    speed, force = (median(numbers) for numbers in zip(*((s.speed_m_s, s.force_n) for s in sliding), strict=True))
    if not all(abs(angle) <= TURNED_RAD for angle in turned) or not (0.0 < speed < math.inf and 0.0 < force < math.inf):
        return None
    over_ns = [state.stamp_ns for state in states if state.stamp_ns > last.stamp_ns]
    end_ns = over_ns[0] if over_ns else last.stamp_ns + round(last.steady_s * NANOSECONDS)
    if end_ns <= first.stamp_ns:
        return None
    return SlideMotion(STRAIGHT, first.direction_rad, speed, force, (end_ns - first.stamp_ns) / NANOSECONDS)
