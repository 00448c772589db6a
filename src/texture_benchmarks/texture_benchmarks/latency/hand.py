"""A hand of five BioTacs: what recognition with every finger at once costs, and how late its estimates are."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_evaluation.train import train_from_bags
from texture_simulation.scene import load_scene
from texture_simulation.simulated_bags import SlidePlan, write_simulated

if TYPE_CHECKING:
    from texture_benchmarks.ros.live_latency import LiveLatency

SCENE, CLASSES = 'kaboli', 10
RECIPES, QUICK_RECIPES = ('default', 'vibration-and-taxels'), ('default',)
FINGERS, QUICK_FINGERS = 5, 2
PLAN, QUICK_PLAN = SlidePlan(slides=20, slide_s=3.0, force_n=0.5), SlidePlan(slides=3, slide_s=1.5, force_n=0.5)
LIVE_S, QUICK_LIVE_S = 40.0, 3.0
TARGETS = {'cpu_percent': 50.0, 'p99_ms': 10.0}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on one simulated BioTac, then recognise with five of them at once through the running nodes."""
    plan = QUICK_PLAN if options.quick else PLAN
    surfaces = tuple(load_scene(SCENE).surfaces)[:CLASSES]
    with tempfile.TemporaryDirectory() as folder:
        rng = np.random.default_rng(options.seed)
        bags = write_simulated(Path(folder) / 'bags', plan, rng, SCENE, surfaces)
        recipes = QUICK_RECIPES if options.quick else RECIPES
        for recipe in recipes:
            train_from_bags(recipe, bags, f'1-{plan.slides}', Path(folder) / recipe)
        rows = {recipe: _live(Path(folder) / f'{recipe}.skops', surfaces[0], options) for recipe in recipes}
    return BenchmarkResult(
        name='hand',
        measured=(
            f'{QUICK_FINGERS if options.quick else FINGERS} BioTacs slide at once, each with a feature extractor and a '
            'classifier of its own: 2.2 kHz of vibration in batches of 10 ms and 22 slow channels at 100 Hz; windows '
            'of 0.5 s every 0.1 s. Latency from publishing the last sample of a window to receiving its estimate, ms; '
            'computing time of all extractors and classifiers, in percent of one core'
        ),
        data=f'simulated BioTacs, scene {SCENE}, {CLASSES} objects; sensor nodes are not part of it',
        split=f'trained on {plan.slides} slides of each object; timed on new slides',
        numbers={'targets': TARGETS, **rows},
    )


def _live(model: Path, surface: str, options: BenchmarkOptions) -> Mapping[str, Any]:
    from texture_benchmarks.ros.live_latency import LiveSlide, measure  # noqa: PLC0415  # ROS is needed for this alone

    slide = LiveSlide(SCENE, surface, QUICK_LIVE_S if options.quick else LIVE_S, options.seed)
    names = [f'finger{i}' for i in range(QUICK_FINGERS if options.quick else FINGERS)]
    return _numbers(measure(model, slide, names))


def _numbers(fingers: Mapping[str, LiveLatency]) -> dict[str, Any]:
    latency_ms = 1000 * np.concatenate([finger.latency_s for finger in fingers.values()])
    nodes = {node for finger in fingers.values() for node in finger.cpu}
    cpu = {node: 100 * sum(finger.cpu[node] for finger in fingers.values()) for node in sorted(nodes)}
    median, p99 = np.percentile(latency_ms, (50, 99))
    return {
        'estimates': len(latency_ms),
        'expected': sum(finger.expected for finger in fingers.values()),
        'median_ms': float(median),
        'p99_ms': float(p99),
        'longest_ms': float(latency_ms.max()),
        'cpu_percent': {**{node: round(share, 1) for node, share in cpu.items()}, 'all': round(sum(cpu.values()), 1)},
    }
