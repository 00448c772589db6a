"""Slides on simulated surfaces, faster than real time, and how well force and speed were kept."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.exploration import ExplorationRequest, Phase
from texture_exploration.arms.protocol import ArmState
from texture_exploration.arms.simulated import RATE_HZ, SimulatedArm, SimulatedArmParams
from texture_exploration.exploration import Exploration, ExplorationOutcome
from texture_exploration.explorer import PERIOD_S
from texture_exploration.motions.catalogue import MOTIONS
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits

ARM_PERIOD_NS = round(1e9 / RATE_HZ)
SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.06)
CIRCLE = ExplorationRequest('circular', speed_m_s=0.1, force_n=1.0, radius_m=0.02, turns=2.0)
# One configuration for all stiffnesses: the stiffest contact is expected throughout.
ARM = SimulatedArmParams(force_mode=False, start_height_m=0.002, max_stiffness_n_m=20000.0)
TOUCH = TouchParams(approach_stiffness_n_m=20000.0)
LIMITS = SafetyLimits()
APART_S = 0.05
LIFTED = (Phase.LIFT, Phase.ABORTED, Phase.DONE)


@dataclass(frozen=True)
class ForceControlMetrics:
    """How an exploration went; shares of the wanted force and speed.

    `overshoot` is the highest force from the approach to the beginning of the slide, above the wanted; negative if it
    stayed below. The others are those of the slide: `force_rms`, `speed_error` (the largest), `mean_speed_error`, and
    `radius_error_m`, the largest distance from the circle, NaN if there was none. The speed is that of the finger in
    space: on a slope it is higher than along the level. All are NaN if it did not come to a slide; `message` says why.
    `peak_n` is the highest force of the whole exploration, and `noticed_s` the time from what was injected until the
    finger was lifted, or, without that, from the first loss of contact in the slide; NaN if there was none.
    """

    success: bool
    message: str
    overshoot: float = math.nan
    force_rms: float = math.nan
    speed_error: float = math.nan
    mean_speed_error: float = math.nan
    radius_error_m: float = math.nan
    peak_n: float = math.nan
    noticed_s: float = math.nan


@dataclass(frozen=True)
class Injection:
    """What happens to a simulated arm, at the third step of a phase."""

    phase: Phase
    happens: Callable[[SimulatedArm], None]


Log = Sequence[tuple[Phase, ArmState]]


def simulate_force_controlled_slide(
    arm: SimulatedArmParams = ARM,
    request: ExplorationRequest = SLIDE,
    touch: TouchParams = TOUCH,
    injection: Injection | None = None,
) -> ForceControlMetrics:
    """Explore once with a simulated arm, under the real exploration loop; evaluated by the true force.

    Parameters
    ----------
    arm
        Arm and surface.
    request
        What is explored.
    touch
        How the finger approaches, presses and lifts.
    injection
        Changes states on their way to the controller; None for no fault.

    Returns
    -------
    ForceControlMetrics
    """
    log: list[tuple[Phase, ArmState]] = []
    now_ns = due_ns = 0
    injected_ns: int | None = None

    def clock() -> int:
        return now_ns

    moving = SimulatedArm(arm, clock, own_thread=False)
    moving.connect()
    motion = MOTIONS[request.motion](request, moving.state().position, touch, LIMITS)
    exploration = Exploration(
        'trial', request, arm=moving, motion=motion, limits=LIMITS, clock=clock, on_state=lambda state: None
    )

    def pace() -> None:
        nonlocal now_ns, due_ns, injected_ns
        due_ns += round(PERIOD_S * 1e9)
        while now_ns + ARM_PERIOD_NS <= due_ns:
            now_ns += ARM_PERIOD_NS
            moving.step(ARM_PERIOD_NS * 1e-9)
        log.append((exploration.state.phase, replace(moving.state(), force_n=moving.true_force_n)))
        if injection and injected_ns is None and [phase for phase, _ in log[-3:]] == [injection.phase] * 3:
            injected_ns = now_ns
            injection.happens(moving)

    outcome = exploration.run(pace)
    moving.close()
    log.append((exploration.state.phase, replace(moving.state(), force_n=moving.true_force_n)))
    return replace(force_control_metrics(log, request, outcome), noticed_s=_noticed_s(log, injected_ns))


def _noticed_s(log: Log, begin_ns: int | None) -> float:
    """Return how long after `begin_ns`, or the first loss of contact in the slide, the finger was lifted, s."""
    if begin_ns is None:
        lost = (state.time_ns for phase, state in log if phase is Phase.SLIDE and state.force_n <= 0.0)
        begin_ns = next(lost, None)
    if begin_ns is None:
        return math.nan
    lifted = (state.time_ns for phase, state in log if phase in LIFTED and state.time_ns >= begin_ns)
    return (next(lifted, log[-1][1].time_ns) - begin_ns) * 1e-9


def force_control_metrics(log: Log, request: ExplorationRequest, outcome: ExplorationOutcome) -> ForceControlMetrics:
    """Return how an exploration went, from the states of the arm in each phase.

    Parameters
    ----------
    log
        States of the arm by phase.
    request
        What was explored.
    outcome
        How it ended.

    Returns
    -------
    ForceControlMetrics
        In SI units.
    """
    before = [state.force_n for phase, state in log if phase in (Phase.APPROACH, Phase.CONTACT)]
    sliding = [state for phase, state in log if phase is Phase.SLIDE]
    peak_n = max((state.force_n for _, state in log), default=math.nan)
    if not sliding:
        return ForceControlMetrics(outcome.success, outcome.message, peak_n=peak_n)
    force = np.array([state.force_n for state in sliding]) / request.force_n
    speed = np.array([math.hypot(*state.velocity) for state in sliding]) / request.speed_m_s
    times_s = np.array([state.time_ns for state in sliding]) * 1e-9
    places = np.array([state.position for state in sliding])
    return ForceControlMetrics(
        success=outcome.success,
        message=outcome.message,
        overshoot=max(before) / request.force_n - 1,
        force_rms=float(np.sqrt(np.mean((force - 1) ** 2))),
        speed_error=float(np.abs(speed - 1).max()),
        mean_speed_error=abs(mean_speed_m_s(times_s, places) / request.speed_m_s - 1),
        radius_error_m=radius_error_m(places[:, :2], request.radius_m),
        peak_n=peak_n,
    )


def mean_speed_m_s(times_s: Array, places: Array) -> float:
    """Return the way through places, (n, 3), over the time it took; pairs further apart than `APART_S` do not count.

    Parameters
    ----------
    times_s : (n,)
        Rising.
    places : (n, 3)
        m.
    """
    took_s = np.diff(times_s)
    ways = np.linalg.norm(np.diff(places, axis=0), axis=1)
    near = took_s < APART_S
    return float(ways[near].sum() / took_s[near].sum())


def radius_error_m(places: Array, radius_m: float) -> float:
    """Return the largest distance of places, (n, 2), from a circle of that radius around their own middle, m.

    NaN if the radius is 0, for another path. The middle is that of the circle that fits best, by least squares
    (Kåsa 1976).

    Parameters
    ----------
    places : (n, 2)
        m.
    radius_m
        Wanted radius.
    """
    if not radius_m:
        return math.nan
    terms = np.column_stack([2 * places, np.ones(len(places))])
    middle = np.linalg.lstsq(terms, (places**2).sum(axis=1), rcond=None)[0][:2]
    return float(np.abs(np.hypot(*(places - middle).T) - radius_m).max())


# Surfaces to try force control on, each as changes of the arm's parameters.
SURFACES: Mapping[str, Mapping[str, Any]] = {
    'flat': {},
    'rising 10°': {'tilt_rad': math.radians(10)},
    'falling 10°': {'tilt_rad': math.radians(-10)},
    'bump of 2 mm': {'bump_m': 0.002},
    'sticky': {'adhesion_n': 0.5, 'stick_slip_n': 0.05},
}


def simulate_slides_on_surfaces(
    stiffness_n_m: Sequence[float] = (200.0, 2000.0, 20000.0), arm: SimulatedArmParams = ARM
) -> dict[str, dict[float, ForceControlMetrics]]:
    """Return the trials on all `SURFACES` by name and stiffness."""
    return {
        name: {
            stiffness: simulate_force_controlled_slide(replace(arm, stiffness_n_m=stiffness, **changes))
            for stiffness in stiffness_n_m
        }
        for name, changes in SURFACES.items()
    }
