# SPDX-License-Identifier: Apache-2.0
"""Accuracy against the time from first touch to decision, in one picture, from the stored figures of other studies."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from texture_benchmarks.recipes import DATA, LATER, VIBRATION
from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult
from texture_core.errors import InvalidData
from texture_evaluation.charts import COLOURS, chart
from texture_papers.protocol import digest_of

OURS, PEERS = 'this suite', 'general classifiers of time series'
PAPERS, VARIANTS = 'recipes of the papers', 'variants of them, of no paper'
STYLES: Mapping[str, dict[str, Any]] = {
    OURS: {'color': COLOURS[0], 'linewidth': 2.2},
    PAPERS: {'color': '#4d4d4d', 'linewidth': 1.2},
    VARIANTS: {'color': '#a6a6a6', 'linewidth': 1.0, 'linestyle': ':'},
    PEERS: {'color': COLOURS[5], 'linewidth': 1.2, 'linestyle': '--'},
}
TICKS_S = (0.5, 1.0, 2.0, 3.0, 5.0)
LINE = 4.6  # least distance of two names, in percent of the slides


@dataclass(frozen=True)
class AccuracyCurve:
    """How often a method is right over time."""

    name: str  # At its line
    kind: str  # A key of STYLES
    # seconds, shares: (n,) Time from first touch to decision, with computing, and share of slides that are
    # right then, 0 to 1
    seconds: Sequence[float]
    shares: Sequence[float]
    # Mean time and share right when each slide ends as soon as it is decided; None where it does not
    ends: tuple[float, float] | None = None


def overview_chart(methods: Sequence[AccuracyCurve], path: str | Path) -> Path:
    """Draw all methods, each named at the left end of its line."""
    with chart(path, (8.0, 5.4), 'Same track: slides recognised over the time since the first touch') as figure:
        axes = figure.subplots()
        for each in methods:
            axes.plot(each.seconds, [100 * share for share in each.shares], **STYLES[each.kind])
            if each.ends:
                axes.plot(each.ends[0], 100 * each.ends[1], '*', color=COLOURS[0], markersize=13)
                axes.annotate('ends when decided', each.ends, (each.ends[0] * 0.98, 103.0), fontsize=8, ha='center')
        for each, height in zip(methods, spread_heights([100 * each.shares[0] for each in methods]), strict=True):
            style = {'color': STYLES[each.kind]['color'], 'weight': 'bold' if each.kind == OURS else 'normal'}
            axes.text(0.475, height, each.name, ha='right', va='center', fontsize=8.5, **style)
        for kind, style in STYLES.items():
            if any(each.kind == kind for each in methods):
                axes.plot([], [], label=kind, **style)
        axes.set(xscale='log', xlim=(0.14, 6.3), ylim=(0, 107), ylabel='slides recognised (%)')
        axes.set_xlabel('time from first touch to decision, with computing (s)')
        axes.set_xticks(TICKS_S, [f'{seconds:g}' for seconds in TICKS_S])
        axes.minorticks_off()
        axes.legend(loc='lower right')
    return Path(path)


def spread_heights(wanted: Sequence[float]) -> list[float]:
    """Return heights near those wanted, in the same order, at least LINE apart."""
    order = sorted(range(len(wanted)), key=wanted.__getitem__)
    found = {order[0]: wanted[order[0]]}
    for before, number in pairwise(order):
        found[number] = max(wanted[number], found[before] + LINE)
    return [found[number] for number in range(len(wanted))]


# Of each paper on textures its own recipe, and what was made of it; the fifth paper grades roughness.
SHOWN: Mapping[str, tuple[str, str]] = {
    'onset': ('onset', OURS),
    'default': ('default', OURS),
    'fast': ('fast', OURS),
    'ets-fine-svm': ('Roberge et al.: ets-fine-svm', PAPERS),  # that of one speed, as these slides have
    'hu-pca-svm': ('Hu et al.: hu-pca-svm', PAPERS),
    'jamali-naive-bayes-5': ('Jamali & Sammut: jamali-naive-bayes-5', PAPERS),
    'kaboli-svm': ('Kaboli et al.: kaboli-svm, vibration alone', PAPERS),
    'hu-log-pca-svm': ('hu-log-pca-svm', VARIANTS),
    'kaboli-svm-rbf': ('kaboli-svm-rbf', VARIANTS),
    'jamali-stft': ('jamali-stft', VARIANTS),
}
ALL_CHANNELS = 'vibration-and-taxels'
SOURCES = {'recipes_later': True, 'trust': True, 'peers': False}  # whether each is needed


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Draw the picture from what lies in the folder of the results."""
    stored = {}
    for name, needed in SOURCES.items():
        path = options.out / f'{name}.json'
        if needed and not path.is_file():
            raise InvalidData(f"no '{path}'; run `texture benchmark {name}` first, or name the folder with --out")
        stored[name] = json.loads(path.read_text(encoding='utf-8'))['numbers'] if path.is_file() else {}
    methods = methods_of(stored)
    return BenchmarkResult(
        name='overview',
        measured=(
            'share of slides recognised, against the sliding time used and the computing time of one window (s); and '
            'where each slide ends when the label is decided. From '
            + ', '.join(f'{name}.json' for name, found in stored.items() if found)
        ),
        data=f'{DATA["biotac20"]}; PAC at 1 kHz; {ALL_CHANNELS}: all channels',
        split='by time: trained on slides 1-30 of each surface, tested on slides 31-40',
        numbers={
            each.name: {
                'kind': each.kind,
                's': [round(seconds, 5) for seconds in each.seconds],
                'share': list(each.shares),
                'ends_when_decided': each.ends,
            }
            for each in methods
        },
        charts=(overview_chart(methods, options.out / 'overview.png'),),
    )


def methods_of(stored: Mapping[str, Mapping[str, Any]]) -> list[AccuracyCurve]:
    """Return what is drawn, from the stored figures of each benchmark; those of the peers may be missing.

    Of recipes that have changed since they were measured nothing is drawn.
    """
    cells = stored['recipes_later'][VIBRATION][LATER]
    current = {recipe: cell for recipe, cell in cells.items() if cell['definition'] == digest_of(recipe)}
    methods = [_of_cell(title, kind, current[recipe]) for recipe, (title, kind) in SHOWN.items() if recipe in current]
    methods += [_of_cell(name, PEERS, cell) for name, cell in stored['peers'].items()]
    whole = stored['trust'][ALL_CHANNELS]
    at_s = whole['accuracy_at_s']
    ends = (whole['early']['mean_s'], whole['early']['accuracy'])
    return [
        *methods,
        AccuracyCurve(f'{ALL_CHANNELS}\n(all channels)', OURS, [*map(float, at_s)], [*at_s.values()], ends),
    ]


def _of_cell(title: str, kind: str, cell: Mapping[str, Any]) -> AccuracyCurve:
    """Return what a cell of a table holds: all decisions, and when they are made with the time of computing."""
    computing_s, found = 1e-6 * cell['latency_us']['median'], cell['decisions']
    return AccuracyCurve(title, kind, [seconds + computing_s for seconds in found['s']], found['share'])
