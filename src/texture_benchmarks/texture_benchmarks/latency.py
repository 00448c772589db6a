# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How long from the last sample of a window to its estimate or grade: in one process, through nodes, with a hand."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
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
from texture_papers.rispal_experiment import FORCE_N, SPEED_M_S, USED_S, SimulatedTextures
from texture_recordings.dataset import SlideDataset
from texture_simulation.offline import SlidePlan, write_simulated
from texture_simulation.scene import load_scene

RECIPES = ('default', 'vibration-and-taxels')
CLASSES = 10
PASSES = 8  # over the test slides
PLAN, QUICK_PLAN = SlidePlan(slides=20, slide_s=3.0), SlidePlan(slides=3, slide_s=1.5)
LIVE_S, QUICK_LIVE_S = 40.0, 3.0
TARGETS = {'in_process_median_us': 150.0, 'in_process_p99_us': 400.0, 'dds_p99_ms': 5.0, 'cpu_percent': 60.0}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on simulated slides over ten surfaces, then time windows in one process and through the graph.

    Windows of 0.5 s at 1 kHz every 0.1 s. In one process: from window to estimate, after one pass to warm up. Through
    DDS: from publishing the last sample to receiving the TextureEstimate, with feature_extractor and classifier as
    processes while 1 kHz in batches of 10 ms and 28 taxels at 60 Hz stream. CPU in percent of one core; the sensor
    node reads an emulated TSF-85.
    """
    from texture_benchmarks.ros.graph import driver_cpu  # noqa: PLC0415  # ROS is needed for this alone

    plan = QUICK_PLAN if options.quick else PLAN
    with tempfile.TemporaryDirectory() as folder:
        surfaces = tuple(load_scene('twelve_textures').surfaces)[:CLASSES]
        bags = write_simulated(Path(folder) / 'bags', plan, np.random.default_rng(options.seed), surfaces=surfaces)
        timings = {recipe: _time(recipe, bags, plan.slides, Path(folder), options) for recipe in RECIPES}
    driver = round(100 * driver_cpu(), 1)
    for timing in timings.values():
        cpu = {'sensor': driver, **timing['dds'].pop('cpu_percent')}
        timing['cpu_percent'] = {**cpu, 'all': round(sum(cpu.values()), 1)}
    return BenchmarkResult(
        name='latency',
        measured=run.__doc__,
        data='simulated TSF-85, scene bench',
        split=f'trained on slides 1-{plan.slides - 1} of each surface; timed on slide {plan.slides}, live on a new one',
        numbers={'targets': TARGETS, **timings},
    )


def _time(recipe: str, bags: list[Path], slides: int, folder: Path, options: BenchmarkOptions) -> dict[str, Any]:
    """Return the figures of one recipe: in one process, and through the graph."""
    from texture_benchmarks.ros.graph import LiveSlide, measure  # noqa: PLC0415

    model = train_from_bags(recipe, bags, f'1-{slides - 1}', folder / recipe)
    cut = [events for _, events in SlideDataset.from_bags(bags, str(slides)).windows(model.recipe.feature_set)]
    # The last of each slide is its end, which is no window; the first pass warms up.
    passes = [[run_model(model, events)[2][:-1] for events in cut] for _ in range(1 + PASSES)]
    alone_us = np.concatenate([of_slide for timed in passes[1:] for of_slide in timed])
    median, p99 = np.percentile(alone_us, (50, 99)).tolist()
    slide = LiveSlide('twelve_textures', 'leather', QUICK_LIVE_S if options.quick else LIVE_S, options.seed)
    [live] = measure(folder / f'{recipe}.npz', slide).values()
    return {'in_process': {'windows': len(alone_us), 'median_us': median, 'p99_us': p99}, 'dds': live.numbers()}


HAND_SCENE, HAND_CLASSES = 'kaboli', 10
HAND_RECIPES, QUICK_RECIPES = ('default', 'vibration-and-taxels'), ('default',)
FINGERS, QUICK_FINGERS = 5, 2
HAND_PLAN, HAND_QUICK_PLAN = (
    SlidePlan(slides=20, slide_s=3.0, force_n=0.5),
    SlidePlan(slides=3, slide_s=1.5, force_n=0.5),
)
HAND_LIVE_S, HAND_QUICK_LIVE_S = 40.0, 3.0
HAND_TARGETS = {'cpu_percent': 50.0, 'p99_ms': 10.0}


def run_hand(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on one simulated BioTac, then recognise with five of them at once through the running nodes.

    Each finger has a separate feature extractor and classifier: 2.2 kHz of vibration in batches of 10 ms and 22
    slow channels at 100 Hz; windows of 0.5 s every 0.1 s. Latency from publishing the last sample of a window to
    receiving its estimate, ms; computing time of all extractors and classifiers, in percent of one core.
    """
    plan = HAND_QUICK_PLAN if options.quick else HAND_PLAN
    surfaces = tuple(load_scene(HAND_SCENE).surfaces)[:HAND_CLASSES]
    with tempfile.TemporaryDirectory() as folder:
        rng = np.random.default_rng(options.seed)
        bags = write_simulated(Path(folder) / 'bags', plan, rng, HAND_SCENE, surfaces)
        recipes = QUICK_RECIPES if options.quick else HAND_RECIPES
        for recipe in recipes:
            train_from_bags(recipe, bags, f'1-{plan.slides}', Path(folder) / recipe)
        rows = {recipe: _live_hand(Path(folder) / f'{recipe}.npz', surfaces[0], options) for recipe in recipes}
    return BenchmarkResult(
        name='hand',
        measured=run_hand.__doc__,
        data=f'simulated BioTacs, scene {HAND_SCENE}, {HAND_CLASSES} objects; sensor nodes are not part of it',
        split=f'trained on {plan.slides} slides of each object; timed on new slides',
        numbers={'targets': HAND_TARGETS, **rows},
    )


