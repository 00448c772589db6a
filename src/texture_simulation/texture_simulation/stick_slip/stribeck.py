"""The Stribeck curve: friction that falls from its value at rest to that of sliding."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from texture_core.arrays import Array
from texture_simulation.stick_slip.friction import StickSlip

FADED = 6.0  # at so many Stribeck speeds the curve is flat


def coefficient(friction: StickSlip, speed_m_s: Array) -> Array:
    """Return the coefficient of friction of steady sliding, without the viscous part: in kinetic to static.

    kinetic + (static − kinetic)·exp(−(speed/stribeck)²).
    Source: Bo & Pavelescu 1982; Armstrong-Hélouvry et al. 1994.

    Parameters
    ----------
    speed_m_s : (...)
        Speed of the tip over the surface, of either sign.

    Returns
    -------
    (...)
        Coefficient at each speed.
    """
    share: Array = np.exp(-((np.asarray(speed_m_s) / friction.stribeck_m_s) ** 2))
    return friction.kinetic + (friction.static - friction.kinetic) * share


def steady_force_n(friction: StickSlip, speed_m_s: Array, force_n: float) -> Array:
    """Return the friction of steady sliding, against the movement, with the viscous part.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    speed_m_s : (...)
        Speeds of the tip, of either sign.
    force_n
        Normal force, at least 0.

    Returns
    -------
    (...)
        Force in N, of the sign of the speed.
    """
    speed = np.asarray(speed_m_s)
    force: Array = force_n * (np.sign(speed) * coefficient(friction, speed) + friction.viscous_s_m * speed)
    return force


def slope_s_m(friction: StickSlip, speed_m_s: Array) -> Array:
    """Return by how much the coefficient grows with a speed ≥ 0, viscous part included; mostly negative.

    Parameters
    ----------
    speed_m_s : (...)
        Speed of the tip over the surface, at least 0.

    Returns
    -------
    (...)
        Slope in s/m at each speed.
    """
    speed = np.asarray(speed_m_s)
    fading = coefficient(friction, speed) - friction.kinetic
    slope: Array = friction.viscous_s_m - 2 * speed / friction.stribeck_m_s**2 * fading
    return slope


def critical_speed_m_s(friction: StickSlip, force_n: float) -> float:
    """Return the speed from which steady sliding is stable: the skin damps more than the falling friction drives.

    The highest speed with skin damping + force·slope = 0; 0 if sliding is stable at all speeds.
    """

    def damping(speed_m_s: float) -> float:
        return friction.skin_n_s_m + force_n * float(slope_s_m(friction, np.array(speed_m_s)))

    speeds = np.linspace(0.0, FADED * friction.stribeck_m_s, 1000)
    driven = np.flatnonzero([damping(speed) < 0 for speed in speeds])
    if not len(driven):
        return 0.0
    last = driven[-1]
    if last + 1 == len(speeds):
        return float(speeds[-1])
    return float(brentq(damping, speeds[last], speeds[last + 1]))
