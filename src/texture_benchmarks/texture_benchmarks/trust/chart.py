"""Chart and table of how slides end under disturbances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.trust.trial import Outcome
from texture_core.arrays import Array
from texture_evaluation.charts import COLOURS, chart

RIGHT, UNKNOWN, WRONG = COLOURS[2], '#d9d9d9', COLOURS[5]
GAP = 0.7  # between two kinds of disturbance, in rows
Outcomes = Mapping[str, Mapping[str, Outcome]]  # by recipe and row


def trust_chart(recipes: Outcomes, title: str, path: str | Path) -> Path:
    """Draw, by recipe and disturbance, which slides were right, undecided or unknown, and wrong but taken for known.

    Each pair of columns shows the first certain estimate at the left and the end of the slide at the right.

    Parameters
    ----------
    recipes
        Recipe → disturbance → outcomes of the slides.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    rows = list(next(iter(recipes.values())))
    places = _places(rows)
    with chart(path, (3.0 * len(recipes) + 2.0, 0.17 * float(places[-1]) + 1.5)) as figure:
        figure.suptitle(title, x=0.01, ha='left', fontweight='bold', fontsize=9)
        grid = figure.subplots(1, 2 * len(recipes), sharey=True, squeeze=False)[0]
        for number, (recipe, outcomes) in enumerate(recipes.items()):
            early, final = grid[2 * number], grid[2 * number + 1]
            _bars(early, places, [(o.early_right, o.early_wrong, o.slides) for o in outcomes.values()])
            _bars(final, places, [(o.final_right, o.final_wrong, o.slides) for o in outcomes.values()])
            early.set(title=recipe, xlabel='first certain\n(% of slides)')
            final.set(xlabel='at the end\n(% of slides)')
        grid[0].set_yticks(places, rows, fontsize=8)
        grid[0].invert_yaxis()
        grid[0].margins(y=0.01)
        handles, labels = grid[0].get_legend_handles_labels()
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


def _places(rows: Sequence[str]) -> Array:
    """Return the height of each row, (n_rows,), with a gap wherever another kind of disturbance begins."""
    kinds = [row.partition(' ')[0] for row in rows]
    return np.cumsum([0.0, *(1.0 + GAP * (one != other) for one, other in pairwise(kinds))])


def _bars(axes: Any, places: Array, counts: Sequence[tuple[int, int, int]]) -> None:
    right, wrong, slides = np.array(counts, dtype=np.float64).T
    shares = {
        'right and known': (100 * right / slides, RIGHT),
        'unknown or undecided': (100 * (slides - right - wrong) / slides, UNKNOWN),
        'wrong and known': (100 * wrong / slides, WRONG),
    }
    left = np.zeros(len(right))
    for name, (share, colour) in shares.items():
        axes.barh(places, share, left=left, color=colour, label=name, height=0.9)
        left += share
    axes.set_xlim(0, 100)
    axes.set_xticks([0, 50, 100])
    axes.tick_params(axis='y', length=0)
    axes.grid(False)
