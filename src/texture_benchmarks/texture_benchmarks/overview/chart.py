"""Picture of accuracy against time, with names at the lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from texture_evaluation.charts import COLOURS, chart

OURS, PAPERS, PEERS = 'this suite', 'recipes of the papers', 'general classifiers of time series'
STYLES: Mapping[str, dict[str, Any]] = {
    OURS: {'color': COLOURS[0], 'linewidth': 2.2},
    PAPERS: {'color': '#8c8c8c', 'linewidth': 1.2},
    PEERS: {'color': COLOURS[5], 'linewidth': 1.2, 'linestyle': '--'},
}
TICKS_S = (0.5, 1.0, 2.0, 3.0, 5.0)
LINE = 4.6  # least distance of two names, in percent of the slides


@dataclass(frozen=True)
class AccuracyCurve:
    """How often a method is right over time.

    Parameters
    ----------
    name
        At its line.
    kind
        A key of STYLES.
    seconds, shares : (n,)
        Time from first touch to decision, with computing, and share of slides that are right then, 0 to 1.
    ends
        Mean time and share right when each slide ends as soon as it is certain; None where it does not.
    """

    name: str
    kind: str
    seconds: Sequence[float]
    shares: Sequence[float]
    ends: tuple[float, float] | None = None


def overview_chart(methods: Sequence[AccuracyCurve], path: str | Path) -> Path:
    """Draw all methods, each named at the left end of its line.

    Parameters
    ----------
    methods
        What is drawn.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (8.0, 5.4), 'Slides recognised over the time since the finger began to slide') as figure:
        axes = figure.subplots()
        for each in methods:
            axes.plot(each.seconds, [100 * share for share in each.shares], **STYLES[each.kind])
            if each.ends:
                axes.plot(each.ends[0], 100 * each.ends[1], '*', color=COLOURS[0], markersize=13)
                axes.annotate('ends when certain', each.ends, (each.ends[0] * 0.98, 103.0), fontsize=8, ha='center')
        for each, height in zip(methods, spread_heights([100 * each.shares[0] for each in methods]), strict=True):
            style = {'color': STYLES[each.kind]['color'], 'weight': 'bold' if each.kind == OURS else 'normal'}
            axes.text(0.475, height, each.name, ha='right', va='center', fontsize=8.5, **style)
        for kind, style in STYLES.items():
            if any(each.kind == kind for each in methods):
                axes.plot([], [], label=kind, **style)
        axes.set(xscale='log', xlim=(0.25, 6.3), ylim=(0, 107), ylabel='slides recognised (%)')
        axes.set_xlabel('time from first touch to decision, with computing (s)')
        axes.set_xticks(TICKS_S, [f'{seconds:g}' for seconds in TICKS_S])
        axes.minorticks_off()
        axes.legend(loc='lower right')
    return Path(path)


def spread_heights(wanted: Sequence[float]) -> list[float]:
    """Return heights near those wanted, in the same order, at least LINE apart.

    Parameters
    ----------
    wanted : (n,)
        Heights at which names would stand.
    """
    order = sorted(range(len(wanted)), key=wanted.__getitem__)
    found = {order[0]: wanted[order[0]]}
    for before, number in pairwise(order):
        found[number] = max(wanted[number], found[before] + LINE)
    return [found[number] for number in range(len(wanted))]
