"""Longest step with which an integrator stays stable; longer steps are refused."""

from __future__ import annotations

import math

from texture_core.errors import InvalidParameter
from texture_simulation.stick_slip.friction import StickSlip
from texture_simulation.stick_slip.integrator import Integrator

MARGIN = 0.5  # share of the border up to which a step is accepted


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

    Returns
    -------
    float
        m/s.
    """
    drop_n = (friction.static - friction.kinetic) * force_n
    return speed_m_s + drop_n / math.sqrt(friction.skin_n_m * friction.mass_kg)


def max_stable_step_s(integrator: Integrator, friction: StickSlip, speed_m_s: float, force_n: float) -> float:
    """Return the longest stable step at up to a speed and a force: sticking, sliding and off the surface.

    Parameters
    ----------
    integrator
        What integrates.
    friction
        Friction of the surface, and the skin.
    speed_m_s
        Speed of the base along the surface.
    force_n
        Normal force, at least 0.

    Returns
    -------
    float
        s.
    """
    slip_m_s = max(max_slip_m_s(friction, speed_m_s, force_n), friction.stribeck_m_s)
    cases = ((0.0, force_n), (slip_m_s, force_n), (slip_m_s, 0.0))
    return min(integrator.limit_s(friction, slip, force) for slip, force in cases)


def check_step(integrator: Integrator, friction: StickSlip, step_s: float, speed_m_s: float, force_n: float) -> None:
    """Raise InvalidParameter if a step is longer than `MARGIN` of the border, or no step at all.

    Parameters
    ----------
    integrator
        What integrates.
    friction
        Friction of the surface, and the skin.
    step_s
        Length of an integration step.
    speed_m_s
        Speed of the base along the surface.
    force_n
        Normal force, at least 0.

    Raises
    ------
    InvalidParameter
        If the step is not above 0 or too long.
    """
    if not step_s > 0:
        raise InvalidParameter(f'a step of {step_s} s; it must be above 0')
    allowed_s = MARGIN * max_stable_step_s(integrator, friction, speed_m_s, force_n)
    if step_s > allowed_s:
        raise InvalidParameter(
            f'a step of {1e6 * step_s:.3g} µs; {integrator.name} allows at most {1e6 * allowed_s:.3g} µs at '
            f'{force_n:.3g} N and {speed_m_s:.3g} m/s with this skin and these bristles: take a shorter step_s, or a '
            'heavier or softer skin'
        )
