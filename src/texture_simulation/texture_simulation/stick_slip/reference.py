"""Stick-slip solved by scipy with a step of its own choice: the measure for the integrators of fixed step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from texture_core.arrays import Array
from texture_core.catalogue import find
from texture_simulation.stick_slip.bristle import AT_REST, Tip, rate
from texture_simulation.stick_slip.friction import StickSlip

SOLVERS: Mapping[str, str] = {'lsoda': 'LSODA', 'radau': 'Radau'}
ABSOLUTE = np.array([1e-4, 1e-2, 1e-6])  # m, m/s, m: how large stretch, slip and bend are; times the tolerance


@dataclass(frozen=True, eq=False)
class Solution:
    """States at the times asked for, and how often the rate was computed."""

    tip: Tip
    evaluations: int


def solve(
    friction: StickSlip,
    speed_m_s: float,
    force_n: float,
    times_s: Array,
    *,
    method: str = 'radau',
    tolerance: float = 1e-9,
) -> Solution:
    """Return the movement from rest under constant speed and force at increasing times, (n,).

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    speed_m_s
        Constant speed of the base.
    force_n
        Constant normal force.
    times_s : (n,)
        Increasing times.
    method
        One of `SOLVERS`.
    tolerance
        Relative tolerance of the solver.

    Returns
    -------
    Solution
        State at each time, and what it took.
    """

    def slope(_: float, state: Array) -> Tip:
        return rate(friction, Tip(*state.tolist()), speed_m_s, force_n)

    found = solve_ivp(
        slope,
        (0.0, float(times_s[-1])),
        AT_REST,
        method=find(SOLVERS, method, 'solver'),
        t_eval=times_s,
        rtol=tolerance,
        atol=tolerance * ABSOLUTE,
    )
    return Solution(Tip(*found.y), int(found.nfev))
