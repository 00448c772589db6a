"""Slides that meet a lag nobody declared, a step, an edge, a soft layer on a hard base, or a force sensor that lies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from texture_benchmarks.motion.trial import ARM, SLIDE, ForceControlMetrics, Injection, simulate_force_controlled_slide
from texture_core.exploration import Phase
from texture_exploration.arms.simulated import SimulatedArm

LAGS_S = (0.0, 0.01, 0.02, 0.05)
DRIFT_N_S = 0.5


@dataclass(frozen=True)
class Hazard:
    """What is under the finger or happens to its force sensor; stiffnesses that it is tried on, N/m."""

    surface: Mapping[str, Any] = field(default_factory=dict)
    injection: Injection | None = None
    stiffnesses_n_m: tuple[float, ...] = (200.0, 2000.0, 5000.0, 20000.0)


def _freeze(phase: Phase) -> Injection:
    return Injection(phase, SimulatedArm.freeze_force)


def _drift(rate_n_s: float) -> Callable[[SimulatedArm], None]:
    return lambda arm: arm.drift_force(rate_n_s)


HAZARDS: Mapping[str, Hazard] = {
    'none': Hazard(),
    'step down 12 mm': Hazard({'step_m': -0.012}),
    'step up 1 mm': Hazard({'step_m': 0.001}, stiffnesses_n_m=(200.0, 2000.0)),
    'edge: the surface ends': Hazard({'edge_m': 0.03}),
    'soft layer of 1 mm on 20 kN/m': Hazard({'layer_m': 0.001}, stiffnesses_n_m=(200.0, 500.0, 1000.0)),
    'force frozen in the approach': Hazard(injection=_freeze(Phase.APPROACH)),
    'force frozen while pressing': Hazard(injection=_freeze(Phase.CONTACT)),
    'force frozen in the slide': Hazard(injection=_freeze(Phase.SLIDE)),
    'force frozen in the slide, rising 10°': Hazard({'tilt_rad': 0.1745}, _freeze(Phase.SLIDE)),
    'force drifts up by 0.5 N/s': Hazard(injection=Injection(Phase.SLIDE, _drift(DRIFT_N_S))),
    'force drifts down by 0.5 N/s': Hazard(injection=Injection(Phase.SLIDE, _drift(-DRIFT_N_S))),
}


def hazard_trials(
    lags_s: Sequence[float] = LAGS_S, most: int | None = None
) -> dict[str, dict[float, dict[float, ForceControlMetrics]]]:
    """Return the trials by hazard, undeclared lag in s and stiffness in N/m, with an arm that knows velocities alone.

    Parameters
    ----------
    lags_s
        Beyond the declared 8 ms.
    most
        The first so many stiffnesses of each hazard; all if None.
    """
    return {
        name: {lag_s: {k: _trial(hazard, lag_s, k) for k in hazard.stiffnesses_n_m[:most]} for lag_s in lags_s}
        for name, hazard in HAZARDS.items()
    }


def lag_trials(
    stiffnesses_n_m: Sequence[float], lags_s: Sequence[float] = LAGS_S
) -> dict[float, dict[float, ForceControlMetrics]]:
    """Return the trials on a flat surface by undeclared lag in s and stiffness in N/m."""
    flat = HAZARDS['none']
    return {lag_s: {k: _trial(flat, lag_s, k) for k in stiffnesses_n_m} for lag_s in lags_s}


def _trial(hazard: Hazard, lag_s: float, stiffness_n_m: float) -> ForceControlMetrics:
    arm = replace(ARM, stiffness_n_m=stiffness_n_m, undeclared_lag_s=lag_s, **hazard.surface)
    return simulate_force_controlled_slide(arm, SLIDE, injection=hazard.injection)
