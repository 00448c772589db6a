"""How far the stamps of a stream are from the truth when its batches arrive late and its clock drifts."""

from __future__ import annotations

import numpy as np

from texture_benchmarks.charts import error_chart
from texture_benchmarks.clock.trial import ClockErrors, simulate_clock_errors
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.arrays import Array

DURATION_S, QUICK_S = 600.0, 20.0
SEEDS = 5
WARM_UP_S = 5.0
SHOWN = 600  # points of a line
TARGET_MS = 0.5


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Stamp simulated streams with 5 ms of arrival jitter and 50 ppm of drift."""
    duration_s = QUICK_S if options.quick else DURATION_S
    trials = [
        simulate_clock_errors(np.random.default_rng(options.seed + k), duration_s=duration_s) for k in range(SEEDS)
    ]
    shown = trials[0]
    chart = error_chart(
        {
            'time of arrival': (shown.time_s, 1000 * np.abs(shown.arrival_error_s)),
            'counted at the nominal rate': (shown.time_s, 1000 * np.abs(shown.nominal_error_s)),
            'clock of the drivers': (shown.time_s, 1000 * np.abs(shown.clock_error_s)),
        },
        'Error of the stamps: 5 ms of arrival jitter, 50 ppm of drift (simulated)',
        ('time since the stream began (s)', 'largest error (ms)'),
        options.out / 'clock.png',
        points=SHOWN,
    )
    return BenchmarkResult(
        name='clock',
        measured=f'largest error of a stamp after {WARM_UP_S:g} s, ms; exponential arrival jitter of mean 5 ms, 50 ppm',
        data=f'{SEEDS} simulated streams of {duration_s:g} s, 1 kHz in batches of 10 ms',
        split='none: nothing is trained',
        numbers={
            'target_ms': TARGET_MS,
            'clock_ms': [_largest_ms(trial, trial.clock_error_s) for trial in trials],
            'arrival_ms': [_largest_ms(trial, trial.arrival_error_s) for trial in trials],
            'nominal_ms': [_largest_ms(trial, trial.nominal_error_s) for trial in trials],
        },
        charts=(chart,),
    )


def _largest_ms(trial: ClockErrors, error_s: Array) -> float:
    return float(1000 * np.abs(error_s[trial.time_s > WARM_UP_S]).max())
