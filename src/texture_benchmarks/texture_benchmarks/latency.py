# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How long from the last sample of a window to its estimate or grade: in one process, through nodes, with a hand."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult
from texture_core.types import Array
from texture_estimation.roughness import (
    TEST,
    TRAIN,
    RoughnessAccumulator,
    RoughnessModel,
    load_roughness_recipe,
    read_grades,
    train_grades,
)
from texture_evaluation.evaluate import run_model
from texture_evaluation.train import train_from_bags
from texture_features.windows import CutWindow
from texture_papers.rispal_experiment import SimulatedTextures
from texture_recordings.dataset import SlideDataset
from texture_simulation.offline import SlidePlan, write_simulated
from texture_simulation.scene import load_scene

RECIPES = ('default', 'vibration-and-taxels')
CLASSES = 10
SCENE, SURFACE = 'twelve_textures', 'leather'
PASSES = 8  # over the test slides
LIVE_S, QUICK_LIVE_S = 40.0, 3.0
TARGETS = {'in_process_median_us': 150.0, 'in_process_p99_us': 400.0, 'dds_p99_ms': 5.0, 'cpu_percent': 60.0}


def _plan(options: BenchmarkOptions, force_n: float) -> SlidePlan:
    """Return the slides over each surface that a model is trained on."""
    slides, slide_s = (3, 1.5) if options.quick else (20, 3.0)
    return SlidePlan(slides=slides, slide_s=slide_s, force_n=force_n)


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on simulated slides over ten surfaces, then time windows in one process and through the graph.

    Windows of 0.5 s at 1 kHz every 0.1 s. In one process: from window to estimate, after one pass to warm up. Through
    DDS: from publishing the last sample to receiving the TextureEstimate, with feature_extractor and classifier as
    processes while 1 kHz in batches of 10 ms and 28 taxels at 60 Hz stream. CPU in percent of one core; the sensor
    node reads an emulated TSF-85.
    """
    from texture_benchmarks.ros.graph import driver_cpu, measure  # noqa: PLC0415  # ROS is needed for this alone

    plan, timings = _plan(options, 2.0), dict[str, Any]()
    with tempfile.TemporaryDirectory() as name:
        folder, surfaces = Path(name), tuple(load_scene(SCENE).surfaces)[:CLASSES]
        bags = write_simulated(folder / 'bags', plan, np.random.default_rng(options.seed), SCENE, surfaces)
        for recipe in RECIPES:
            model = train_from_bags(recipe, bags, f'1-{plan.slides - 1}', folder / recipe)
            dataset = SlideDataset.from_bags(bags, str(plan.slides))
            cut = [events for _, events in dataset.windows(model.recipe.feature_set)]
            # The last of each slide is its end, which is no window; the first pass warms up.
            passes = [[run_model(model, events)[2][:-1] for events in cut] for _ in range(1 + PASSES)]
            alone_us = np.concatenate([of_slide for timed in passes[1:] for of_slide in timed])
            median, p99 = np.percentile(alone_us, (50, 99)).tolist()
            live_s = QUICK_LIVE_S if options.quick else LIVE_S
            live = measure(folder / f'{recipe}.npz', SCENE, SURFACE, live_s, seed=options.seed)
            alone = {'windows': len(alone_us), 'median_us': median, 'p99_us': p99}
            timings[recipe] = {'in_process': alone, 'dds': live, 'cpu_percent': live.pop('cpu_percent')}
    driver = round(100 * driver_cpu(), 1)
    for timing in timings.values():
        cpu = timing['cpu_percent']
        timing['cpu_percent'] = {'sensor': driver, **cpu, 'all': round(driver + cpu['all'], 1)}
    return BenchmarkResult(
        data='simulated TSF-85, scene bench',
        split=f'trained on slides 1-{plan.slides - 1} of each surface; timed on slide {plan.slides}, live on a new one',
        numbers={'targets': TARGETS, **timings},
    )


HAND_SCENE = 'kaboli'
FINGERS, QUICK_FINGERS = 5, 2
HAND_TARGETS = {'cpu_percent': 50.0, 'p99_ms': 10.0}


def run_hand(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on one simulated BioTac, then recognise with five of them at once through the running nodes.

    Each finger has a separate feature extractor and classifier: 2.2 kHz of vibration in batches of 10 ms and 22
    slow channels at 100 Hz; windows of 0.5 s every 0.1 s. Latency from publishing the last sample of a window to
    receiving its estimate, ms; computing time of all extractors and classifiers, in percent of one core.
    """
    from texture_benchmarks.ros.graph import measure  # noqa: PLC0415  # ROS is needed for this alone

    plan, rows = _plan(options, 0.5), dict[str, Any]()
    surfaces = tuple(load_scene(HAND_SCENE).surfaces)[:CLASSES]
    fingers = [f'finger{number}' for number in range(QUICK_FINGERS if options.quick else FINGERS)]
    with tempfile.TemporaryDirectory() as name:
        folder, live_s = Path(name), QUICK_LIVE_S if options.quick else LIVE_S
        bags = write_simulated(folder / 'bags', plan, np.random.default_rng(options.seed), HAND_SCENE, surfaces)
        for recipe in RECIPES[: 1 if options.quick else None]:
            train_from_bags(recipe, bags, f'1-{plan.slides}', folder / recipe)
            model = folder / f'{recipe}.npz'
            rows[recipe] = measure(model, HAND_SCENE, surfaces[0], live_s, seed=options.seed, fingers=fingers)
    return BenchmarkResult(
        data=f'simulated BioTacs, scene {HAND_SCENE}, {CLASSES} objects; sensor nodes are not part of it',
        split=f'trained on {plan.slides} slides of each object; timed on new slides',
        numbers={'targets': HAND_TARGETS, **rows},
    )


