"""Teach a trained model more textures slide by slide, and train another on the very same slides, for comparison."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.features import FeatureVector
from texture_core.signal import NANOSECONDS
from texture_estimation.classification.training import train
from texture_estimation.incremental.incremental_classifier import Pupil
from texture_estimation.model import Model
from texture_estimation.recipe import Recipe
from texture_features.labelled_features import LabelledFeatures

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Score:
    """Shares of test windows and of whole test slides that are right, 0 to 1."""

    windows: float
    slides: float


@dataclass(frozen=True, eq=False)
class Course:
    """What came of teaching: scores by the number of slides of each new texture, and the time of each lesson.

    `before` and `old` are the scores on the old textures alone: without the new ones, and after each stage.
    """

    taught: dict[int, Score]
    trained: dict[int, Score]
    new: dict[int, Score]
    old: dict[int, Score]
    before: Score
    lesson_s: Array
    judge_us: tuple[float, float]


def try_course(
    recipe: Recipe, examples: LabelledFeatures, new: Sequence[str], *, taught: int, stages: Sequence[int], path: Path
) -> Course:
    """Return how a model does that knows all labels but `new` and is taught these slide by slide.

    Parameters
    ----------
    recipe
        Of all models.
    examples
        Slides 'label/NUMBER' of all labels: those up to `taught` are learnt from, the others tested.
    stages
        Numbers of slides of each new label after which is tested, rising.
    path
        Where the model is saved, and its lessons with it.
    """
    numbers = np.array([int(group.rsplit('/', 1)[1].removeprefix('slide')) for group in examples.groups])
    is_new = np.isin(examples.labels, list(new))
    test, learnt = numbers > taught, numbers <= taught
    base = train(recipe, _some(examples, learnt & ~is_new))
    base.save(path)
    pupil, lesson_s = Pupil(base, path), []
    course = Course({}, {}, {}, {}, _score(base, _some(examples, test & ~is_new)), np.empty(0), (0.0, 0.0))
    for stage, before in zip(stages, (0, *stages), strict=False):
        for number in range(before + 1, stage + 1):
            for label in new:
                rows = np.flatnonzero((numbers == number) & (examples.labels == label))
                lesson_s.append(_teach(pupil, examples, rows))
        trained = train(recipe, _some(examples, learnt & (~is_new | (numbers <= stage))))
        for scores, model, which in (
            (course.taught, pupil.model, test),
            (course.trained, trained, test),
            (course.new, pupil.model, test & is_new),
            (course.old, pupil.model, test & ~is_new),
        ):
            scores[stage] = _score(model, _some(examples, which))
    window = examples.values[0]
    return replace(
        course, lesson_s=np.array(lesson_s), judge_us=(_judge_us(base, window), _judge_us(pupil.model, window))
    )


def _some(examples: LabelledFeatures, rows: Mask) -> LabelledFeatures:
    return replace(examples, values=examples.values[rows], labels=examples.labels[rows], groups=examples.groups[rows])


def _teach(pupil: Pupil, examples: LabelledFeatures, rows: NDArray[np.intp]) -> float:
    """Teach one slide, and return how long it took by the clock of the processor, which other work hardly lengthens."""
    name = str(examples.groups[rows[0]])
    for place, row in enumerate(rows):
        start_ns = round(place * examples.hop_s * NANOSECONDS)
        values = examples.values[row]
        pupil.remember(
            FeatureVector(
                start_ns, name, examples.window_s, examples.hop_s, examples.names, values,
                feature_set=examples.feature_set,
            )
        )  # fmt: skip
    began = time.process_time()
    pupil.learn(str(examples.labels[rows[0]]), name)
    return time.process_time() - began


def _score(model: Model, examples: LabelledFeatures) -> Score:
    log_probabilities = model.predict_log_proba(examples.values)
    truth = np.array([model.labels.index(label) for label in examples.labels])
    slides, first, inverse = np.unique(examples.groups, return_index=True, return_inverse=True)
    sums = np.zeros((len(slides), len(model.labels)))
    np.add.at(sums, inverse.reshape(-1), log_probabilities)
    return Score(
        float((log_probabilities.argmax(axis=1) == truth).mean()), float((sums.argmax(axis=1) == truth[first]).mean())
    )


def _judge_us(model: Model, window: Array, repeats: int = 200) -> float:
    """Return the median time of judging one window, µs."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        model.judge(window)
        times.append(time.perf_counter() - began)
    return 1e6 * float(np.median(times))
