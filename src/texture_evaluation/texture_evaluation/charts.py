"""Charts that a stranger can read: what is shown stands in the title, units on the axes, colours safe for all eyes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.signal import welch

from texture_core.arrays import AnyArray, Array, Samples
from texture_core.estimates import TextureEstimate

# Okabe & Ito 2008: told apart by all kinds of colour vision.
COLOURS = ('#0072B2', '#E69F00', '#009E73', '#CC79A7', '#56B4E9', '#D55E00', '#000000')
STYLE: Any = {
    'font.size': 9,
    'axes.titlesize': 10,
    'axes.titlelocation': 'left',
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.grid': True,
    'grid.alpha': 0.3,
    'legend.frameon': False,
}
DPI = 130
MANY = 25  # more labels than this: no numbers in the cells
SHOWN_LABELS = 4
SHOWN_S = 0.5


@dataclass(frozen=True, eq=False)
class Tour:
    """One slide from the first sample to the decision, and how often such decisions are right.

    Parameters
    ----------
    source
        Where the signal comes from, in words, such as 'simulated TSF-85'.
    surface
        What the finger slid over.
    samples : (n_samples,)
        One channel of the slide.
    rate_hz, unit
        Of the samples.
    estimates
        The growing evidence, after each window.
    labels, table
        Confusion of test windows, as `metrics.confusion` counts it.
    others
        Slides over other surfaces, (n_samples,) each, whose spectra are drawn beside for comparison.
    """

    source: str
    surface: str
    samples: Array
    rate_hz: float
    unit: str
    estimates: Sequence[TextureEstimate]
    labels: Sequence[str]
    table: AnyArray
    others: Mapping[str, Array] = field(default_factory=dict)


def picture(tour: Tour, path: str | Path) -> Path:
    """Draw one slide in four panels: signal, spectrum, evidence and confusion."""
    with chart(path, (11.0, 8.0)) as figure:
        figure.suptitle(
            f'How a slide over {tour.surface} is recognised ({tour.source})', x=0.02, ha='left', fontweight='bold'
        )
        (signal, spectrum), (evidence, table) = figure.subplots(2, 2)
        _signal(signal, tour)
        _spectrum(spectrum, tour)
        _evidence(evidence, tour)
        _table(table, tour.labels, tour.table)
        table.set_title('4. All test slides: what each single window was taken for')
    return Path(path)


def confusion_chart(labels: Sequence[str], table: AnyArray, title: str, path: str | Path) -> Path:
    """Draw a confusion table; each row is a surface and adds up to 100 %."""
    side = 3.5 + 0.28 * len(labels)
    with chart(path, (side + 0.8, side)) as figure:
        axes = figure.subplots()
        _table(axes, labels, table)
        axes.set_title(title)
    return Path(path)


def evidence_chart(series: Mapping[str, tuple[Array, Array]], title: str, path: str | Path) -> Path:
    """Draw the share of slides recognised over the sliding time used, one line a method."""
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
    """Draw lines of percentages over x, on a logarithmic x axis if wanted; (x, y) by the name of each line."""
    with chart(path, (7.0, 4.2)) as figure:
        axes = figure.subplots()
        for (name, (x, y)), style in zip(series.items(), _styles(), strict=False):
            axes.plot(x, y, label=name, marker='.', **style)
        axes.set(xlabel=axis_labels[0], ylabel=axis_labels[1], title=title)
        if logarithmic:
            axes.set_xscale('log')
        else:
            axes.set_xlim(left=0)
        axes.set_ylim(top=101)
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
    """Draw positive errors over time on a logarithmic axis: the largest of each of `points` stretches of time."""
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
    """
    with chart(path, (4.0 * len(panels), 4.0)) as figure:
        figure.suptitle(title, x=0.02, ha='left', fontweight='bold')
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
    panels: Mapping[str, Mapping[str, tuple[float, float]]], title: str, axis_labels: tuple[str, str], path: str | Path
) -> Path:
    """Draw methods by cost and share of successes, a panel for each data set, and the front that no other betters.

    Parameters
    ----------
    panels
        Title of the panel → name of the method → its cost, on a logarithmic axis, and its share, 0 to 1.
    """
    names = list(dict.fromkeys(name for points in panels.values() for name in points))
    with chart(path, (4.2 * len(panels) + 2.0, 4.8)) as figure:
        figure.suptitle(title, x=0.02, ha='left', fontweight='bold')
        rows = figure.subplots(1, len(panels) + 1, squeeze=False, width_ratios=[4.2] * len(panels) + [2.0])[0]
        for axes, (name, points) in zip(rows, panels.items(), strict=False):
            _front(axes, points, names)
            axes.set(xlabel=axis_labels[0], title=name, xscale='log', ylim=(0, 101))
        rows[0].set_ylabel(axis_labels[1])
        listed = '\n'.join(f'{number}  {name}' for number, name in enumerate(names, 1))
        rows[-1].text(0.0, 1.0, listed, va='top', fontsize=8)
        rows[-1].axis('off')
    return Path(path)


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Return the points, by rising cost, of which no other has at most the cost and at least the share."""
    front: list[int] = []
    for index in sorted(range(len(points)), key=lambda index: (points[index][0], -points[index][1])):
        if not front or points[index][1] > points[front[-1]][1]:
            front.append(index)
    return front


def histogram_chart(series: Mapping[str, Array], title: str, axis_label: str, path: str | Path) -> Path:
    """Draw how values are spread, each group on its own row; the line stands at 99 % of them."""
    with chart(path, (7.0, 1.0 + 1.3 * len(series))) as figure:
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
        figure.suptitle(title, x=0.02, ha='left', fontweight='bold')
    return Path(path)


@contextmanager
def chart(path: str | Path, size: tuple[float, float]) -> Iterator[Figure]:
    """Give an empty figure and save it at the end; no display is needed and no global state is touched."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=size, layout='constrained')
        FigureCanvasAgg(figure)
        yield figure
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=DPI, bbox_inches='tight', pad_inches=0.12)


