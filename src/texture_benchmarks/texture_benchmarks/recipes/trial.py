"""Recipes compared on the same recorded slides, with the code that runs on the robot."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import groupby
from typing import Any

import numpy as np
from scipy.signal import resample_poly
from sklearn.model_selection import LeaveOneGroupOut

from texture_core.errors import InvalidData
from texture_core.features import FeatureVector
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_estimation.classification.training import train
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe
from texture_evaluation import metrics
from texture_evaluation.evaluate import run_model
from texture_evaluation.metrics import SlideResult
from texture_features.feature import Feature
from texture_features.feature_set import InputFeatures
from texture_features.features.force import Force
from texture_features.features.log_spectrum import LogSpectrum
from texture_features.features.speed import Speed
from texture_features.labelled_features import LabelledFeatures
from texture_features.windowing.time_stretch import Stretched
from texture_recordings.slide_dataset import cut_slide
from texture_recordings.slides import LabelledSlide

# Every recipe is given windows of this length, but for those whose paper votes over shorter parts, and is trained on
# windows this far apart.
LENGTH_S = 0.5
TIMED_SLIDES = 40


@dataclass(frozen=True, eq=False)
class RecipeResult:
    """How a recipe did on slides it had not seen, over all the splits tried.

    Parameters
    ----------
    results
        What was said of each slide when it was held out.
    train_s
        Computing time of each training, from described windows to a model.
    model
        Of the last split.
    """

    results: Sequence[SlideResult]
    train_s: Sequence[float]
    model: TextureModel

    def numbers(self) -> dict[str, Any]:
        """Return the figures of one cell of the table."""
        return {
            'window_accuracy': metrics.window_accuracy(self.results),
            'accuracy_at_s': metrics.accuracy_at_times(self.results),
            'accuracy_at_end': metrics.accuracy_at_end(self.results),
            'unclassified_windows': metrics.unclassified_windows(self.results),
            'unclassified_at_s': metrics.unclassified_at_times(self.results),
            'train_s': round(float(np.mean(self.train_s)), 2),
        }


Described = Mapping[LabelledSlide, Sequence[FeatureVector]]
Split = tuple[frozenset[str], frozenset[str]]  # names of the training slides, and tested on


def at_rate(slide: LabelledSlide, topic: str, rate_hz: float) -> LabelledSlide:
    """Return the slide with one topic alone, brought to another rate, stretch by stretch between losses."""
    return dataclasses.replace(slide, signals={topic: _at_rate(slide.signals[topic], rate_hz)})


def comparable(recipe: Recipe, rate_hz: float, *, of_motion: bool, length_s: float | None = None) -> Recipe:
    """Return a recipe with windows as all others have them.

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
    """
    windows = recipe.feature_set.windows
    if length_s is not None:
        windows = dataclasses.replace(windows, length_s=length_s, hop_s=min(length_s, LENGTH_S))
    elif windows.length_s >= LENGTH_S:
        windows = dataclasses.replace(windows, length_s=LENGTH_S, hop_s=LENGTH_S)
    inputs = (_adapted(item, round(windows.length_s * rate_hz), of_motion) for item in recipe.feature_set.inputs)
    inputs = (item for item in inputs if item.features)
    feature_set = dataclasses.replace(recipe.feature_set, windows=windows, inputs=tuple(inputs), _layouts={})
    return dataclasses.replace(recipe, feature_set=feature_set)


def every(hop_s: float, recipe: Recipe) -> Recipe:
    """Return a recipe whose windows begin so far apart."""
    windows = dataclasses.replace(recipe.feature_set.windows, hop_s=hop_s)
    feature_set = dataclasses.replace(recipe.feature_set, windows=windows, _layouts={})
    return dataclasses.replace(recipe, feature_set=feature_set)


def try_recipe(recipe: Recipe, slide_signals: Sequence[LabelledSlide], folds: Sequence[Split]) -> RecipeResult:
    """Train and test a recipe on each split of the slides."""
    return evaluate_extracted(recipe, extract_all(recipe, slide_signals), folds)


def extract_all(recipe: Recipe, slide_signals: Sequence[LabelledSlide]) -> Described:
    """Return the features of all windows of all slides."""
    return {item: extract_features(recipe, item) for item in slide_signals}


def evaluate_extracted(
    recipe: Recipe,
    extracted: Described,
    folds: Sequence[Split],
    added_slides: Described | None = None,
    apart_s: float = LENGTH_S,
) -> RecipeResult:
    """Train and test a recipe on each split of slides that it has described.

    Parameters
    ----------
    recipe, extracted, folds
        What to learn, from which slides, and which to test it on.
    added_slides
        The same slides in the windows for training, where these are others than those to test.
    apart_s
        How far apart the training windows begin at least.
    """
    results: list[SlideResult] = []
    taken: list[float] = []
    for training, tested in folds:
        windows = (extracted if added_slides is None else added_slides).items()
        examples = examples_of({slide: vectors for slide, vectors in windows if slide.name in training}, apart_s)
        start = time.process_time()
        model = train(recipe, examples)
        taken.append(time.process_time() - start)
        results += [_evaluated(model, slide, vectors) for slide, vectors in extracted.items() if slide.name in tested]
    return RecipeResult([result for result in results if result.estimates], taken, model)


def extract_features(recipe: Recipe, item: LabelledSlide) -> list[FeatureVector]:
    """Return the features of all windows of a slide, named after it."""
    vectors = recipe.feature_set.extract_many(cut_slide(item, recipe.feature_set))
    return [dataclasses.replace(vector, exploration_id=item.name) for vector in vectors if not vector.last]


def examples_of(extracted: Described, apart_s: float = LENGTH_S) -> LabelledFeatures:
    """Return windows that begin at least so far apart, of all slides."""
    chosen = [vector for vectors in extracted.values() for vector in _apart(vectors, apart_s)]
    if not chosen:
        raise InvalidData('no slide for training has a whole window; record longer slides')
    examples = LabelledFeatures.from_vectors(chosen, {slide.name: slide.surface for slide in extracted})
    return dataclasses.replace(examples, hop_s=max(apart_s, examples.hop_s))


def latency_us(recipe: Recipe, model: TextureModel, slide_signals: Sequence[LabelledSlide]) -> dict[str, float]:
    """Return median and 99th percentile of the computing time of windows one by one; the first slide warms up.

    By the clock of the processor, which other work on the machine lengthens little.
    """
    cut = [cut_slide(item, recipe.feature_set) for item in slide_signals[:: max(1, len(slide_signals) // TIMED_SLIDES)]]
    taken = [run_model(model, events, time.process_time)[2][:-1] for events in (cut[0], *cut)][1:]
    median, p99 = np.percentile(np.concatenate(taken), (50, 99))
    return {'median': round(float(median), 1), 'p99': round(float(p99), 1)}


def random_splits(slides: Sequence[LabelledSlide], count: int, rng: np.random.Generator) -> list[Split]:
    """Return splits in which each slide is tested once; each surface is assigned at random."""
    part: dict[str, int] = {}
    for _, group in groupby(sorted(slides, key=lambda slide: slide.surface), key=lambda slide: slide.surface):
        own = list(group)
        part |= {slide.name: int(k) % count for slide, k in zip(own, rng.permutation(len(own)), strict=True)}
    return [_split(part, held) for held in range(count)]


def chronological_split(slides: Sequence[LabelledSlide], last_training: int) -> list[Split]:
    """Return the one split with the first slides of each surface for training and the later ones for test."""
    return [_split({slide.name: int(slide.number > last_training) for slide in slides}, 1)]


def splits_by(values: Mapping[str, float]) -> list[Split]:
    """Return one split for each value that slides have, by name: those that have it are tested."""
    names, groups = np.array(list(values)), list(values.values())
    parts = LeaveOneGroupOut().split(names, groups=groups)
    return [(frozenset(names[train].tolist()), frozenset(names[test].tolist())) for train, test in parts]


def _split(part: Mapping[str, int], held: int) -> Split:
    tested = frozenset(name for name, own in part.items() if own == held)
    return frozenset(part) - tested, tested


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
    if isinstance(feature, LogSpectrum):  # padding a window with zeros adds points, but nothing to them
        return dataclasses.replace(feature, points=min(feature.points, max(2, n_samples // 2)))
    return feature


def _apart(vectors: Sequence[FeatureVector], apart_s: float) -> list[FeatureVector]:
    kept: list[FeatureVector] = []
    for vector in vectors:
        if not kept or vector.start_ns - kept[-1].start_ns >= apart_s * NANOSECONDS - 1:
            kept.append(vector)
    return kept


def _evaluated(model: TextureModel, slide: LabelledSlide, vectors: Sequence[FeatureVector]) -> SlideResult:
    evidence = EvidenceAccumulator(model)
    estimates = [evidence.update(vector) for vector in vectors]
    alone = model.decide(np.stack([vector.values for vector in vectors])) if vectors else []
    return SlideResult(slide.surface, alone, estimates)
