"""The vibration of a slowly dragged tip, by formula: it sticks until the skin pulls enough, then slips half a swing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from texture_simulation.stick_slip.bristle import Tip
from texture_simulation.stick_slip.friction import StickSlip
from texture_simulation.stick_slip.stribeck import coefficient

NUDGE = 1e-9  # m/s, so small that only the linear movement is seen
BEND_NUDGE = 1e-7  # share of the bending


@dataclass(frozen=True)
class LimitCycle:
    """How long a tip sticks and slips, and how far the force on the skin swings."""

    stick_s: float
    slip_s: float
    swing_n: float

    @property
    def period_s(self) -> float:
        """Time from one letting go to the next."""
        return self.stick_s + self.slip_s


def slow_drag(friction: StickSlip, speed_m_s: float, force_n: float) -> LimitCycle:
    """Return the cycle of a drag that is slow against the Stribeck speed and the swing of the tip.

    The tip lets go at static·force and swings about kinetic·force; without damping it comes to rest as far below, hence
    the period 2·(static − kinetic)·force / (stiffness·speed) + half a period of the skin. Damping shortens the swing.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    speed_m_s
        Speed of the base along the surface.
    force_n
        Normal force, at least 0.

    Returns
    -------
    LimitCycle
        Times in s, and the swing of the force in N.
    """
    drop_n = (friction.static - friction.kinetic) * force_n
    natural_1_s = math.sqrt(friction.skin_n_m / friction.mass_kg)
    damping = min(friction.skin_n_s_m / (2 * friction.mass_kg * natural_1_s), 1 - 1e-9)
    root = math.sqrt(1 - damping**2)
    swing_n = drop_n * (1 + math.exp(-math.pi * damping / root))
    return LimitCycle(swing_n / (friction.skin_n_m * speed_m_s), math.pi / (natural_1_s * root), swing_n)


def nudged(friction: StickSlip, base_m_s: float, force_n: float) -> Tip:
    """Return the state of steady sliding (or rest, at 0) with the speed of the tip and the bend off by a nudge.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    base_m_s
        Speed of the base; 0 for a tip at rest.
    force_n
        Normal force, at least 0.

    Returns
    -------
    Tip
        In floats.
    """
    curve = float(coefficient(friction, np.array(base_m_s))) if base_m_s else 0.0
    off = BEND_NUDGE * (curve or friction.kinetic)
    stretch_m = force_n * (curve + friction.viscous_s_m * base_m_s) / friction.skin_n_m
    return Tip(stretch_m, base_m_s + NUDGE, (curve + off) / friction.bristle_1_m)
