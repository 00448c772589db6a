# SPDX-License-Identifier: Apache-2.0
"""Accuracy against computing time and sliding time by the length of windows, and what a training costs as it grows."""

from __future__ import annotations

import resource
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from texture_benchmarks.recipes import (
    DATA,
    FIRST,
    LATER,
    LENGTH_S,
    QUICK_FIRST,
    QUICK_MATERIALS,
    QUICK_SLIDES,
    RATE_HZ,
    all_at_rate,
    comparable,
    every,
    figures_of,
    latencies_us,
)
from texture_benchmarks.study import (
    BenchmarkOptions,
    BenchmarkResult,
    decided_at,
    evidence_chart,
    imported,
    in_own_process,
    line_chart,
    map_forked,
)
from texture_core.config import find
from texture_core.types import Array
from texture_estimation.learners.catalogue import LEARNERS
from texture_estimation.learners.learner import Learner
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe, with_channels
from texture_estimation.search import single_blas_thread
from texture_evaluation import metrics
from texture_evaluation.charts import COLOURS, chart
from texture_evaluation.cross_validation import ChronologicalSplit, Split, cross_validate
from texture_recordings.dataset import SlideDataset

N_FEATURES = 68  # those of the default recipe
WINDOWS_PER_SLIDE = 5
# Distance of the classes from each other in every feature, in standard deviations within one.
SPREAD = 0.5
KIB = 1024.0


@dataclass(frozen=True)
class TrainingSize:
    """Of a training: how many windows, and of how many surfaces."""

    windows: int
    labels: int


@dataclass(frozen=True)
class Cost:
    """Computing time (s) of a training, and the memory (MiB) that it took beyond its examples."""

    seconds: float
    mebibytes: float


def costs(learner: str, sizes: Sequence[TrainingSize], limit_s: float, seed: int) -> Mapping[TrainingSize, Cost]:
    """Return the costs of rising sizes, up to the first that would take longer than the limit, in proportion."""
    found: dict[TrainingSize, Cost] = {}
    for size in sizes:
        if found:
            before, last = next(reversed(found.items()))
            if last.seconds * size.windows / before.windows > limit_s:
                break
        found[size] = in_own_process(partial(_cost, find(LEARNERS, learner, 'learner')(), size, seed))
    return found


def _cost(learner: Learner, size: TrainingSize, seed: int) -> Cost:
    rng = np.random.default_rng(seed)
    codes = np.arange(size.windows) % size.labels
    groups = codes + size.labels * (np.arange(size.windows) // (size.labels * WINDOWS_PER_SLIDE))
    centres = SPREAD * rng.standard_normal((size.labels, N_FEATURES))
    values = centres[codes] + rng.standard_normal((size.windows, N_FEATURES))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    learner.fit(values, codes, groups)
    taken = time.process_time() - start
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    return Cost(round(taken, 3), round(used / KIB, 1))


OVERLAPPING_S = 0.1  # windows of LENGTH_S begin so far apart on the robot
CONFIDENCES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999)


class FrontierJob(NamedTuple):
    """A recipe with windows of a length, which begin so far apart as they are long or LENGTH_S, or overlap."""

    name: str
    length_s: float
    overlap: bool = False

    def recipe(self) -> Recipe:
        """Return the recipe of the job."""
        recipe = comparable(
            with_channels(load_recipe(self.name), 'fast'), RATE_HZ, of_motion=False, length_s=self.length_s
        )
        return every(OVERLAPPING_S, recipe) if self.overlap else recipe


class _Point(NamedTuple):
    """What came of a job."""

    model: TextureModel
    figures: dict[str, Any]
    curve: tuple[Array, Array]  # seconds of sliding, share of slides recognised
    early: tuple[Array, Array]  # mean seconds of sliding, share right, when slides end at CONFIDENCES
    rule: Mapping[str, float]  # the same at the fitted rule


