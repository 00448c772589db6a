# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How training and recognition scale with the number of textures."""

from __future__ import annotations

import resource
import time
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import eigh

from texture_benchmarks.learning import score
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
from texture_estimation.learners.learner import group_means
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.training import train
from texture_evaluation.cross_validation import single_blas_thread
from texture_features.feature_set import LabelledFeatures


class FeatureSpread:
    """How recorded features vary among textures, among slides over one, and among windows of one; draws others."""

    def __init__(self, examples: LabelledFeatures) -> None:
        _, first, groups = np.unique(examples.groups, return_index=True, return_inverse=True)
        classes = np.unique(examples.labels[first], return_inverse=True)[1]
        slides = group_means(examples.values, groups)
        textures = group_means(slides, classes)
        self._like, self._mean = examples, textures.mean(axis=0)
        self._among_textures = _root(textures - self._mean)
        self._among_slides = _root(slides - textures[classes])
        self._among_windows = _root(examples.values - slides[groups])

    def textures(self, labels: int, rng: np.random.Generator) -> Array:
        """Return the centres of this many textures."""
        return self._mean + rng.standard_normal((labels, len(self._mean))) @ self._among_textures

    def slides(
        self, textures: Array, count: int, windows: int, rng: np.random.Generator, first: int = 1
    ) -> LabelledFeatures:
        """Return windows of `count` slides over each texture; `first` is the number of the first slide."""
        names = [f't{number:04d}' for number in range(len(textures))]
        slides = [f'{name}/{first + number}' for name in names for number in range(count)]
        means = np.repeat(textures, count, axis=0)
        means = means + rng.standard_normal(means.shape) @ self._among_slides
        drawn = rng.standard_normal((len(means) * windows, means.shape[1])) @ self._among_windows
        return LabelledFeatures(
            drawn + np.repeat(means, windows, axis=0),
            np.repeat(names, count * windows),
            np.repeat(slides, windows),
            self._like.names,
            self._like.feature_set,
            self._like.window_s,
            self._like.hop_s,
        )


def _root(deviations: Array) -> Array:
    """Return the symmetric square root of a covariance, from deviations (n, n_features)."""
    values, vectors = eigh(deviations.T @ deviations / max(1, len(deviations) - 1))
    return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


RECIPE = 'default'
TEXTURES, QUICK_TEXTURES = (20, 100, 500, 1000), (6,)
SLIDES, WINDOWS = 5, 5  # trained of each texture, and of each slide
MOST_TESTED = 200
KIB_PER_MIB = 1024.0


def _measure(recipe: Recipe, spread: FeatureSpread, seed: int, labels: int) -> dict[str, Any]:
    """Return what one training on this many textures costs, and what its model recognises of another slide of each."""
    rng = np.random.default_rng(seed)
    textures = spread.textures(labels, rng)
    examples = spread.slides(textures, SLIDES, WINDOWS, rng)
    before, start = _peak_mib(), time.process_time()
    model = train(recipe, examples)
    taken, after = time.process_time() - start, _peak_mib()
    others = spread.slides(textures, 1, WINDOWS, rng, first=SLIDES + 1)
    accuracy = score(model, others.of_slides(np.unique(others.groups)[:: max(1, labels // MOST_TESTED)]))
    return {
        'labels': labels,
        'training_windows': len(examples.labels),
        'train_s': round(taken, 1),
        'memory_beyond_examples_mib': round(after - before, 1),
        'memory_of_the_process_mib': round(after, 1),
        'window_accuracy': accuracy['windows'],
        'slide_accuracy': accuracy['slides'],
    }


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KIB_PER_MIB


TARGETS = {'1000 textures': {'train_s': 300.0, 'memory_mib': 2048.0}}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train a recipe on drawn features of more and more textures.

    Computing time (s) and memory (MiB) of a training; fraction of single windows and of slides (of as many windows as
    those trained on) recognised.
    """
    recipe = load_recipe(RECIPE)
    recipe = replace(recipe, augmentation=replace(recipe.augmentation, copies=0))
    feature_set = replace(recipe.feature_set, windows=recipe.training_windows)
    slides = recorded(options, 'biotac20', (QUICK_SLIDES, QUICK_MATERIALS), topics=feature_set.topics)
    spread = FeatureSpread(slides.features(feature_set))
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
    )
