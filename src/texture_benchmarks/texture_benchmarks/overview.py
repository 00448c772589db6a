# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Accuracy against sliding time and against computing time: ours, the papers' and peers, in one run by one protocol."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.transforms import Bbox

from texture_benchmarks import peers
from texture_benchmarks.peers import CNN, MINIROCKET, QUANT, SVC, recipe_of, right_over_time, windows_of
from texture_benchmarks.study import (
    DATA,
    QUICK_MATERIALS,
    QUICK_SLIDES,
    BenchmarkOptions,
    BenchmarkResult,
    fraction_interval,
    map_forked,
    recorded,
    with_spaced_windows,
)
from texture_core.types import AnyArray, Array
from texture_estimation.recipe import FAST_TOPIC
from texture_evaluation import metrics
from texture_evaluation.charts import COLOURS, chart, pareto_front
from texture_evaluation.cross_validation import ChronologicalSplit, cross_validate, single_blas_thread, split_slides
from texture_evaluation.evaluate import run_model
from texture_papers.protocol import digest_of
from texture_recordings.dataset import SlideDataset, cut_slide

VIBRATION, ALL_CHANNELS = 'vibration', 'all channels'
OURS, PAPERS, PEERS = 'this suite', 'recipes of papers', 'general classifiers'


class _Job(NamedTuple):
    channels: str
    kind: str
    name: str


# What is tried, the longest first; the first recipe takes the most memory: it has a worker that nothing used before.
# The features of 23 channels take QUANT gigabytes, and a tenth of a second each.
JOBS = (
    _Job(VIBRATION, PAPERS, 'hu-pca-svm'),
    _Job(VIBRATION, PEERS, MINIROCKET),
    _Job(VIBRATION, PEERS, QUANT),
    _Job(VIBRATION, PEERS, CNN),
    _Job(ALL_CHANNELS, PEERS, MINIROCKET),
    _Job(ALL_CHANNELS, PEERS, CNN),
    _Job(VIBRATION, PAPERS, 'ets-fine-svm'),
    _Job(VIBRATION, PAPERS, 'ets-linear-svm'),
    _Job(VIBRATION, PAPERS, 'jamali-naive-bayes-5'),
    _Job(VIBRATION, OURS, 'default'),
    _Job(VIBRATION, OURS, 'any-place'),
    _Job(VIBRATION, PEERS, SVC),
    _Job(ALL_CHANNELS, OURS, 'vibration-and-taxels'),
    _Job(ALL_CHANNELS, OURS, 'any-place-and-taxels'),
    _Job(ALL_CHANNELS, PAPERS, 'kaboli-svm'),
    _Job(ALL_CHANNELS, PAPERS, 'kaboli-pa'),
)
QUICK_RECIPES = {'default', 'jamali-naive-bayes-5', 'kaboli-pa', 'vibration-and-taxels'}
AUTHORS = {'ets': 'Roberge et al.', 'hu': 'Hu et al.', 'jamali': 'Jamali & Sammut', 'kaboli': 'Kaboli et al.'}
PEERS_SHOWN = (SVC, MINIROCKET)  # over the sliding time: QUANT lies between them
AT_S = 3.0  # the longest window of a paper is complete
TIMED_SLIDES, LATENCY_ROUNDS = 40, 5  # the round with the lowest median counts, as other work only adds
DATA_SET = f'{DATA["biotac20"]}; PAC at 2.2 kHz, and with all channels 19 electrodes and the slow ones'
SPLIT = 'by time: trained on slides 1-30 of each surface, tested on slides 31-40; the same track'

# --------------------
# One run.


