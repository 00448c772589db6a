"""Slides on simulated surfaces, faster than real time, and how well force and speed were kept."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from texture_core.exploration import ExplorationRequest, Phase
from texture_exploration.arms.protocol import ArmState
from texture_exploration.arms.simulated import SimulatedArm, SimulatedArmParams
from texture_exploration.exploration import Exploration
from texture_exploration.explorer import PERIOD_S
from texture_exploration.motions.linear_slide import linear_slide
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits

ARM_PERIOD_NS = 5_000_000
SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.06)
ARM = SimulatedArmParams(force_mode=False, start_height_m=0.002)


@dataclass(frozen=True)
class Trial:
    """How a slide went; shares of the wanted force and speed.

    `overshoot` is the highest force from the approach to the beginning of the slide, above the wanted; `force_rms` and
    `speed_error` (the largest) are those of the slide. All are NaN if it did not come to a slide; `message` says why.
    """

    success: bool
    message: str
    overshoot: float
    force_rms: float
    speed_error: float


def slide_trial(
    arm: SimulatedArmParams = ARM,
    request: ExplorationRequest = SLIDE,
    touch: TouchParams = TouchParams(),  # noqa: B008
) -> Trial:
    """Slide once on a simulated arm, under the real exploration loop."""
    log: list[tuple[Phase, ArmState]] = []
    limits = SafetyLimits()
    now_ns = 0

    def clock() -> int:
        return now_ns

    moving = SimulatedArm(arm, clock, own_thread=False)
    moving.connect()
    motion = linear_slide(request, moving.state().position, touch, limits)
    exploration = Exploration(
        'trial', request, arm=moving, motion=motion, limits=limits, clock=clock, on_state=lambda state: None
    )

    def pace() -> None:
        nonlocal now_ns
        for _ in range(round(PERIOD_S * 1e9) // ARM_PERIOD_NS):
            now_ns += ARM_PERIOD_NS
            moving.step(ARM_PERIOD_NS * 1e-9)
        log.append((exploration.state.phase, moving.state()))

    outcome = exploration.run(pace)
    moving.close()
    before = [state.force_n for phase, state in log if phase in (Phase.APPROACH, Phase.CONTACT)]
    sliding = [state for phase, state in log if phase is Phase.SLIDE]
    if not sliding:
        return Trial(outcome.success, outcome.message, math.nan, math.nan, math.nan)
    force = np.array([state.force_n for state in sliding]) / request.force_n
    speed = np.array([math.hypot(*state.velocity[:2]) for state in sliding]) / request.speed_m_s
    return Trial(
        success=outcome.success,
        message=outcome.message,
        overshoot=max(before) / request.force_n - 1,
        force_rms=float(np.sqrt(np.mean((force - 1) ** 2))),
        speed_error=float(np.abs(speed - 1).max()),
    )


# Surfaces to try force control on, each as changes of the arm's parameters.
SURFACES: Mapping[str, Mapping[str, Any]] = {
    'flat': {},
    'rising 10°': {'tilt_rad': math.radians(10)},
    'falling 10°': {'tilt_rad': math.radians(-10)},
    'bump of 2 mm': {'bump_m': 0.002},
    'sticky': {'adhesion_n': 0.5, 'stick_slip_n': 0.05},
}


def surface_trials(
    stiffness_n_m: Sequence[float] = (200.0, 2000.0, 20000.0), acceleration_m_s2: float = 1.0
) -> dict[str, dict[float, Trial]]:
    """Return the trials on all `SURFACES` by name and stiffness; the stiffest expected contact is the actual one."""
    touch = TouchParams(acceleration_m_s2=acceleration_m_s2)
    return {
        name: {
            stiffness: slide_trial(
                replace(ARM, stiffness_n_m=stiffness, stiffest_n_m=max(1000.0, stiffness), **changes), touch=touch
            )
            for stiffness in stiffness_n_m
        }
        for name, changes in SURFACES.items()
    }
