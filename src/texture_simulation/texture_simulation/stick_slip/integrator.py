"""What integrates the bristle model step by step, and the longest step with which it is stable."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from texture_simulation.stick_slip.bristle import Value
from texture_simulation.stick_slip.friction import StickSlip

State = tuple[Value, Value, Value]
Step = Callable[[Value, Value, Value, Value, Value], State]


@dataclass(frozen=True)
class Integrator:
    """An integrator of fixed step.

    Parameters
    ----------
    name
        For messages and charts.
    prepare
        Gives, for a friction, a step (s) and `exp`, the function (stretch, slip, bend, speed, force) → the state one
        step later. It takes floats for one scan (`math.exp`) or arrays for many (`numpy.exp`).
    limit_s
        Gives the longest stable step, for a friction, the speed of the tip over the surface (0 if it sticks) and the
        force.
    """

    name: str
    prepare: Callable[[StickSlip, float, Any], Step]
    limit_s: Callable[[StickSlip, float, float], float]
