"""The chart of the ablation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.ablation.variants import (
    SHIPPED,
    WITHIN,
)
from texture_evaluation.charts import COLOURS, chart


def ablation_chart(numbers: Mapping[str, Any], path: Path) -> Path:
    """Draw how the accuracy and the computing time change when a part is left out or changed.

    Parameters
    ----------
    numbers
        Name of the data → figures of its variants.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (10.0, 1.2 + 0.24 * sum(len(own['variants']) for own in numbers.values()))) as figure:
        figure.suptitle(
            'One part left out or changed (BioTac, 20 materials, slides 1-30, a third held out in turn)',
            x=0.02, ha='left', fontweight='bold',
        )  # fmt: skip
        figure.supxlabel(
            f'Orange: as released, and the fastest that is at most {100 * WITHIN:g} point below the best', fontsize=9
        )
        heights = [len(own['variants']) for own in numbers.values()]
        grid = figure.subplots(len(numbers), 2, sharey='row', squeeze=False, height_ratios=heights)
        for (term_effect, cost), (name, own) in zip(grid, numbers.items(), strict=True):
            variants = sorted(own['variants'].items(), key=lambda item: item[1]['held_out'])
            rows = np.arange(len(variants))
            colours = [COLOURS[5 if each in (own['smallest'], SHIPPED) else 0] for each, _ in variants]
            term_effect.barh(rows, [figures['change_points'] for _, figures in variants], color=colours)
            term_effect.set(yticks=rows, yticklabels=[each for each, _ in variants], title=name)
            term_effect.set_xlabel('change of single windows recognised (percentage points)')
            cost.barh(rows, [figures['latency_us'] for _, figures in variants], color=colours)
            cost.set_xlabel('time from window to estimate (µs)')
            cost.set_title('computing time')
    return path
