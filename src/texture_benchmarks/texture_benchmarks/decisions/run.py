"""When recorded slides are decided and how rightly, what the confidence contributes, and what is taken for unknown."""

from __future__ import annotations

from typing import Any

import numpy as np

from texture_benchmarks.decisions.chart import charts
from texture_benchmarks.decisions.trial import (
    QUICK_SLIDES,
    REJECTED,
    TESTED,
    TRAINED,
    UNKNOWN,
    Trial,
    try_recipe,
)
from texture_benchmarks.imported_data import imported
from texture_benchmarks.papers.interval import mean_share
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_estimation.recipe import load_recipe

RECIPES = ('default', 'vibration-and-taxels')
TARGET_REJECTED = 0.05
QUICK_MATERIALS = tuple(f'material{number:02d}' for number in range(1, 5))
TARGETS = {
    'default': {'early_accuracy': 0.97, 'early_mean_s': 1.2},
    'vibration-and-taxels': {'early_accuracy': 0.99, 'early_mean_s': 0.6},
    'calibration_error': 0.03,
    'unknown_accepted': 0.1,
}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on the first 30 slides of each material, decide about the last 10; leave materials out in several draws."""
    slides, materials = (QUICK_SLIDES, QUICK_MATERIALS) if options.quick else ('', ())
    with imported(options, 'biotac20', slides, materials) as bags:
        trials = {name: try_recipe(load_recipe(name), bags, options) for name in RECIPES}
    draws = len(trials[RECIPES[0]].draws)
    return BenchmarkResult(
        name='decisions',
        measured='share of slides decided rightly and mean sliding time when each ends as soon as it is certain; '
        'calibration error over all estimates; share of known slides rejected and of unknown slides accepted after '
        '2.5 s, mean over the draws, with an interval of 95 % for the threshold of the model',
        data=f'BioTac, {len(bags)} materials (github dexrob/BioTac_slide_20_50, Gao et al. 2020)',
        split=f'by slide and by time: trained on slides {TRAINED} of each material, tested on {TESTED}; for unknown '
        f'ones {UNKNOWN} materials are held out, in {draws} draws. Rules are fitted on slides {TRAINED}',
        numbers={'targets': TARGETS, **{name: _numbers(trial) for name, trial in trials.items()}},
        charts=charts(trials, options.out),
    )


def _numbers(trial: Trial) -> dict[str, Any]:
    figures, stopping = trial.figures, trial.model.stopping_rule
    at = REJECTED.index(TARGET_REJECTED)
    means = trial.draws[:, :-1].mean(axis=0)
    return {
        'early': figures['early'],
        'rule': {'confidence': stopping.confidence, 'patience_s': stopping.max_windows * 0.5},
        'accuracy_at_s': figures['accuracy_at_s'],
        'calibration_error': figures['calibration_error'],
        'candidates': {'asked_coverage': trial.model.prediction_sets.coverage, **figures['candidates']},
        'falsely_rejected_when_decided': figures['falsely_rejected'],
        'unknown': {
            'allowed_false_rejections': TARGET_REJECTED,
            'false_rejections': float(means[at, 0]),
            'accepted': float(means[at, 1]),
            'accepted_per_draw': trial.draws[:, at, 1].tolist(),
            'at_the_threshold': {
                'false_rejections': mean_share(trial.draws[:, -1, 0]).as_json(),
                'accepted': mean_share(trial.draws[:, -1, 1]).as_json(),
            },
            'accepted_at_false_rejections': float(np.interp(TARGET_REJECTED, *means.T)),
        },
    }
