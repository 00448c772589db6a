"""Charts and tables of how accuracy falls as one thing gets worse."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_evaluation.charts import COLOURS, chart

KEPT = 0.9  # of the accuracy without degradation: below it, a recipe has broken down
NETWORKS, MACHINES = '-ann', '-svm'  # drawn in one colour where they differ in nothing else
NOT_BROKEN = '–'


@dataclass(frozen=True, eq=False)
class Curve:
    """Share of windows recognised (0 to 1) at each strength, and the strength at which it breaks down, if it does."""

    shares: Sequence[float]
    breakdown: float | None


@dataclass(frozen=True, eq=False)
class Panel:
    """The curves of all recipes for one effect.

    Parameters
    ----------
    axis
        What the strength is, with its unit.
    strengths
        From none to the worst; they only rise or only fall.
    curves
        By recipe.
    slides
        What was degraded: 'recorded' or 'simulated'.
    """

    axis: str
    strengths: Sequence[float]
    curves: Mapping[str, Curve]
    slides: str


def robustness_chart(effect: str, panel: Panel, families: Mapping[str, Sequence[str]], path: str | Path) -> Path:
    """Draw one effect, from nothing at the left to worst at the right, the recipes of each family beside each other.

    A curve ends in a ring where it breaks down; what comes after is drawn faintly.

    Parameters
    ----------
    effect
        Name of the effect.
    panel
        Curves of all recipes.
    families
        Family → recipes that are drawn beside each other.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    title = f'{effect.capitalize()}: single windows recognised as it grows, {panel.slides} slides'
    with chart(path, (3.9 * len(families), 4.4)) as figure:
        figure.suptitle(f'{title} (ring: below {100 * KEPT:.0f} % of nominal)', x=0.02, ha='left', fontweight='bold')
        row = figure.subplots(1, len(families), sharey=True, squeeze=False)[0]
        for axes, (family, recipes) in zip(row, families.items(), strict=True):
            _curves(axes, panel, recipes)
            axes.set(title=family, xlabel=panel.axis)
            axes.legend(loc='upper center', bbox_to_anchor=(0.5, -0.18), ncols=2, fontsize=8)
        row[0].set_ylabel('windows recognised (%)')
        row[0].set_ylim(bottom=0)
    return Path(path)


def robustness_tables(panels: Mapping[str, Panel]) -> str:
    """Return the breakdown points in Markdown: a table for each kind of slides, a row for each recipe."""
    kinds = dict.fromkeys(panel.slides for panel in panels.values())
    tables = [_table(kind, {name: panel for name, panel in panels.items() if panel.slides == kind}) for kind in kinds]
    return '\n'.join(tables)


def _table(kind: str, panels: Mapping[str, Panel]) -> str:
    nominal = next(iter(panels.values()))
    rows = [
        [f'{kind} slides', 'windows recognised', *panels],
        ['---'] * (len(panels) + 2),
        ['strength', 'without degradation', *(panel.axis for panel in panels.values())],
        ['tried up to', '', *(f'{panel.strengths[-1]:g}' for panel in panels.values())],
    ]
    for recipe in sorted(nominal.curves, key=lambda recipe: -nominal.curves[recipe].shares[0]):
        points = (_point(panel.curves[recipe]) for panel in panels.values())
        rows.append([f'`{recipe}`', f'{100 * nominal.curves[recipe].shares[0]:.1f} %', *points])
    return ''.join(f'| {" | ".join(cells)} |\n' for cells in rows)


def _curves(axes: Any, panel: Panel, recipes: Sequence[str]) -> None:
    places = np.arange(len(panel.strengths))
    kinds = list(dict.fromkeys(recipe.replace(NETWORKS, MACHINES) for recipe in recipes))
    for recipe in recipes:
        style = {
            'color': COLOURS[kinds.index(recipe.replace(NETWORKS, MACHINES)) % len(COLOURS)],
            'linestyle': '--' if NETWORKS in recipe else '-',
        }
        curve = panel.curves[recipe]
        shares = 100 * np.array(curve.shares)
        axes.plot(places, shares, alpha=0.25, linewidth=1, **style)
        end = places[-1] if curve.breakdown is None else _place(curve.breakdown, panel.strengths)
        kept = np.append(places[places < end], end)
        axes.plot(kept, np.interp(kept, places, shares), label=recipe, **style)
        if curve.breakdown is not None:
            axes.plot(end, np.interp(end, places, shares), 'o', mfc='none', markersize=8, color=style['color'])
    axes.set_xticks(places, ['none' if math.isinf(s) else f'{s:g}' for s in panel.strengths], fontsize=7)


def _place(strength: float, strengths: Sequence[float]) -> float:
    """Return where a strength lies between the evenly spaced ones; strengths only rise or only fall."""
    places = np.arange(len(strengths))
    rising = strengths[0] < strengths[-1]
    order = slice(None) if rising else slice(None, None, -1)
    return float(np.interp(strength, np.array(strengths)[order], places[order]))


def _point(curve: Curve) -> str:
    return NOT_BROKEN if curve.breakdown is None else f'{curve.breakdown:.3g}'
