"""How well force, speed and circle are kept, by which robot on which surface; and where force control is stable."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from math import isfinite
from typing import Any

import numpy as np

from texture_benchmarks.motion.chart import border_chart, hazard_chart, robot_chart, surface_chart
from texture_benchmarks.motion.defaults import TARGETS, bump_speed_m_s, defaults, margins
from texture_benchmarks.motion.hazards import LAGS_S, hazard_trials, lag_trials
from texture_benchmarks.motion.robot_trials import typical_trial
from texture_benchmarks.motion.robots_under_test import ROBOTS
from texture_benchmarks.motion.tables import hazard_table, lag_table, robot_table, surface_table
from texture_benchmarks.motion.trial import (
    ARM,
    CIRCLE,
    SLIDE,
    ForceControlMetrics,
    simulate_force_controlled_slide,
    simulate_slides_on_surfaces,
)
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_exploration.arms.simulated import SimulatedArmParams
from texture_exploration.force_control import ForceController
from texture_exploration.stability import LoopModel, stability_chart

STIFFNESSES_N_M = (200.0, 2000.0, 20000.0)
FINE_STIFFNESSES_N_M = tuple(float(k) for k in np.geomspace(200.0, 20000.0, 9))
BORDER_STIFFNESSES_N_M = (100.0, 1e3, 1e4, 1e5)
DELAYS_S = tuple(float(delay) for delay in np.linspace(0.0, 0.02, 21))
QUICK_DELAYS_S = (0.0, 0.008, 0.02)
QUICK_ROBOTS = ('emulated rails',)
REPEATS = 3  # of the emulated robots
SIMULATED: Mapping[str, SimulatedArmParams] = {
    'simulated, force mode': replace(ARM, force_mode=True),
    'simulated, velocities only': ARM,
}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Slide straight and in a circle with every robot, over every surface; draw the border of stability."""
    stiffnesses = STIFFNESSES_N_M[1:2] if options.quick else STIFFNESSES_N_M
    fine = STIFFNESSES_N_M if options.quick else FINE_STIFFNESSES_N_M
    surfaces = simulate_slides_on_surfaces(fine)
    lags_s = LAGS_S[::3] if options.quick else LAGS_S
    lags, hazards = lag_trials(fine, lags_s), hazard_trials(lags_s, 2 if options.quick else None)
    border = stability_chart(BORDER_STIFFNESSES_N_M, QUICK_DELAYS_S if options.quick else DELAYS_S, _controller)
    robots = {name: _simulated(arm, stiffnesses) for name, arm in SIMULATED.items()}
    here = [name for name, robot in ROBOTS.items() if importlib.util.find_spec(robot.needs)]
    for name in QUICK_ROBOTS if options.quick else here:
        robots[name] = _emulated(name, stiffnesses, 1 if options.quick else REPEATS)
    options.out.mkdir(parents=True, exist_ok=True)
    table = options.out / 'motion.md'
    tables = (robot_table(robots, TARGETS), surface_table(surfaces), lag_table(lags), hazard_table(hazards))
    table.write_text('\n'.join(tables), encoding='utf-8')
    return BenchmarkResult(
        name='motion',
        measured=(
            'one slide of 60 mm at 0.05 m/s and one of two turns at 0.1 m/s on a circle of 20 mm, with 1 N, for each '
            'robot and stiffness; in the hand and with ROS controllers strokes of 20 mm at 0.02 m/s. '
            'Shares of what was asked for: overshoot '
            'until the slide begins, force error (root mean square), largest and mean speed error of the slide; '
            f'largest distance from the circle. Of emulated robots the median of {REPEATS} slides'
        ),
        data='simulated surfaces; the emulated robots in real time, on the same machine',
        split='none: nothing is trained; the force loop was designed on these surfaces',
        numbers={
            'targets': TARGETS,
            'robots': robots,
            'surfaces_velocities_only': {name: _rows(trials) for name, trials in surfaces.items()},
            'undeclared_lag': {_milliseconds(lag): _rows(trials) for lag, trials in lags.items()},
            'hazards': {
                name: {_milliseconds(lag): _rows(trials) for lag, trials in by_lag.items()}
                for name, by_lag in hazards.items()
            },
            'bump_speed_m_s': {_newtons(k): bump_speed_m_s(k) for k in stiffnesses},
            'border_error': float(np.abs(border['simulated'] / border['predicted'] - 1).max()),
            'margin': margins(),
        },
        charts=(
            robot_chart(robots, TARGETS, options.out / 'motion_robots.png'),
            surface_chart(surfaces, TARGETS, options.out / 'motion_surfaces.png'),
            hazard_chart(lags, hazards, TARGETS, options.out / 'motion_hazards.png'),
            border_chart(border, defaults(border), options.out / 'motion_stability.png'),
        ),
    )


def _controller(loop: LoopModel) -> ForceController:
    return ForceController(loop.gain_m_s_n, loop.integral_s)


def _simulated(arm: SimulatedArmParams, stiffnesses: Sequence[float]) -> dict[str, Any]:
    arms = {k: replace(arm, stiffness_n_m=k) for k in stiffnesses}
    return {
        _newtons(k): {request.motion: _row(simulate_force_controlled_slide(at, request)) for request in (SLIDE, CIRCLE)}
        for k, at in arms.items()
    }


def _emulated(name: str, stiffnesses: Sequence[float], repeats: int) -> dict[str, Any]:
    requests = ROBOTS[name].requests
    return {
        _newtons(k): {request.motion: _row(typical_trial(name, k, request, repeats)) for request in requests}
        for k in stiffnesses
    }


def _rows(trials: Mapping[float, ForceControlMetrics]) -> dict[str, Any]:
    return {_newtons(stiffness): _row(trial) for stiffness, trial in trials.items()}


def _row(trial: ForceControlMetrics) -> dict[str, Any]:
    """Return the numbers of a trial; what there is none of is left out, as is the message of a success."""
    numbers = {name: value for name, value in asdict(trial).items() if isinstance(value, float) and isfinite(value)}
    return {'success': trial.success, **numbers, **({} if trial.success else {'message': trial.message})}


def _newtons(stiffness_n_m: float) -> str:
    return f'{stiffness_n_m:.0f} N/m'


def _milliseconds(time_s: float) -> str:
    return f'{1e3 * time_s:.0f} ms'
