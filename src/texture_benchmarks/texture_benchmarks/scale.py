# SPDX-License-Identifier: Apache-2.0
"""How training and recognition scale with the number of textures and of windows."""

from __future__ import annotations

import resource
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigh

from texture_benchmarks.study import (
    DATA,
    QUICK_MATERIALS,
    QUICK_SLIDES,
    BenchmarkOptions,
    BenchmarkResult,
    imported,
    map_forked,
)
from texture_core.types import AnyArray, Array
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.learners.learner import group_means
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.search import single_blas_thread
from texture_estimation.training import train
from texture_evaluation.charts import COLOURS, chart
from texture_features.augmentation import KINDS, NOISE
from texture_features.feature_set import AugmentedFeatures, FeatureCopies, LabelledFeatures
from texture_recordings.dataset import SlideDataset

GAIN_RESPONSES = {'log_bands': 2.0, 'log_power': 2.0, 'log_amplitude': 1.0}  # per natural logarithm of the gain


@dataclass(frozen=True)
class DrawnSize:
    """How much is drawn."""

    labels: int  # Number of textures
    slides: int  # Slides of each
    windows: int  # Windows of each slide
    # copies, disturbed: augmented and disturbed copies of each slide
    copies: int = 0
    disturbed: int = 0


@dataclass(frozen=True, eq=False)
class FeatureSpread:
    """How features vary among textures, among slides over one, and among windows of one."""

    like: LabelledFeatures  # Recorded examples, of which names, fingerprint and windows are taken
    mean: Array  # (n_features,) Of the textures
    # among_textures, among_slides, among_windows: (n_features, n_features) Square roots of the covariances:
    # rows of standard normal numbers times these have them
    among_textures: Array
    among_slides: Array
    among_windows: Array

    @classmethod
    def of(cls, examples: LabelledFeatures) -> FeatureSpread:
        """Measure the covariances of recorded slides."""
        _, first, groups = np.unique(examples.groups, return_index=True, return_inverse=True)
        classes = np.unique(examples.labels[first], return_inverse=True)[1]
        slides = group_means(examples.values, groups)
        textures = group_means(slides, classes)
        return cls(
            examples,
            textures.mean(axis=0),
            _root(textures - textures.mean(axis=0)),
            _root(slides - textures[classes]),
            _root(examples.values - slides[groups]),
        )

    def textures(self, labels: int, rng: np.random.Generator) -> Array:
        """Return the centres of so many textures."""
        return self.mean + rng.standard_normal((labels, len(self.mean))) @ self.among_textures

    def slides(self, textures: Array, size: DrawnSize, rng: np.random.Generator, first: int = 1) -> LabelledFeatures:
        """Return windows of slides over textures, and their copies."""
        names = [f't{number:04d}' for number in range(size.labels)]
        slides = np.array([f'{name}/{first + number}' for name in names for number in range(size.slides)])
        means = np.repeat(textures, size.slides, axis=0)
        means = means + rng.standard_normal(means.shape) @ self.among_slides
        return LabelledFeatures(
            values=self._windows(means, size.windows, rng),
            labels=np.repeat(names, size.slides * size.windows),
            groups=np.repeat(slides, size.windows),
            names=self.like.names,
            feature_set=self.like.feature_set,
            window_s=self.like.window_s,
            hop_s=self.like.hop_s,
            augmented=self._augmented(means, slides, size, rng) if size.copies else None,
        )

    def _augmented(
        self, means: Array, slides: AnyArray, size: DrawnSize, rng: np.random.Generator
    ) -> AugmentedFeatures:
        """Return copies: other windows of the same slides, that half of the copies are called noisy for their cost."""
        response = [next((r for part, r in GAIN_RESPONSES.items() if part in name), 0.0) for name in self.like.names]
        return AugmentedFeatures(
            self._copies(means, slides, size.windows, [*islice(cycle(('', NOISE)), size.copies)], rng=rng),
            self._copies(means, slides, size.windows, [*islice(cycle(KINDS), size.disturbed)], rng=rng),
            np.array(response),
        )

    def _copies(
        self, means: Array, slides: AnyArray, windows: int, kinds: Sequence[str], *, rng: np.random.Generator
    ) -> FeatureCopies:
        count = len(kinds)
        values = np.empty((len(slides), count, windows, len(self.mean)), dtype=np.float32)
        for number in range(count):
            values[:, number] = self._windows(means, windows, rng).reshape(len(slides), windows, -1)
        return FeatureCopies(
            values.reshape(-1, len(self.mean)),
            np.repeat(slides, count * windows),
            np.tile(np.repeat(np.arange(count), windows), len(slides)),
            np.tile(np.repeat(kinds, windows), len(slides)),
        )

    def _windows(self, means: Array, windows: int, rng: np.random.Generator) -> Array:
        drawn = rng.standard_normal((len(means) * windows, means.shape[1])) @ self.among_windows
        drawn += np.repeat(means, windows, axis=0)
        return drawn