# Results of a job: its figures, and a function that returns the time for each window, in µs.
_Tried = tuple[dict[str, Any], Callable[[], Array]]


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train every method on earlier slides and test it on later ones, each with the windows of its recipe.

    Recipes as released, those of papers with one set of variables each, their training windows at least 0.5 s
    apart; peers with windows of 0.5 s that do not overlap. Accuracy of slides over the sliding time, with 95 %
    intervals over surfaces; mean sliding time and accuracy when each slide ends as soon as it is decided; computing
    time of one window from samples to estimate (µs, median and 99th percentile), by the clock of the processor, of
    the round of 5 over all methods whose median was lowest.
    """
    dataset = recorded(options, 'biotac20', (QUICK_SLIDES, QUICK_MATERIALS))
    splitter = ChronologicalSplit(4 / 6 if options.quick else 30 / 40)  # of the slides of each material
    jobs = jobs_of(options.quick)
    tried = dict(zip(jobs, map_forked(partial(_try, dataset, splitter, options.seed), jobs), strict=True))
    with single_blas_thread():
        rounds = [{job: time_us() for job, (_, time_us) in tried.items()} for _ in range(LATENCY_ROUNDS)]
    numbers: dict[str, Any] = {VIBRATION: {}, ALL_CHANNELS: {}}
    for job, (figures, _) in tried.items():
        median, p99 = min((np.percentile(times[job], (50, 99)).tolist() for times in rounds), key=itemgetter(0))
        latency_us = {'median': round(median, 1), 'p99': round(p99, 1)}
        numbers[job.channels][job.name] = {**figures, 'latency_us': latency_us}
    return BenchmarkResult(
        data=DATA_SET,
        split=SPLIT,
        numbers=numbers,
        charts=(
            sliding_chart(numbers, options.out / 'accuracy_over_sliding.png'),
            computing_chart(numbers, options.out / 'accuracy_over_computing.png'),
        ),
    )


def jobs_of(quick: bool) -> list[_Job]:
    """Return what is tried: some recipes alone for a reduced run, and peers only where their package is."""
    chosen = [job for job in JOBS if not quick or job.name in QUICK_RECIPES]
    return [job for job in chosen if job.name not in peers.CLASSIFIERS or peers.available(job.name)]


def _try(dataset: SlideDataset, splitter: ChronologicalSplit, seed: int, job: _Job) -> _Tried:
    if job.name in peers.CLASSIFIERS:
        return _try_peer(dataset, splitter, seed, job)
    recipe = recipe_of(job.name)
    if job.kind != OURS:
        recipe = with_spaced_windows(recipe)
    [fold] = cross_validate(recipe, dataset, splitter).folds
    results = list(fold.results.values())
    right = {}
    for seconds in metrics.curve(results)[0].tolist():
        ends = [(result.after(seconds), result.surface) for result in results]
        labels = [end.label == surface for end, surface in ends if end is not None]
        if len(labels) == len(ends):
            right[seconds] = labels
    figures = {
        'kind': job.kind,
        **({} if job.kind == PEERS else {'definition': digest_of(job.name)}),
        'window_accuracy': metrics.window_accuracy(results),
        'unclassified_windows': metrics.unclassified_windows(results),
        **_over_time(right, [result.surface for result in results]),
        'ends_when_decided': dict(metrics.early_decision(results)) if job.kind == OURS else None,
    }
    cut = [cut_slide(slide, recipe.feature_set) for slide in _timed(dataset.slides)]
    return figures, partial(_time_recipe, replace(fold.model), cut)  # a copy has nothing that no other process takes


def _timed(slides: Sequence[Any]) -> Sequence[Any]:
    """Return the slides, among all, whose windows are timed: the same for every method."""
    return slides[:: max(1, len(slides) // TIMED_SLIDES)]


def _time_recipe(model: Any, cut: Sequence[Any]) -> Array:
    """Return the computing times of windows, µs; the last of a slide is its end, and the first slide warms up."""
    taken = [run_model(model, events, time.process_time)[2][:-1] for events in (cut[0], *cut)][1:]
    return np.concatenate(taken)


def _try_peer(dataset: SlideDataset, splitter: ChronologicalSplit, seed: int, job: _Job) -> _Tried:
    topics = (FAST_TOPIC,) if job.channels == VIBRATION else tuple(sorted(dataset[0].signals))
    windows = [windows_of(slide, topics) for slide in dataset]
    [(trained, tested)] = split_slides(dataset, splitter)
    classifier = peers.classifier(job.name, seed)
    labels = np.repeat(dataset.labels[trained], [len(windows[row]) for row in trained])
    classifier.fit(np.concatenate([windows[row] for row in trained]), labels)
    codes = [classifier.classes_.tolist().index(label) for label in dataset.labels[tested]]
    over_time = [
        right_over_time(classifier.predict_proba(windows[row]), code) for row, code in zip(tested, codes, strict=True)
    ]
    hop_s = peers.WINDOWS.hop_s
    right = {round(hop_s * number, 6): list(each) for number, each in enumerate(zip(*over_time, strict=False), 1)}
    figures = {'kind': job.kind, **_over_time(right, dataset.labels[tested].tolist())}
    return figures, partial(_time_peer, classifier, np.concatenate(_timed(windows)))


def _time_peer(classifier: Any, windows: AnyArray) -> Array:
    taken_us = []
    for window in (windows[0], *windows):
        start = time.process_time()
        classifier.predict_proba(window[None])
        taken_us.append(1e6 * (time.process_time() - start))
    return np.array(taken_us[1:])


def _over_time(right: Mapping[float, Sequence[bool]], surfaces: Sequence[str]) -> dict[str, Any]:
    """Return the accuracy of slides after each time, with intervals over the surfaces."""
    intervals = {seconds: fraction_interval(each, surfaces) for seconds, each in right.items()}
    accuracy = {seconds: float(np.mean(each)) for seconds, each in right.items()}
    usual = (*metrics.TIMES_S, AT_S)
    return {
        'slides': len(surfaces),
        's': [*right],
        'share': [round(one, 4) for one in accuracy.values()],
        'interval': [[round(edge, 4) for edge in edges] for edges in intervals.values()],
        'accuracy_at_s': {f'{seconds:.1f}': _at(accuracy, seconds) for seconds in usual},
        'interval_at_s': {f'{seconds:.1f}': _at(intervals, seconds) for seconds in usual},
        'accuracy_at_end': [*accuracy.values()][-1],
    }


def _at(found: Mapping[float, Any], seconds: float) -> Any:
    """Return what was last found until a time; None if nothing was, or if all slides are shorter."""
    reached = [key for key in found if key <= seconds + metrics.TOLERANCE_S]
    return found[max(reached)] if reached and max(found) >= seconds - metrics.TOLERANCE_S else None


# --------------------
# The charts, from the figures.

STYLES: Mapping[str, dict[str, Any]] = {
    OURS: {'color': COLOURS[0]},
    PAPERS: {'color': '#4d4d4d'},
    PEERS: {'color': COLOURS[5]},
}
DASHES = {OURS: '-', PAPERS: '-.', PEERS: '--'}
LEAST = 0.3  # percent wrong that is drawn for none wrong: half a slide of 200 is 0.25
TICKS = {LEAST: '100', **{wrong: f'{100.0 - wrong:g}' for wrong in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)}}
TICKS_S = (0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0)


def _measured(numbers: Mapping[str, Any]) -> str:
    """Return data set, split, shift and n of both charts."""
    n = max(cell['slides'] for cells in numbers.values() for cell in cells.values())
    return f'BioTac (biotac20), 20 materials, same track: slides 1–30 of each trained, 31–40 tested (n = {n})'


def wrong_percent(value: AnyArray | Sequence[float] | float) -> Array:
    """Return the percentage wrong, LEAST for none."""
    return np.maximum(100.0 * (1.0 - np.asarray(value, dtype=np.float64)), LEAST)


def sliding_chart(numbers: Mapping[str, Any], path: str | Path) -> Path:
    """Draw the accuracy of slides over the sliding time, with the interval of ours, in a panel for the channels."""
    with chart(path, (6.2, 7.6), f'Accuracy over the sliding time. {_measured(numbers)}') as figure:
        for axes, channels in zip(figure.subplots(2, 1, sharex=True), (VIBRATION, ALL_CHANNELS), strict=True):
            _draw_sliding(axes, _shown(numbers, channels))
            axes.set_title(channels)
        axes.set_xlabel('sliding time (s)')
        axes.plot([], [], '*', color='black', markersize=13, label='mean end and accuracy with early stopping')
        axes.fill_between([], [], [], color='grey', alpha=0.2, label=f'95 % interval of {OURS}')
        figure.legend(loc='outside lower left')
    return Path(path)


def _shown(numbers: Mapping[str, Any], channels: str) -> dict[str, Mapping[str, Any]]:
    """Return ours, the best recipe of a paper with these channels, and general classifiers, by the name at the line."""
    cells = numbers[channels]
    papers = {name: cell for name, cell in cells.items() if cell['kind'] == PAPERS}
    best = max(papers, key=lambda name: papers[name]['accuracy_at_end'])
    ours = {name: cells[name] for name in ('default', 'vibration-and-taxels') if name in cells}
    peers = {
        name if name in cells else f'{name},\n{VIBRATION}': cells.get(name, numbers[VIBRATION][name])
        for name in PEERS_SHOWN
        if name in numbers[VIBRATION]
    }
    return {**ours, f'{AUTHORS[best.split("-")[0]]}:\n{best}': papers[best], **peers}


def _draw_sliding(axes: Any, shown: Mapping[str, Mapping[str, Any]]) -> None:
    for name, cell in shown.items():
        dashes = ':' if name.startswith(PEERS_SHOWN[0]) else DASHES[cell['kind']]
        style, wrong = STYLES[cell['kind']], wrong_percent(cell['share'])
        if cell['kind'] == OURS:  # several bands would hide each other; the table has the other intervals
            high, low = wrong_percent(cell['interval']).T
            axes.fill_between(cell['s'], low, high, alpha=0.13, linewidth=0, **style)
        axes.plot(cell['s'], wrong, dashes, linewidth=2.0, **style)
        if ends := cell.get('ends_when_decided'):
            axes.plot(ends['mean_s'], wrong_percent(ends['accuracy']), '*', markersize=15, markeredgecolor='black',
                      zorder=5, **style)  # fmt: skip
    last = [float(np.log10(wrong_percent(cell['share'][-1]))) for cell in shown.values()]
    for (name, cell), height in zip(shown.items(), spread(last, 0.3), strict=True):
        axes.text(6.25, 10**height, name, va='center', **STYLES[cell['kind']])
    axes.set(xscale='log', yscale='log', xlim=(0.45, 6.1), ylim=(100.0, LEAST * 0.8), ylabel='accuracy (%)')
    axes.set_xticks([s for s in TICKS_S if s > 0.4], [f'{s:g}' for s in TICKS_S if s > 0.4])
    axes.set_yticks([*TICKS], [*TICKS.values()])
    axes.minorticks_off()


def spread(wanted: Sequence[float], spacing: float) -> list[float]:
    """Return heights near those wanted, in the same order, with at least this spacing."""
    order = sorted(range(len(wanted)), key=wanted.__getitem__)
    found = {order[0]: wanted[order[0]]} if order else {}
    for before, number in pairwise(order):
        found[number] = max(wanted[number], found[before] + spacing)
    return [found[number] for number in range(len(wanted))]


MARKS = {VIBRATION: 'o', ALL_CHANNELS: 's'}
TICKS_US = (50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000)


def computing_chart(numbers: Mapping[str, Any], path: str | Path) -> Path:
    """Draw the accuracy of slides after AT_S over the computing time of a window, with the front of all."""
    cells = [
        (name, channels, cell)
        for channels in (VIBRATION, ALL_CHANNELS)
        for name, cell in numbers[channels].items()
        if cell['accuracy_at_s'][f'{AT_S:.1f}'] is not None
    ]
    accuracies = [cell['accuracy_at_s'][f'{AT_S:.1f}'] for _, _, cell in cells]
    points = [(cell['latency_us']['median'], value) for (_, _, cell), value in zip(cells, accuracies, strict=True)]
    front = pareto_front(points)
    title = f'Accuracy after {AT_S:g} s by computing time. {_measured(numbers)}'
    with chart(path, (6.2, 7.6), title) as figure:
        axes = figure.subplots()
        axes.step([points[at][0] for at in front], wrong_percent([points[at][1] for at in front]), where='post',
                  color='black', linewidth=1.0, zorder=1, label='Pareto front')  # fmt: skip
        for (_, channels, cell), (cost, value) in zip(cells, points, strict=True):
            edges = wrong_percent(cell['interval_at_s'][f'{AT_S:.1f}'])
            wrong, style = wrong_percent(value), STYLES[cell['kind']]
            axes.plot([cost, cost], edges, linewidth=1.0, alpha=0.35, **style)
            axes.plot([cost, cell['latency_us']['p99']], [wrong, wrong], linewidth=1.0, alpha=0.6, **style)
            axes.plot(cost, wrong, MARKS[channels], markersize=7, **style)
        drawn = {cell['kind'] for _, _, cell in cells}
        for kind in (kind for kind in STYLES if kind in drawn):
            axes.plot([], [], 'o', markersize=7, label=kind, **STYLES[kind])
        for channels, mark in MARKS.items():
            axes.plot([], [], mark, color='white', markeredgecolor='black', markersize=7, label=channels)
        axes.plot([], [], '-', color='grey', label='across: 99 of 100 windows;\nupright: 95 % interval')
        axes.set(xscale='log', yscale='log', ylim=(110.0, LEAST * 0.8), ylabel='accuracy (%)')
        axes.set_yticks([*TICKS], [*TICKS.values()])
        axes.set_xlabel('computing time of a window, median (µs)')
        axes.minorticks_off()
        figure.legend(loc='outside lower left', ncols=2)
        costs = [cost for cost, _ in points]
        axes.set_xlim(0.7 * min(costs), 3.0 * max(costs))
        ticks = [tick for tick in TICKS_US if min(costs) / 1.5 < tick < 3.0 * max(costs)]
        axes.set_xticks(ticks, [f'{tick:g}' for tick in ticks])
        figure.canvas.draw()  # names are placed by what is there
        _name_points(axes, [name for name, _, _ in cells], [cell['kind'] for _, _, cell in cells], points)
    return Path(path)


OFFSETS = [(x, y) for y in (7, -8, 20, -21, 33, -34) for x in (6, -6)]  # of a name from its point, in points


def _name_points(axes: Any, names: Sequence[str], kinds: Sequence[str], points: Sequence[tuple[float, float]]) -> None:
    """Write names next to their points, the most accurate first, where they cover no other name and no point."""
    places = [(cost, wrong_percent(value)) for cost, value in points]
    taken = [Bbox.from_bounds(x - 6, y - 6, 12, 12) for x, y in axes.transData.transform(places)]
    for index in sorted(range(len(names)), key=lambda at: -points[at][1]):
        for offset in OFFSETS:
            text = axes.annotate(names[index], places[index], xytext=offset, textcoords='offset points', va='center',
                                 ha='left' if offset[0] > 0 else 'right', **STYLES[kinds[index]])  # fmt: skip
            box = text.get_window_extent(axes.figure.canvas.get_renderer())
            if box.x0 > axes.bbox.x0 and not any(box.overlaps(other) for other in taken):
                text.set_bbox({'facecolor': 'white', 'alpha': 0.7, 'edgecolor': 'none', 'pad': 0.5})
                taken.append(box)
                break
            text.remove()
