"""Charts that several benchmarks draw."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_evaluation.charts import COLOURS, chart, draw_confusion, line_styles, pareto_front

FEW_LINES = 5  # more names than these would cover lines
DIRECT_LABELS = 10  # names in a chart of many methods
LABEL_DECADES, LABEL_SHARE = 0.4, 0.035  # room of a name, on the axes of cost and share
ROOM_DECADES = 0.3  # left of the cheapest point


def confusion_chart(labels: Sequence[str], table: AnyArray, title: str, path: str | Path) -> Path:
    """Draw a confusion table; each row is a surface and adds up to 100 %.

    Parameters
    ----------
    labels
        Name of each row and column.
    table : (n, n)
        Counts, true surfaces in the rows.
    title
        Above the chart.
    path
        File that is written; its ending says the format.

    Returns
    -------
    Path
        Of the file.
    """
    side = 3.5 + 0.28 * len(labels)
    with chart(path, (side + 0.8, side)) as figure:
        axes = figure.subplots()
        draw_confusion(axes, labels, table)
        axes.set_title(title)
    return Path(path)


def evidence_chart(series: Mapping[str, tuple[Array, Array]], title: str, path: str | Path) -> Path:
    """Draw the share of slides recognised over the sliding time used, one line a method.

    Parameters
    ----------
    series
        Name of the method → sliding time in s and share recognised, 0 to 1, (n,) each.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    percent = {name: (seconds, 100 * np.asarray(accuracy)) for name, (seconds, accuracy) in series.items()}
    return line_chart(percent, title, ('sliding time used (s)', 'slides recognised (%)'), path)


def line_chart(
    series: Mapping[str, tuple[Array, Array]],
    title: str,
    axis_labels: tuple[str, str],
    path: str | Path,
    *,
    logarithmic: bool = False,
) -> Path:
    """Draw lines of percentages over x, on a logarithmic x axis if wanted; (x, y) by the name of each line.

    Parameters
    ----------
    series
        Name of the line → x and share, 0 to 1, (n,) each.
    title
        Above the chart.
    axis_labels
        Of x and of y.
    path
        File that is written.
    logarithmic
        Whether the x axis is logarithmic.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (7.0, 4.2)) as figure:
        axes = figure.subplots()
        for (name, (x, y)), style in zip(series.items(), line_styles(), strict=False):
            axes.plot(x, y, label=name, marker='.', **style)
        axes.set(xlabel=axis_labels[0], ylabel=axis_labels[1], title=title)
        if logarithmic:
            axes.set_xscale('log')
        else:
            axes.set_xlim(left=0)
        axes.set_ylim(top=101)
        if len(series) > FEW_LINES:
            axes.legend(loc='upper center', bbox_to_anchor=(0.5, -0.14), ncols=4, fontsize=8)
        else:
            axes.legend(loc='best')
    return Path(path)


def error_chart(
    series: Mapping[str, tuple[Array, Array]],
    title: str,
    axis_labels: tuple[str, str],
    path: str | Path,
    *,
    points: int,
) -> Path:
    """Draw positive errors over time on a logarithmic axis: the largest of each of `points` stretches of time.

    Parameters
    ----------
    series
        Name of the line → time and error, above 0, (n,) each.
    title
        Above the chart.
    axis_labels
        Of time and of error, with their units.
    path
        File that is written.
    points
        Number of stretches of time.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (7.0, 4.2)) as figure:
        axes = figure.subplots()
        for (name, (x, y)), colour in zip(series.items(), COLOURS, strict=False):
            size = max(1, len(x) // points)
            rows = len(x) // size
            largest = np.asarray(y)[: rows * size].reshape(rows, size).max(axis=1)
            axes.semilogy(np.asarray(x)[: rows * size : size], largest, label=name, color=colour, linewidth=1)
        axes.set(xlabel=axis_labels[0], ylabel=axis_labels[1], title=title)
        axes.legend(loc='best')
    return Path(path)


def fault_chart(panels: Mapping[str, Mapping[str, tuple[Array, Array, Array]]], title: str, path: str | Path) -> Path:
    """Draw what is recovered of packets, and dashed what false ones are believed; a panel for each kind of fault.

    Parameters
    ----------
    panels
        Kind of fault → name of the line → faults per byte, share recovered and share of false ones, 0 to 1, (n,) each.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (4.0 * len(panels), 4.0), title) as figure:
        rows = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        for axes, (kind, series) in zip(rows, panels.items(), strict=True):
            for (name, (rates, recovered, false)), colour in zip(series.items(), COLOURS, strict=False):
                axes.plot(rates, 100 * recovered, label=f'{name}: recovered', marker='.', color=colour)
                if false.any():
                    axes.plot(rates, 100 * false, label=f'{name}: false', marker='.', color=colour, linestyle='--')
            axes.set(xlabel='faults per byte', title=kind, xscale='log', ylim=(-2, 102))
        rows[0].set_ylabel('share of the packets sent (%)')
        rows[-1].legend(loc='center left', bbox_to_anchor=(0.0, 0.42))
    return Path(path)


def front_chart(
    panels: Mapping[str, Mapping[str, tuple[float, float]]],
    title: str,
    axis_labels: tuple[str, str],
    path: str | Path,
    *,
    always: Collection[str] = (),
) -> Path:
    """Draw methods by cost and share of successes, with the front that no other betters; a row for each data set.

    Parameters
    ----------
    panels
        Title of the panel → name of the method → its cost, on a logarithmic axis, and its share, 0 to 1.
    title
        Above the chart.
    axis_labels
        Of cost and of share, with their units.
    path
        File that is written.
    always
        Methods that are named wherever they lie; others where there is room.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (7.4, 0.6 + 4.0 * len(panels)), title) as figure:
        rows = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
        for axes, (name, points) in zip(rows, panels.items(), strict=True):
            axes.set(ylabel=axis_labels[1], title=name, xscale='log', ylim=(0, 101))
            _front(axes, points, always)
        rows[-1].set_xlabel(axis_labels[0])
    return Path(path)


