# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How long from the last sample of a window to its estimate: in one process, and through the nodes."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult
from texture_evaluation.evaluate import run_model
from texture_evaluation.train import train_from_bags
from texture_recordings.dataset import SlideDataset
from texture_simulation.offline import SlidePlan, write_simulated
from texture_simulation.scene import load_scene

RECIPES = ('default', 'vibration-and-taxels')
CLASSES = 10
SCENE, SURFACE = 'twelve_textures', 'leather'
PASSES = 8  # over the test slides
TARGETS = {'in_process_median_us': 150.0, 'in_process_p99_us': 400.0, 'dds_p99_ms': 5.0, 'cpu_percent': 60.0}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on simulated slides over ten surfaces, then time windows in one process and through the graph.

    Windows of 0.5 s at 1 kHz every 0.1 s. In one process: from window to estimate, after one pass to warm up. Through
    DDS: from publishing the last sample to receiving the TextureEstimate, with feature_extractor and classifier as
    processes while 1 kHz in batches of 10 ms and 28 taxels at 60 Hz stream. CPU in percent of one core; the sensor
    node reads an emulated TSF-85.
    """
    from texture_benchmarks.ros.graph import driver_cpu, measure  # noqa: PLC0415  # ROS is needed for this alone

    slides, slide_s, live_s = (3, 1.5, 3.0) if options.quick else (20, 3.0, 40.0)
    plan, timings = SlidePlan(slides=slides, slide_s=slide_s, force_n=2.0), dict[str, Any]()
    with tempfile.TemporaryDirectory() as name:
        folder, surfaces = Path(name), tuple(load_scene(SCENE).surfaces)[:CLASSES]
        bags = write_simulated(folder / 'bags', plan, np.random.default_rng(options.seed), SCENE, surfaces)
        for recipe in RECIPES:
            model = train_from_bags(recipe, bags, f'1-{slides - 1}', folder / recipe)
            dataset = SlideDataset.from_bags(bags, str(slides))
            cut = [events for _, events in dataset.windows(model.recipe.feature_set)]
            # The last of each slide is its end, which is no window; the first pass warms up.
            passes = [[run_model(model, events)[2][:-1] for events in cut] for _ in range(1 + PASSES)]
            alone_us = np.concatenate([of_slide for timed in passes[1:] for of_slide in timed])
            median, p99 = np.percentile(alone_us, (50, 99)).tolist()
            live = measure(folder / f'{recipe}.npz', SCENE, SURFACE, live_s, seed=options.seed)
            alone = {'windows': len(alone_us), 'median_us': median, 'p99_us': p99}
            timings[recipe] = {'in_process': alone, 'dds': live, 'cpu_percent': live.pop('cpu_percent')}
    driver = round(100 * driver_cpu(), 1)
    for timing in timings.values():
        cpu = timing['cpu_percent']
        timing['cpu_percent'] = {'sensor': driver, **cpu, 'all': round(driver + cpu['all'], 1)}
    return BenchmarkResult(
        data=f'simulated TSF-85, scene {SCENE}',
        split=f'trained on slides 1-{slides - 1} of each surface; timed on slide {slides}, live on a new one',
        numbers={'targets': TARGETS, **timings},
    )
