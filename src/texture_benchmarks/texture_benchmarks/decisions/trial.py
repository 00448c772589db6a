"""One recipe on later slides, and on slides of unknown surfaces."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.result import BenchmarkOptions
from texture_benchmarks.shared_models import trained_once
from texture_core.arrays import AnyArray, Array
from texture_estimation.classification.training import train
from texture_estimation.model import TextureModel
from texture_estimation.open_set.novelty import EFFECTIVE_WINDOWS, SlideNovelty
from texture_estimation.recipe import Recipe
from texture_evaluation.evaluate import evaluate_dataset
from texture_evaluation.metrics import SlideResult
from texture_evaluation.train import training_examples
from texture_features.labelled_features import LabelledFeatures
from texture_recordings.slide_dataset import SlideDataset

TRAINED, TESTED = '1-30', '31-40'
UNKNOWN, DRAWS = 5, 3  # each draw is a training of its own
REJECTED = (0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3)
QUICK_SLIDES, QUICK_TRAINED, QUICK_TESTED = '1-8,31-32', '1-8', '9-10'


@dataclass(frozen=True, eq=False)
class Trial:
    """What came out of one recipe."""

    recipe: Recipe
    model: TextureModel
    results: Sequence[SlideResult]
    figures: dict[str, Any]
    draws: AnyArray  # (n_draws, n_rejected + 1, 2): false rejections and unknown surfaces accepted; shipped last


def try_recipe(recipe: Recipe, bags: list[Path], options: BenchmarkOptions) -> Trial:
    """Train a recipe on the first slides, decide about the later ones, and hold materials out in several draws.

    Parameters
    ----------
    recipe
        What is trained.
    bags
        Of all materials.
    options
        Seed, and whether to hurry.

    Returns
    -------
    Trial
        Model, results and figures.
    """
    first, last = (QUICK_TRAINED, QUICK_TESTED) if options.quick else (TRAINED, TESTED)
    dataset = SlideDataset.from_bags(bags, topics=recipe.feature_set.topics)
    later = dataset.select(last)
    trained = training_examples(recipe, dataset.select(first))
    model = trained_once(options, f'{recipe.name}-{first}', lambda: train(recipe, trained))
    report = evaluate_dataset(model, later)
    tested = later.features(recipe.feature_set)
    unknown, draws = (1, 2) if options.quick else (UNKNOWN, DRAWS)
    labels, rng = np.unique(trained.labels), np.random.default_rng(options.seed)
    trained = _without_disturbed_copies(trained)
    return Trial(
        recipe,
        model,
        report.known,
        report.as_json(),
        np.array([_rejected(recipe, trained, tested, rng.permutation(labels)[:unknown]) for _ in range(draws)]),
    )


def _without_disturbed_copies(examples: LabelledFeatures) -> LabelledFeatures:
    """Return the examples without the copies on which early stopping is fitted: it plays no part in what is unknown."""
    if examples.augmented is None:
        return examples
    disturbed = examples.augmented.disturbed
    none = disturbed.select(np.zeros(len(disturbed.groups), dtype=bool))
    return dataclasses.replace(examples, augmented=dataclasses.replace(examples.augmented, disturbed=none))


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
