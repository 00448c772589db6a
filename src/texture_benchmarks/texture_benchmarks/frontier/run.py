"""The frontier: accuracy against computing time and sliding time, and what a training costs as it grows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from texture_benchmarks.charts import evidence_chart, line_chart
from texture_benchmarks.frontier.chart import early_chart, size_chart
from texture_benchmarks.frontier.training_costs import Cost, TrainingSize, costs
from texture_benchmarks.frontier.trial import CONFIDENCES, OVERLAPPING_S, FrontierJob, Points, try_all
from texture_benchmarks.imported_data import imported
from texture_benchmarks.recipes import minirocket
from texture_benchmarks.recipes.run import DATA, FIRST, LATER, QUICK_FIRST, QUICK_MATERIALS, QUICK_SLIDES, RATE_HZ
from texture_benchmarks.recipes.trial import LENGTH_S, all_at_rate
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.arrays import Array
from texture_estimation.search.parallel import single_blas_thread
from texture_evaluation.cross_validation.chronological_split import ChronologicalSplit
from texture_evaluation.cross_validation.splits import Split
from texture_recordings.slide_dataset import SlideDataset

# Ours with windows of all lengths, and of each paper the recipe that recognises most, of those that train in seconds.
LENGTHS_S, FEW_LENGTHS_S = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0), (0.1, 0.5, 2.0)
RECIPES: Mapping[str, Sequence[float]] = {
    'default': LENGTHS_S,
    'fast': LENGTHS_S,
    'hu-log-pca-svm': FEW_LENGTHS_S,
    'ets-linear-svm': FEW_LENGTHS_S,
    'kaboli-svm-rbf': FEW_LENGTHS_S,
    'jamali-naive-bayes-5': FEW_LENGTHS_S,
}
QUICK_RECIPES: Mapping[str, Sequence[float]] = {'fast': (0.1, 0.5)}
SHOWN = 'default'
# MiniRocket takes minutes for training all windows, and time that grows with their square.
ROCKET, ROCKET_EVERY = 'MiniRocket', 2
LEARNERS = ('mlp', 'svm_rbf', 'naive_bayes', 'passive_aggressive')
QUICK_LEARNERS = ('mlp', 'naive_bayes')
FEW_LABELS, WINDOWS_PER_LABEL = 10, 50
BY_WINDOWS = [TrainingSize(windows, FEW_LABELS) for windows in (100, 300, 1_000, 3_000, 10_000, 30_000, 100_000)]
BY_LABELS = [TrainingSize(WINDOWS_PER_LABEL * labels, labels) for labels in (2, 5, 10, 20, 50, 100, 200)]
FIXED = {'windows': f'of {FEW_LABELS} surfaces', 'labels': f'{WINDOWS_PER_LABEL} windows each'}
LIMIT_S, QUICK_SIZES = 18.0, 2


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Try recipes with windows of many lengths on recorded slides, and learners with trainings of many sizes."""
    dataset = _recorded(options)
    split = Split(LATER, ChronologicalSplit(QUICK_FIRST if options.quick else FIRST))
    recipes = QUICK_RECIPES if options.quick else RECIPES
    name = SHOWN if SHOWN in recipes else next(iter(recipes))
    overlap = FrontierJob(name, LENGTH_S, overlap=True)
    tried = try_all([overlap, *(FrontierJob(each, s) for each in recipes for s in recipes[each])], dataset, split)
    points = {each: {s: tried[FrontierJob(each, s)] for s in recipes[each]} for each in recipes}
    shown, overlapping = points[name], tried[overlap]
    with single_blas_thread():
        rocket = _rocket(dataset, split, options)
    sizes = _sizes(options)
    return BenchmarkResult(
        name='frontier',
        measured=(
            'share of single windows recognised and computing time of one (µs, median and 99th percentile) by the '
            'length of the window; share of slides recognised over the sliding time, and over its mean when each ends '
            'at a confidence; computing time (s) and memory '
            f'(MiB) of a training on artificial examples, where {LIMIT_S:.0f} s are enough for it by the size before'
        ),
        data=f'{DATA["biotac20"]}; PAC at 1 kHz',
        split='by time: trained on slides 1-30 of each material, windows 0.5 s apart; tested on slides 31-40',
        numbers={
            'by_window_length': {
                each: {f'{length_s:g} s': figures for length_s, figures in own.items()}
                for each, own in _figures(points).items()
            },
            ROCKET: {f'{length_s:g} s': figures for length_s, figures in rocket.items()}
            or (minirocket.ABSENT if not options.quick else 'not measured in a quick run'),
            'ending_at_confidences': {
                'confidences': CONFIDENCES,
                **{f'{length_s:g} s': _rounded(point.early) for length_s, point in shown.items()},
                'overlapping': _rounded(overlapping.early),
                'overlapping, fitted rule': overlapping.rule,
            },
            'by_sliding_time': {
                f'{each}, {length_s:g} s': _rounded(point.curve)
                for each, own in points.items()
                for length_s, point in own.items()
            },
            'trainings': {
                grown: {learner: _rows(found) for learner, found in own.items()} for grown, own in sizes.items()
            },
        },
        charts=(
            line_chart(
                {
                    each: _line(own)
                    for each, own in {**_figures(points), **({ROCKET: rocket} if rocket else {})}.items()
                },
                'Recorded slides: windows of 0.05 or 0.1 s (lowest) to 2 s (highest)',
                ('time from window to estimate (µs)', 'single windows recognised (%)'),
                options.out / 'frontier_windows.png',
                logarithmic=True,
            ),
            evidence_chart(
                {f'windows of {length_s:g} s': point.curve for length_s, point in shown.items()},
                f'Recorded slides recognised by `{name}`, by the length of its windows',
                options.out / 'frontier_sliding.png',
            ),
            early_chart(
                {
                    **{f'windows of {length_s:g} s': point.early for length_s, point in shown.items()},
                    f'{LENGTH_S:g} s, every {OVERLAPPING_S:g} s': overlapping.early,
                },
                (overlapping.rule['mean_s'], overlapping.rule['accuracy']),
                f'Slides that end at a confidence, `{name}`, by the length of its windows',
                options.out / 'frontier_early.png',
            ),
            size_chart(sizes, FIXED, options.out / 'frontier_training.png'),
        ),
    )


