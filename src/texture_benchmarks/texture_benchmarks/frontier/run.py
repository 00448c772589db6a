"""The frontier: accuracy against computing time and sliding time, and what a training costs as it grows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from texture_benchmarks.forked import each_on_a_core
from texture_benchmarks.frontier.chart import early_chart, size_chart
from texture_benchmarks.frontier.training_costs import Cost, Size, costs
from texture_benchmarks.imported_data import imported
from texture_benchmarks.recipes import minirocket
from texture_benchmarks.recipes.run import (
    DATA,
    LAST_LEARNT,
    QUICK_LAST_LEARNT,
    QUICK_MATERIALS,
    QUICK_SLIDES,
    RATE_HZ,
)
from texture_benchmarks.recipes.trial import (
    LENGTH_S,
    Division,
    Recorded,
    comparable,
    division_by_time,
    every,
    latency_us,
    read_recorded,
    try_recipe,
)
from texture_benchmarks.result import Bench, BenchResult
from texture_core.arrays import Array
from texture_estimation.model import Model
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.search.spread import one_thread_each
from texture_evaluation import metrics
from texture_evaluation.charts import evidence_chart, line_chart
from texture_evaluation.train import with_channels

# Ours with windows of all lengths, and of each paper the recipe that recognises most, of those that train in seconds.
LENGTHS_S, FEW_LENGTHS_S = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0), (0.1, 0.5, 2.0)
RECIPES: Mapping[str, Sequence[float]] = {
    'default': LENGTHS_S,
    'fast': LENGTHS_S,
    'hu-pca-svm': FEW_LENGTHS_S,
    'ets-linear-svm': FEW_LENGTHS_S,
    'kaboli-svm-rbf': FEW_LENGTHS_S,
    'jamali-naive-bayes-5': FEW_LENGTHS_S,
}
QUICK_RECIPES: Mapping[str, Sequence[float]] = {'fast': (0.1, 0.5)}
SHOWN = 'default'
OVERLAPPING_S = 0.1  # windows of LENGTH_S begin so far apart on the robot
CONFIDENCES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999)
# MiniRocket takes minutes to learn from all windows, and time that grows with their square.
ROCKET, ROCKET_EVERY = 'MiniRocket', 2
LEARNERS = ('mlp', 'svm_rbf', 'naive_bayes', 'passive_aggressive')
QUICK_LEARNERS = ('mlp', 'naive_bayes')
FEW_LABELS, WINDOWS_OF_A_LABEL = 10, 50
BY_WINDOWS = [Size(windows, FEW_LABELS) for windows in (100, 300, 1_000, 3_000, 10_000, 30_000, 100_000)]
BY_LABELS = [Size(WINDOWS_OF_A_LABEL * labels, labels) for labels in (2, 5, 10, 20, 50, 100, 200)]
FIXED = {'windows': f'of {FEW_LABELS} surfaces', 'labels': f'{WINDOWS_OF_A_LABEL} windows each'}
LIMIT_S, QUICK_SIZES = 18.0, 2


class _Job(NamedTuple):
    """A recipe with windows of a length, which begin so far apart as they are long or LENGTH_S, or overlap."""

    name: str
    length_s: float
    overlap: bool = False

    def recipe(self) -> Recipe:
        recipe = comparable(
            with_channels(load_recipe(self.name), 'fast'), RATE_HZ, of_motion=False, length_s=self.length_s
        )
        return every(OVERLAPPING_S, recipe) if self.overlap else recipe


class _Point(NamedTuple):
    """What came of a job."""

    model: Model
    figures: dict[str, Any]
    curve: tuple[Array, Array]  # seconds of sliding, share of slides recognised
    early: tuple[Array, Array]  # mean seconds of sliding, share right, when slides end at CONFIDENCES
    rule: Mapping[str, float]  # the same at the rule learnt


_Points = Mapping[str, Mapping[float, _Point]]  # by recipe and length (s) of its windows


def run(bench: Bench) -> BenchResult:
    """Try recipes with windows of many lengths on recorded slides, and learners with trainings of many sizes."""
    recorded = _recorded(bench)
    slides = [item.slide for item in recorded]
    divisions = division_by_time(slides, QUICK_LAST_LEARNT if bench.quick else LAST_LEARNT)
    recipes = QUICK_RECIPES if bench.quick else RECIPES
    name = SHOWN if SHOWN in recipes else next(iter(recipes))
    overlap = _Job(name, LENGTH_S, overlap=True)
    tried = _try_all([overlap, *(_Job(each, s) for each in recipes for s in recipes[each])], recorded, divisions)
    points = {each: {s: tried[_Job(each, s)] for s in recipes[each]} for each in recipes}
    shown, overlapping = points[name], tried[overlap]
    with one_thread_each():
        rocket = _rocket(recorded, divisions, bench)
    sizes = _sizes(bench)
    return BenchResult(
        name='frontier',
        measured=(
            'share of single windows recognised and computing time of one (µs, median and 99th percentile) by the '
            'length of the window; share of slides recognised over the sliding time, and over its mean when each ends '
            'at a confidence; computing time (s) and memory '
            f'(MiB) of a training on made-up examples, where {LIMIT_S:.0f} s are enough for it by the size before'
        ),
        data=f'{DATA["biotac20"]}; PAC at 1 kHz',
        split='by time: learnt from slides 1-30 of each material, windows 0.5 s apart; tested on slides 31-40',
        numbers={
            'by_window_length': {
                each: {f'{length_s:g} s': figures for length_s, figures in own.items()}
                for each, own in _figures(points).items()
            },
            ROCKET: {f'{length_s:g} s': figures for length_s, figures in rocket.items()}
            or (minirocket.ABSENT if not bench.quick else 'not measured in a quick run'),
            'ending_at_confidences': {
                'confidences': CONFIDENCES,
                **{f'{length_s:g} s': _rounded(point.early) for length_s, point in shown.items()},
                'overlapping': _rounded(overlapping.early),
                'overlapping, rule learnt': overlapping.rule,
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
                bench.out / 'frontier_windows.png',
                logarithmic=True,
            ),
            evidence_chart(
                {f'windows of {length_s:g} s': point.curve for length_s, point in shown.items()},
                f'Recorded slides recognised by `{name}`, by the length of its windows',
                bench.out / 'frontier_sliding.png',
            ),
            early_chart(
                {
                    **{f'windows of {length_s:g} s': point.early for length_s, point in shown.items()},
                    f'{LENGTH_S:g} s, every {OVERLAPPING_S:g} s': overlapping.early,
                },
                (overlapping.rule['mean_s'], overlapping.rule['accuracy']),
                f'Slides that end at a confidence, `{name}`, by the length of its windows',
                bench.out / 'frontier_early.png',
            ),
            size_chart(sizes, FIXED, bench.out / 'frontier_training.png'),
        ),
    )


def _recorded(bench: Bench) -> list[Recorded]:
    slides, materials = (QUICK_SLIDES, QUICK_MATERIALS) if bench.quick else ('', ())
    with imported(bench, 'biotac20', slides, materials) as bags:
        recorded = read_recorded(bags, ('signal',))
    return [item.at_rate('signal', RATE_HZ) for item in recorded]


def _try(recorded: Sequence[Recorded], divisions: Sequence[Division], job: _Job) -> _Point:
    outcome = try_recipe(job.recipe(), recorded, divisions)
    results = outcome.results
    early = metrics.decided_at(results, CONFIDENCES)
    return _Point(outcome.model, outcome.numbers(), metrics.curve(results), early, metrics.early_decision(results))


def _try_all(jobs: Sequence[_Job], recorded: Sequence[Recorded], divisions: Sequence[Division]) -> dict[_Job, _Point]:
    """Return what comes of each job, one on each core; the computing time of windows is taken alone, at the end."""
    tried = dict(zip(jobs, each_on_a_core(partial(_try, recorded, divisions), jobs), strict=True))
    with one_thread_each():
        for job, point in tried.items():
            point.figures['latency_us'] = latency_us(job.recipe(), point.model, recorded)
    return tried


def _rocket(recorded: Sequence[Recorded], divisions: Sequence[Division], bench: Bench) -> dict[float, dict[str, Any]]:
    """Return the figures of MiniRocket by the length of the window; none where it is not installed."""
    if bench.quick or not minirocket.installed():
        return {}
    return {
        length_s: minirocket.try_minirocket(recorded, divisions, bench.seed, length_s, ROCKET_EVERY)
        for length_s in FEW_LENGTHS_S
    }


def _figures(points: _Points) -> dict[str, dict[float, dict[str, Any]]]:
    return {name: {length_s: point.figures for length_s, point in own.items()} for name, own in points.items()}


def _rounded(curve: tuple[Array, Array]) -> dict[str, list[float]]:
    return {'s': curve[0].round(3).tolist(), 'share': curve[1].round(4).tolist()}


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