def _live_hand(model: Path, surface: str, options: BenchmarkOptions) -> Mapping[str, Any]:
    from texture_benchmarks.ros.graph import LiveLatency, LiveSlide, measure  # noqa: PLC0415  # ROS is needed for this

    slide = LiveSlide(HAND_SCENE, surface, HAND_QUICK_LIVE_S if options.quick else HAND_LIVE_S, options.seed)
    names = [f'finger{i}' for i in range(QUICK_FINGERS if options.quick else FINGERS)]
    fingers = list(measure(model, slide, names).values())
    cpu = {node: sum(finger.cpu[node] for finger in fingers) for node in sorted(fingers[0].cpu)}
    latency_s = np.concatenate([finger.latency_s for finger in fingers])
    all_of_them = LiveLatency(latency_s, sum(finger.expected for finger in fingers), cpu | {'all': sum(cpu.values())})
    numbers: dict[str, Any] = all_of_them.numbers()
    return numbers


ROUGHNESS_RECIPES = {'ours': 'roughness', 'SVM5': 'ets-roughness-svm5', 'ANN5': 'ets-roughness-ann5'}
SCANS, QUICK_SCANS = 20, 4
TIMED, QUICK_TIMED, WARM_UP = 5000, 200, 200
ROUNDS = 5  # the quickest counts, as other work on the machine only adds
TARGET_US = 200.0


def run_roughness(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on simulated scans, then time windows of textures never touched, one by one."""
    grades = read_grades('ets_roughness')
    simulated = SimulatedTextures(load_scene('roughness'), options.seed)
    count = QUICK_SCANS if options.quick else SCANS
    windows = [
        event for texture in grades.used_for(TEST) for event in simulated.events(texture, count, SPEED_M_S, FORCE_N)
    ]
    models = {}
    for name, recipe_name in list(ROUGHNESS_RECIPES.items())[: 1 if options.quick else None]:
        recipe = load_roughness_recipe(recipe_name)
        examples = simulated.extract(recipe.feature_set, grades.used_for(TRAIN), count, SPEED_M_S, FORCE_N)
        models[name] = train_grades(recipe, examples, grades)
    timed = QUICK_TIMED if options.quick else TIMED
    rounds = [{name: grading_us(model, windows, timed) for name, model in models.items()} for _ in range(ROUNDS)]
    times = {name: min((taken[name] for taken in rounds), key=np.median) for name in models}
    percentiles = {name: np.percentile(values, (50, 99)).tolist() for name, values in times.items()}
    return BenchmarkResult(
        name='roughness-latency',
        measured=(
            f'computing time of a core: features, checks, head and evidence for windows of {USED_S} s at 1 kHz, '
            f'one by one, in one process; the quickest of {ROUNDS} rounds'
        ),
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
