"""When recorded slides are decided and how rightly, what the confidence contributes, and what is taken for unknown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.charts import line_chart
from texture_benchmarks.imported_data import imported
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.arrays import AnyArray, Array
from texture_estimation.classification.training import train
from texture_estimation.model import TextureModel
from texture_estimation.open_set.novelty import EFFECTIVE_WINDOWS, SlideNovelty
from texture_estimation.recipe import Recipe, load_recipe
from texture_evaluation.evaluate import evaluate_dataset
from texture_evaluation.metrics import SlideResult, decided_at
from texture_evaluation.train import training_examples
from texture_features.labelled_features import LabelledFeatures
from texture_recordings.slide_dataset import SlideDataset

RECIPES = ('default', 'vibration-and-taxels')
TRAINED, TESTED = '1-30', '31-40'
CONFIDENCES = (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.98, 0.99, 0.995, 0.999)
UNKNOWN, DRAWS = 5, 10
REJECTED = (0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3)
TARGET_REJECTED = 0.05
QUICK_MATERIALS = tuple(f'material{number:02d}' for number in range(1, 5))
QUICK_SLIDES, QUICK_TRAINED, QUICK_TESTED = '1-8,31-32', '1-8', '9-10'
TARGETS = {
    'default': {'early_accuracy': 0.97, 'early_mean_s': 1.2},
    'vibration-and-taxels': {'early_accuracy': 0.99, 'early_mean_s': 0.6},
    'calibration_error': 0.03,
    'unknown_accepted': 0.1,
}


@dataclass(frozen=True, eq=False)
class _Trial:
    """What came out of one recipe."""

    recipe: Recipe
    model: TextureModel
    results: Sequence[SlideResult]
    figures: dict[str, Any]
    draws: AnyArray  # (n_draws, n_rejected + 1, 2): false rejections and unknown surfaces accepted; shipped last


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on the first 30 slides of each material, decide about the last 10; leave materials out in several draws."""
    slides, materials = (QUICK_SLIDES, QUICK_MATERIALS) if options.quick else ('', ())
    with imported(options, 'biotac20', slides, materials) as bags:
        trials = {name: _try(load_recipe(name), bags, options) for name in RECIPES}
    return BenchmarkResult(
        name='decisions',
        measured='share of slides decided rightly and mean sliding time when each ends as soon as it is certain; '
        'calibration error over all estimates; share of known and of unknown slides taken for unknown after 2.5 s',
        data=f'BioTac, {len(bags)} materials (github dexrob/BioTac_slide_20_50, Gao et al. 2020)',
        split=f'by slide and by time: trained on slides {TRAINED} of each material, tested on {TESTED}; for unknown '
        f'ones {UNKNOWN} materials are held out, in {DRAWS} draws. Rules are fitted on slides {TRAINED}',
        numbers={'targets': TARGETS, **{name: _numbers(trial) for name, trial in trials.items()}},
        charts=_charts(trials, options.out),
    )


def _try(recipe: Recipe, bags: list[Path], options: BenchmarkOptions) -> _Trial:
    first, last = (QUICK_TRAINED, QUICK_TESTED) if options.quick else (TRAINED, TESTED)
    dataset = SlideDataset.from_bags(bags, topics=recipe.feature_set.topics)
    later = dataset.select(last)
    trained = training_examples(recipe, dataset.select(first))
    model = train(recipe, trained)
    report = evaluate_dataset(model, later)
    tested = later.features(recipe.feature_set)
    unknown, draws = (1, 2) if options.quick else (UNKNOWN, DRAWS)
    labels, rng = np.unique(trained.labels), np.random.default_rng(options.seed)
    return _Trial(
        recipe,
        model,
        report.known,
        report.as_json(),
        np.array([_rejected(recipe, trained, tested, rng.permutation(labels)[:unknown]) for _ in range(draws)]),
    )


