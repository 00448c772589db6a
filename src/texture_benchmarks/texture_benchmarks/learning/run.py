"""A model taught more textures slide by slide against one trained anew on the same slides, on recorded slides."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.imported_data import imported
from texture_benchmarks.learning.trial import Course, Score, try_course
from texture_benchmarks.result import Bench, BenchResult
from texture_core.arrays import Array
from texture_estimation.learners.mlp import Mlp
from texture_estimation.recipe import Recipe, load_recipe
from texture_evaluation.charts import line_chart
from texture_recordings.dataset import describe

RECIPE = 'default'
TAUGHT, STAGES, NEW, DRAWS = 30, (1, 2, 5, 10, 30), 5, 3
QUICK_SLIDES, QUICK_TAUGHT, QUICK_STAGES = '1-3,31-32', 3, (1, 2)
QUICK_MATERIALS = ('material01', 'material02', 'material03', 'material04')
FOLDS = 2  # for the calibration alone: less to wait for
TARGETS = {'lesson_ms': 50.0, 'behind_training_points': 3.0}


def run(bench: Bench) -> BenchResult:
    """Train on 15 materials, teach 5 more, test on later slides of all; several draws of the five."""
    recipe = _recipe()
    stages, taught = (QUICK_STAGES, QUICK_TAUGHT) if bench.quick else (STAGES, TAUGHT)
    slides, materials = (QUICK_SLIDES, QUICK_MATERIALS) if bench.quick else ('', ())
    with imported(bench, 'biotac20', slides, materials) as bags, tempfile.TemporaryDirectory() as folder:
        examples = describe(bags, replace(recipe.feature_set, windows=recipe.training_windows))
        labels, rng = np.unique(examples.labels), np.random.default_rng(bench.seed)
        draws = [rng.permutation(labels)[: 1 if bench.quick else NEW] for _ in range(1 if bench.quick else DRAWS)]
        courses = [
            try_course(
                recipe, examples, draw.tolist(), taught=taught, stages=stages, path=Path(folder) / f'draw{number}'
            )
            for number, draw in enumerate(draws)
        ]
    return BenchResult(
        name='learning',
        measured='share of test windows and whole test slides (summed log-probabilities) that are right, mean over the '
        'draws; time of a lesson with its writing to disk, by the clock of the processor; time to judge a window',
        data=f'BioTac vibration, {len(labels)} materials (github dexrob/BioTac_slide_20_50, Gao et al. 2020), recipe '
        f'{RECIPE} calibrated in {FOLDS} parts',
        split=f'{len(courses)} draws of {len(draws[0])} new materials: trained on slides 1-{taught} of the others, '
        f'taught slide by slide from slide 1 on, tested on the slides after {taught} of all',
        numbers=_numbers(courses, draws, stages),
        charts=(_chart(courses, stages, len(draws[0]), bench.out / 'learning.png'),),
    )


def _recipe() -> Recipe:
    recipe = load_recipe(RECIPE)
    learner = recipe.learner
    return replace(recipe, learner=replace(learner, folds=FOLDS)) if isinstance(learner, Mlp) else recipe


def _numbers(courses: Sequence[Course], draws: Sequence[Any], stages: Sequence[int]) -> Mapping[str, Any]:
    lesson_ms = 1000 * np.concatenate([course.lesson_s for course in courses])
    gaps = [
        100 * (course.trained[stage].windows - course.taught[stage].windows) for course in courses for stage in stages
    ]
    return {
        'targets': TARGETS,
        'new': [sorted(draw.tolist()) for draw in draws],
        'slides': {
            str(stage): {
                'taught': _mean([course.taught[stage] for course in courses]),
                'trained': _mean([course.trained[stage] for course in courses]),
                'taught, new textures': _mean([course.new[stage] for course in courses]),
                'taught, old textures': _mean([course.old[stage] for course in courses]),
            }
            for stage in stages
        },
        'old textures before any lesson': _mean([course.before for course in courses]),
        'behind_training_points': {
            'most, windows': round(max(gaps), 1),
            'mean, windows': round(float(np.mean(gaps)), 1),
        },
        'lesson_ms': {
            'lessons': len(lesson_ms),
            'median': round(float(np.median(lesson_ms)), 1),
            '95 %': round(float(np.percentile(lesson_ms, 95)), 1),
            'longest': round(float(lesson_ms.max()), 1),
        },
        'judge_us': dict(
            zip(('trained', 'taught'), np.median([course.judge_us for course in courses], axis=0).round(1), strict=True)
        ),
    }


def _mean(scores: Sequence[Score]) -> Mapping[str, float]:
    return {
        'windows': round(float(np.mean([score.windows for score in scores])), 4),
        'slides': round(float(np.mean([score.slides for score in scores])), 4),
    }


def _chart(courses: Sequence[Course], stages: Sequence[int], new: int, path: Path) -> Path:
    x = np.array(stages, dtype=float)

    def percent(field: str, what: str) -> Array:
        shares = [[getattr(getattr(course, field)[stage], what) for course in courses] for stage in stages]
        shown: Array = 100 * np.mean(shares, axis=1)
        return shown

    lines = {
        f'{how}: {what}': (x, percent(field, what))
        for what in ('slides', 'windows')
        for how, field in (('taught one slide at a time', 'taught'), ('trained anew on the same slides', 'trained'))
    }
    return line_chart(
        lines,
        f'{new} new materials learnt beside the others (BioTac, later slides of all)',
        ('slides of each new material', 'right (%)'),
        path,
        logarithmic=True,
    )
