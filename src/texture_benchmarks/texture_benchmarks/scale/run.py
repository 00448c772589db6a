"""How training and recognition scale: with the number of textures, and with the number of windows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from texture_benchmarks.imported_data import imported
from texture_benchmarks.recipes.run import DATA, QUICK_MATERIALS, QUICK_SLIDES
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.scale.chart import scale_chart
from texture_benchmarks.scale.drawn_features import DrawnSize, FeatureSpread
from texture_benchmarks.scale.trial import costs_of
from texture_estimation.recipe import load_recipe
from texture_estimation.search.parallel import single_blas_thread
from texture_recordings.slide_dataset import SlideDataset

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
    """Train recipes on drawn features, more and more of them."""
    with single_blas_thread():
        textures = _rows(options, MANY_TEXTURES, QUICK_TEXTURES if options.quick else TEXTURES)
        windows = _rows(options, MANY_WINDOWS, QUICK_WINDOWS if options.quick else WINDOWS)
    return BenchmarkResult(
        name='scale',
        measured=(
            'computing time (s) and memory (MiB) of a training; time from features to estimate (µs); share of single '
            'windows and of slides (of as many windows as those trained on) recognised'
        ),
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
