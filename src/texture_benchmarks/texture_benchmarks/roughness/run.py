"""How long from a window to its grade, in one process."""

from __future__ import annotations

import numpy as np

from texture_benchmarks.roughness.grade_latency import times_us
from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult, histogram_chart
from texture_estimation.roughness import TEST, TRAIN, load_roughness_recipe, read_grades, train_grades
from texture_papers.rispal_experiment import FORCE_N, SPEED_M_S, USED_S, SimulatedTextures
from texture_simulation.scene import load_scene

RECIPES = {'ours': 'roughness', 'SVM5': 'ets-roughness-svm5', 'ANN5': 'ets-roughness-ann5'}
SCANS, QUICK_SCANS = 20, 4
TIMED, QUICK_TIMED = 5000, 200
ROUNDS = 5  # the quickest counts, as other work on the machine only adds
TARGET_US = 200.0


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on simulated scans, then time windows of textures never touched, one by one."""
    grades = read_grades('ets_roughness')
    simulated = SimulatedTextures(load_scene('roughness'), options.seed)
    count = QUICK_SCANS if options.quick else SCANS
    windows = [
        event for texture in grades.used_for(TEST) for event in simulated.events(texture, count, SPEED_M_S, FORCE_N)
    ]
    models = {}
    for name, recipe_name in list(RECIPES.items())[: 1 if options.quick else None]:
        recipe = load_roughness_recipe(recipe_name)
        examples = simulated.extract(recipe.feature_set, grades.used_for(TRAIN), count, SPEED_M_S, FORCE_N)
        models[name] = train_grades(recipe, examples, grades)
    timed = QUICK_TIMED if options.quick else TIMED
    rounds = [{name: times_us(model, windows, timed) for name, model in models.items()} for _ in range(ROUNDS)]
    times = {name: min((taken[name] for taken in rounds), key=np.median) for name in models}
    chart = histogram_chart(
        times,
        'From the samples of a window to the grade, in one process (simulated)',
        'time (µs)',
        options.out / 'roughness-latency.png',
    )
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
        charts=(chart,),
    )
