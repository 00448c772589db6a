# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How training and recognition scale with the number of textures."""

from __future__ import annotations

import resource
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
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
    map_forked,
    recorded,
)
from texture_core.types import Array
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.learners.learner import group_means
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.training import train
from texture_evaluation.charts import COLOURS, chart
from texture_evaluation.cross_validation import single_blas_thread
from texture_features.feature_set import LabelledFeatures


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
        """Return the centres of this many textures."""
        return self.mean + rng.standard_normal((labels, len(self.mean))) @ self.among_textures

    def slides(
        self, textures: Array, count: int, windows: int, rng: np.random.Generator, first: int = 1
    ) -> LabelledFeatures:
        """Return windows of `count` slides over each texture; `first` is the number of the first slide."""
        names = [f't{number:04d}' for number in range(len(textures))]
        slides = [f'{name}/{first + number}' for name in names for number in range(count)]
        means = np.repeat(textures, count, axis=0)
        means = means + rng.standard_normal(means.shape) @ self.among_slides
        drawn = rng.standard_normal((len(means) * windows, means.shape[1])) @ self.among_windows
        return LabelledFeatures(
            values=drawn + np.repeat(means, windows, axis=0),
            labels=np.repeat(names, count * windows),
            groups=np.repeat(slides, windows),
            names=self.like.names,
            feature_set=self.like.feature_set,
            window_s=self.like.window_s,
            hop_s=self.like.hop_s,
        )


def _root(deviations: Array) -> Array:
    """Return the symmetric square root of a covariance, from deviations (n, n_features)."""
    values, vectors = eigh(deviations.T @ deviations / max(1, len(deviations) - 1))
    return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


RECIPE = 'default'
TEXTURES, QUICK_TEXTURES = (20, 100, 500, 1000), (6,)
SLIDES, WINDOWS = 5, 5  # trained of each texture, and of each slide
MOST_TESTED, WARM_UP = 200, 50
KIB_PER_MIB = 1024.0


def _measure(recipe: Recipe, spread: FeatureSpread, seed: int, labels: int) -> dict[str, Any]:
    """Return what one training on this many textures costs, and what its model recognises of another slide of each."""
    rng = np.random.default_rng(seed)
    textures = spread.textures(labels, rng)
    examples = spread.slides(textures, SLIDES, WINDOWS, rng)
    before, start = _peak_mib(), time.process_time()
    model = train(recipe, examples)
    taken, after = time.process_time() - start, _peak_mib()
    (window_accuracy, slide_accuracy), latency_us = _tested(
        model, spread.slides(textures, 1, WINDOWS, rng, first=SLIDES + 1)
    )
    median, p99 = np.percentile(latency_us, (50, 99)).round(1).tolist()
    return {
        'labels': labels,
        'training_windows': len(examples.labels),
        'train_s': round(taken, 1),
        'memory_beyond_examples_mib': round(after - before, 1),
        'memory_of_the_process_mib': round(after, 1),
        'window_accuracy': window_accuracy,
        'slide_accuracy': slide_accuracy,
        'features_to_estimate_us': {'median': median, 'p99': p99},
    }


def _tested(model: TextureModel, examples: LabelledFeatures) -> tuple[tuple[float, float], Array]:
    """Return the accuracy of windows and of slides, and the times from features to estimate."""
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


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KIB_PER_MIB


def scale_chart(rows: Sequence[Mapping[str, Any]], path: str | Path) -> Path:
    """Draw accuracy, training time, memory and the time of an estimate by textures."""
    lines: Mapping[str, Mapping[str, Sequence[float]]] = {
        'recognised (%)': {
            'single windows': [100 * row['window_accuracy'] for row in rows],
            'slides of 1.5 s': [100 * row['slide_accuracy'] for row in rows],
        },
        'features to estimate, median (µs)': {'': [row['features_to_estimate_us']['median'] for row in rows]},
        'training (s)': {'': [row['train_s'] for row in rows]},
        'memory (MiB)': {
            'beyond the examples': [row['memory_beyond_examples_mib'] for row in rows],
            'whole process': [row['memory_of_the_process_mib'] for row in rows],
        },
    }
    with chart(path, (9.0, 5.6), f'More textures ({RECIPE}): drawn features, simulated', points=11.0) as figure:
        for axes, (what, curves) in zip(figure.subplots(2, 2, sharex=True).flat, lines.items(), strict=True):
            for (label, values), colour in zip(curves.items(), COLOURS, strict=False):
                axes.plot([row['labels'] for row in rows], values, marker='.', color=colour, label=label)
            axes.set(title=what, xscale='log', ylim=(0, None))
            if len(curves) > 1:
                axes.legend()
        for axes in figure.axes[2:]:
            axes.set_xlabel('textures')
    return Path(path)


TARGETS = {'1000 textures': {'train_s': 300.0, 'memory_mib': 2048.0, 'window_us': 500.0}}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train a recipe on drawn features of more and more textures.

    Computing time (s) and memory (MiB) of a training; time from features to estimate (µs); fraction of single windows
    and of slides (of as many windows as those trained on) recognised.
    """
    recipe = load_recipe(RECIPE)
    recipe = replace(recipe, augmentation=replace(recipe.augmentation, copies=0))
    feature_set = replace(recipe.feature_set, windows=recipe.training_windows)
    slides = recorded(options, 'biotac20', (QUICK_SLIDES, QUICK_MATERIALS), topics=feature_set.topics)
    spread = FeatureSpread.of(slides.features(feature_set))
    measure = partial(_measure, recipe, spread, options.seed)
    counts = QUICK_TEXTURES if options.quick else TEXTURES
    with single_blas_thread():
        rows = [map_forked(measure, [labels])[0] for labels in counts]  # each alone, for its memory
    return BenchmarkResult(
        data='simulated at the level of features: centres of textures, slides and windows drawn from normal '
        f'distributions with the covariances of recorded ones; covariances from {DATA["biotac20"]}, all slides, '
        'windows 0.25 s apart; no augmented copies',
        split='trained on some slides of each texture, tested on another one of each, of up to 400 textures',
        numbers={'targets': TARGETS, f'textures, {RECIPE}': rows},
        charts=(scale_chart(rows, options.out / 'scale.png'),),
    )
