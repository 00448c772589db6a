"""Pictures of estimated grades beside those of people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_evaluation.charts import COLOURS, chart

SHADES = {'training': COLOURS[2], 'unseen': COLOURS[0]}  # green and blue as in the paper
NORMAL_90 = 1.6449


@dataclass(frozen=True, eq=False)
class Series:
    """Textures with the human grade, the mean and standard deviation of the estimates, and the interval claimed."""

    textures: tuple[str, ...]
    human: Array
    mean: Array
    std: Array
    interval_std: Array

    @classmethod
    def of(cls, table: Mapping[str, Mapping[str, float]]) -> Series:
        """Return the series of a table by texture."""
        columns = [np.array([row[name] for row in table.values()]) for name in ('human', 'mean', 'std', 'interval_std')]
        return cls(tuple(table), *columns)


def grades_chart(
    panels: Mapping[str, Mapping[str, Series]], textures: Sequence[str], title: str, path: str | Path
) -> Path:
    """Draw the estimates of each texture beside its human grade, a panel for each head (the paper's Fig. 7).

    The thick bar is one standard deviation over the windows, the thin one the 90 % interval of a window.

    Parameters
    ----------
    panels
        Regressor → name of the series → its estimates.
    textures
        Labels, in the order of their human grades.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    human = {name: grade for series in panels.values() for s in series.values()
             for name, grade in zip(s.textures, s.human, strict=True)}  # fmt: skip
    order = sorted(textures, key=lambda name: (human[name], list(textures).index(name)))
    place = {name: index for index, name in enumerate(order)}
    with chart(path, (0.36 * len(order) + 2.0, 2.9 * len(panels) + 1.0), title) as figure:
        rows = figure.subplots(len(panels), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for axes, (name, series) in zip(rows, panels.items(), strict=True):
            axes.scatter(range(len(order)), [human[texture] for texture in order], marker='_', s=160,
                         color=COLOURS[5], label='people', zorder=4)  # fmt: skip
            for kind, one in series.items():
                _bars(axes, one, place, kind)
            axes.set(title=name, ylabel='grade (1 to 5)', ylim=(0.2, 5.8), yticks=range(1, 6))
            axes.legend(loc='upper left', ncols=3)
        rows[-1].set_xticks(range(len(order)), order, rotation=90)
        rows[-1].set_xlabel('texture, from smooth to rough for people')
    return Path(path)


def coverage_chart(nominal: Array, covered: Array, title: str, path: str | Path) -> Path:
    """Draw the share of grades within the intervals over the share claimed.

    Parameters
    ----------
    nominal, covered : (n,)
        Share claimed and share found, 0 to 1.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (5.2, 4.6)) as figure:
        axes = figure.subplots()
        axes.plot([45, 100], [45, 100], color=COLOURS[6], linewidth=0.8, linestyle='--', label='exact coverage')
        axes.plot(100 * nominal, 100 * covered, marker='o', color=COLOURS[0], label='unseen textures')
        axes.set(xlabel='interval claimed (%)', ylabel='grades of people within it (%)', xlim=(45, 100), ylim=(30, 101))
        axes.set_title(title, fontsize=8)
        axes.legend(loc='upper left')
    return Path(path)


def _bars(axes: Any, series: Series, place: Mapping[str, int], kind: str) -> None:
    at = [place[name] for name in series.textures]
    half = NORMAL_90 * series.interval_std
    axes.errorbar(at, series.mean, yerr=half, fmt='none', color=SHADES[kind], linewidth=0.8, alpha=0.6, zorder=2)
    axes.errorbar(at, series.mean, yerr=series.std, fmt='o', markersize=4, color=SHADES[kind], linewidth=3,
                  alpha=0.85, label=kind, zorder=3)  # fmt: skip
