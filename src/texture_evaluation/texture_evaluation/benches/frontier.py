"""The frontier: accuracy against computing time and sliding time, and what a training costs as it grows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np

from texture_core.arrays import Array
from texture_estimation.recipe import load_recipe
from texture_evaluation import metrics, minirocket
from texture_evaluation.benches.recipes import DATA, RATE_HZ, VIBRATION, biotac20_settings
from texture_evaluation.benches.result import Bench, BenchResult
from texture_evaluation.charts import evidence_chart, line_chart
from texture_evaluation.frontier_charts import early_chart, size_chart
from texture_evaluation.recipe_trials import LENGTH_S, Division, Recorded, comparable, latency_us, try_recipe
from texture_evaluation.train import with_channels
from texture_evaluation.training_costs import Cost, Size, costs

# Of the recipes that judge each window, those that train in seconds.
RECIPES = ('default', 'fast', 'hu-pca-svm', 'jamali-naive-bayes-5')
LENGTHS_S = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
QUICK_RECIPES, QUICK_LENGTHS_S = ('fast',), (0.1, 0.5)
SHOWN = 'default'
OVERLAPPING_S = 0.1  # windows of LENGTH_S begin so far apart on the robot
CONFIDENCES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999)
# MiniRocket takes minutes to learn from all windows, and time that grows with their square.
ROCKET, ROCKET_LENGTHS_S, ROCKET_EVERY = 'MiniRocket', (0.1, 0.5, 2.0), 2
LEARNERS = ('mlp', 'svm_rbf', 'svm_linear', 'naive_bayes', 'passive_aggressive')
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
    early: tuple[Array, Array]  # mean seconds of sliding, share right, when slides end at CONFIDENCES


def run(bench: Bench) -> BenchResult:
    """Try recipes with windows of many lengths on recorded slides, and learners with trainings of many sizes."""
    [source] = bench.recordings('biotac20')
    setting = biotac20_settings(source, bench)[VIBRATION]
    points = _points(setting.recorded, setting.splits['by time'], bench.quick)
    shown = points[_shown(points)]
    overlapping, rule = _overlapping(_shown(points), setting.recorded, setting.splits['by time'])
    rocket = _rocket(setting.recorded, setting.splits['by time'], bench)
    sizes = _sizes(bench)
    return BenchResult(
        name='frontier',
        measured=(
            'share of single windows recognised and computing time of one (µs, median and 99th percentile) by the '
            'length of the window; share of slides recognised over the sliding time, and over its mean when each ends '
            'at a confidence; computing time (s) and memory '
            f'(MiB) of a training on made-up examples, until one takes more than {LIMIT_S:.0f} s'
        ),
        data=f'{DATA["biotac20"]}; PAC at 1 kHz',
        split='by time: learnt from slides 1-30 of each material, windows 0.5 s apart; tested on slides 31-40',
        numbers={
            'by_window_length': {
                name: {f'{length_s:g} s': figures for length_s, figures in own.items()}
                for name, own in _figures(points).items()
            },
            ROCKET: {f'{length_s:g} s': figures for length_s, figures in rocket.items()}
            or (minirocket.ABSENT if not bench.quick else 'not measured in a quick run'),
            'ending_at_confidences': {
                'confidences': CONFIDENCES,
                **{f'{length_s:g} s': _rounded(point.early) for length_s, point in shown.items()},
                'overlapping': _rounded(overlapping),
                'overlapping, rule learnt': rule,
            },
            'by_sliding_time': {
                f'{name}, {length_s:g} s': _rounded(point.curve)
                for name, own in points.items()
                for length_s, point in own.items()
            },
            'trainings': {grown: {name: _rows(found) for name, found in own.items()} for grown, own in sizes.items()},
        },
        charts=(
            line_chart(
                {
                    name: _line(own)
                    for name, own in {**_figures(points), **({ROCKET: rocket} if rocket else {})}.items()
                },
                'Recorded slides: windows of 0.05 s (left) to 2 s (right)',
                ('time from window to estimate (µs)', 'single windows recognised (%)'),
                bench.out / 'frontier_windows.png',
                logarithmic=True,
            ),
            evidence_chart(
                {f'windows of {length_s:g} s': point.curve for length_s, point in shown.items()},
                f'Recorded slides recognised by `{_shown(points)}`, by the length of its windows',
                bench.out / 'frontier_sliding.png',
            ),
            early_chart(
                {
                    **{f'windows of {length_s:g} s': point.early for length_s, point in shown.items()},
                    f'{LENGTH_S:g} s, every {OVERLAPPING_S:g} s': overlapping,
                },
                (rule['mean_s'], rule['accuracy']),
                f'Slides that end at a confidence, `{_shown(points)}`, by the length of its windows',
                bench.out / 'frontier_early.png',
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
    return _Point(figures, metrics.curve(outcome.results), metrics.decided_at(outcome.results, CONFIDENCES))


def _overlapping(
    name: str, recorded: Sequence[Recorded], divisions: Sequence[Division]
) -> tuple[tuple[Array, Array], Mapping[str, float]]:
    """Return how slides end at CONFIDENCES, and by the rule learnt, with windows that overlap as on the robot."""
    recipe = comparable(with_channels(load_recipe(name), 'fast'), RATE_HZ, of_motion=False)
    windows = replace(recipe.feature_set.windows, hop_s=OVERLAPPING_S)
    recipe = replace(recipe, feature_set=replace(recipe.feature_set, windows=windows, _layouts={}))
    results = try_recipe(recipe, recorded, divisions).results
    return metrics.decided_at(results, CONFIDENCES), metrics.early_decision(results)


def _rocket(recorded: Sequence[Recorded], divisions: Sequence[Division], bench: Bench) -> dict[float, dict[str, Any]]:
    """Return the figures of MiniRocket by the length of the window; none where it is not installed."""
    if bench.quick or not minirocket.installed():
        return {}
    return {
        length_s: minirocket.try_minirocket(recorded, divisions, bench.seed, length_s, ROCKET_EVERY)
        for length_s in ROCKET_LENGTHS_S
    }


def _figures(points: Mapping[str, Mapping[float, _Point]]) -> dict[str, dict[float, dict[str, Any]]]:
    return {name: {length_s: point.figures for length_s, point in own.items()} for name, own in points.items()}


def _rounded(curve: tuple[Array, Array]) -> dict[str, list[float]]:
    return {'s': curve[0].round(3).tolist(), 'share': curve[1].round(4).tolist()}


def _shown(points: Mapping[str, Any]) -> str:
    return SHOWN if SHOWN in points else next(iter(points))


def _line(figures: Mapping[float, dict[str, Any]]) -> tuple[Array, Array]:
    x = np.array([item['latency_us']['median'] for item in figures.values()])
    return x, np.array([100 * item['window_accuracy'] for item in figures.values()])


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