def histogram_chart(series: Mapping[str, Array], title: str, axis_label: str, path: str | Path) -> Path:
    """Draw how values are spread, each group on its own row; the line stands at 99 % of them.

    Parameters
    ----------
    series
        Name of the group → its values, (n,).
    title
        Above the chart.
    axis_label
        Of the values, with their unit.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (7.0, 1.0 + 1.3 * len(series)), title) as figure:
        rows = figure.subplots(len(series), 1, sharex=True, squeeze=False)[:, 0]
        longest = max(float(np.max(values)) for values in series.values())
        edges = np.linspace(0.0, 1.02 * longest, 120)
        for axes, (name, values) in zip(rows, series.items(), strict=True):
            p99 = float(np.percentile(values, 99))
            axes.hist(values, bins=edges, color=COLOURS[0])
            axes.axvline(p99, color=COLOURS[5], linestyle='--')
            axes.set_title(f'{name}: median {np.median(values):.2f}, 99 % below {p99:.2f}', fontsize=9)
            axes.set_ylabel('windows')
        rows[-1].set_xlabel(axis_label)
    return Path(path)


def _front(axes: Any, points: Mapping[str, tuple[float, float]], always: Collection[str]) -> None:
    values = list(points.values())
    best = pareto_front(values)
    axes.step(
        [values[index][0] for index in best], [100 * values[index][1] for index in best],
        where='post', color=COLOURS[5], linewidth=1,
    )  # fmt: skip
    for index, (cost, share) in enumerate(values):
        axes.plot(cost, 100 * share, '.', color=COLOURS[5 if index in best else 0])
    costs = [cost for cost, _ in values]
    axes.set_xlim(min(costs) / 10**ROOM_DECADES, 3.5 * max(costs))  # room for the names at both ends
    names = list(points)
    own = [index for index, name in enumerate(names) if name in always]
    for index, (start, height) in _named(values, best, own).items():
        left = start < np.log10(values[index][0])
        axes.annotate(
            names[index], (values[index][0], 100 * height), xytext=(-5 if left else 5, 0), textcoords='offset points',
            va='center', ha='right' if left else 'left', fontsize=8, fontweight='bold' if index in best else 'normal',
        )  # fmt: skip


def _free_places(
    points: Sequence[tuple[float, float]], index: int, places: Mapping[int, tuple[float, float]]
) -> list[tuple[float, float]]:
    """Return where the name of a point covers no other point and no name, and does not leave the chart on the left."""
    (x, y), up = points[index], LABEL_SHARE / 2
    edge = min(point[0] for point in points) - ROOM_DECADES
    return [
        place
        for place in ((x, y + up), (x - LABEL_DECADES, y + up), (x, y - up))
        if place[0] >= edge
        and not any(_covers(place, other, LABEL_DECADES) for other in places.values())
        and not any(_covers(place, point, 0.0) for point in points if point != points[index])
    ]


def _named(
    values: Sequence[tuple[float, float]], best: Sequence[int], always: Sequence[int] = ()
) -> dict[int, tuple[float, float]]:
    """Return where names stand, in decades and as a share: `always`, the front, then the best that cover nothing."""
    points = [(float(np.log10(cost)), share) for cost, share in values]
    others = sorted(set(range(len(points))) - set(best), key=lambda index: -points[index][1])
    places: dict[int, tuple[float, float]] = {}
    for index in dict.fromkeys([*always, *sorted(best, key=lambda index: -points[index][1]), *others]):
        free = _free_places(points, index, places) or [points[index]] * (index in always)
        if free and len(places) < DIRECT_LABELS:
            places[index] = free[0]
    return places


def _covers(place: tuple[float, float], other: tuple[float, float], length: float) -> bool:
    """Return whether a name that starts at a place lies on another one of a length in decades, or on a point (0)."""
    return -length < other[0] - place[0] < LABEL_DECADES and abs(place[1] - other[1]) < LABEL_SHARE
