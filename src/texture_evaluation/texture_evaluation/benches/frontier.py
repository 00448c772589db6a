"""The frontier: accuracy against computing time and sliding time, and what a training costs as it grows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np

from texture_core.arrays import Array
from texture_estimation.recipe import load_recipe
from texture_evaluation import metrics
from texture_evaluation.benches.recipes import DATA, RATE_HZ, VIBRATION, biotac20_settings
from texture_evaluation.benches.result import Bench, BenchResult
from texture_evaluation.charts import evidence_chart, line_chart
from texture_evaluation.frontier_charts import size_chart
from texture_evaluation.recipe_trials import Division, Recorded, comparable, latency_us, try_recipe
from texture_evaluation.train import with_channels
from texture_evaluation.training_costs import Cost, Size, costs

# Of the recipes that judge each window, those that train in seconds.
RECIPES = ('default', 'fast', 'ets-linear-svm', 'hu-pca-svm', 'jamali-naive-bayes-5', 'kaboli-svm')
LENGTHS_S = (0.05, 0.1, 0.2, 0.35, 0.5, 1.0, 2.0)
QUICK_RECIPES, QUICK_LENGTHS_S = ('fast',), (0.1, 0.5)
SHOWN = 'default'
LEARNERS = ('mlp', 'svm_rbf', 'svm_linear', 'svm_pairs', 'naive_bayes', 'passive_aggressive')
QUICK_LEARNERS = ('mlp', 'naive_bayes')
FEW_LABELS, WINDOWS_OF_A_LABEL = 10, 50
BY_WINDOWS = [Size(windows, FEW_LABELS) for windows in (100, 300, 1_000, 3_000, 10_000, 30_000, 100_000)]
BY_LABELS = [Size(WINDOWS_OF_A_LABEL * labels, labels) for labels in (2, 5, 10, 20, 50, 100, 200)]
FIXED = {'windows': f'of {FEW_LABELS} surfaces', 'labels': f'{WINDOWS_OF_A_LABEL} windows each'}
LIMIT_S, QUICK_SIZES = 10.0, 2


class _Point(NamedTuple):
    """One recipe with windows of one length."""

    figures: dict[str, Any]
    curve: tuple[Array, Array]  # seconds of sliding, share of slides recognised


def run(bench: Bench) -> BenchResult:
    """Try recipes with windows of many lengths on recorded slides, and learners with trainings of many sizes."""
    [source] = bench.recordings('biotac20')
    setting = biotac20_settings(source, bench)[VIBRATION]
    points = _points(setting.recorded, setting.splits['by time'], bench.quick)
    sizes = _sizes(bench)
    return BenchResult(
        name='frontier',
        measured=(
            'share of single windows recognised and computing time of one (µs, median and 99th percentile) by the '
            'length of the window; share of slides recognised over the sliding time; computing time (s) and memory '
            f'(MiB) of a training on made-up examples, until one takes more than {LIMIT_S:.0f} s'
        ),
        data=f'{DATA["biotac20"]}; PAC at 1 kHz',
        split='by time: learnt from slides 1-30 of each material, windows 0.5 s apart; tested on slides 31-40',
        numbers={
            'by_window_length': {
                name: {f'{length_s:g} s': point.figures for length_s, point in own.items()}
                for name, own in points.items()
            },
            'by_sliding_time': {
                f'{name}, {length_s:g} s': {'s': point.curve[0].round(3).tolist(), 'share': point.curve[1].tolist()}
                for name, own in points.items()
                for length_s, point in own.items()
            },
            'trainings': {grown: {name: _rows(found) for name, found in own.items()} for grown, own in sizes.items()},
        },
        charts=(
            line_chart(
                {name: _line(own) for name, own in points.items()},
                'Recorded slides: windows of 0.05 s (left) to 2 s (right)',
                ('time from window to estimate (µs)', 'single windows recognised (%)'),
                bench.out / 'frontier_windows.png',
                logarithmic=True,
            ),
            evidence_chart(
                {f'windows of {length_s:g} s': point.curve for length_s, point in points[_shown(points)].items()},
                f'Recorded slides recognised by `{_shown(points)}`, by the length of its windows',
                bench.out / 'frontier_sliding.png',
            ),
            size_chart(sizes, FIXED, bench.out / 'frontier_training.png'),
        ),
    )


def _points(recorded: Sequence[Recorded], divisions: Sequence[Division], quick: bool) -> dict[str, dict[float, _Point]]:
    return {
        name: {
            length_s: _point(name, length_s, recorded, divisions)
            for length_s in (QUICK_LENGTHS_S if quick else LENGTHS_S)
        }
        for name in (QUICK_RECIPES if quick else RECIPES)
    }


def _point(name: str, length_s: float, recorded: Sequence[Recorded], divisions: Sequence[Division]) -> _Point:
    recipe = comparable(with_channels(load_recipe(name), 'fast'), RATE_HZ, of_motion=False, length_s=length_s)
    outcome = try_recipe(recipe, recorded, divisions)
    figures = {**outcome.numbers(), 'latency_us': latency_us(recipe, outcome.model, recorded)}
    return _Point(figures, metrics.curve(outcome.results))


def _shown(points: Mapping[str, Any]) -> str:
    return SHOWN if SHOWN in points else next(iter(points))


def _line(points: Mapping[float, _Point]) -> tuple[Array, Array]:
    figures = [point.figures for point in points.values()]
    x = np.array([item['latency_us']['median'] for item in figures])
    return x, np.array([100 * item['window_accuracy'] for item in figures])


def _sizes(bench: Bench) -> dict[str, dict[str, Mapping[Size, Cost]]]:
    return {
        grown: {
            name: costs(name, sizes[:QUICK_SIZES] if bench.quick else sizes, LIMIT_S, bench.seed)
            for name in (QUICK_LEARNERS if bench.quick else LEARNERS)
        }
        for grown, sizes in (('windows', BY_WINDOWS), ('labels', BY_LABELS))
    }


def _rows(found: Mapping[Size, Cost]) -> list[dict[str, float]]:
    return [{**asdict(size), **asdict(item)} for size, item in found.items()]
