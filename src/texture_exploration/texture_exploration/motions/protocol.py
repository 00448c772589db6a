"""What every motion can do, and how it is planned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from texture_core.exploration import ExplorationRequest, Phase
from texture_exploration.arms.protocol import ArmCommand, ArmState, Vector
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits


@dataclass(frozen=True)
class MotionStep:
    """What the arm shall do now, and how far the motion is.

    `steady_s` guarantees that phase, speed and force hold so long from now; `direction_rad` is the direction of travel;
    `progress` the share of the slide that is over.
    """

    command: ArmCommand
    phase: Phase
    steady_s: float
    direction_rad: float
    progress: float


class Motion(Protocol):
    """One planned exploration. Knows no clock and no arm: it is stepped with the time and the state of the arm."""

    def step(self, time_ns: int, arm: ArmState) -> MotionStep:
        """Return what to do at `time_ns` (CLOCK_MONOTONIC), until the phase is DONE or ABORTED."""

    def abort(self, reason: str) -> None:
        """Lift the finger along the normal and end as ABORTED, from any phase; the first reason counts."""

    def finish(self, reason: str) -> None:
        """End the slide early, but not before the guaranteed time is over, and go on to DONE."""

    @property
    def force_n(self) -> float:
        """The wanted force of the slide."""

    @property
    def lifted(self) -> bool:
        """Whether the finger was lifted at the end, and the measured force says so."""

    @property
    def message(self) -> str:
        """What happened, in one sentence."""


class Planner(Protocol):
    """Plans a motion: checks a request against the limits and fills in the defaults."""

    def __call__(
        self, request: ExplorationRequest, home: Vector, touch: TouchParams, limits: SafetyLimits, /
    ) -> Motion:
        """Return a motion, ready for its first step.

        Parameters
        ----------
        request
            What the operator asks for; 0 takes the default of a number.
        home
            Place where the slide begins and to which height it lifts, m, in the frame of the surface.
        touch
            How the finger approaches, presses and lifts.
        limits
            Allowed speeds, forces and workspace.

        Returns
        -------
        Motion

        Raises
        ------
        MotionRefused
            If a number is out of its range, does not belong to this motion, or the path leaves the workspace.
        """
