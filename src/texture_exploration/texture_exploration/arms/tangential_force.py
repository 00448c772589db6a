"""Tangential force of a sliding finger, from the force vector of a wrist sensor."""

from __future__ import annotations

import math

from texture_exploration.arms.protocol import Vector

SLIDING_M_S = 1e-3  # a slower finger has no direction of travel that its noise does not turn


def tangential_force_n(force_n: Vector, velocity_m_s: Vector) -> float:
    """Return the force of the surface against the direction of travel, N; NaN for a finger that does not slide.

    Parameters
    ----------
    force_n : (3,)
        Force of the surface on the finger, N, in the frame of the surface: z is the normal.
    velocity_m_s : (3,)
        Velocity of the finger, m/s, in the same frame.

    Returns
    -------
    float
        −F·v / |v| of the components along the surface: positive where the surface drags the finger, μ N under Coulomb
        friction.

    Examples
    --------
    >>> tangential_force_n((-0.6, 0.0, 2.0), (0.05, 0.0, 0.001))  # a coefficient of 0.3 under 2 N
    0.6
    >>> tangential_force_n((-0.6, 0.0, 2.0), (0.0, 0.0, 0.0))
    nan
    """
    speed_m_s = math.hypot(*velocity_m_s[:2])
    if not speed_m_s >= SLIDING_M_S:
        return math.nan
    return -(force_n[0] * velocity_m_s[0] + force_n[1] * velocity_m_s[1]) / speed_m_s
