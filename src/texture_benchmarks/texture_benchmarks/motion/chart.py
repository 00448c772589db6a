"""Charts and tables of force control: what is kept on which surface, and where it is stable."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.motion.tables import plain_number
from texture_benchmarks.motion.trial import ForceControlMetrics
from texture_core.arrays import Array
from texture_evaluation.charts import COLOURS, chart

MARKERS = 'o^vsDP'
TICKS = (0.2, 2, 20)

STRAIGHT = ('linear_slide', 'in_hand_sliding')

# What is drawn of each robot: motions (the first that it does), number, what it is called, in what unit times how much.
PANELS = (
    (STRAIGHT, 'force_rms', 'force error, rms (%)', 100),
    (STRAIGHT, 'overshoot', 'overshoot of the force (%)', 100),
    (('circular',), 'speed_error', 'largest speed error on the circle (%)', 100),
    (('circular',), 'radius_error_m', 'largest error of the radius (mm)', 1000),
)


def hazard_chart(
    lags: Mapping[float, Mapping[float, ForceControlMetrics]],
    hazards: Mapping[str, Mapping[float, Mapping[float, ForceControlMetrics]]],
    targets: Mapping[str, float],
    path: str | Path,
) -> Path:
    """Draw the overshoot over the stiffness, a line for each undeclared lag, and the highest force of each hazard.

    Parameters
    ----------
    lags
        Undeclared lag in s → stiffness in N/m → what came out.
    hazards
        Hazard → stiffness in N/m → what came out.
    targets
        Limits that are drawn, by their names.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(
        path, (11.0, 5.2), 'An arm without a force mode, 1 N at 0.05 m/s: undeclared lag, and hazards'
    ) as figure:
        left, right = figure.subplots(1, 2)
        for (lag, trials), colour, marker in zip(lags.items(), COLOURS, MARKERS, strict=False):
            kilo = np.array(list(trials)) / 1000
            shares = [100 * trial.overshoot for trial in trials.values()]
            left.semilogx(kilo, shares, color=colour, marker=marker, markersize=4, label=f'{1e3 * lag:.0f} ms')
        left.axhline(100 * targets['overshoot'], color='black', linestyle='--', linewidth=1)
        left.set(title='overshoot of the force (%)', xlabel='stiffness of the contact (kN/m)')
        left.set(xticks=TICKS, xticklabels=map(str, TICKS))
        left.legend(title='undeclared lag', loc='center left')
        names = list(hazards)
        rows = np.arange(len(names))
        for number, (lag, colour) in enumerate(zip(lags, COLOURS, strict=False)):
            peaks = [max(trial.peak_n for trial in hazards[name][lag].values()) for name in names]
            right.barh(rows + 0.2 * (number - 1.5), peaks, height=0.2, color=colour)
        right.set(title='highest true force, worst stiffness (N)', yticks=rows, yticklabels=names)
        right.invert_yaxis()
    return Path(path)


def robot_chart(robots: Mapping[str, Mapping[str, Any]], targets: Mapping[str, float], path: str | Path) -> Path:
    """Draw how each robot kept force, speed and circle over the stiffness; `robots` is as in the JSON of the bench.

    Parameters
    ----------
    robots
        Robot → figures by stiffness.
    targets
        Limits that are drawn, by their names.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(
        path, (9.0, 6.4), 'Flat surfaces, 1 N: straight at 0.05 m/s (the hand 0.02), circle of 20 mm at 0.1 m/s'
    ) as figure:
        panels = list(figure.subplots(2, 2).flat)
        for axes, (motions, number, name, times) in zip(panels, PANELS, strict=True):
            highest = times * targets[number]
            for (robot, by_stiffness), colour, marker in zip(robots.items(), COLOURS, MARKERS, strict=False):
                kilo = [float(stiffness.split()[0]) / 1000 for stiffness in by_stiffness]
                values = [times * plain_number(row, motions, number) for row in by_stiffness.values()]
                axes.semilogx(kilo, values, color=colour, marker=marker, label=robot)
                highest = max(highest, *values) if np.isfinite(values).all() else highest
            axes.axhline(times * targets[number], color='black', linestyle='--', linewidth=1)
            axes.set(title=name, xlabel='stiffness of the contact (kN/m)', xticks=TICKS, xticklabels=map(str, TICKS))
            axes.set_ylim(top=1.15 * highest)
        figure.legend(*panels[0].get_legend_handles_labels(), loc='outside lower center', ncols=3)
    return Path(path)


def surface_chart(
    surfaces: Mapping[str, Mapping[float, ForceControlMetrics]], targets: Mapping[str, float], path: str | Path
) -> Path:
    """Draw force and speed errors over stiffness, a line for each surface.

    Parameters
    ----------
    surfaces
        Surface → stiffness in N/m → what came out.
    targets
        Limits that are drawn, by their names.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (9.0, 4.4), 'An arm without a force mode over simulated surfaces: 1 N, 0.05 m/s') as figure:
        force, speed = figure.subplots(1, 2)
        for (name, trials), colour, marker in zip(surfaces.items(), COLOURS, MARKERS, strict=False):
            kilo = np.array(list(trials)) / 1000
            for axes, errors in (
                (force, [trial.force_rms for trial in trials.values()]),
                (speed, [trial.speed_error for trial in trials.values()]),
            ):
                axes.semilogx(kilo, 100 * np.array(errors), color=colour, marker=marker, markersize=4, label=name)
        for axes, number, title in (
            (force, 'force_rms', 'force error, rms (%)'),
            (speed, 'speed_error', 'largest speed error in space (%)'),
        ):
            axes.axhline(100 * targets[number], color='black', linestyle='--', linewidth=1)
            axes.set(title=title, xlabel='stiffness of the contact (kN/m)', ylim=(0, None))
            axes.set(xticks=TICKS, xticklabels=map(str, TICKS))
        force.legend(loc='best')
    return Path(path)


def border_chart(border: Mapping[str, Array], chosen: Array, path: str | Path) -> Path:
    """Draw the gain from which the loop is unstable over its delay, predicted and simulated, and the chosen gains.

    Parameters
    ----------
    border
        See `texture_exploration.stability.stability_chart`.
    chosen : (n_stiffnesses, n_delays)
        Gains in m/s/N.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (8.0, 5.0)) as figure:
        axes = figure.subplots()
        delay_ms = 1000 * border['delay_s']
        rows = zip(border['stiffness_n_m'], border['predicted'], border['simulated'], chosen, COLOURS, strict=False)
        for stiffness, predicted, simulated, gains, colour in rows:
            axes.semilogy(delay_ms, predicted, color=colour, label=f'{stiffness / 1000:g} kN/m')
            axes.semilogy(delay_ms, simulated, '.', color=colour)
            axes.semilogy(delay_ms, gains, ':', color=colour)
        axes.set(
            xlabel='delay of the loop (ms)',
            ylabel='gain (m/s per N)',
            title='Stability limit of the force control at 250 Hz: eigenvalues (lines), simulation (dots)\n'
            'Dotted: the gain that the controller chooses',
        )
        axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5), title='stiffness')
    return Path(path)
