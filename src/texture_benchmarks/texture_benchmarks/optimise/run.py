"""How long genetic searches of the papers' size take, what they find, and how far their quick judges can be trusted."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from texture_benchmarks.result import Bench, BenchResult
from texture_core.catalogue import find
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness.grades import TRAIN, read_grades
from texture_estimation.roughness.recipe import load_roughness_recipe
from texture_estimation.search.division import Division
from texture_estimation.search.feature_cache import FeatureCache
from texture_estimation.search.genetic_search import SearchParams
from texture_estimation.search.grading import Grading
from texture_estimation.search.optimise import Optimised, optimise
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.scans import Scans, Stream
from texture_estimation.search.spread import over_cores
from texture_estimation.search.task import Task
from texture_estimation.search.telling_apart import TellingApart
from texture_evaluation.optimise_charts import convergence_chart, search_front_chart
from texture_simulation.offline import simulate_slides
from texture_simulation.scene import load_scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.simulated_slide import SimulatedSlide

Draw = Callable[[Mapping[str, Optimised[Any]], Path], tuple[Path, ...]]

GRADES = 'ets_roughness'
USUAL = SearchParams()
QUICK = SearchParams(population=5, generations=2, halves=3, finalists=1)
QUICK_SCANS = 4  # of each surface, speed and force
# Random individuals, and halves of each, on which a quick judge is compared with the learner itself.
COMPARED, QUICK_COMPARED, COMPARED_HALVES = 12, 4, 3


@dataclass(frozen=True)
class Data:
    """Slides over the surfaces of a scene: so many of each, with each speed and force."""

    scene: str
    speeds_m_s: tuple[float, ...]
    forces_n: tuple[float, ...]
    scan_s: float
    count: int


@dataclass(frozen=True)
class Case:
    """One search: a recipe, its space, the data, and how long it may take on two cores."""

    recipe: str
    space: str
    data: str
    limit_s: float | None
    params: SearchParams = USUAL


DATA: Mapping[str, Data] = {
    'linear': Data('ets_linear', (0.10, 0.15, 0.20), (1.0, 2.5, 5.0), 0.5, 50),
    'fine': Data('ets_fine', (0.125,), (2.0,), 0.8, 200),
    'roughness': Data('roughness', (0.15,), (2.5,), 0.5, 200),
}
FRONT = SearchParams(objective='front')
CASES: Mapping[str, Case] = {
    'linear, SVM': Case('ets-linear-svm', 'ets-svm', 'linear', 60.0),
    'linear, ANN': Case('ets-linear-ann', 'ets-ann', 'linear', 60.0),
    'linear, SVM, no individual given up': Case('ets-linear-svm', 'ets-svm', 'linear', None, SearchParams(race=False)),
    'linear, SVM, front': Case('ets-linear-svm', 'ets-svm-points', 'linear', None, FRONT),
    'linear, ANN, front': Case('ets-linear-ann', 'ets-ann-points', 'linear', None, FRONT),
    'ten textures, SVM': Case('ets-fine-svm', 'ets-fine-svm', 'fine', 300.0),
    'ten textures, ANN': Case('ets-fine-ann', 'ets-fine-ann', 'fine', 300.0),
    'roughness, SVM5': Case('ets-roughness-svm5', 'ets-roughness-svm5', 'roughness', 900.0),
    'roughness, ANN5': Case('ets-roughness-ann5', 'ets-roughness-ann5', 'roughness', 900.0, SearchParams(finalists=1)),
    'roughness, ANN1': Case('ets-roughness-ann1', 'ets-roughness-ann1', 'roughness', 900.0),
}
LINEAR = ('linear, SVM', 'linear, ANN')  # the papers' own
COMPARISONS = (*LINEAR, 'ten textures, ANN')


def run(bench: Bench) -> BenchResult:
    """Run the searches of the linear experiment once, as large as in the paper."""
    return _searched('optimise', LINEAR, (), bench, _charts_linear)


def run_large(bench: Bench) -> BenchResult:
    """Run all searches once, as large as in the papers: half an hour on two cores."""
    return _searched('optimise-large', tuple(CASES), COMPARISONS, bench, _charts)


def _searched(name: str, cases: Sequence[str], comparisons: Sequence[str], bench: Bench, charts: Draw) -> BenchResult:
    felt = {data: _feel(DATA[data], bench) for data in dict.fromkeys(CASES[case].data for case in cases)}
    numbers: dict[str, Any] = {}
    found: dict[str, Optimised[Any]] = {}
    for case in cases:
        numbers[case], found[case] = run_case(CASES[case], felt[CASES[case].data], bench)
    compared = {case: _compare(CASES[case], felt[CASES[case].data], bench) for case in comparisons}
    return BenchResult(
        name=name,
        measured='time of genetic searches on all cores, the best individuals judged again by the learner itself',
        data='simulated: ' + '; '.join(f'{data}: {len(one.labels)} scans' for data, one in felt.items()),
        split=f'{QUICK.halves if bench.quick else USUAL.halves} random halves of the slides, as in the papers',
        numbers={'searches': numbers, **({'quick_against_exact': compared} if compared else {})},
        charts=charts(found, bench.out),
    )


def run_case(case: Case, felt: Scans, bench: Bench) -> tuple[dict[str, Any], Optimised[Any]]:
    """Search once; return the figures and what was found."""
    params = replace(QUICK, objective=case.params.objective, race=case.params.race) if bench.quick else case.params
    params = replace(params, seed=bench.seed)
    space, task = _space_and_task(case)
    load = os.getloadavg()[0]
    began_s, began_cpu_s = time.perf_counter(), time.process_time()
    with over_cores() as spread:
        found = optimise(space, Division(felt, params.halves, params.seed), params, task, spread=spread)
    took_s, cpu_s = time.perf_counter() - began_s, time.process_time() - began_cpu_s
    last = found.found.history[-1]
    best = found.best
    return {
        'wall_s': round(took_s, 1),
        'processor_s': round(cpu_s, 1),
        'limit_s': case.limit_s,
        'load_before': round(load, 1),
        'evaluations': params.population * params.generations,
        'different_individuals': last.judged,
        'halves_judged': last.halves,
        'halves_of_all': last.judged * params.halves,
        'fitness_searched': round(best.searched.fitness, 4),
        'fitness_exact': round(best.fitness, 4),
        'learning': round(float(best.record.learning.mean()), 4),
        'test': round(float(best.record.test.mean()), 4),
        'best': space.variables.named(best.searched.individual),
    }, found


def _space_and_task(case: Case) -> tuple[RecipeSpace[Any], Task[Any]]:
    if case.data == 'roughness':
        return RecipeSpace.load(case.space, load_roughness_recipe(case.recipe)), Grading(read_grades(GRADES))
    return RecipeSpace.load(case.space, load_recipe(case.recipe)), TellingApart()


def _feel(data: Data, bench: Bench) -> Scans:
    """Simulate the scans; of the roughness scene those of the textures that the paper trains on."""
    scene = load_scene(data.scene)
    kind = find(SENSORS, scene.sensor, 'sensor model')
    surfaces = read_grades(GRADES).used_for(TRAIN) if data.scene == 'roughness' else tuple(scene.surfaces)
    count = QUICK_SCANS if bench.quick else data.count
    conditions = [(speed, force) for speed in data.speeds_m_s for force in data.forces_n]
    speed, force = np.repeat(np.array(conditions), count, axis=0).T
    samples = [
        simulate_slides(
            scene,
            surface,
            len(speed),
            SimulatedSlide(speed, force, data.scan_s),
            np.random.default_rng([bench.seed, n]),
        )
        for n, surface in enumerate(surfaces)
    ]
    return Scans(
        {'signal': Stream(np.concatenate(samples).astype(np.float64), kind.fast.rate_hz)},
        np.repeat(surfaces, len(speed)),
        np.tile(speed, len(surfaces)),
        np.tile(force, len(surfaces)),
    )


def _compare(case: Case, felt: Scans, bench: Bench) -> dict[str, float]:
    """Return how a quick judge ranks random individuals, against the learner itself."""
    space, task = _space_and_task(case)
    division = Division(felt, COMPARED_HALVES, bench.seed)
    features = FeatureCache(felt)
    rng = np.random.default_rng(bench.seed)
    compared = QUICK_COMPARED if bench.quick else COMPARED
    fitness = np.empty((2, compared))
    for place in range(compared):
        recipe = space.recipe(space.variables.decode(rng.random(len(space.axes))))
        windows = recipe.training_windows
        values = features.values(task.described(recipe))
        for row, quick in enumerate((True, False)):
            trial = task.trial(recipe, values, division.examples(windows), division.halves(windows), quick=quick)
            half = trial.start()
            fitness[row, place] = np.mean([half(number) for number in range(COMPARED_HALVES)])
    return {
        'individuals': compared,
        'rank_correlation': round(float(spearmanr(*fitness).statistic), 3),
        'mean_difference': round(float((fitness[0] - fitness[1]).mean()), 4),
    }


def _charts_linear(found: Mapping[str, Optimised[Any]], out: Path) -> tuple[Path, ...]:
    told = {name: one.found.history for name, one in found.items()}
    title = 'Searches of the linear experiment (simulated slides)'
    return (convergence_chart(told, title, out / 'optimise_linear.png'),)


def _charts(found: Mapping[str, Optimised[Any]], out: Path) -> tuple[Path, ...]:
    single = {name: one.found.history for name, one in found.items() if CASES[name].params.objective == 'accuracy'}
    fronts: dict[str, Sequence[tuple[float, float]]] = {
        name.removesuffix(', front'): [(point.searched.cost, point.fitness) for point in one.finalists]
        for name, one in found.items()
        if CASES[name].params.objective == 'front'
    }
    told = {name: history for name, history in single.items() if CASES[name].data != 'roughness'}
    graded = {name: history for name, history in single.items() if CASES[name].data == 'roughness'}
    return (
        convergence_chart(told, 'Searches that tell surfaces apart (simulated slides)', out / 'optimise_textures.png'),
        convergence_chart(graded, 'Searches that grade roughness (simulated slides)', out / 'optimise_roughness.png'),
        search_front_chart(
            fronts, 'The linear experiment: fitness and computing (simulated slides)', out / 'optimise_front.png'
        ),
    )
