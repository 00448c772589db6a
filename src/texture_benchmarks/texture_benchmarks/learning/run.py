"""A model trained more textures slide by slide against one trained again on the same slides, on recorded slides."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.charts import line_chart
from texture_benchmarks.imported_data import imported
from texture_benchmarks.learning.trial import IncrementalRun, Score, run_incremental
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.arrays import Array
from texture_estimation.learners.mlp import Mlp
from texture_estimation.recipe import Recipe, load_recipe
from texture_evaluation.train import training_examples
from texture_recordings.slide_dataset import SlideDataset

RECIPE = 'default'
TRAINED, STAGES, NEW, DRAWS = 30, (1, 2, 5, 10, 30), 5, 3
QUICK_SLIDES, QUICK_TRAINED, QUICK_STAGES = '1-3,31-32', 3, (1, 2)
QUICK_MATERIALS = ('material01', 'material02', 'material03', 'material04')
FOLDS = 2  # for the calibration alone: less to wait for
TARGETS = {'add_ms': 50.0, 'behind_training_points': 3.0}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on 15 materials, add 5 more, test on later slides of all; several draws of the five."""
    recipe = _recipe()
    stages, last_training = (QUICK_STAGES, QUICK_TRAINED) if options.quick else (STAGES, TRAINED)
    slides, materials = (QUICK_SLIDES, QUICK_MATERIALS) if options.quick else ('', ())
    with imported(options, 'biotac20', slides, materials) as bags, tempfile.TemporaryDirectory() as folder:
        examples = training_examples(recipe, SlideDataset.from_bags(bags, topics=recipe.feature_set.topics))
        labels, rng = np.unique(examples.labels), np.random.default_rng(options.seed)
        draws = [rng.permutation(labels)[: 1 if options.quick else NEW] for _ in range(1 if options.quick else DRAWS)]
        incremental_runs = [
            run_incremental(
                recipe,
                examples,
                draw.tolist(),
                last_training=last_training,
                stages=stages,
                path=Path(folder) / f'draw{number}',
            )
            for number, draw in enumerate(draws)
        ]
    return BenchmarkResult(
        name='learning',
        measured='share of test windows and of whole test slides (final estimate) that are right, mean over the '
        'draws; processor time of adding a slide, stored on disk; time to classify a window',
        data=f'BioTac vibration, {len(labels)} materials (github dexrob/BioTac_slide_20_50, Gao et al. 2020), recipe '
        f'{RECIPE} calibrated in {FOLDS} parts',
        split=f'{len(incremental_runs)} draws of {len(draws[0])} new materials: trained on slides '
        f'1-{last_training} of the others, '
        f'trained slide by slide from slide 1 on, tested on the slides after {last_training} of all',
        numbers=_numbers(incremental_runs, draws, stages),
        charts=(_chart(incremental_runs, stages, len(draws[0]), options.out / 'learning.png'),),
    )


def _recipe() -> Recipe:
    recipe = load_recipe(RECIPE)
    learner = recipe.learner
    return replace(recipe, learner=replace(learner, folds=FOLDS)) if isinstance(learner, Mlp) else recipe


def _numbers(
    incremental_runs: Sequence[IncrementalRun], draws: Sequence[Any], stages: Sequence[int]
) -> Mapping[str, Any]:
    added_slide_ms = 1000 * np.concatenate([incremental_run.add_s for incremental_run in incremental_runs])
    gaps = [
        100 * (incremental_run.retrained[stage].windows - incremental_run.incremental[stage].windows)
        for incremental_run in incremental_runs
        for stage in stages
    ]
    return {
        'targets': TARGETS,
        'new': [sorted(draw.tolist()) for draw in draws],
        'slides': {
            str(stage): {
                'incremental': _mean([incremental_run.incremental[stage] for incremental_run in incremental_runs]),
                'retrained': _mean([incremental_run.retrained[stage] for incremental_run in incremental_runs]),
                'incremental, new textures': _mean(
                    [incremental_run.new[stage] for incremental_run in incremental_runs]
                ),
                'incremental, old textures': _mean(
                    [incremental_run.old[stage] for incremental_run in incremental_runs]
                ),
            }
            for stage in stages
        },
        'old textures before any added slide': _mean([incremental_run.before for incremental_run in incremental_runs]),
        'behind_training_points': {
            'most, windows': round(max(gaps), 1),
            'mean, windows': round(float(np.mean(gaps)), 1),
        },
        'add_ms': {
            'added_slides': len(added_slide_ms),
            'median': round(float(np.median(added_slide_ms)), 1),
            '95 %': round(float(np.percentile(added_slide_ms, 95)), 1),
            'longest': round(float(added_slide_ms.max()), 1),
        },
        'predict_us': dict(
            zip(
                ('retrained', 'incremental'),
                np.median([incremental_run.predict_us for incremental_run in incremental_runs], axis=0).round(1),
                strict=True,
            )
        ),
    }


def _mean(scores: Sequence[Score]) -> Mapping[str, float]:
    return {
        field: round(float(np.mean([getattr(score, field) for score in scores])), 4)
        for field in Score.__dataclass_fields__
    }


def _chart(incremental_runs: Sequence[IncrementalRun], stages: Sequence[int], new: int, path: Path) -> Path:
    x = np.array(stages, dtype=float)

    def percent(field: str, what: str) -> Array:
        shares = [
            [getattr(getattr(incremental_run, field)[stage], what) for incremental_run in incremental_runs]
            for stage in stages
        ]
        shown: Array = 100 * np.mean(shares, axis=1)
        return shown

    lines = {
        f'{how}: {what}': (x, percent(field, what))
        for what in ('slides', 'windows')
        for how, field in (
            ('added one slide at a time', 'incremental'),
            ('trained again on the same slides', 'retrained'),
        )
    }
    return line_chart(
        lines,
        f'{new} new materials added to the others (BioTac, later slides of all)',
        ('slides of each new material', 'right (%)'),
        path,
        logarithmic=True,
    )
