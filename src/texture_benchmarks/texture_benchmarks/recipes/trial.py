"""Recipes compared on the same recorded slides, with the code that runs on the robot."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Hashable, Mapping, Sequence
from fractions import Fraction
from operator import itemgetter
from typing import Any, TypeVar

import numpy as np
from scipy.signal import resample_poly
from sklearn.model_selection import LeaveOneGroupOut

from texture_core.signal import TactileSignal
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe
from texture_evaluation import metrics
from texture_evaluation.cross_validation.cross_validation import CrossValidation
from texture_evaluation.cross_validation.splits import Split
from texture_evaluation.evaluate import run_model
from texture_features.augmentation.augmentation import Augmentation
from texture_features.feature import Feature
from texture_features.feature_set import InputFeatures
from texture_features.features.force import Force
from texture_features.features.spectrum import Spectrum
from texture_features.features.speed import Speed
from texture_features.windowing.time_stretch import Stretched
from texture_recordings.labelled_slide import LabelledSlide
from texture_recordings.slide_dataset import SlideDataset, cut_slide

# Every recipe is given windows of this length, but for those whose paper votes over shorter parts, and is trained on
# windows this far apart.
LENGTH_S = 0.5
TIMED_SLIDES = 40
LATENCY_ROUNDS = 5  # the quickest counts, as other work on the machine only adds
ROUNDING = 1e-9  # of a quotient of two times
Key = TypeVar('Key', bound=Hashable)


def figures_of(result: CrossValidation) -> dict[str, Any]:
    """Return the figures of one cell of the table."""
    results = result.pooled
    seconds, shares = metrics.curve(results)
    return {
        'window_accuracy': metrics.window_accuracy(results),
        'accuracy_at_s': metrics.accuracy_at_times(results),
        'accuracy_at_end': metrics.accuracy_at_end(results),
        'decisions': {'s': seconds.round(3).tolist(), 'share': shares.round(4).tolist()},
        'unclassified_windows': metrics.unclassified_windows(results),
        'unclassified_at_s': metrics.unclassified_at_times(results),
        'train_s': round(float(np.mean([fold.train_s for fold in result.folds])), 2),
    }


def in_random_folds(name: str, dataset: SlideDataset, count: int, seed: int) -> Split:
    """Return a split in which each slide is tested once; slides of each surface are assigned to folds at random.

    Parameters
    ----------
    name
        Name of the split.
    dataset
        The slides.
    count
        Number of folds.
    seed
        Seed of the assignment.

    Returns
    -------
    Split
    """
    rng, folds = np.random.default_rng(seed), np.empty(len(dataset), dtype=np.intp)
    for label in np.unique(dataset.labels):
        rows = np.flatnonzero(dataset.labels == label)
        folds[rows] = rng.permutation(len(rows)) % count
    return Split(name, LeaveOneGroupOut(), folds)


def at_rate(slide: LabelledSlide, topic: str, rate_hz: float) -> LabelledSlide:
    """Return the slide with one topic alone, brought to another rate, stretch by stretch between losses.

    Parameters
    ----------
    slide
        Slide with its signals.
    topic
        Signal that is kept.
    rate_hz
        Its new sampling rate.

    Returns
    -------
    LabelledSlide
    """
    return dataclasses.replace(slide, signals={topic: _at_rate(slide.signals[topic], rate_hz)})


def all_at_rate(dataset: SlideDataset, topic: str, rate_hz: float) -> SlideDataset:
    """Return the slides with one topic alone, brought to another rate.

    Parameters
    ----------
    dataset
        Slides with their signals.
    topic
        Signal that is kept.
    rate_hz
        Its new sampling rate.

    Returns
    -------
    SlideDataset
    """
    return SlideDataset(tuple(at_rate(slide, topic, rate_hz) for slide in dataset))


def comparable(
    recipe: Recipe, rate_hz: float, *, of_motion: bool, length_s: float | None = None, augmented: bool = False
) -> Recipe:
    """Return a recipe with windows as all others have them, trained LENGTH_S apart.

    Parameters
    ----------
    recipe
        Windows of LENGTH_S or more become LENGTH_S long and do not overlap; shorter ones are left as they are.
    rate_hz
        Of the signal: a longer power spectrum than a window has points is not asked for.
    of_motion
        Whether speed and force may be used. Where they belong to the recording session, they betray the surface.
    length_s
        Of all windows, if given; they begin so far apart, or LENGTH_S if they are longer.
    augmented
        Whether a recipe that trains with changed copies of the slides does so: that takes minutes.

    Returns
    -------
    Recipe
    """
    windows = recipe.feature_set.windows
    if length_s is not None:
        windows = dataclasses.replace(windows, length_s=length_s, hop_s=min(length_s, LENGTH_S))
    elif windows.length_s >= LENGTH_S:
        windows = dataclasses.replace(windows, length_s=LENGTH_S, hop_s=LENGTH_S)
    inputs = (_adapted(item, round(windows.length_s * rate_hz), of_motion) for item in recipe.feature_set.inputs)
    inputs = (item for item in inputs if item.features)
    feature_set = dataclasses.replace(recipe.feature_set, windows=windows, inputs=tuple(inputs), _layouts={})
    augmentation = recipe.augmentation if augmented else Augmentation()
    comparable_recipe = dataclasses.replace(recipe, feature_set=feature_set, augmentation=augmentation)
    return trained_every(LENGTH_S, comparable_recipe)


def every(hop_s: float, recipe: Recipe) -> Recipe:
    """Return a recipe whose windows begin so far apart; those for training stay as they are."""
    windows = dataclasses.replace(recipe.feature_set.windows, hop_s=hop_s)
    feature_set = dataclasses.replace(recipe.feature_set, windows=windows, _layouts={})
    return dataclasses.replace(recipe, feature_set=feature_set)


def trained_every(apart_s: float, recipe: Recipe) -> Recipe:
    """Return a recipe whose training windows begin so far apart, or the next multiple of a shorter hop."""
    hop_s = recipe.feature_set.windows.hop_s
    multiple_s = hop_s * math.ceil(apart_s / hop_s - ROUNDING) if hop_s < apart_s else apart_s
    return dataclasses.replace(recipe, training=dataclasses.replace(recipe.training, hop_s=multiple_s))


def latency_us(recipe: Recipe, model: TextureModel, dataset: SlideDataset) -> dict[str, float]:
    """Return median and 99th percentile of the computing time of windows one by one; the first slide warms up.

    By the clock of the processor, which other work on the machine lengthens little.

    Parameters
    ----------
    recipe
        Names windows and features.
    model
        Trained with it.
    dataset
        Slides whose windows are classified.

    Returns
    -------
    dict
        'median' and 'p99', µs.
    """
    timed = dataset.slides[:: max(1, len(dataset) // TIMED_SLIDES)]
    cut = [cut_slide(slide, recipe.feature_set) for slide in timed]
    taken = [run_model(model, events, time.process_time)[2][:-1] for events in (cut[0], *cut)][1:]
    median, p99 = np.percentile(np.concatenate(taken), (50, 99))
    return {'median': round(float(median), 1), 'p99': round(float(p99), 1)}


def latencies_us(timed: Mapping[Key, tuple[Recipe, TextureModel, SlideDataset]]) -> dict[Key, dict[str, float]]:
    """Return what `latency_us` does for each, of the round over all in which its median was lowest.

    Other work on the machine comes and goes within a minute, and only ever lengthens a round.

    Parameters
    ----------
    timed
        What `latency_us` takes, by any key.

    Returns
    -------
    dict
        'median' and 'p99', µs, by key.
    """
    rounds = [{key: latency_us(*item) for key, item in timed.items()} for _ in range(LATENCY_ROUNDS)]
    return {key: min((taken[key] for taken in rounds), key=itemgetter('median')) for key in timed}


def _at_rate(batches: Sequence[TactileSignal], rate_hz: float) -> list[TactileSignal]:
    ratio = Fraction(rate_hz / batches[0].sampling_rate_hz).limit_denominator(1000)
    runs: list[list[TactileSignal]] = []
    for batch in batches:
        if runs and batch.first_sample == runs[-1][-1].next_sample:
            runs[-1].append(batch)
        else:
            runs.append([batch])
    return [_resampled(run, ratio, rate_hz) for run in runs]


def _resampled(run: Sequence[TactileSignal], ratio: Fraction, rate_hz: float) -> TactileSignal:
    samples = np.concatenate([batch.samples for batch in run]).astype(np.float64)
    whole = resample_poly(samples, ratio.numerator, ratio.denominator, axis=0)[: int(len(samples) * ratio)]
    return dataclasses.replace(
        run[0],
        sampling_rate_hz=rate_hz,
        first_sample=round(run[0].first_sample * ratio),
        samples=whole.astype(np.float32),
    )


def _adapted(item: InputFeatures, n_samples: int, of_motion: bool) -> InputFeatures:
    features = [(name, _adapted_feature(feature, n_samples, of_motion)) for name, feature in item.features]
    kept = tuple((name, feature) for name, feature in features if of_motion or not isinstance(feature, Speed | Force))
    return dataclasses.replace(item, features=kept)


def _adapted_feature(feature: Feature, n_samples: int, of_motion: bool) -> Feature:
    if isinstance(feature, Stretched):
        own = _adapted_feature(feature.feature, n_samples, of_motion)
        return dataclasses.replace(feature, feature=own) if of_motion else own
    if isinstance(feature, Spectrum):  # padding a window with zeros adds points, but nothing to them
        return dataclasses.replace(feature, points=min(feature.points, max(2, n_samples // 2)))
    return feature
