"""Time, results and surrogate quality of genetic searches of the papers' size."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from texture_benchmarks.optimise.cases import (
    CASES,
    COMPARISONS,
    DATA,
    GRADES,
    LINEAR,
    USUAL,
    Data,
    SearchCase,
    space_and_task,
)
from texture_benchmarks.optimise.charts import linear_charts, search_charts
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.catalogue import find
from texture_estimation.roughness.grades import TRAIN, read_grades
from texture_estimation.search.feature_cache import FeatureCache
from texture_estimation.search.generation import SearchParams
from texture_estimation.search.optimise import SearchResult, optimise
from texture_estimation.search.parallel import threaded_map
from texture_estimation.search.search_slides import SearchSlides
from texture_estimation.search.slide_arrays import ArrayStream, SlideArrays
from texture_simulation.offline import simulate_slides
from texture_simulation.scene import load_scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.simulated_slide import SimulatedSlide

Draw = Callable[[Mapping[str, SearchResult[Any]], Path], tuple[Path, ...]]

QUICK = SearchParams(population=5, generations=2, halves=3, finalists=1)
QUICK_SCANS = 4  # of each surface, speed and force
# Random individuals, and halves of each, on which a quick surrogate is compared with the learner itself.
COMPARED, QUICK_COMPARED, COMPARED_HALVES = 12, 4, 3


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Run the searches of the linear experiment once, as large as in the paper."""
    return _searched('optimise', LINEAR, (), options, linear_charts)


def run_large(options: BenchmarkOptions) -> BenchmarkResult:
    """Run all searches once, as large as in the papers: half an hour on two cores."""
    return _searched('optimise-large', tuple(CASES), COMPARISONS, options, search_charts)


def _searched(
    name: str, cases: Sequence[str], comparisons: Sequence[str], options: BenchmarkOptions, charts: Draw
) -> BenchmarkResult:
    measured = {
        data: _simulate_slides(DATA[data], options) for data in dict.fromkeys(CASES[case].data for case in cases)
    }
    numbers: dict[str, Any] = {}
    found: dict[str, SearchResult[Any]] = {}
    for case in cases:
        numbers[case], found[case] = run_case(CASES[case], measured[CASES[case].data], options)
    compared = {case: _compare(CASES[case], measured[CASES[case].data], options) for case in comparisons}
    return BenchmarkResult(
        name=name,
        measured='time of genetic searches on all cores, the best individuals evaluated again by the learner itself',
        data='simulated: ' + '; '.join(f'{data}: {len(one.labels)} scans' for data, one in measured.items()),
        split=f'{QUICK.halves if options.quick else USUAL.halves} random halves of the slides, as in the papers',
        numbers={'searches': numbers, **({'quick_against_exact': compared} if compared else {})},
        charts=charts(found, options.out),
    )


def run_case(
    case: SearchCase, measured: SlideArrays, options: BenchmarkOptions
) -> tuple[dict[str, Any], SearchResult[Any]]:
    """Search once; return the figures and what was found.

    Parameters
    ----------
    case
        Recipe, search space and task.
    measured
        Slides that the search may use.
    options
        Seed, and whether it must be quick.

    Returns
    -------
    (dict, SearchResult)
        Figures as plain values, and all else.
    """
    params = replace(QUICK, objective=case.params.objective, race=case.params.race) if options.quick else case.params
    params = replace(params, seed=options.seed)
    space, task = space_and_task(case)
    load = os.getloadavg()[0]
    began_s, began_cpu_s = time.perf_counter(), time.process_time()
    with threaded_map() as parallel_map:
        found = optimise(
            space, SearchSlides(measured, params.halves, params.seed), params, task, parallel_map=parallel_map
        )
    took_s, cpu_s = time.perf_counter() - began_s, time.process_time() - began_cpu_s
    last = found.found.history[-1]
    best = found.best
    return {
        'wall_s': round(took_s, 1),
        'processor_s': round(cpu_s, 1),
        'limit_s': case.limit_s,
        'load_before': round(load, 1),
        'evaluations': params.population * params.generations,
        'different_individuals': last.evaluated,
        'halves_evaluated': last.halves,
        'halves_of_all': last.evaluated * params.halves,
        'fitness_searched': round(best.searched.fitness, 4),
        'fitness_exact': round(best.fitness, 4),
        'learning': round(float(best.record.learning.mean()), 4),
        'test': round(float(best.record.test.mean()), 4),
        'best': space.variables.named(best.searched.individual),
    }, found


def _simulate_slides(data: Data, options: BenchmarkOptions) -> SlideArrays:
    """Simulate the scans; of the roughness scene those of the textures that the paper trains on."""
    scene = load_scene(data.scene)
    kind = find(SENSORS, scene.sensor, 'sensor model')
    surfaces = read_grades(GRADES).used_for(TRAIN) if data.scene == 'roughness' else tuple(scene.surfaces)
    count = QUICK_SCANS if options.quick else data.count
    conditions = [(speed, force) for speed in data.speeds_m_s for force in data.forces_n]
    speed, force = np.repeat(np.array(conditions), count, axis=0).T
    samples = [
        simulate_slides(
            scene,
            surface,
            len(speed),
            SimulatedSlide(speed, force, data.scan_s),
            np.random.default_rng([options.seed, n]),
        )
        for n, surface in enumerate(surfaces)
    ]
    return SlideArrays(
        {'signal': ArrayStream(np.concatenate(samples).astype(np.float64), kind.fast.rate_hz)},
        np.repeat(surfaces, len(speed)),
        np.tile(speed, len(surfaces)),
        np.tile(force, len(surfaces)),
    )


def _compare(case: SearchCase, measured: SlideArrays, options: BenchmarkOptions) -> dict[str, float]:
    """Return how a quick surrogate ranks random individuals, against the learner itself."""
    space, task = space_and_task(case)
    search_slides = SearchSlides(measured, COMPARED_HALVES, options.seed)
    features = FeatureCache(measured)
    rng = np.random.default_rng(options.seed)
    compared = QUICK_COMPARED if options.quick else COMPARED
    fitness = np.empty((2, compared))
    for place in range(compared):
        recipe = space.recipe(space.variables.decode(rng.random(len(space.axes))))
        windows = recipe.training_windows
        values = features.values(task.feature_set_of(recipe))
        for row, quick in enumerate((True, False)):
            fitness_function = task.fitness_function(
                recipe, values, search_slides.examples(windows), search_slides.halves(windows), quick=quick
            )
            half = fitness_function.start()
            fitness[row, place] = np.mean([half(number) for number in range(COMPARED_HALVES)])
    return {
        'individuals': compared,
        'rank_correlation': round(float(spearmanr(*fitness).statistic), 3),
        'mean_difference': round(float((fitness[0] - fitness[1]).mean()), 4),
    }
