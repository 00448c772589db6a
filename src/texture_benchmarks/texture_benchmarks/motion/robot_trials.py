"""Slides of emulated robots in real time, evaluated by where the finger really was and how hard it really pressed."""

from __future__ import annotations

import statistics
from bisect import bisect_right
from contextlib import ExitStack
from dataclasses import fields, replace

from texture_benchmarks.motion.robots_under_test import DEADLINE_S, ROBOTS, FingerLog
from texture_benchmarks.motion.trial import ForceControlMetrics, force_control_metrics
from texture_core.exploration import ExplorationRequest, ExplorationState, Phase
from texture_core.finger_state import FingerState
from texture_exploration.arms.protocol import ArmState
from texture_exploration.explorer import Explorer
from texture_exploration.safety import SafetyLimits

LIMITS = SafetyLimits(state_timeout_s=1.0, approach_timeout_s=40.0)  # a busy machine is not what is tried here


def typical_trial(name: str, stiffness_n_m: float, request: ExplorationRequest, repeats: int) -> ForceControlMetrics:
    """Return the median of each number of several trials, or one that failed: the machine may have been busy once.

    Parameters
    ----------
    name
        Name of the robot in `ROBOTS`.
    stiffness_n_m
        Stiffness of the surface.
    request
        What is explored.
    repeats
        Number of trials.

    Returns
    -------
    ForceControlMetrics
    """
    trials = [robot_trial(name, stiffness_n_m, request) for _ in range(repeats)]
    failed = [trial for trial in trials if not trial.success]
    if failed:
        return failed[0]
    names = [field.name for field in fields(ForceControlMetrics) if field.name not in ('success', 'message')]
    medians = {name: statistics.median(getattr(trial, name) for trial in trials) for name in names}
    return ForceControlMetrics(True, trials[0].message, **medians)


def robot_trial(name: str, stiffness_n_m: float, request: ExplorationRequest) -> ForceControlMetrics:
    """Explore once with one of `ROBOTS`, over a surface of that stiffness.

    Parameters
    ----------
    name
        Name of the robot in `ROBOTS`.
    stiffness_n_m
        Stiffness of the surface.
    request
        What is explored.

    Returns
    -------
    ForceControlMetrics
    """
    robot = ROBOTS[name]
    states: list[ExplorationState] = []
    with ExitStack() as stack:
        log = stack.enter_context(FingerLog())
        arm = stack.enter_context(robot.start(stiffness_n_m, log.port))
        explorer = Explorer(arm, replace(robot.touch, approach_stiffness_n_m=stiffness_n_m), LIMITS, states.append)
        stack.callback(explorer.close)
        explorer.connect()
        exploration = explorer.begin('trial', request)
        exploration.ended.wait(DEADLINE_S)
        return force_control_metrics(_by_phase(log.fingers, states), request, exploration.outcome)


def _by_phase(fingers: list[FingerState], states: list[ExplorationState]) -> list[tuple[Phase, ArmState]]:
    """Return where the finger was in which phase.

    What it did before the first is left out, as is what of a slide was not guaranteed to be steady: turns of strokes.
    """
    begins = [state.stamp_ns for state in states]
    log = []
    for finger in fingers:
        newest = bisect_right(begins, finger.time_ns) - 1
        if newest >= 0 and (states[newest].phase is not Phase.SLIDE or _guaranteed(states[newest], finger.time_ns)):
            log.append((states[newest].phase, _arm_state(finger)))
    return log


def _guaranteed(state: ExplorationState, time_ns: int) -> bool:
    return time_ns <= state.stamp_ns + state.steady_s * 1e9


def _arm_state(finger: FingerState) -> ArmState:
    velocity = (finger.vx_m_s, finger.vy_m_s, finger.vz_m_s)
    return ArmState(finger.time_ns, (finger.x_m, finger.y_m, finger.z_m), velocity, finger.force_n)
