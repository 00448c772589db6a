"""Chart of how soon textures are recognised by the way the next motion is chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from texture_core.arrays import Array
from texture_evaluation.charts import COLOURS, chart


def slides_chart(
    right: Mapping[str, Array], wanted: Sequence[float], path: str | Path, slides: str = 'simulated'
) -> Path:
    """Draw the accuracy against the number of slides; shaded is one standard deviation between seeds.

    Parameters
    ----------
    right : (n_seeds, n_slides)
        Share of trials that are right, by the way to choose.
    wanted
        Shares that are drawn as lines.
    path
        File that is written.
    slides
        What the slides are, for the title.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (6.4, 4.0), f'Textures recognised after several slides ({slides})') as figure:
        axes = figure.subplots()
        for colour, marker, (name, shares) in zip(COLOURS, 'osvDP', right.items(), strict=False):
            numbers, mean, off = np.arange(1, shares.shape[1] + 1), shares.mean(axis=0), shares.std(axis=0)
            axes.plot(numbers, 100 * mean, color=colour, marker=marker, markersize=5, label=name)
            axes.fill_between(numbers, 100 * (mean - off), 100 * (mean + off), color=colour, alpha=0.2, linewidth=0)
        for share in wanted:
            axes.axhline(100 * share, color='k', linewidth=1, linestyle='--')
        axes.set(xlabel='slides', ylabel='trials with the right texture (%)', xticks=numbers, ylim=(None, 101))
        axes.legend(loc='best', title='next motion')
    return Path(path)