def _front(axes: Any, points: Mapping[str, tuple[float, float]], names: Sequence[str]) -> None:
    values = list(points.values())
    best = pareto_front(values)
    axes.step(
        [values[index][0] for index in best], [100 * values[index][1] for index in best],
        where='post', color=COLOURS[5], linewidth=1,
    )  # fmt: skip
    for index, (name, (cost, share)) in enumerate(points.items()):
        axes.plot(cost, 100 * share, '.', color=COLOURS[5 if index in best else 0])
        axes.annotate(
            str(names.index(name) + 1), (cost, 100 * share), xytext=(3, 3), textcoords='offset points',
            fontsize=8, fontweight='bold' if index in best else 'normal',
        )  # fmt: skip


def _styles() -> Iterator[dict[str, Any]]:
    for dashes in ('-', '--', ':'):
        for colour in COLOURS:
            yield {'color': colour, 'linestyle': dashes}


def _signal(axes: Any, tour: Tour) -> None:
    shown = tour.samples[: round(SHOWN_S * tour.rate_hz)]
    axes.plot(np.arange(len(shown)) / tour.rate_hz, shown, color=COLOURS[0], linewidth=0.8)
    axes.set(xlabel='time since the slide began (s)', ylabel=f'signal ({tour.unit or "no unit"})')
    axes.set_title(f'1. The fingertip vibrates while it slides: the first {SHOWN_S} s')


def _spectrum(axes: Any, tour: Tour) -> None:
    slides = {tour.surface: tour.samples, **tour.others}
    for (name, slide), colour in zip(slides.items(), COLOURS, strict=False):
        samples: Samples = np.asarray(slide, dtype=float)
        n_segment = min(len(samples), round(tour.rate_hz / 2))
        hertz, power = welch(samples, fs=tour.rate_hz, nperseg=n_segment)
        own = name == tour.surface
        axes.semilogy(hertz[1:], power[1:], color=colour, linewidth=1.4 if own else 0.7, label=name, zorder=2 + own)
    unit = f'{tour.unit}²/Hz' if tour.unit else '1/Hz'
    axes.set(xlabel='frequency (Hz)', ylabel=f'power density ({unit})')
    axes.set_title('2. Its spectrum is the mark of the surface')
    if tour.others:
        axes.legend(loc='upper right')


def _evidence(axes: Any, tour: Tour) -> None:
    labels = tour.estimates[-1].labels
    seconds = [estimate.evidence_s for estimate in tour.estimates]
    probabilities = 100 * np.array([estimate.probabilities for estimate in tour.estimates])
    shown = np.argsort(-probabilities.max(axis=0))[:SHOWN_LABELS]
    for column, style in zip(sorted(shown, key=lambda c: -probabilities[-1, c]), _styles(), strict=False):
        axes.plot(seconds, probabilities[:, column], marker='.', label=labels[column], **style)
    axes.set(xlabel='sliding time used (s)', ylabel='probability (%)', ylim=(-3, 103))
    axes.set_xlim(left=0)
    axes.set_title(f'3. Evidence grows until it says: {tour.estimates[-1].label}')
    axes.legend(loc='center right', title='surface')


def _table(axes: Any, labels: Sequence[str], table: AnyArray) -> None:
    totals = np.maximum(table.sum(axis=1, keepdims=True), 1)
    percent = 100 * table / totals
    image = axes.imshow(percent, cmap='Blues', vmin=0, vmax=100)
    axes.grid(visible=False)
    axes.set_xticks(range(len(labels)), labels, rotation=90 if len(labels) > 6 else 30, ha='center')
    axes.set_yticks(range(len(labels)), labels)
    axes.set(xlabel='taken for', ylabel='surface under the finger')
    axes.figure.colorbar(image, ax=axes, label='windows of the surface (%)', fraction=0.046)
    if len(labels) > MANY:
        return
    size = 8 if len(labels) <= 12 else 6
    for row, column in np.argwhere(percent >= 0.5):
        value = percent[row, column]
        axes.text(
            column,
            row,
            f'{value:.0f}',
            ha='center',
            va='center',
            fontsize=size,
            color='white' if value > 60 else 'black',
        )
