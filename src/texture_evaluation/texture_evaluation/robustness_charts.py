"""Chart and table of how accuracy falls as one thing gets worse."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texture_evaluation.charts import COLOURS, chart

COLUMNS = 4


@dataclass(frozen=True, eq=False)
class Curve:
    """Share of windows recognised (0 to 1) at each strength, and the strength at which it breaks down, if it does."""

    shares: Sequence[float]
    breakdown: float | None


@dataclass(frozen=True, eq=False)
class Panel:
    """The curves of all recipes for one effect."""

    axis: str
    strengths: Sequence[float]
    curves: Mapping[str, Curve]


def robustness_chart(panels: Mapping[str, Panel], title: str, path: str | Path) -> Path:
    """Draw a panel for each effect, from nothing at the left to worst at the right; a ring is the breakdown point."""
    rows = -(-(len(panels) + 1) // COLUMNS)
    with chart(path, (3.6 * COLUMNS, 3.1 * rows)) as figure:
        figure.suptitle(title, x=0.02, ha='left', fontweight='bold')
        grid = figure.subplots(rows, COLUMNS, sharey=True, squeeze=False).ravel()
        for axes, (effect, panel) in zip(grid, panels.items(), strict=False):
            places = np.arange(len(panel.strengths))
            for (recipe, curve), colour in zip(panel.curves.items(), COLOURS, strict=False):
                shares = 100 * np.array(curve.shares)
                axes.plot(places, shares, marker='.', color=colour, label=recipe)
                if curve.breakdown is not None:
                    place = _place(curve.breakdown, panel.strengths)
                    axes.plot(place, np.interp(place, places, shares), 'o', mfc='none', markersize=9, color=colour)
            axes.set_xticks(places, ['none' if math.isinf(s) else f'{s:g}' for s in panel.strengths], fontsize=7)
            axes.set(title=effect, xlabel=panel.axis, ylim=(0, None))
        for axes in grid[::COLUMNS]:
            axes.set_ylabel('windows recognised (%)')
        for axes in grid[len(panels) :]:
            axes.axis('off')
        handles, names = grid[0].get_legend_handles_labels()
        grid[len(panels)].legend(handles, names, loc='center', title='recipe (ring: below 90 % of nominal)')
    return Path(path)


def robustness_table(panels: Mapping[str, Panel]) -> str:
    """Return the breakdown points in Markdown: a row for each effect, a column for each recipe."""
    recipes = list(next(iter(panels.values())).curves)
    lines = [['effect', 'strength', *recipes], ['---'] * (len(recipes) + 2)]
    lines.append(['none', 'windows recognised', *(_percent(panels, recipe) for recipe in recipes)])
    for effect, panel in panels.items():
        worst = panel.strengths[-1]
        points = [_point(panel.curves[recipe], worst) for recipe in recipes]
        lines.append([effect, panel.axis, *points])
    return '\n'.join(f'| {" | ".join(cells)} |' for cells in lines) + '\n'


def _place(strength: float, strengths: Sequence[float]) -> float:
    """Return where a strength lies between the evenly spaced ones; strengths only rise or only fall."""
    places = np.arange(len(strengths))
    rising = strengths[0] < strengths[-1]
    order = slice(None) if rising else slice(None, None, -1)
    return float(np.interp(strength, np.array(strengths)[order], places[order]))


def _percent(panels: Mapping[str, Panel], recipe: str) -> str:
    return f'{100 * next(iter(panels.values())).curves[recipe].shares[0]:.1f} %'


def _point(curve: Curve, worst: float) -> str:
    return f'not up to {worst:g}' if curve.breakdown is None else f'{curve.breakdown:.3g}'
