"""Table of how much each recipe withstands as one thing gets worse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

KEPT = 0.9  # of the accuracy without degradation: below it, a recipe has broken down
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


def _point(curve: Curve) -> str:
    return NOT_BROKEN if curve.breakdown is None else f'{curve.breakdown:.3g}'
