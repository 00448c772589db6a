"""Charts of force control: what is kept on which surface, and where it is stable."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_evaluation.charts import COLOURS, chart
from texture_exploration.force_trials import Trial

MARKERS = 'o^vsD'


# What is drawn of each robot: motion, number, what it is called, and in what unit times how much.
PANELS = (
    ('linear_slide', 'force_rms', 'force error, rms (%)', 100),
    ('linear_slide', 'overshoot', 'overshoot of the force (%)', 100),
    ('circular', 'speed_error', 'largest speed error on the circle (%)', 100),
    ('circular', 'radius_error_m', 'largest error of the radius (mm)', 1000),
)


def robot_chart(robots: Mapping[str, Mapping[str, Any]], targets: Mapping[str, float], path: str | Path) -> Path:
    """Draw how each robot kept force, speed and circle over the stiffness; `robots` is as in the JSON of the bench."""
    with chart(path, (9.0, 6.4)) as figure:
        figure.suptitle(
            'Flat surfaces, 1 N: straight at 0.05 m/s, circle of 20 mm at 0.1 m/s', x=0.02, ha='left', fontweight='bold'
        )
        for axes, (motion, number, name, times) in zip(figure.subplots(2, 2).flat, PANELS, strict=True):
            for (robot, by_stiffness), colour, marker in zip(robots.items(), COLOURS, MARKERS, strict=False):
                kilo = [float(stiffness.split()[0]) / 1000 for stiffness in by_stiffness]
                values = [times * row[motion].get(number, np.nan) for row in by_stiffness.values()]
                axes.semilogx(kilo, values, color=colour, marker=marker, label=robot)
            axes.axhline(times * targets[number], color='black', linestyle='--', linewidth=1)
            axes.set(title=name, xlabel='stiffness of the contact (kN/m)')
            axes.set_ylim(top=1.15 * times * targets[number])
        figure.legend(*axes.get_legend_handles_labels(), loc='outside lower center', ncols=len(robots))
    return Path(path)


def surface_chart(surfaces: Mapping[str, Mapping[float, Trial]], target: float, path: str | Path) -> Path:
    """Draw force and speed errors over stiffness, a line for each surface."""
    with chart(path, (9.0, 4.4)) as figure:
        figure.suptitle(
            'An arm without a force mode over simulated surfaces: 1 N, 0.05 m/s', x=0.02, ha='left', fontweight='bold'
        )
        force, speed = figure.subplots(1, 2)
        for (name, trials), colour, marker in zip(surfaces.items(), COLOURS, MARKERS, strict=False):
            kilo = np.array(list(trials)) / 1000
            for axes, errors in (
                (force, [trial.force_rms for trial in trials.values()]),
                (speed, [trial.speed_error for trial in trials.values()]),
            ):
                axes.semilogx(kilo, 100 * np.array(errors), color=colour, marker=marker, markersize=4, label=name)
                axes.set_xlabel('stiffness of the contact (kN/m)')
        force.axhline(100 * target, color='black', linestyle='--', linewidth=1)
        force.set(title='force error, rms (%)', ylim=(0, None))
        speed.set(title='largest speed error (%): it follows exactly', ylim=(-0.05, 2.0))
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
            title='Force control at 250 Hz is unstable above the lines: eigenvalues (lines), simulation (dots)\n'
            'The gains that are chosen by themselves are dotted',
        )
        axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5), title='stiffness')
    return Path(path)