def _rejected(recipe: Recipe, trained: LabelledFeatures, tested: LabelledFeatures, unknown: AnyArray) -> Array:
    """Return false rejections and unknown surfaces accepted, (n_rejected, 2), at shares of false rejections allowed.

    The threshold is moved so far that these shares of the tested slides over known surfaces are rejected.
    """
    kept = ~np.isin(trained.labels, unknown)
    model = train(recipe, trained.take(kept))
    slides = [np.flatnonzero(tested.groups == group) for group in np.unique(tested.groups)]
    novel = np.isin(tested.labels[[rows[0] for rows in slides]], unknown)
    hops = tested.hop_s / tested.window_s
    scores = np.array([_excess(model, tested.values[rows], hops) for rows in slides])
    limits = np.quantile(scores[~novel], 1.0 - np.array(REJECTED))
    found = [((scores[~novel] > limit).mean(), (scores[novel] <= limit).mean()) for limit in limits]
    shipped = ((scores[~novel] > 0.0).mean(), (scores[novel] <= 0.0).mean())
    return np.array([*found, shipped])


def _excess(model: TextureModel, values: Array, hops: float) -> float:
    """Return the novelty score after 2.5 s of sliding less the threshold of the model."""
    detector = model.novelty_detector
    if detector is None:
        return 0.0
    first = values[: 1 + round((EFFECTIVE_WINDOWS[-1] - 1.0) / hops)]
    evidence = model.recipe.evidence.window_evidence(model.predictor(first))
    novelty = SlideNovelty(detector.distances, len(model.labels))
    for number, window in enumerate(first):
        best = int(evidence[number].argmax())
        novelty.add(window, model.activations(window), best, 1.0 + number * hops)
    mean = evidence.mean(axis=0)
    second, highest = np.partition(mean, -2)[-2:].tolist()
    length = 1.0 + (len(first) - 1) * hops
    return detector.novelty_score(novelty.scores(int(mean.argmax()), highest - second), length) - detector.threshold(
        length
    )


def _numbers(trial: _Trial) -> dict[str, Any]:
    figures, stopping = trial.figures, trial.model.stopping_rule
    at = REJECTED.index(TARGET_REJECTED)
    means, shipped = trial.draws[:, :-1].mean(axis=0), trial.draws[:, -1].mean(axis=0)
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
            'shipped': {'false_rejections': float(shipped[0]), 'accepted': float(shipped[1])},
            'accepted_at_false_rejections': float(np.interp(TARGET_REJECTED, *means.T)),
        },
    }


def _charts(trials: dict[str, _Trial], out: Path) -> tuple[Path, ...]:
    where = f'BioTac, trained on slides {TRAINED}, tested on {TESTED}'
    early = {f'{name}: ending at a confidence': _by_confidence(trial.results) for name, trial in trials.items()}
    early |= {f'{name}: the fitted rule': _point(trial.figures['early']) for name, trial in trials.items()}
    return (
        line_chart(
            early,
            f'Early decisions. {where}',
            ('mean time of sliding (s)', 'slides right (%)'),
            out / 'decisions_early.png',
        ),
        line_chart(
            {
                **{name: _reliability(trial.results) for name, trial in trials.items()},
                'as right as it says': (np.array([30.0, 100.0]), np.array([30.0, 100.0])),
            },
            f'Confidence and how often it is right. {where}',
            ('mean confidence (%)', 'right (%)'),
            out / 'decisions_calibration.png',
        ),
        line_chart(
            {name: tuple(100.0 * trial.draws[:, :-1].mean(axis=0).T) for name, trial in trials.items()},
            f'{UNKNOWN} of 20 materials not in the training set, after 2.5 s. {where}',
            ('known ones taken for unknown (%)', 'unknown ones taken for known (%)'),
            out / 'decisions_unknown.png',
        ),
    )


def _by_confidence(results: Sequence[SlideResult]) -> tuple[Array, Array]:
    """Return mean time (s) and accuracy (%) of slides that end at a confidence, (n,) each."""
    times, shares = decided_at(results, CONFIDENCES)
    return times, 100.0 * shares


def _point(early: dict[str, float]) -> tuple[Array, Array]:
    return np.array([early['mean_s']]), np.array([100.0 * early['accuracy']])


def _reliability(results: Sequence[SlideResult]) -> tuple[Array, Array]:
    """Return mean confidence and accuracy (%) in tenths of the confidence that hold 20 estimates or more."""
    reported = np.array([(e.confidence, e.label == r.surface) for r in results for e in r.estimates], dtype=np.float64)
    bins = np.minimum((10.0 * reported[:, 0]).astype(int), 9)
    used = [reported[bins == number] for number in range(10) if np.count_nonzero(bins == number) >= 20]
    confidence, right = 100.0 * np.array([part.mean(axis=0) for part in used]).reshape(-1, 2).T
    return confidence, right
