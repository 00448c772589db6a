"""Grid and table of how slides end under disturbances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.trust.simulated import SIMULATED
from texture_benchmarks.trust.trial import ROWS, UNDISTURBED, Outcome
from texture_evaluation.charts import COLOURS, chart

RIGHT, UNKNOWN, WRONG = COLOURS[2], '#d9d9d9', COLOURS[5]
UNDISTURBED_SIMULATED = 'undisturbed, simulated'
HALF = 0.42  # width of one of the two bars of a strength
Outcomes = Mapping[str, Mapping[str, Outcome]]  # by recipe and row
Ticks = list[tuple[str, str]]  # below a pair of bars, and the row that it shows


def trust_chart(recipes: Outcomes, title: str, path: str | Path) -> Path:
    """Draw one grid: a column for each recipe, a row for each disturbance, a pair of stacked bars for each strength.

    Of each pair the left bar is the first certain estimate, the right one the end of the slide: right and known,
    unknown or undecided, wrong and known.

    Parameters
    ----------
    recipes
        Recipe → disturbance → outcomes of the slides.
    title
        Above the grid.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    panels = grid_panels(list(next(iter(recipes.values()))))
    with chart(path, (3.4 * len(recipes) + 0.8, 0.78 * len(panels) + 1.1)) as figure:
        figure.suptitle(title, x=0.01, ha='left', fontweight='bold', fontsize=9)
        grid = figure.subplots(len(panels), len(recipes), sharey=True, sharex='row', squeeze=False)
        for row, (name, ticks) in zip(grid, panels.items(), strict=True):
            for axes, outcomes in zip(row, recipes.values(), strict=True):
                _bars(axes, ticks, outcomes)
            row[0].set_ylabel(name, rotation=0, ha='right', va='center', fontsize=8)
        for axes, recipe in zip(grid[0], recipes, strict=True):
            axes.set_title(recipe)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside lower center', ncols=3)
    return Path(path)


def trust_table(recipes: Outcomes, allowed: float) -> str:
    """Return the same as a table in Markdown: by row, slides right, unknown, and wrong; more than allowed in bold."""
    rows = next(iter(recipes.values()))
    lines = [
        f'| slides right, unknown, wrong | of | {" | ".join(f"`{name}`, early | at the end" for name in recipes)} |',
        f'| --- | --- |{" --- |" * 2 * len(recipes)}',
    ]
    for row, first in rows.items():
        cells = [
            _cell(right, wrong, first.slides, allowed)
            for outcomes in recipes.values()
            for o in [outcomes[row]]
            for right, wrong in ((o.early_right, o.early_wrong), (o.final_right, o.final_wrong))
        ]
        lines.append(f'| {row} | {first.slides} | {" | ".join(cells)} |')
    return '\n'.join(lines) + '\n'


def _cell(right: int, wrong: int, slides: int, allowed: float) -> str:
    number = f'**{wrong}**' if wrong > allowed * slides + 1e-9 else str(wrong)
    return f'{right}, {slides - right - wrong}, {number}'


def grid_panels(rows: Sequence[str]) -> dict[str, Ticks]:
    """Return what each row of the grid shows, for the rows that were measured.

    Parameters
    ----------
    rows
        Names of the disturbances with their strengths, and of the undisturbed slides.

    Returns
    -------
    dict
        Disturbance → what stands below each pair of bars, and the row that the pair shows.
    """
    panels = {
        row.title: [(row.tick(strength), row.name(strength)) for strength in row.strengths] for row in ROWS.values()
    }
    for name in SIMULATED:
        kind, _, strength = name.removesuffix(', simulated').partition(' × ')
        panels.setdefault('force × …,\nsimulated' if strength else 'motion,\nsimulated', []).append(
            (strength or kind, name)
        )
    measured = {title: [tick for tick in ticks if tick[1] in rows] for title, ticks in panels.items()}
    return {title: _with_undisturbed(title, ticks) for title, ticks in measured.items() if ticks}


def _with_undisturbed(title: str, ticks: Ticks) -> Ticks:
    """Return the strengths with the undisturbed slides: at 1 where strengths are factors, before them elsewhere."""
    clean = UNDISTURBED_SIMULATED if 'simulated' in title else UNDISTURBED
    if '×' not in title:
        return [('none', clean), *ticks]
    return sorted([*ticks, ('1', clean)], key=lambda tick: float(tick[0]))


def _bars(axes: Any, ticks: Ticks, outcomes: Mapping[str, Outcome]) -> None:
    shown = [outcomes[name] for _, name in ticks]
    places = np.arange(len(shown))
    for side, ends in (
        (-1, [(o.early_right, o.early_wrong) for o in shown]),
        (1, [(o.final_right, o.final_wrong) for o in shown]),
    ):
        right, wrong = 100.0 * np.array(ends).T / [o.slides for o in shown]
        at = places + side * HALF / 2
        axes.bar(at, right, HALF, color=RIGHT, label='right and known' if side < 0 else '')
        axes.bar(at, 100 - right - wrong, HALF, right, color=UNKNOWN, label='unknown or undecided' if side < 0 else '')
        axes.bar(at, wrong, HALF, 100 - wrong, color=WRONG, label='wrong and known' if side < 0 else '')
    axes.set_xticks(places, [tick for tick, _ in ticks], fontsize=7)
    axes.set(ylim=(0, 100), yticks=[0, 50, 100])
    axes.tick_params(length=0, pad=1, labelsize=7)
    axes.grid(visible=False)