def _try(dataset: SlideDataset, split: Split, job: FrontierJob) -> _Point:
    result = cross_validate(job.recipe(), dataset, split.splitter)
    results = result.pooled
    early = decided_at(results, CONFIDENCES)
    rule = metrics.early_decision(results)
    return _Point(result.folds[-1].model, figures_of(result), metrics.curve(results), early, rule)


def try_all(jobs: Sequence[FrontierJob], dataset: SlideDataset, split: Split) -> dict[FrontierJob, _Point]:
    """Return what comes of each job, one on each core; the computing time of windows is taken alone, at the end."""
    tried = dict(zip(jobs, map_forked(partial(_try, dataset, split), jobs), strict=True))
    with single_blas_thread():
        latencies = latencies_us({job: (job.recipe(), point.model, dataset) for job, point in tried.items()})
    for job, latency in latencies.items():
        tried[job].figures['latency_us'] = latency
    return tried


AXES = {'windows': 'training windows', 'labels': 'surfaces'}
COSTS = {'seconds': 'computing time of a training (s)', 'mebibytes': 'memory beyond the examples (MiB)'}
MIN_MIB = 0.1  # nothing measurable


def early_chart(
    lines: Mapping[str, tuple[Array, Array]], rule: tuple[float, float], title: str, path: str | Path
) -> Path:
    """Draw the share of slides decided rightly over their mean length, when each ends at a confidence."""
    with chart(path, (7.0, 4.6)) as figure:
        axes = figure.subplots()
        for (name, (seconds, shares)), colour in zip(lines.items(), COLOURS, strict=False):
            axes.plot(seconds, 100.0 * shares, marker='.', color=colour, label=name)
        axes.plot(rule[0], 100.0 * rule[1], '*', color='black', markersize=12, label='the fitted rule, every 0.1 s')
        axes.set(xlabel='mean sliding time (s)', ylabel='slides decided rightly (%)', title=title)
        axes.set_xlim(left=0)
        axes.legend(loc='lower right')
    return Path(path)


