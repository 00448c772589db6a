"""Find by simulation the longest step with which an integrator stays stable, to compare it with the predicted one."""

from __future__ import annotations

import math

import numpy as np

from texture_simulation.stick_slip.bristle import Tip
from texture_simulation.stick_slip.friction import StickSlip
from texture_simulation.stick_slip.simulate import drag_unchecked
from texture_simulation.stick_slip.stability_limit import ContactRegime
from texture_simulation.stick_slip.stribeck import coefficient

STEPS = 3000
NUDGE = 1e-9  # m/s, so small that only the linear movement is seen
BEND_NUDGE = 1e-7  # share of the bending
GROWN = 30.0  # times the nudge: unstable
HALVINGS = 12


def simulated_max_stable_step_s(
    method: str,
    friction: StickSlip,
    phase: ContactRegime,
    force_n: float,
    *,
    slip_m_s: float,
    between_s: tuple[float, float],
) -> float:
    """Return the step between two where a nudged tip begins to swing ever more; inf if it never does.

    Sticking, the base stands and the tip is nudged; sliding, it moves at `slip_m_s`; the state is off by a nudge.

    Parameters
    ----------
    method
        One of `INTEGRATORS`.
    friction
        Friction of the surface, and the skin.
    phase
        Whether the tip sticks or slides.
    force_n
        Normal force, at least 0.
    slip_m_s
        Speed of the tip over the surface; 0 if it sticks.
    between_s
        Steps between which the limit is sought.
    """
    base_m_s = 0.0 if phase is ContactRegime.STICK else slip_m_s
    low, high = between_s
    if not _grows(method, friction, base_m_s, force_n, high):
        return math.inf
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        if _grows(method, friction, base_m_s, force_n, middle):
            high = middle
        else:
            low = middle
    return math.sqrt(low * high)


def _grows(method: str, friction: StickSlip, base_m_s: float, force_n: float, step_s: float) -> bool:
    start = nudged(friction, base_m_s, force_n)
    drive = np.full(STEPS, base_m_s)
    with np.errstate(all='ignore'):
        tip = drag_unchecked(
            friction, drive, np.full(STEPS, force_n), step_s, method=method, start=start, force_before_n=force_n
        )
    swing = np.abs(tip.slip_m_s[-STEPS // 10 :] - base_m_s).max()
    return not swing < GROWN * NUDGE


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
    """
    curve = float(coefficient(friction, np.array(base_m_s))) if base_m_s else 0.0
    off = BEND_NUDGE * (curve or friction.kinetic)
    stretch_m = force_n * (curve + friction.viscous_s_m * base_m_s) / friction.skin_n_m
    return Tip(stretch_m, base_m_s + NUDGE, (curve + off) / friction.bristle_1_m)
