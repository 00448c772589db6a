"""LuGre friction: the surfaces touch with bristles that bend before they slide (Canudas de Wit et al. 1995).

State of the tip: `stretch_m` of the skin (base ahead of tip), `slip_m_s` (speed of the tip over the surface) and
`bend_m` of the bristles. With N the normal force and g the Stribeck curve:

    stretch' = speed − slip
    mass·slip' = skin_n_m·stretch + skin_n_s_m·(speed − slip) − N·(σ0·bend + σ1(slip)·bend' + σ2·slip)
    bend' = slip − σ0·|slip|·bend / g(slip)

σ1 fades as the Stribeck curve does, which keeps friction passive at all speeds. What comes into contact when the force
grows comes unbent, and what leaves takes its share of the bending with it: bend·N stays when N grows, bend stays when
N falls. So a change of force adds no energy, and a new touch begins unbent by itself.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from texture_core.arrays import Array
from texture_simulation.stick_slip.friction import StickSlip

Value = Any  # a float, or an array over scans: the same formulas serve both


class Tip(NamedTuple):
    """State of one tip (floats) or of many (arrays of one shape)."""

    stretch_m: Value
    slip_m_s: Value
    bend_m: Value


AT_REST = Tip(0.0, 0.0, 0.0)


def rate(friction: StickSlip, tip: Tip, speed_m_s: Value, force_n: Value, exp: Any = math.exp) -> Tip:
    """Return the derivative of the state under a constant normal force; `exp` is numpy's for arrays.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    tip
        State of the tip, floats or arrays of one shape.
    speed_m_s
        Speed of the base along the surface.
    force_n
        Normal force, at least 0.
    exp
        `math.exp` for one slide in floats, `numpy.exp` for arrays.

    Returns
    -------
    Tip
        Derivative of each part of the state by time.
    """
    stretch, slip, bend = tip
    fading = exp(-slip * slip / friction.stribeck_m_s**2)
    curve = friction.kinetic + (friction.static - friction.kinetic) * fading
    bending = slip - friction.bristle_1_m * abs(slip) * bend / curve
    rubbing = friction.bristle_1_m * bend + friction.bristle_s_m * fading * bending + friction.viscous_s_m * slip
    pull_n = friction.skin_n_m * stretch + friction.skin_n_s_m * (speed_m_s - slip)
    return Tip(speed_m_s - slip, (pull_n - force_n * rubbing) / friction.mass_kg, bending)


def energy_j(friction: StickSlip, tip: Tip, force_n: Value) -> Value:
    """Return what is stored: movement of the tip, stretched skin, bent bristles.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    tip
        State of the tip, floats or arrays of one shape.
    force_n
        Normal force, at least 0.

    Returns
    -------
    float or array
        J, at least 0.
    """
    moving = friction.mass_kg * tip.slip_m_s**2
    bent = force_n * friction.bristle_1_m * tip.bend_m**2
    return (moving + friction.skin_n_m * tip.stretch_m**2 + bent) / 2


def jacobian(friction: StickSlip, slip_m_s: float, force_n: float) -> Array:
    """Return the derivative of `rate` at rest with unbent bristles, or at steady sliding with slip > 0, (3, 3).

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    slip_m_s
        Speed of the tip over the surface; 0 if it sticks.
    force_n
        Normal force, at least 0.

    Returns
    -------
    (3, 3)
        1/s, in the order of the fields of `Tip`.
    """
    fading = math.exp(-((slip_m_s / friction.stribeck_m_s) ** 2))
    curve = friction.kinetic + (friction.static - friction.kinetic) * fading
    slope = -2 * slip_m_s / friction.stribeck_m_s**2 * (curve - friction.kinetic)
    relaxing = friction.bristle_1_m * slip_m_s / curve
    bending_by_slip = slip_m_s * slope / curve if slip_m_s else 1.0
    damping = friction.bristle_s_m * fading
    by_slip = force_n * (damping * bending_by_slip + friction.viscous_s_m)
    by_bend = force_n * (friction.bristle_1_m - damping * relaxing)
    moved = np.array([friction.skin_n_m, -friction.skin_n_s_m - by_slip, -by_bend]) / friction.mass_kg
    return np.array([[0.0, -1.0, 0.0], moved, [0.0, bending_by_slip, -relaxing]])
