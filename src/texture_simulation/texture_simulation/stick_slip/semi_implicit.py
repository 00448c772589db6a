"""The integrator of the bristle model: stable with long steps however stiff the bristles are."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from texture_simulation.stick_slip.bristle import Value
from texture_simulation.stick_slip.friction import StickSlip
from texture_simulation.stick_slip.integrator import Integrator, State, Step

CORRECTIONS = 2  # solutions of the semi-implicit step: one with the friction of the old speed, one with that of the new


def semi_implicit(friction: StickSlip, step_s: float, exp: Any = math.exp) -> Step:
    """Return a step with friction and damping at the new speed and the skin's spring at the old stretch.

    Friction at the new speed makes the bristles harmless however stiff they are; the spring at the old stretch keeps
    the skin's own swing from being damped by the numbers. The new slip w = ±W solves a quadratic equation:

        bend' = (bend + h·w) / (1 + q·W), q = h·σ0/g
        (mass/h + c + N·σ2)·w + N·(σ0·bend' + σ1·(bend' − bend)/h) = mass·slip/h + k·stretch + c·speed

    The Stribeck curve g and σ1 are taken at the old slip first, then once again at the slip that this gave.
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


def semi_implicit_limit_s(friction: StickSlip, slip_m_s: float, force_n: float) -> float:
    """Return the longest semi-implicit step: h²·k = 4·m + 2·h·D + h²·N·σ0, with D all damping and σ0 only if sticking.

    Only the skin's own swing limits it, and not even that while bristles stiffer than the skin hold.
    """
    f = friction
    sticking = slip_m_s == 0.0
    damper = f.skin_n_s_m + force_n * (f.viscous_s_m + (f.bristle_s_m if sticking else 0.0))
    spring = f.skin_n_m - (force_n * f.bristle_1_m if sticking else 0.0)
    if spring <= 0:
        return math.inf
    return (damper + math.sqrt(damper**2 + 4 * f.mass_kg * spring)) / spring


SEMI_IMPLICIT = Integrator('semi_implicit', semi_implicit, semi_implicit_limit_s)