def _recorded(options: BenchmarkOptions) -> SlideDataset:
    slides, materials = (QUICK_SLIDES, QUICK_MATERIALS) if options.quick else ('', ())
    with imported(options, 'biotac20', slides, materials) as bags:
        return all_at_rate(SlideDataset.from_bags(bags, topics=('signal',)), 'signal', RATE_HZ)


def _rocket(dataset: SlideDataset, split: Split, options: BenchmarkOptions) -> dict[float, dict[str, Any]]:
    """Return the figures of MiniRocket by the length of the window; none where it is not installed."""
    if options.quick or not minirocket.installed():
        return {}
    return {
        length_s: minirocket.try_minirocket(dataset, split, options.seed, length_s, ROCKET_EVERY)
        for length_s in FEW_LENGTHS_S
    }


def _figures(points: Points) -> dict[str, dict[float, dict[str, Any]]]:
    return {name: {length_s: point.figures for length_s, point in own.items()} for name, own in points.items()}


def _rounded(curve: tuple[Array, Array]) -> dict[str, list[float]]:
    return {'s': curve[0].round(3).tolist(), 'share': curve[1].round(4).tolist()}


def _line(figures: Mapping[float, dict[str, Any]]) -> tuple[Array, Array]:
    x = np.array([item['latency_us']['median'] for item in figures.values()])
    return x, np.array([100 * item['window_accuracy'] for item in figures.values()])


def _sizes(options: BenchmarkOptions) -> dict[str, dict[str, Mapping[TrainingSize, Cost]]]:
    return {
        grown: {
            name: costs(name, sizes[:QUICK_SIZES] if options.quick else sizes, LIMIT_S, options.seed)
            for name in (QUICK_LEARNERS if options.quick else LEARNERS)
        }
        for grown, sizes in (('windows', BY_WINDOWS), ('labels', BY_LABELS))
    }


def _rows(found: Mapping[TrainingSize, Cost]) -> list[dict[str, float]]:
    return [{**asdict(size), **asdict(item)} for size, item in found.items()]
