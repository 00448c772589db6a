"""Longest step with which an integrator stays stable, from the linearised motion; longer steps are refused."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import Enum

import numpy as np
from scipy.optimize import brentq

from texture_core.catalogue import find
from texture_core.errors import InvalidParameter
from texture_simulation.stick_slip.bristle import jacobian
from texture_simulation.stick_slip.friction import StickSlip

MARGIN = 0.5  # share of the border up to which a step is accepted
RK4_LIMIT = (1.0, 3.5)  # step·|λ| between which the border lies in all directions that decay
SETTLED = 1e-6  # an eigenvalue so much smaller than the largest belongs to what does not move at all


class ContactRegime(Enum):
    """What the tip does while steps are taken."""

    STICK = 'stick'
    SLIDE = 'slide'


StepLimit = Callable[[StickSlip, float, float], float]


def euler_limit_s(friction: StickSlip, slip_m_s: float, force_n: float) -> float:
    """Return the longest step of Euler's method: |1 + step·λ| ≤ 1 for each eigenvalue that decays.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    slip_m_s
        Speed of the tip over the surface; 0 if it sticks.
    force_n
        Normal force, at least 0.
    """
    return min(-2 * root.real / abs(root) ** 2 for root in _decaying(friction, slip_m_s, force_n))


def runge_kutta_limit_s(friction: StickSlip, slip_m_s: float, force_n: float) -> float:
    """Return the longest step of the classical Runge–Kutta method: |R(step·λ)| ≤ 1 for each eigenvalue that decays.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    slip_m_s
        Speed of the tip over the surface; 0 if it sticks.
    force_n
        Normal force, at least 0.
    """

    def growth(size: float, direction: complex) -> float:
        z = size * direction
        return float(abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24)) - 1

    def limit(root: complex) -> float:
        return float(brentq(growth, *RK4_LIMIT, args=(root / abs(root),))) / abs(root)

    return min(limit(root) for root in _decaying(friction, slip_m_s, force_n))


def exponential_limit_s(friction: StickSlip, slip_m_s: float, force_n: float) -> float:
    """Return the longest split step: h·K·tanh(h·D/2m) = 2·D for a spring K and a damper D; h²·K = 4·m without damper.

    Sticking, the bristles are part of the spring; sliding, they relax exactly and only the skin is left.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    slip_m_s
        Speed of the tip over the surface; 0 if it sticks.
    force_n
        Normal force, at least 0.
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


def semi_implicit_limit_s(friction: StickSlip, slip_m_s: float, force_n: float) -> float:
    """Return the longest semi-implicit step: h²·k = 4·m + 2·h·D + h²·N·σ0, with D all damping and σ0 only if sticking.

    Only the skin's own swing limits it, and not even that while bristles stiffer than the skin hold.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    slip_m_s
        Speed of the tip over the surface; 0 if it sticks.
    force_n
        Normal force, at least 0.
    """
    f = friction
    sticking = slip_m_s == 0.0
    damper = f.skin_n_s_m + force_n * (f.viscous_s_m + (f.bristle_s_m if sticking else 0.0))
    spring = f.skin_n_m - (force_n * f.bristle_1_m if sticking else 0.0)
    if spring <= 0:
        return math.inf
    return (damper + math.sqrt(damper**2 + 4 * f.mass_kg * spring)) / spring


STEP_LIMITS: Mapping[str, StepLimit] = {
    'explicit_euler': euler_limit_s,
    'runge_kutta_4': runge_kutta_limit_s,
    'exponential': exponential_limit_s,
    'semi_implicit': semi_implicit_limit_s,
}


def max_slip_m_s(friction: StickSlip, speed_m_s: float, force_n: float) -> float:
    """Return the speed that a tip reaches at most when it slips: that of the base and that of the skin let go.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    speed_m_s
        Speed of the base along the surface.
    force_n
        Normal force, at least 0.
    """
    drop_n = (friction.static - friction.kinetic) * force_n
    return speed_m_s + drop_n / math.sqrt(friction.skin_n_m * friction.mass_kg)


def max_stable_step_s(method: str, friction: StickSlip, speed_m_s: float, force_n: float) -> float:
    """Return the longest stable step at up to a speed and a force: sticking, sliding and off the surface.

    Parameters
    ----------
    method
        One of `INTEGRATORS`.
    friction
        Friction of the surface, and the skin.
    speed_m_s
        Speed of the base along the surface.
    force_n
        Normal force, at least 0.
    """
    limit = find(STEP_LIMITS, method, 'integrator')
    slip_m_s = max(max_slip_m_s(friction, speed_m_s, force_n), friction.stribeck_m_s)
    cases = ((0.0, force_n), (slip_m_s, force_n), (slip_m_s, 0.0))
    return min(limit(friction, slip, force) for slip, force in cases)


def check_step(method: str, friction: StickSlip, step_s: float, speed_m_s: float, force_n: float) -> None:
    """Raise InvalidParameter if a step is longer than `MARGIN` of the border, or no step at all.

    Parameters
    ----------
    method
        One of `INTEGRATORS`.
    friction
        Friction of the surface, and the skin.
    step_s
        Length of an integration step.
    speed_m_s
        Speed of the base along the surface.
    force_n
        Normal force, at least 0.
    """
    if not step_s > 0:
        raise InvalidParameter(f'a step of {step_s} s; it must be above 0')
    allowed_s = MARGIN * max_stable_step_s(method, friction, speed_m_s, force_n)
    if step_s > allowed_s:
        raise InvalidParameter(
            f'a step of {1e6 * step_s:.3g} µs; {method} allows at most {1e6 * allowed_s:.3g} µs at {force_n:.3g} N and '
            f'{speed_m_s:.3g} m/s with this skin and these bristles: take a shorter step_s, or a heavier or softer skin'
        )


def _decaying(friction: StickSlip, slip_m_s: float, force_n: float) -> list[complex]:
    """Return the eigenvalues that decay; those that grow do so in truth as well, and 0 is a tip that stays."""
    roots = np.linalg.eigvals(jacobian(friction, slip_m_s, force_n))
    least = SETTLED * float(np.abs(roots).max())
    return [complex(root) for root in roots if root.real < 0 and abs(root) > least]
