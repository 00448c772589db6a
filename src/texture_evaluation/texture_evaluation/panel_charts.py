"""The two pictures of a human panel: votes per grade, and mean with standard deviation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray
from texture_estimation.roughness.ratings import GRADES, Ratings
from texture_evaluation.charts import COLOURS, chart

MIN_SHARE = 4 / 30  # the paper leaves out grades that got fewer than 4 of 30 votes
MANY = 40  # more textures than this: small names
LARGEST_DOT = 220.0


def votes_chart(ratings: Ratings, path: str | Path) -> Path:
    """Draw how many people gave each texture each grade, textures from smooth to rough (the paper's Fig. 3)."""
    order = np.argsort(ratings.means, kind='stable')
    votes = ratings.votes[order]
    least = max(1, round(MIN_SHARE * len(ratings.raters)))
    with chart(path, _size(ratings)) as figure:
        axes = figure.subplots()
        texture, grade = np.nonzero(votes >= least)
        numbers = votes[texture, grade]
        axes.scatter(
            texture, GRADES[grade], s=LARGEST_DOT * numbers / len(ratings.raters), color=COLOURS[0], alpha=0.8, zorder=3
        )
        axes.scatter(np.arange(len(order)), ratings.means[order], marker='_', color=COLOURS[5], s=80, zorder=4)
        _axes(axes, ratings, order)
        hidden = f', fewer than {least} are not shown' if least > 1 else ''
        axes.set_title(f'Votes per grade of {len(ratings.raters)} people: larger dots have more{hidden}; lines: means')
    return Path(path)


def deviations_chart(ratings: Ratings, path: str | Path) -> Path:
    """Draw mean grade plus and minus one standard deviation over the people (the paper's Fig. 4)."""
    order = np.argsort(ratings.means, kind='stable')
    means, deviations = ratings.means[order], np.nan_to_num(ratings.deviations[order])
    with chart(path, _size(ratings)) as figure:
        axes = figure.subplots()
        places = np.arange(len(order))
        axes.bar(places, 2 * deviations, bottom=means - deviations, width=0.6, color=COLOURS[4], zorder=2)
        axes.scatter(places, means, marker='_', color=COLOURS[0], s=80, zorder=3)
        _axes(axes, ratings, order)
        axes.set_title(f'Grade of {len(ratings.raters)} people: mean ± standard deviation')
    return Path(path)


def _axes(axes: Any, ratings: Ratings, order: AnyArray) -> None:
    names = [ratings.textures[index] for index in order]
    small = len(names) > MANY
    axes.set_xticks(range(len(names)), names, rotation=90, fontsize=5 if small else 8)
    axes.set(xlabel='texture, from smooth to rough', ylabel='roughness grade (1 to 5)', ylim=(0.5, 5.5), yticks=GRADES)
    axes.set_xlim(-0.8, len(names) - 0.2)
    axes.grid(visible=False, axis='x')


def _size(ratings: Ratings) -> tuple[float, float]:
    return max(7.0, 0.13 * len(ratings.textures)), 4.2
