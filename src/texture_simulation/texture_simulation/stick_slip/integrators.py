"""Integrators of fixed step for the bristle model.

Each entry of `INTEGRATORS` prepares, for one friction and one step, a function (stretch, slip, bend, speed, force) →
the state one step later. It takes floats for one scan or arrays for many; `exp` is `math.exp` or `numpy.exp`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from texture_simulation.stick_slip.bristle import Tip, Value, rate
from texture_simulation.stick_slip.friction import StickSlip

State = tuple[Value, Value, Value]
Step = Callable[[Value, Value, Value, Value, Value], State]
Prepare = Callable[[StickSlip, float, Any], Step]
CORRECTIONS = 2  # solutions of the semi-implicit step: one with the friction of the old speed, one with that of the new


def explicit_euler(friction: StickSlip, step_s: float, exp: Any = math.exp) -> Step:
    """Return Euler's step: state + step·rate.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    step_s
        Length of an integration step.
    exp
        `math.exp` for one slide in floats, `numpy.exp` for arrays.
    """

    def step(stretch: Value, slip: Value, bend: Value, speed: Value, force: Value) -> State:
        slope = rate(friction, Tip(stretch, slip, bend), speed, force, exp)
        return stretch + step_s * slope[0], slip + step_s * slope[1], bend + step_s * slope[2]

    return step


def runge_kutta_4(friction: StickSlip, step_s: float, exp: Any = math.exp) -> Step:
    """Return the classical step of fourth order.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    step_s
        Length of an integration step.
    exp
        `math.exp` for one slide in floats, `numpy.exp` for arrays.
    """

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
    """Return a split step: each of slip, bend and stretch in turn, solved exactly while the others stand still.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    step_s
        Length of an integration step.
    exp
        `math.exp` for one slide in floats, `numpy.exp` for arrays.
    """
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


def semi_implicit(friction: StickSlip, step_s: float, exp: Any = math.exp) -> Step:
    """Return a step with friction and damping at the new speed and the skin's spring at the old stretch.

    Friction at the new speed makes the bristles harmless however stiff they are; the spring at the old stretch keeps
    the skin's own swing from being damped by the numbers. The new slip w = ±W solves a quadratic equation:

        bend' = (bend + h·w) / (1 + q·W), q = h·σ0/g
        (mass/h + c + N·σ2)·w + N·(σ0·bend' + σ1·(bend' − bend)/h) = mass·slip/h + k·stretch + c·speed

    The Stribeck curve g and σ1 are taken at the old slip first, then once again at the slip that this gave.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    step_s
        Length of an integration step.
    exp
        `math.exp` for one slide in floats, `numpy.exp` for arrays.
    """
    stiffness, damping, viscous = friction.skin_n_m, friction.skin_n_s_m, friction.viscous_s_m
    bristle, bristle_damping = friction.bristle_1_m, friction.bristle_s_m
    kinetic, more = friction.kinetic, friction.static - friction.kinetic
    inertia, narrow, step_bristle = (
        friction.mass_kg / step_s,
        -1 / friction.stribeck_m_s**2,
        step_s * friction.bristle_1_m,
    )
    corrections = range(CORRECTIONS)
    copysign = math.copysign if exp is math.exp else np.copysign

    def step(stretch: Value, slip: Value, bend: Value, speed: Value, force: Value) -> State:
        linear = inertia + damping + force * viscous
        drive = inertia * slip + stiffness * stretch + damping * speed
        left = drive - force * bristle * bend
        size, sign = abs(left), copysign(1.0, left)
        for _ in corrections:
            fading = exp(narrow * slip * slip)
            bent = step_bristle / (kinetic + more * fading)
            holding = force * bristle_damping * fading
            square = linear * bent
            middle = linear + force * step_bristle + holding - sign * bent * (drive + holding * bend / step_s)
            fast = ((middle * middle + 4 * square * size) ** 0.5 - middle) / (2 * square)
            slip = sign * fast
        return stretch + step_s * (speed - slip), slip, (bend + step_s * slip) / (1 + bent * fast)

    return step


INTEGRATORS: Mapping[str, Prepare] = {
    'explicit_euler': explicit_euler,
    'runge_kutta_4': runge_kutta_4,
    'exponential': exponential,
    'semi_implicit': semi_implicit,
}
