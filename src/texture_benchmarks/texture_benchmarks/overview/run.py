"""Accuracy against the time from first touch to decision, in one picture, from stored figures."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from texture_benchmarks.overview.chart import OURS, PAPERS, PEERS, AccuracyCurve, overview_chart
from texture_benchmarks.recipes.run import DATA, LATER, VIBRATION
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.errors import InvalidData

# Of each paper on textures the recipe that recognises most slides after 5 s; the fifth paper grades roughness.
SHOWN: Mapping[str, tuple[str, str]] = {
    'onset': ('onset', OURS),
    'default': ('default', OURS),
    'fast': ('fast', OURS),
    'hu-log-pca-svm': ('Hu et al.', PAPERS),
    'kaboli-svm-rbf': ('Kaboli et al.', PAPERS),
    'ets-linear-ann': ('Roberge et al.', PAPERS),
    'jamali-stft': ('Jamali & Sammut', PAPERS),
}
ALL_CHANNELS = 'vibration-and-taxels'
SOURCES = {'recipes_later': True, 'trust': True, 'peers': False}  # whether each is needed


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Draw the picture from what lies in the folder of the results."""
    stored = {name: _stored(options.out, name, needed=needed) for name, needed in SOURCES.items()}
    methods = methods_of(stored)
    return BenchmarkResult(
        name='overview',
        measured=(
            'share of slides recognised, against the sliding time used and the computing time of one window (s); and '
            'where each slide ends when the recipe is certain. From '
            + ', '.join(f'{name}.json' for name, found in stored.items() if found)
        ),
        data=f'{DATA["biotac20"]}; PAC at 1 kHz; {ALL_CHANNELS}: all channels',
        split='by time: trained on slides 1-30 of each surface, tested on slides 31-40',
        numbers={
            each.name: {
                'kind': each.kind,
                's': [round(seconds, 5) for seconds in each.seconds],
                'share': list(each.shares),
                'ends_when_certain': each.ends,
            }
            for each in methods
        },
        charts=(overview_chart(methods, options.out / 'overview.png'),),
    )


def methods_of(stored: Mapping[str, Mapping[str, Any]]) -> list[AccuracyCurve]:
    """Return what is drawn, from the stored figures of each benchmark; those of the peers may be missing.

    Parameters
    ----------
    stored
        Name of a benchmark → its numbers.
    """
    cells = stored['recipes_later'][VIBRATION][LATER]
    methods = [_of_cell(title, kind, cells[recipe]) for recipe, (title, kind) in SHOWN.items()]
    methods += [_of_cell(name, PEERS, cell) for name, cell in stored['peers'].items()]
    whole = stored['trust'][ALL_CHANNELS]
    at_s = whole['accuracy_at_s']
    ends = (whole['early']['mean_s'], whole['early']['accuracy'])
    return [
        *methods,
        AccuracyCurve(f'{ALL_CHANNELS}\n(all channels)', OURS, [*map(float, at_s)], [*at_s.values()], ends),
    ]


def _of_cell(title: str, kind: str, cell: Mapping[str, Any]) -> AccuracyCurve:
    """Return what a cell of a table holds: all decisions, or those after some times where an older run has no more."""
    computing_s = 1e-6 * cell['latency_us']['median']
    found = cell.get('decisions') or _after_some_times(cell['accuracy_at_s'])
    return AccuracyCurve(title, kind, [seconds + computing_s for seconds in found['s']], found['share'])


def _after_some_times(accuracy_at_s: Mapping[str, float | None]) -> dict[str, list[float]]:
    known = {float(seconds): share for seconds, share in accuracy_at_s.items() if share is not None}
    return {'s': [*known], 'share': [*known.values()]}


def _stored(folder: Path, name: str, *, needed: bool) -> Mapping[str, Any]:
    path = folder / f'{name}.json'
    if not path.is_file():
        if needed:
            raise InvalidData(f"no '{path}'; run `texture benchmark {name}` first, or name the folder with --out")
        return {}
    numbers: Mapping[str, Any] = json.loads(path.read_text(encoding='utf-8'))['numbers']
    return numbers
