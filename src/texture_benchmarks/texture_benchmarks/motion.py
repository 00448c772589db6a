# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How hard a finger presses in virtual time, on independent physics; and where the force control is stable."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from texture_benchmarks.force_trials import LIMIT_N, SEEDS, TrialEnd, Trials, explored, row, sweep
from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult, resumed
from texture_core.types import Array
from texture_evaluation.charts import COLOURS, chart
from texture_exploration.force_control import (
    ForceController,
    ForceLoopParams,
    LoopModel,
    lowest_unstable_gain,
    stability_limit_gain,
)

# --------------------
# The stability limit: predicted by eigenvalues, and that of the running controller.

CYCLES = 60  # number of delays after which a simulated loop is evaluated
SMALL = 0.1
FINE = 20  # simulation steps per period


def simulated_stability_limit_gain(loop: LoopModel) -> float:
    """Return the gain from which a running `ForceController` makes a disturbance grow, m/s/N."""
    return lowest_unstable_gain(loop, lambda gain: _disturbance_decays(replace(loop, gain_m_s_n=gain)), bisections=12)


def _disturbance_decays(loop: LoopModel) -> bool:
    """Run the controller on a spring, finely integrated, after a jolt of 1 N; return whether the swinging shrinks."""
    running = ForceController(loop.gain_m_s_n, loop.integral_s)
    fine_s = loop.period_s / FINE
    late = round(loop.delay_s / fine_s)
    periods = math.ceil(CYCLES * (loop.delay_s + loop.period_s) / loop.period_s)
    error, peaks = 1.0, np.empty(periods)
    velocities = np.zeros(late + FINE * periods)
    for period in range(periods):
        now = FINE * period
        velocities[late + now : late + now + FINE] = running.update(error, loop.period_s)
        error += loop.stiffness_n_m * fine_s * float(velocities[now : now + FINE].sum())
        peaks[period] = abs(error)
        if peaks[period] > 1e6:
            return False
    third = periods // 3
    # The integral part may leave a small slow rest that still rises; a swinging that grows began with 1.
    return bool(peaks[-third:].max() < max(SMALL, peaks[third : 2 * third].max()))


def stability_chart(
    stiffness_n_m: Sequence[float],
    delay_s: Sequence[float],
    period_s: float = 0.004,
    integral_s: float = 0.5,
) -> dict[str, Array]:
    """Return the data of a chart: the stability limit of the gain over stiffness and delay, predicted and simulated."""
    loops = [[LoopModel(k, 0.0, delay, period_s, integral_s) for delay in delay_s] for k in stiffness_n_m]
    return {
        'stiffness_n_m': np.array(stiffness_n_m, dtype=float),
        'delay_s': np.array(delay_s, dtype=float),
        'predicted': np.array([[stability_limit_gain(loop) for loop in row] for row in loops]),
        'simulated': np.array([[simulated_stability_limit_gain(loop) for loop in row] for row in loops]),
    }


def limit_chart(limit: Mapping[str, Array], path: Path) -> Path:
    """Draw the gain from which the loop is unstable over its delay, predicted and simulated, and the chosen gains."""
    with chart(path, (8.0, 5.0)) as figure:
        axes = figure.subplots()
        delay_ms = 1000 * limit['delay_s']
        rows = zip(limit['stiffness_n_m'], limit['predicted'], limit['simulated'], COLOURS, strict=False)
        for stiffness, predicted, simulated, colour in rows:
            chosen = [
                ForceLoopParams(loop_delay_s=delay, max_stiffness_n_m=stiffness).gain_m_s_n(1 / ARM_RATE_HZ)
                for delay in limit['delay_s']
            ]
            axes.semilogy(delay_ms, predicted, color=colour, label=f'{stiffness / 1000:g} kN/m')
            axes.semilogy(delay_ms, simulated, '.', color=colour)
            axes.semilogy(delay_ms, chosen, ':', color=colour)
        title = (
            'Stability limit of the force control at 250 Hz: eigenvalues (lines), simulation (dots)\n'
            'Dotted: the gain that the controller chooses'
        )
        axes.set(xlabel='delay of the loop (ms)', ylabel='gain (m/s per N)', title=title)
        axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5), title='stiffness')
    return path


def force_chart(rows: Mapping[str, Trials], path: Path) -> Path:
    """Draw the largest force of each trial by kind: success, or ended with a reason."""
    with chart(path, (8.5, 4.6), 'Largest true force of each trial, 5 N wanted') as figure:
        axes = figure.subplots()
        for place, trials in enumerate(rows.values()):
            for success, colour in ((False, COLOURS[1]), (True, COLOURS[0])):
                chosen = [end for _, end in trials if (end.end == 'success') is success]
                largest = [max(end.normal_n, end.sideways_n) for end in chosen]
                offset = 0.12 if success else -0.12
                label = ('success' if success else 'ended with a reason') if place == 0 else None
                axes.plot(largest, [place + offset] * len(largest), '.', color=colour, alpha=0.5, label=label)
        axes.axvline(LIMIT_N, color='black', linestyle='--', linewidth=1)
        axes.set(xlabel='largest force (N); dashed: limit', yticks=range(len(rows)), yticklabels=list(rows))
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.legend(loc='lower right')
    return path


ARM_RATE_HZ = 250.0
STIFFNESSES_N_M = (100.0, 1e3, 1e4, 1e5)
DELAYS_S = tuple(float(delay) for delay in np.linspace(0.0, 0.02, 21))
QUICK_DELAYS_S = (0.0, 0.008, 0.02)
FINISHED = 'motion.jsonl'  # a line for each trial, as it is finished


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Slide 30 mm with 5 N in virtual time on physics that shares no code with the suite; draw the stability limit.

    A late integrator on a spring with friction, by an arm of ROS controllers that holds the last velocity: stiffness
    of 0.2 to 20 kN/m, delay of 0 to 50 ms, noise of 3 to 20 mN; a wall, wrong signs and axes, a surface upside down 1
    to 12 mm away; in each phase non-finite samples, broken links and a second explorer. Largest true forces of
    each kind of trial, the most time above 10 N, and how the trials ended.
    """
    seeds = 1 if options.quick else SEEDS
    planned = {', '.join(map(str, trial)): trial for trial in sweep(seeds, options.quick)}
    ended = resumed(explored, planned, options.out / FINISHED, options)
    rows: defaultdict[str, Trials] = defaultdict(list)
    for name, end in ended.items():
        rows[planned[name].name].append((planned[name], TrialEnd(*end)))
    limit = stability_chart(STIFFNESSES_N_M, QUICK_DELAYS_S if options.quick else DELAYS_S)
    return BenchmarkResult(
        data='virtual arm and surface, in virtual time',
        split='none: nothing is trained',
        numbers={
            'seeds': seeds,
            'planned': len(planned),
            'rows': {name: row(trials) for name, trials in rows.items()},
            'border_error': float(np.abs(limit['simulated'] / limit['predicted'] - 1).max()),
        },
        charts=(
            force_chart(rows, options.out / 'motion_forces.png'),
            limit_chart(limit, options.out / 'motion_stability.png'),
        ),
    )
