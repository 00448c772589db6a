"""What integrates the bristle model step by step, and the longest step with which it is stable."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from texture_simulation.stick_slip.bristle import Value
from texture_simulation.stick_slip.friction import StickSlip

State = tuple[Value, Value, Value]
Step = Callable[[Value, Value, Value, Value, Value], State]


class PrepareStep(Protocol):
    """Makes the step of an integrator."""

    def __call__(self, friction: StickSlip, step_s: float, exp: Any, /) -> Step:
        """Return what takes the state over one step.

        Parameters
        ----------
        friction
            Friction of the surface, and the skin.
        step_s
            Length of an integration step.
        exp
            `math.exp` for one slide in floats, `numpy.exp` for arrays.

        Returns
        -------
        callable
            Takes stretch, slip, bend, and the speed and the force at the end of the step; returns the next state.
        """


class StepLimit(Protocol):
    """Gives the longest step with which an integrator is stable."""

    def __call__(self, friction: StickSlip, slip_m_s: float, force_n: float, /) -> float:
        """Return the longest stable step.

        Parameters
        ----------
        friction
            Friction of the surface, and the skin.
        slip_m_s
            Speed of the tip over the surface; 0 if it sticks.
        force_n
            Normal force, at least 0.

        Returns
        -------
        float
            s; inf if every step is stable.
        """


@dataclass(frozen=True)
class Integrator:
    """An integrator of fixed step.

    Parameters
    ----------
    name
        For messages and charts.
    prepare
        Makes its step.
    limit_s
        Gives the longest stable step.
    """

    name: str
    prepare: PrepareStep
    limit_s: StepLimit
