"""Find by simulation the longest step with which an integrator stays stable, to compare it with the predicted one."""

from __future__ import annotations

import math
from enum import Enum

import numpy as np

from texture_simulation.stick_slip.friction import StickSlip
from texture_simulation.stick_slip.integrator import Integrator
from texture_simulation.stick_slip.limit_cycle import NUDGE, nudged
from texture_simulation.stick_slip.simulate import drag_unchecked

STEPS = 3000
GROWN = 30.0  # times the nudge: unstable
HALVINGS = 12


class ContactRegime(Enum):
    """What the tip does while steps are taken."""

    STICK = 'stick'
    SLIDE = 'slide'


def simulated_max_stable_step_s(
    integrator: Integrator,
    friction: StickSlip,
    regime: ContactRegime,
    force_n: float,
    *,
    slip_m_s: float,
    between_s: tuple[float, float],
) -> float:
    """Return the step between two where a nudged tip begins to swing ever more; inf if it never does.

    Sticking, the base stands and the tip is nudged; sliding, it moves at `slip_m_s`; the state is off by a nudge.

    Parameters
    ----------
    integrator
        What integrates.
    friction
        Friction of the surface, and the skin.
    regime
        Whether the tip sticks or slides.
    force_n
        Normal force, at least 0.
    slip_m_s
        Speed of the tip over the surface; 0 if it sticks.
    between_s
        Steps between which the limit is sought.

    Returns
    -------
    float
        s.
    """
    base_m_s = 0.0 if regime is ContactRegime.STICK else slip_m_s
    low, high = between_s
    if not _grows(integrator, friction, base_m_s, force_n, high):
        return math.inf
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        if _grows(integrator, friction, base_m_s, force_n, middle):
            high = middle
        else:
            low = middle
    return math.sqrt(low * high)


def _grows(integrator: Integrator, friction: StickSlip, base_m_s: float, force_n: float, step_s: float) -> bool:
    start = nudged(friction, base_m_s, force_n)
    drive = np.full(STEPS, base_m_s)
    with np.errstate(all='ignore'):
        tip = drag_unchecked(
            friction, drive, np.full(STEPS, force_n), step_s, integrator=integrator, start=start, force_before_n=force_n
        )
    swing = np.abs(tip.slip_m_s[-STEPS // 10 :] - base_m_s).max()
    return not swing < GROWN * NUDGE
