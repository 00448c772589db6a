"""Charts of genetic searches: how they converge, and the front of accuracy and computing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path

from texture_estimation.search.generation import Generation
from texture_evaluation.charts import COLOURS, chart, line_styles, pareto_front

NAMED = 10  # lines of more searches than this are not named


def convergence_chart(searches: Mapping[str, Sequence[Generation]], title: str, path: str | Path) -> Path:
    """Draw the fitness of the best individual over the generations, a line for each search.

    Parameters
    ----------
    searches
        Name of the search → its generations.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
    """
    with chart(path, (7.5, 4.2), title) as figure:
        axes = figure.subplots()
        for (name, history), style in zip(searches.items(), cycle(line_styles()), strict=False):
            best = [100 * one.best.fitness for one in history]
            label = name if len(searches) <= NAMED else None
            axes.step([one.number for one in history], best, where='mid', label=label, **style)
        axes.set(xlabel='generation', ylabel='fitness of the best individual (%)')
        if len(searches) <= NAMED:
            axes.legend(loc='lower right')
    return Path(path)


def search_front_chart(fronts: Mapping[str, Sequence[tuple[float, float]]], title: str, path: str | Path) -> Path:
    """Draw the recipes of each search by cost and fitness, and the front that none of them betters.

    Parameters
    ----------
    fronts
        Name of the search → (operations of a window, fitness from 0 to 1) of each recipe.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
    """
    with chart(path, (7.5, 4.2), title) as figure:
        axes = figure.subplots()
        for number, (name, points) in enumerate(fronts.items()):
            colour = COLOURS[number % len(COLOURS)]
            best = [points[index] for index in pareto_front(points)]
            axes.plot([cost for cost, _ in points], [100 * share for _, share in points], '.', color=colour)
            axes.step(
                [cost for cost, _ in best], [100 * share for _, share in best],
                where='post', color=colour, linewidth=1, label=name,
            )  # fmt: skip
        axes.set(xscale='log', xlabel='operations from the samples of a window to the decision', ylabel='fitness (%)')
        axes.legend(loc='lower right')
    return Path(path)
