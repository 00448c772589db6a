"""Draw cross-validated recipes beside each other: shares with their intervals, and slides over sliding time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_evaluation.charts import COLOURS, chart, line_styles
from texture_evaluation.cross_validation.cross_validation import CrossValidation
from texture_evaluation.metrics import curve

KINDS = (('window', 'single windows', 'o'), ('slide', 'whole slides', 's'))


def comparison_chart(results: Sequence[CrossValidation], title: str, path: str | Path) -> Path:
    """Draw the shares of windows and slides that are right with 95 % intervals, and how slides do over their time.

    Parameters
    ----------
    results
        One for each recipe.
    title
        What was split, and how.
    path
        File of the picture.

    Returns
    -------
    Path
    """
    with chart(path, (10.0, 2.4 + 0.5 * len(results)), title) as figure:
        shares, times = figure.subplots(1, 2)
        _draw_shares(shares, results)
        for result, style in zip(results, line_styles(), strict=False):
            seconds, accuracy = curve(result.pooled)
            times.plot(seconds, 100 * accuracy, label=result.recipe, marker='.', **style)
        times.set(xlabel='sliding time used (s)', ylabel='slides recognised (%)', xlim=(0, None), ylim=(None, 101))
        times.legend(loc='best')
    return Path(path)


def _draw_shares(axes: Any, results: Sequence[CrossValidation]) -> None:
    figures = [result.as_json() for result in results]
    rows = np.arange(len(results))
    for (kind, name, marker), colour, offset in zip(KINDS, COLOURS, (-0.12, 0.12), strict=False):
        shares = 100 * np.array([one[f'{kind}_accuracy'] for one in figures])
        edges = 100 * np.array([one[f'{kind}_accuracy_interval'] for one in figures]).T
        errors = np.maximum([shares - edges[0], edges[1] - shares], 0.0)
        axes.errorbar(
            shares, rows + offset, xerr=errors, fmt=marker, color=colour, capsize=3, label=f'{name}, 95 % interval'
        )
    axes.set_yticks(rows, [result.recipe for result in results])
    axes.set(xlabel='right (%)', xlim=(None, 101), ylim=(len(results) - 0.5, -0.5))
    axes.legend(loc='best')
