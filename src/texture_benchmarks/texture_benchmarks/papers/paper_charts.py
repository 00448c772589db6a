"""Pictures of a rebuilt experiment beside the paper's figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.papers.interval import Interval
from texture_core.arrays import AnyArray
from texture_evaluation.charts import COLOURS, chart


def accuracy_chart(
    panels: Mapping[str, Mapping[str, tuple[float | None, Interval]]], title: str, path: str | Path
) -> Path:
    """Draw the share of test slides recognised by each method: the paper's as a cross, the simulated with its interval.

    Parameters
    ----------
    panels
        Task → method → the paper's share, if it tells, and the simulated one.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    heights = [len(methods) + 1 for methods in panels.values()]
    with chart(path, (7.0, 1.2 + 0.3 * sum(heights)), title) as figure:
        rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
        for axes, (task, methods) in zip(rows, panels.items(), strict=True):
            _bars(axes, methods)
            axes.set_title(task)
        rows[-1].set_xlabel('test slides recognised (%)')
        rows[0].legend(loc='lower left', bbox_to_anchor=(0.5, 1.0), ncols=2)
    return Path(path)


def confusions_chart(
    tables: Mapping[str, tuple[Sequence[str], AnyArray, AnyArray]], title: str, path: str | Path
) -> Path:
    """Draw tables of confusion: the paper's on the left, the simulated on the right, in % of each row.

    Parameters
    ----------
    tables
        Method → surfaces, and two tables of shares with a last column for what is unclassified.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    side = 2.2 + 0.3 * max(len(surfaces) for surfaces, _, _ in tables.values())
    with chart(path, (2.0 * side + 1.5, side * len(tables)), title) as figure:
        rows = figure.subplots(len(tables), 2, squeeze=False)
        for (left, right), (name, (surfaces, theirs, ours)) in zip(rows, tables.items(), strict=True):
            _table(left, surfaces, theirs)
            _table(right, surfaces, ours)
            left.set_title(f'{name}: paper')
            right.set_title(f'{name}: simulated')
    return Path(path)


def _bars(axes: Any, methods: Mapping[str, tuple[float | None, Interval]]) -> None:
    at = np.arange(len(methods))
    ours = [interval for _, interval in methods.values()]
    values = 100 * np.array([interval.value for interval in ours])
    reach = 100 * np.array([[i.value - i.low for i in ours], [i.high - i.value for i in ours]])
    axes.errorbar(values, at, xerr=reach, fmt='o', markersize=4, color=COLOURS[0], label='simulated, 95 % interval')
    reported = [
        (100 * paper, place) for place, (paper, _) in zip(at, methods.values(), strict=True) if paper is not None
    ]
    axes.plot(*zip(*reported, strict=True), 'x', color=COLOURS[5], label='paper') if reported else None
    axes.set_yticks(at, list(methods))
    axes.set(ylim=(len(methods) - 0.4, -0.6))


def _table(axes: Any, surfaces: Sequence[str], table: AnyArray) -> None:
    percent = 100 * np.asarray(table)
    axes.imshow(percent, cmap='Blues', vmin=0, vmax=100)
    axes.grid(visible=False)
    axes.set_xticks(range(percent.shape[1]), [*surfaces, 'unclassified'], rotation=90)
    axes.set_yticks(range(len(surfaces)), surfaces)
    axes.set(xlabel='taken for', ylabel='surface')
    for row, column in np.argwhere(percent >= 0.5):
        value = percent[row, column]
        axes.text(column, row, f'{value:.0f}', ha='center', va='center', fontsize=7,
                  color='white' if value > 60 else 'black')  # fmt: skip