def size_chart(
    panels: Mapping[str, Mapping[str, Mapping[TrainingSize, Cost]]], fixed: Mapping[str, str], path: str | Path
) -> Path:
    """Draw time and memory of trainings over their size, a line for each learner."""
    with chart(path, (10.0, 7.6)) as figure:
        figure.suptitle('Cost of a training by its size (artificial examples)', x=0.02, ha='left', fontweight='bold')
        grid = figure.subplots(2, 2)
        for axes, (cost, axis) in zip(grid.ravel(), product(COSTS, AXES), strict=True):
            for (learner, found), colour in zip(panels[axis].items(), COLOURS, strict=False):
                x = [getattr(size, axis) for size in found]
                y = [max(getattr(item, cost), MIN_MIB if cost == 'mebibytes' else 0.0) for item in found.values()]
                axes.loglog(x, y, marker='.', color=colour, label=learner)
            axes.set(xlabel=f'{AXES[axis]} ({fixed[axis]})', ylabel=COSTS[cost])
        grid[0, 0].legend(loc='best')
    return Path(path)


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
OVERLAPPING = f'{LENGTH_S:g} s, every {OVERLAPPING_S:g} s'
COMPARED_LEARNERS = ('mlp', 'svm_rbf', 'texture_papers.jamali:NaiveBayes', 'texture_papers.kaboli:PassiveAggressive')
QUICK_LEARNERS = ('mlp', 'texture_papers.jamali:NaiveBayes')
FEW_LABELS, WINDOWS_PER_LABEL = 10, 50
BY_WINDOWS = [TrainingSize(windows, FEW_LABELS) for windows in (100, 300, 1_000, 3_000, 10_000, 30_000, 100_000)]
BY_LABELS = [TrainingSize(WINDOWS_PER_LABEL * labels, labels) for labels in (2, 5, 10, 20, 50, 100, 200)]
FIXED = {'windows': f'of {FEW_LABELS} surfaces', 'labels': f'{WINDOWS_PER_LABEL} windows each'}
LIMIT_S, QUICK_SIZES = 18.0, 2


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Try recipes with windows of many lengths on recorded slides, and learners with trainings of many sizes.

    Share of single windows recognised and computing time of one (µs, median and 99th percentile) by the length of the
    window; share of slides recognised over the sliding time, and over its mean when each ends at a confidence;
    computing time (s) and memory (MiB) of a training on artificial examples, up to the size that would take longer
    than 18 s.
    """
    some = (QUICK_SLIDES, QUICK_MATERIALS) if options.quick else ()
    with imported(options, 'biotac20', *some) as bags:
        dataset = all_at_rate(SlideDataset.from_bags(bags, topics=('signal',)), 'signal', RATE_HZ)
    split = Split(LATER, ChronologicalSplit(QUICK_FIRST if options.quick else FIRST))
    recipes = QUICK_RECIPES if options.quick else RECIPES
    name = next(iter(recipes))
    overlap = FrontierJob(name, LENGTH_S, overlap=True)
    tried = try_all([overlap, *(FrontierJob(each, s) for each in recipes for s in recipes[each])], dataset, split)
    points = {each: {f'{s:g} s': tried[FrontierJob(each, s)] for s in recipes[each]} for each in recipes}
    early = {length: point.early for length, point in points[name].items()}
    overlapping = tried[overlap]
    sizes = {
        grown: {
            learner: costs(learner, of[:QUICK_SIZES] if options.quick else of, LIMIT_S, options.seed)
            for learner in (QUICK_LEARNERS if options.quick else COMPARED_LEARNERS)
        }
        for grown, of in (('windows', BY_WINDOWS), ('labels', BY_LABELS))
    }
    return BenchmarkResult(
        name='frontier',
        measured=run.__doc__,
        data=f'{DATA["biotac20"]}; PAC at 1 kHz',
        split='by time: trained on slides 1-30 of each material, windows 0.5 s apart; tested on slides 31-40',
        numbers={
            'by_window_length': {each: {s: point.figures for s, point in own.items()} for each, own in points.items()},
            'ending_at_confidences': {
                'confidences': CONFIDENCES,
                **{length: _rounded(line) for length, line in early.items()},
                'overlapping': _rounded(overlapping.early),
                'overlapping, fitted rule': overlapping.rule,
            },
            'by_sliding_time': {
                f'{each}, {s}': _rounded(point.curve) for each, own in points.items() for s, point in own.items()
            },
            'trainings': {
                grown: {
                    learner: [{**asdict(size), **asdict(cost)} for size, cost in found.items()]
                    for learner, found in own.items()
                }
                for grown, own in sizes.items()
            },
        },
        charts=(
            line_chart(
                {each: _line([point.figures for point in own.values()]) for each, own in points.items()},
                'Recorded slides: windows of 0.05 or 0.1 s (lowest) to 2 s (highest)',
                ('time from window to estimate (µs)', 'single windows recognised (%)'),
                options.out / 'frontier_windows.png',
                logarithmic=True,
            ),
            evidence_chart(
                {f'windows of {length}': point.curve for length, point in points[name].items()},
                f'Recorded slides recognised by `{name}`, by the length of its windows',
                options.out / 'frontier_sliding.png',
            ),
            early_chart(
                {**{f'windows of {s}': line for s, line in early.items()}, OVERLAPPING: overlapping.early},
                (overlapping.rule['mean_s'], overlapping.rule['accuracy']),
                f'Slides that end at a confidence, `{name}`, by the length of its windows',
                options.out / 'frontier_early.png',
            ),
            size_chart(sizes, FIXED, options.out / 'frontier_training.png'),
        ),
    )


def _rounded(curve: tuple[Array, Array]) -> dict[str, list[float]]:
    return {'s': curve[0].round(3).tolist(), 'share': curve[1].round(4).tolist()}


def _line(figures: Sequence[Mapping[str, Any]]) -> tuple[Array, Array]:
    x = np.array([item['latency_us']['median'] for item in figures])
    return x, np.array([100 * item['window_accuracy'] for item in figures])
