"""Tables of robots, surfaces, hazards and lags."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from texture_benchmarks.motion.trial import ForceControlMetrics

# The same as columns of a table.
COLUMNS = (
    ('force_rms', 'force error, rms (%)', 100),
    ('overshoot', 'overshoot (%)', 100),
    ('speed_error', 'largest speed error (%)', 100),
    ('mean_speed_error', 'mean speed error (%)', 100),
    ('radius_error_m', 'error of the radius (mm)', 1000),
)


def robot_table(robots: Mapping[str, Mapping[str, Any]], targets: Mapping[str, float]) -> str:
    """Return a Markdown table of what each robot kept, bold where it misses a target.

    Parameters
    ----------
    robots
        As in the JSON of the benchmark.
    targets
        By number; at most so much is asked.
    """
    asked = [f'{times * targets[name]:g}' if name in targets else '' for name, _, times in COLUMNS]
    rows = [
        [
            robot,
            stiffness,
            motion,
            *(_against_target(numbers.get(name), times, targets.get(name)) for name, _, times in COLUMNS),
        ]
        for robot, by_stiffness in robots.items()
        for stiffness, motions in by_stiffness.items()
        for motion, numbers in motions.items()
    ]
    return _table(
        ['robot', 'stiffness', 'motion', *(title for _, title, _ in COLUMNS)],
        [['asked: at most', '', '', *asked], *rows],
    )


def surface_table(surfaces: Mapping[str, Mapping[float, ForceControlMetrics]]) -> str:
    """Return a Markdown table of the error of the force by surface and stiffness, in percent."""
    stiffnesses = list(next(iter(surfaces.values())))
    rows = [[name, *(_cell(trial.force_rms, 100) for trial in trials.values())] for name, trials in surfaces.items()]
    return _table(['force error, rms (%)', *(f'{stiffness:.0f} N/m' for stiffness in stiffnesses)], rows)


def hazard_table(hazards: Mapping[str, Mapping[float, Mapping[float, ForceControlMetrics]]]) -> str:
    """Return a Markdown table of the highest true force and what became of the slide, by hazard and undeclared lag."""
    lags = list(next(iter(hazards.values())))
    rows = [[name, *(_hazard_cell(by_lag[lag].values()) for lag in lags)] for name, by_lag in hazards.items()]
    return _table(['hazard, over all stiffnesses', *(f'{1e3 * lag:.0f} ms undeclared lag' for lag in lags)], rows)


def lag_table(lags: Mapping[float, Mapping[float, ForceControlMetrics]]) -> str:
    """Return a Markdown table of the overshoot by stiffness and undeclared lag, in percent."""
    stiffnesses = list(next(iter(lags.values())))
    rows = [
        [f'{1e3 * lag:.0f} ms', *(_cell(trial.overshoot, 100) for trial in trials.values())]
        for lag, trials in lags.items()
    ]
    return _table(['overshoot (%), undeclared lag', *(f'{k:.0f} N/m' for k in stiffnesses)], rows)


def plain_number(row: Mapping[str, Mapping[str, float]], motions: Sequence[str], number: str) -> float:
    """Return a number of the first of the motions that a robot does, NaN if it does none.

    Parameters
    ----------
    row
        Motion → numbers by their names.
    motions
        Names of the motions, the preferred one first.
    number
        Name of the number.

    Returns
    -------
    float
        In the unit of the number.
    """
    return next((row[motion].get(number, np.nan) for motion in motions if motion in row), np.nan)


def _hazard_cell(trials: Iterable[ForceControlMetrics]) -> str:
    tried = list(trials)
    ended = sum(trial.success for trial in tried)
    times = [1e3 * trial.noticed_s for trial in tried if not trial.success and np.isfinite(trial.noticed_s)]
    late = f', at most {max(times):.0f} ms' if times else ''
    outcome = {len(tried): 'success', 0: f'aborts{late}'}.get(ended, f'{ended} of {len(tried)} succeed{late}')
    return f'{max(trial.peak_n for trial in tried):.2f} N, {outcome}'


def _cell(value: float | None, times: float) -> str:
    return '' if value is None else f'{times * value:.2f}'


def _against_target(value: float | None, times: float, target: float | None) -> str:
    missed = value is not None and target is not None and not value <= target
    return f'**{_cell(value, times)}**' if missed else _cell(value, times)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ['---'] * len(head), *rows]
    return ''.join(f'| {" | ".join(cells)} |\n' for cells in lines)