def _root(deviations: Array) -> Array:
    """Return the symmetric square root of a covariance, from deviations (n, n_features)."""
    values, vectors = eigh(deviations.T @ deviations / max(1, len(deviations) - 1))
    root: Array = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return root


TESTED_SLIDES, MOST_TESTED, WARM_UP = 1, 200, 50
KIB_PER_MIB = 1024.0


def costs_of(recipe: Recipe, spread: FeatureSpread, size: DrawnSize, seed: int) -> dict[str, Any]:
    """Return what one training costs, and what its model recognises of other slides."""
    trained = recipe if size.copies else replace(recipe, augmentation=replace(recipe.augmentation, copies=0))
    [found] = map_forked(lambda size: _measure(trained, spread, size, seed), [size])
    return found


def _measure(recipe: Recipe, spread: FeatureSpread, size: DrawnSize, seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    textures = spread.textures(size.labels, rng)
    examples = spread.slides(textures, size, rng)
    before, start = _peak_mib(), time.process_time()
    model = train(recipe, examples)
    taken, after = time.process_time() - start, _peak_mib()
    tested = spread.slides(textures, replace(size, slides=TESTED_SLIDES, copies=0), rng, first=size.slides + 1)
    right, latency_us = _tested(model, tested)
    return {
        **asdict(size),
        'training_windows': len(examples.labels),
        'train_s': round(taken, 1),
        'examples_mib': round(_bytes(examples) / KIB_PER_MIB**2, 1),
        'memory_beyond_examples_mib': round(after - before, 1),
        'memory_of_the_process_mib': round(after, 1),
        'window_accuracy': right[0],
        'slide_accuracy': right[1],
        'features_to_estimate_us': {name: round(float(np.percentile(latency_us, q)), 1) for name, q in QUANTILES},
    }


QUANTILES = (('median', 50), ('p99', 99))


def _tested(model: TextureModel, examples: LabelledFeatures) -> tuple[tuple[float, float], Array]:
    """Return the shares of windows and of slides recognised, and the times from features to estimate."""
    slides = np.unique(examples.groups)
    chosen = slides[:: max(1, len(slides) // MOST_TESTED)]
    windows = examples.of_slides(chosen)
    alone = float(np.mean(np.array(model.decide(windows.values)) == windows.labels))
    evidence, right, taken = EvidenceAccumulator(model), [], []
    for slide in chosen.tolist():
        for vector in windows.vectors(slide):
            start = time.perf_counter()
            estimate = evidence.update(vector)
            taken.append(1e6 * (time.perf_counter() - start))
        right.append(estimate.label == slide.partition('/')[0])
    return (alone, float(np.mean(right))), np.array(taken[min(WARM_UP, len(taken) // 2) :])


def _bytes(examples: LabelledFeatures) -> int:
    copies = [examples.augmented.copies, examples.augmented.disturbed] if examples.augmented else []
    return examples.values.nbytes + sum(each.values.nbytes for each in copies)


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KIB_PER_MIB


Rows = Sequence[Mapping[str, Any]]
HEADROOM = 0.05  # above the highest point


def scale_chart(textures: Rows, windows: Rows, path: str | Path) -> Path:
    """Draw accuracy, training time, memory and window time by textures, and time and memory by windows."""
    labels = [row['labels'] for row in textures]
    counts = [row['training_windows'] for row in windows]
    title = 'More textures (default) and more windows (vibration-and-taxels): drawn features, simulated'
    with chart(path, (11.0, 5.6), title) as figure:
        grid = figure.subplots(2, 3)
        _line(grid[0, 0], labels, [100 * row['window_accuracy'] for row in textures], 'single windows', COLOURS[0])
        _line(grid[0, 0], labels, [100 * row['slide_accuracy'] for row in textures], 'slides of 1.5 s', COLOURS[2])
        grid[0, 0].set(ylabel='recognised (%)', ylim=(0, 101))
        grid[0, 0].legend()
        _line(grid[0, 1], labels, [row['features_to_estimate_us']['median'] for row in textures])
        grid[0, 1].set(ylabel='features to estimate, median (µs)')
        _costs(grid[0, 2], grid[1, 0], labels, textures)
        _costs(grid[1, 1], grid[1, 2], counts, windows)
        for axes in (*grid[0], grid[1, 0]):
            axes.set(xlabel='textures', xscale='log')
        for axes in grid[1, 1:]:
            axes.set(xlabel='training windows, 8 copies each', xscale='log')
    return Path(path)


def _costs(seconds: Any, memory: Any, sizes: Sequence[int], rows: Rows) -> None:
    _line(seconds, sizes, [row['train_s'] for row in rows])
    seconds.set(ylabel='training (s)')
    _line(memory, sizes, [row['memory_beyond_examples_mib'] for row in rows], 'beyond the examples')
    _line(memory, sizes, [row['memory_of_the_process_mib'] for row in rows], 'whole process', COLOURS[5])
    memory.set(ylabel='memory (MiB)')
    memory.legend()


def _line(axes: Any, x: Sequence[float], y: Sequence[float], label: str = '', colour: str = COLOURS[0]) -> None:
    below = axes.get_ylim()[1] if axes.lines else 0.0
    axes.plot(x, y, marker='.', color=colour, label=label)
    axes.set_ylim(0, max(below, (1 + HEADROOM) * max(y)))


MANY_TEXTURES, MANY_WINDOWS = 'default', 'vibration-and-taxels'
TEXTURES = tuple(DrawnSize(labels, slides=5, windows=5) for labels in (20, 100, 500, 1000))
# 23 windows, 0.25 s apart, are a slide of 6 s. Copies as the recipe has them.
WINDOWS = tuple(DrawnSize(20, slides, windows=23, copies=8, disturbed=6) for slides in (10, 40, 217))
QUICK_TEXTURES, QUICK_WINDOWS = (DrawnSize(6, 5, 5),), (DrawnSize(3, 8, 5, copies=1, disturbed=1),)
TARGETS = {
    '1000 textures': {'train_s': 300.0, 'memory_mib': 2048.0, 'window_us': 500.0},
    '100 000 windows': {'train_s': 240.0, 'memory_mib': 1024.0},
}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train recipes on drawn features, more and more of them.

    Computing time (s) and memory (MiB) of a training; time from features to estimate (µs); share of single windows
    and of slides (of as many windows as those trained on) recognised.
    """
    with single_blas_thread():
        textures = _rows(options, MANY_TEXTURES, QUICK_TEXTURES if options.quick else TEXTURES)
        windows = _rows(options, MANY_WINDOWS, QUICK_WINDOWS if options.quick else WINDOWS)
    return BenchmarkResult(
        name='scale',
        measured=run.__doc__,
        data=(
            'simulated at the level of features: centres of textures, slides and windows drawn from normal '
            f'distributions with the covariances of recorded ones; covariances from {DATA["biotac20"]}, all slides, '
            f'windows 0.25 s apart. Copies of the slides for `{MANY_WINDOWS}`: other windows of the same slides; '
            f'`{MANY_TEXTURES}` without copies'
        ),
        split='trained on some slides of each texture, tested on another one of each, of up to 400 textures',
        numbers={'targets': TARGETS, f'textures, {MANY_TEXTURES}': textures, f'windows, {MANY_WINDOWS}': windows},
        charts=(scale_chart(textures, windows, options.out / 'scale.png'),),
    )


def _rows(options: BenchmarkOptions, name: str, sizes: Sequence[DrawnSize]) -> list[Mapping[str, Any]]:
    recipe = load_recipe(name)
    feature_set = replace(recipe.feature_set, windows=recipe.training_windows, _layouts={})
    some = (QUICK_SLIDES, QUICK_MATERIALS) if options.quick else ()
    with imported(options, 'biotac20', *some) as bags:
        dataset = SlideDataset.from_bags(bags, topics=feature_set.topics)
        spread = FeatureSpread.of(dataset.features(feature_set))
    del dataset
    return [costs_of(recipe, spread, size, options.seed) for size in sizes]
