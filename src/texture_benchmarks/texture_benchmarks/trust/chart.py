"""Chart of how slides end under disturbances."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.trust.trial import Outcome
from texture_evaluation.charts import COLOURS, chart

RIGHT, UNKNOWN, WRONG = COLOURS[2], '#d9d9d9', COLOURS[5]
LIMIT = 1 / 30  # 2 of 60


def trust_chart(recipes: Mapping[str, Mapping[str, Outcome]], title: str, path: str | Path) -> Path:
    """Draw, by recipe and disturbance, which slides were right, undecided or unknown, and wrong but taken for known.

    Each pair of columns shows the first certain estimate at the left and the end of the slide at the right.
    """
    rows = list(next(iter(recipes.values())))
    with chart(path, (2.9 * len(recipes) + 1.6, 0.22 * len(rows) + 1.4)) as figure:
        figure.suptitle(title, x=0.02, ha='left', fontweight='bold')
        grid = figure.subplots(1, 2 * len(recipes), sharey=True, squeeze=False)[0]
        for number, (recipe, outcomes) in enumerate(recipes.items()):
            early, final = grid[2 * number], grid[2 * number + 1]
            _bars(early, [(o.early_right, o.early_wrong, o.slides) for o in outcomes.values()])
            _bars(final, [(o.final_right, o.final_wrong, o.slides) for o in outcomes.values()])
            early.set(title=recipe, xlabel='first certain (%)')
            final.set(xlabel='end (%)')
        grid[0].set_yticks(np.arange(len(rows)), rows, fontsize=7)
        grid[0].invert_yaxis()
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside lower center', ncols=3)
    return Path(path)


def _bars(axes: Any, counts: list[tuple[int, int, int]]) -> None:
    right, wrong, slides = np.array(counts, dtype=np.float64).T
    shares = {
        'right and known': (100 * right / slides, RIGHT),
        'unknown or undecided': (100 * (slides - right - wrong) / slides, UNKNOWN),
        'wrong and known': (100 * wrong / slides, WRONG),
    }
    left = np.zeros(len(right))
    for name, (share, colour) in shares.items():
        axes.barh(np.arange(len(right)), share, left=left, color=colour, label=name, height=0.8)
        left += share
    axes.axvline(100 * (1 - LIMIT), color='black', linewidth=0.6, linestyle=':')
    axes.set_xlim(0, 100)
    axes.grid(False)
