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
    """Draw what recognition loses without each part, and what that costs.

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
    with chart(path, (11.0, 0.9 + 0.24 * sum(len(own['variants']) for own in numbers.values()))) as figure:
        figure.suptitle(
            'Change of accuracy and cost by what is left out (BioTac, 20 materials, slides held out of the first 30)',
            x=0.02, ha='left', fontweight='bold',
        )  # fmt: skip
        heights = [len(own['variants']) for own in numbers.values()]
        grid = figure.subplots(len(numbers), 2, sharey='row', squeeze=False, height_ratios=heights)
        for (term_effect, cost), (name, own) in zip(grid, numbers.items(), strict=True):
            variants = sorted(own['variants'].items(), key=lambda item: item[1]['held_out'])
            rows = np.arange(len(variants))
            colours = [COLOURS[5 if each in (own['smallest'], SHIPPED) else 0] for each, _ in variants]
            term_effect.barh(rows, [figures['change_points'] for _, figures in variants], color=colours)
            term_effect.set(yticks=rows, yticklabels=[each for each, _ in variants], title=name)
            term_effect.set_xlabel('single windows recognised, against as shipped (points)')
            cost.barh(rows, [figures['latency_us'] for _, figures in variants], color=colours)
            cost.set_xlabel('time from window to estimate (µs)')
            cost.set_title(f'smallest within {100 * WITHIN:g} point of the best: {own["smallest"]}')
    return path
