"""How a dragged tip vibrates over the speed."""

from __future__ import annotations

import math

import numpy as np

from texture_benchmarks.stick_slip.chart import Vibration
from texture_benchmarks.stick_slip.dragged_tip import FORCE_N, FRICTION
from texture_core.arrays import Array
from texture_simulation.stick_slip.limit_cycle import nudged, slow_drag
from texture_simulation.stick_slip.simulate import drag, pull_n
from texture_simulation.stick_slip.stribeck import critical_speed_m_s

SHOWN_SHARES = (0.2, 0.6, 1.3)
FINE_S = 2e-5


def drag_vibration(shares: tuple[float, ...]) -> Vibration:
    """Return how the tip vibrates over the speed."""
    critical = critical_speed_m_s(FRICTION, FORCE_N)
    speeds = critical * np.array(shares)
    late = [_second_half(_pulled_n(speed)) for speed in speeds]
    slid = [_second_half(_pulled_n(speed, from_sliding=True)) for speed in speeds]
    return Vibration(
        speed_m_s=speeds,
        critical_m_s=critical,
        period_s=np.array([_period_s(pull) for pull in late]),
        formula_s=np.array([slow_drag(FRICTION, speed, FORCE_N).period_s for speed in speeds]),
        from_rest_n=np.array([float(np.ptp(pull)) for pull in late]),
        from_sliding_n=np.array([float(np.ptp(pull)) for pull in slid]),
        step_s=FINE_S,
        shown={share * critical: _pulled_n(share * critical) for share in SHOWN_SHARES},
    )


def _pulled_n(speed_m_s: float, *, from_sliding: bool = False) -> Array:
    """Return the force on the skin from rest, or from sliding with a nudge, for some periods."""
    duration_s = max(0.6, 8 * slow_drag(FRICTION, speed_m_s, FORCE_N).period_s)
    speed = np.full(round(duration_s / FINE_S), speed_m_s)
    force = np.full_like(speed, FORCE_N)
    if not from_sliding:
        return pull_n(FRICTION, drag(FRICTION, speed, force, FINE_S), speed)
    start = nudged(FRICTION, speed_m_s, FORCE_N)
    return pull_n(FRICTION, drag(FRICTION, speed, force, FINE_S, start=start, force_before_n=FORCE_N), speed)


def _period_s(pull: Array) -> float:
    """Return the mean time between rises through the middle; NaN if it does not vibrate."""
    middle = (pull.max() + pull.min()) / 2
    rises = np.flatnonzero((pull[:-1] < middle) & (pull[1:] >= middle))
    if np.ptp(pull) < 1e-3 or len(rises) < 2:
        return math.nan
    return float((rises[-1] - rises[0]) / (len(rises) - 1) * FINE_S)


def _second_half(pull: Array) -> Array:
    return pull[len(pull) // 2 :]
