"""Integrators of fixed step to compare with that of the simulation, and their longest stable steps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.optimize import brentq

from texture_simulation.stick_slip.bristle import Tip, Value, jacobian, rate
from texture_simulation.stick_slip.friction import StickSlip
from texture_simulation.stick_slip.integrator import Integrator, State, Step
from texture_simulation.stick_slip.semi_implicit import SEMI_IMPLICIT

RK4_LIMIT = (1.0, 3.5)  # step·|λ| between which the border lies in all directions that decay
SETTLED = 1e-6  # an eigenvalue so much smaller than the largest belongs to what does not move at all


def explicit_euler(friction: StickSlip, step_s: float, exp: Any = math.exp) -> Step:
    """Return Euler's step: state + step·rate."""

    def step(stretch: Value, slip: Value, bend: Value, speed: Value, force: Value) -> State:
        slope = rate(friction, Tip(stretch, slip, bend), speed, force, exp)
        return stretch + step_s * slope[0], slip + step_s * slope[1], bend + step_s * slope[2]

    return step


def runge_kutta_4(friction: StickSlip, step_s: float, exp: Any = math.exp) -> Step:
    """Return the classical step of fourth order."""

    def ahead(tip: Tip, slope: Tip, by_s: float) -> Tip:
        return Tip(tip[0] + by_s * slope[0], tip[1] + by_s * slope[1], tip[2] + by_s * slope[2])

    def step(stretch: Value, slip: Value, bend: Value, speed: Value, force: Value) -> State:
        tip = Tip(stretch, slip, bend)
        first = rate(friction, tip, speed, force, exp)
        second = rate(friction, ahead(tip, first, step_s / 2), speed, force, exp)
        third = rate(friction, ahead(tip, second, step_s / 2), speed, force, exp)
        fourth = rate(friction, ahead(tip, third, step_s), speed, force, exp)
        total = Tip(*(a + 2 * b + 2 * c + d for a, b, c, d in zip(first, second, third, fourth, strict=True)))
        return ahead(tip, total, step_s / 6)

    return step


def exponential(friction: StickSlip, step_s: float, exp: Any = math.exp) -> Step:
    """Return a split step: each of slip, bend and stretch in turn, solved exactly while the others stand still."""
    f = friction

    def step(stretch: Value, slip: Value, bend: Value, speed: Value, force: Value) -> State:
        fading = exp(-slip * slip / f.stribeck_m_s**2)
        curve = f.kinetic + (f.static - f.kinetic) * fading
        damping = force * f.bristle_s_m * fading
        drag = f.skin_n_s_m + damping + force * f.viscous_s_m + 1e-12  # never a division by nothing
        push = f.skin_n_m * stretch + f.skin_n_s_m * speed - force * f.bristle_1_m * bend
        push = push + damping * f.bristle_1_m * abs(slip) * bend / curve
        slip = push / drag + (slip - push / drag) * exp(-step_s * drag / f.mass_kg)
        relaxing = f.bristle_1_m * abs(slip) / curve + 1e-12
        kept = exp(-step_s * relaxing)
        return stretch + step_s * (speed - slip), slip, bend * kept + slip * (1 - kept) / relaxing

    return step


def euler_limit_s(friction: StickSlip, slip_m_s: float, force_n: float) -> float:
    """Return the longest step of Euler's method: |1 + step·λ| ≤ 1 for each eigenvalue that decays."""
    return min(-2 * root.real / abs(root) ** 2 for root in _decaying(friction, slip_m_s, force_n))


def runge_kutta_limit_s(friction: StickSlip, slip_m_s: float, force_n: float) -> float:
    """Return the longest step of the classical Runge–Kutta method: |R(step·λ)| ≤ 1 for each eigenvalue that decays."""

    def growth(size: float, direction: complex) -> float:
        z = size * direction
        return float(abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24)) - 1

    def limit(root: complex) -> float:
        return float(brentq(growth, *RK4_LIMIT, args=(root / abs(root),))) / abs(root)

    return min(limit(root) for root in _decaying(friction, slip_m_s, force_n))


def exponential_limit_s(friction: StickSlip, slip_m_s: float, force_n: float) -> float:
    """Return the longest split step: h·K·tanh(h·D/2m) = 2·D for a spring K and a damper D; h²·K = 4·m without damper.

    Sticking, the bristles are part of the spring; sliding, they relax exactly and only the skin is left.
    """
    f = friction
    sticking = slip_m_s == 0.0
    spring = f.skin_n_m + (force_n * f.bristle_1_m if sticking else 0.0)
    damper = f.skin_n_s_m + force_n * (f.viscous_s_m + (f.bristle_s_m if sticking else 0.0))
    undamped_s = 2 * math.sqrt(f.mass_kg / spring)
    if damper == 0.0:
        return undamped_s

    def excess(step_s: float) -> float:
        return step_s * spring * math.tanh(step_s * damper / (2 * f.mass_kg)) - 2 * damper

    return float(brentq(excess, undamped_s / 2, max(undamped_s, 2 * damper / spring) * 10))


def _decaying(friction: StickSlip, slip_m_s: float, force_n: float) -> list[complex]:
    """Return the eigenvalues that decay; those that grow do so in truth as well, and 0 is a tip that stays."""
    roots = np.linalg.eigvals(jacobian(friction, slip_m_s, force_n))
    least = SETTLED * float(np.abs(roots).max())
    return [complex(root) for root in roots if root.real < 0 and abs(root) > least]


INTEGRATORS: Mapping[str, Integrator] = {
    one.name: one
    for one in (
        Integrator('explicit_euler', explicit_euler, euler_limit_s),
        Integrator('runge_kutta_4', runge_kutta_4, runge_kutta_limit_s),
        Integrator('exponential', exponential, exponential_limit_s),
        SEMI_IMPLICIT,
    )
}
