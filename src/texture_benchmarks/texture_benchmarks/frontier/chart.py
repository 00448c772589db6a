"""Charts of the frontier."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from pathlib import Path

from texture_benchmarks.frontier.training_costs import Cost, TrainingSize
from texture_core.arrays import Array
from texture_evaluation.charts import COLOURS, chart

AXES = {'windows': 'training windows', 'labels': 'surfaces'}
COSTS = {'seconds': 'computing time of a training (s)', 'mebibytes': 'memory beyond the examples (MiB)'}
MIN_MIB = 0.1  # nothing measurable


def early_chart(
    lines: Mapping[str, tuple[Array, Array]], rule: tuple[float, float], title: str, path: str | Path
) -> Path:
    """Draw the share of slides decided rightly over their mean length, when each ends at a confidence.

    Parameters
    ----------
    lines
        Mean seconds and shares at rising confidences, by name.
    rule
        Mean seconds and share of the stopping rule fitted with the model.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (7.0, 4.6)) as figure:
        axes = figure.subplots()
        for (name, (seconds, shares)), colour in zip(lines.items(), COLOURS, strict=False):
            axes.plot(seconds, 100.0 * shares, marker='.', color=colour, label=name)
        axes.plot(rule[0], 100.0 * rule[1], '*', color='black', markersize=12, label='the fitted rule, every 0.1 s')
        axes.set(xlabel='mean sliding time (s)', ylabel='slides decided rightly (%)', title=title)
        axes.set_xlim(left=0)
        axes.legend(loc='lower right')
    return Path(path)


def size_chart(
    panels: Mapping[str, Mapping[str, Mapping[TrainingSize, Cost]]], fixed: Mapping[str, str], path: str | Path
) -> Path:
    """Draw time and memory of trainings over their size, a line for each learner.

    Parameters
    ----------
    panels
        What grows, 'windows' or 'labels' → learner → costs by size.
    fixed
        What is fixed meanwhile, in words.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (10.0, 7.6)) as figure:
        figure.suptitle('Cost of a training by its size (artificial examples)', x=0.02, ha='left', fontweight='bold')
        grid = figure.subplots(2, 2)
        for axes, (cost, axis) in zip(grid.ravel(), product(COSTS, AXES), strict=True):
            for (learner, found), colour in zip(panels[axis].items(), COLOURS, strict=False):
                x = [getattr(size, axis) for size in found]
                y = [max(getattr(item, cost), MIN_MIB if cost == 'mebibytes' else 0.0) for item in found.values()]
                axes.loglog(x, y, marker='.', color=colour, label=learner)
            axes.set(xlabel=f'{AXES[axis]} ({fixed[axis]})', ylabel=COSTS[cost])
        grid[0, 0].legend(loc='best')
    return Path(path)