ROUGHNESS_RECIPES = {'ours': 'roughness', 'SVM5': 'ets-roughness-svm5', 'ANN5': 'ets-roughness-ann5'}
SCANS, QUICK_SCANS = 20, 4
TIMED, QUICK_TIMED, WARM_UP = 5000, 200, 200
ROUNDS = 5  # the quickest counts, as other work on the machine only adds
TARGET_US = 200.0


def run_roughness(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on simulated scans, then time windows of textures never touched, one by one, in one process.

    Computing time of a core: features, checks, head and evidence for windows of 0.5 s at 1 kHz; the quickest of 5
    rounds.
    """
    grades = read_grades('ets_roughness')
    simulated = SimulatedTextures(load_scene('roughness'), options.seed)
    count = QUICK_SCANS if options.quick else SCANS
    windows = [event for texture in grades.used_for(TEST) for event in simulated.events(texture, count)]
    models = {}
    for name, recipe_name in list(ROUGHNESS_RECIPES.items())[: 1 if options.quick else None]:
        recipe = load_roughness_recipe(recipe_name)
        examples = simulated.extract(recipe.feature_set, grades.used_for(TRAIN), count)
        models[name] = train_grades(recipe, examples, grades)
    timed = QUICK_TIMED if options.quick else TIMED
    rounds = [{name: grading_us(model, windows, timed) for name, model in models.items()} for _ in range(ROUNDS)]
    times = {name: min((taken[name] for taken in rounds), key=np.median) for name in models}
    percentiles = {name: np.percentile(values, (50, 99)).tolist() for name, values in times.items()}
    return BenchmarkResult(
        data='simulated TSF-85, scene roughness',
        split="by texture, the paper's: 15 for training, windows of the 10 others timed",
        numbers={
            'target_us': TARGET_US,
            **{name: {'median_us': median, 'p99_us': p99} for name, (median, p99) in percentiles.items()},
        },
    )


def grading_us(model: RoughnessModel, windows: Sequence[CutWindow], count: int) -> Array:
    """Return the computing time of `count` windows, taken in turn, µs: of the core, whatever other programs take."""
    evidence, taken_us = RoughnessAccumulator(model), []
    for number in range(WARM_UP + count):
        # each a separate slide: nothing follows a grade that is final
        window = windows[number % len(windows)]
        began = time.thread_time()
        evidence.update(model.recipe.feature_set.extract(window))
        taken_us.append(1e6 * (time.thread_time() - began))
    return np.array(taken_us[WARM_UP:])
