"""Incremental training slide by slide, compared with training from scratch on the same slides."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.estimates import TextureEstimate
from texture_estimation.classification.training import train
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.incremental.incremental_classifier import IncrementalClassifier
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe
from texture_features.labelled_features import LabelledFeatures

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Score:
    """Shares of test windows and of whole test slides that are right, 0 to 1.

    `known` is the share of slides that are reported as known surfaces, `certain_and_wrong` that of slides which could
    have been stopped at their end with a wrong label.
    """

    windows: float
    slides: float
    known: float
    certain_and_wrong: float


@dataclass(frozen=True, eq=False)
class IncrementalRun:
    """Result of incremental training: scores by the number of slides of each new texture, and times.

    `before` and `old` are the scores on the old textures alone: without the new ones, and after each stage.
    """

    incremental: dict[int, Score]
    retrained: dict[int, Score]
    new: dict[int, Score]
    old: dict[int, Score]
    before: Score
    add_s: Array
    predict_us: tuple[float, float]


def run_incremental(
    recipe: Recipe,
    examples: LabelledFeatures,
    new: Sequence[str],
    *,
    last_training: int,
    stages: Sequence[int],
    path: Path,
) -> IncrementalRun:
    """Return how a model does that knows all labels but `new` and is trained these slide by slide.

    Parameters
    ----------
    recipe
        Of all models.
    examples
        Slides 'label/NUMBER' of all labels: those up to `last_training` are used for training, the others tested.
    stages
        Numbers of slides of each new label after which is tested, rising.
    path
        Where the model is saved, and its added slides with it.
    new
        Labels that are added.
    last_training
        Number of the last slide of a label that may be trained on.

    Returns
    -------
    IncrementalRun
        Accuracies at each stage.
    """
    numbers = np.array([int(group.rsplit('/', 1)[1].removeprefix('slide')) for group in examples.groups])
    is_new = np.isin(examples.labels, list(new))
    test, training = numbers > last_training, numbers <= last_training
    base = train(recipe, examples.take(training & ~is_new))
    base.save(path)
    incremental_classifier, add_s = IncrementalClassifier(base, path), []
    incremental_run = IncrementalRun(
        {}, {}, {}, {}, _score(base, examples.take(test & ~is_new)), np.empty(0), (0.0, 0.0)
    )
    for stage, before in zip(stages, (0, *stages), strict=False):
        for number in range(before + 1, stage + 1):
            for label in new:
                [slide] = set(examples.groups[(numbers == number) & (examples.labels == label)].tolist())
                add_s.append(_add_examples(incremental_classifier, examples, slide))
        retrained = train(recipe, examples.take(training & (~is_new | (numbers <= stage))))
        for scores, model, which in (
            (incremental_run.incremental, incremental_classifier.model, test),
            (incremental_run.retrained, retrained, test),
            (incremental_run.new, incremental_classifier.model, test & is_new),
            (incremental_run.old, incremental_classifier.model, test & ~is_new),
        ):
            scores[stage] = _score(model, examples.take(which))
    window = examples.X[0]
    return replace(
        incremental_run,
        add_s=np.array(add_s),
        predict_us=(_predict_us(base, window), _predict_us(incremental_classifier.model, window)),
    )


def _add_examples(incremental_classifier: IncrementalClassifier, examples: LabelledFeatures, slide: str) -> float:
    """Add one slide, and return the processor time that it took, s."""
    for vector in examples.vectors(slide)[:-1]:  # the last one is the end
        incremental_classifier.observe(vector)
    began = time.process_time()
    incremental_classifier.add(str(examples.labels[examples.groups == slide][0]), slide)
    return time.process_time() - began


def _score(model: TextureModel, examples: LabelledFeatures) -> Score:
    log_probabilities = model.predict_log_proba(examples.values)
    truth = np.array([model.labels.index(label) for label in examples.labels])
    slides = [(str(slide), str(examples.labels[examples.groups == slide][0])) for slide in np.unique(examples.groups)]
    finals = [(label, _final(model, examples, slide)) for slide, label in slides]
    return Score(
        windows=float((log_probabilities.argmax(axis=1) == truth).mean()),
        slides=float(np.mean([final.label == label for label, final in finals])),
        known=float(np.mean([final.known for _, final in finals])),
        certain_and_wrong=float(np.mean([final.decided and final.label != label for label, final in finals])),
    )


def _final(model: TextureModel, examples: LabelledFeatures, slide: str) -> TextureEstimate:
    """Return the final estimate of a slide, as the classifier reports it."""
    evidence = EvidenceAccumulator(model)
    *_, final = [evidence.update(vector) for vector in examples.vectors(slide)]
    return final


def _predict_us(model: TextureModel, window: Array, repeats: int = 200) -> float:
    """Return the median time of classifying one window, µs."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        model.predict_log_proba(window)
        times.append(time.perf_counter() - began)
    return 1e6 * float(np.median(times))
